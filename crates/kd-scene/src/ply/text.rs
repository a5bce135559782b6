//! The elements of a PLY file that is text.

use std::ops::Range;

use super::Row;
use super::header::{Element, Kind, Scalar};
use crate::LoadError;
use crate::error::quoted;
use crate::file_mesh::Corner;
use crate::report::{Place, Report, WarningCode};
use crate::source::Source;
use crate::text_lines::TextLines;
use crate::words::{integer, number};

/// Reads the elements of a text, each of which begins on a line of its own. Its values may be on several lines.
pub(super) struct TextRows {
    lines: TextLines,
    /// The number of the first line of the last element.
    pub(super) line: usize,
    /// The first line of an element that has several.
    first: Vec<u8>,
    has_several: bool,
}

/// Why an element cannot be read.
enum Fault {
    Problem(&'static str),
    /// The line has further values.
    TooMany,
    Source(LoadError),
}

impl Fault {
    fn text(&self) -> String {
        match self {
            Self::Problem(problem) => (*problem).to_owned(),
            Self::TooMany => "more values than the header declares".to_owned(),
            Self::Source(error) => error.to_string(),
        }
    }
}

impl From<LoadError> for Fault {
    fn from(error: LoadError) -> Self {
        Self::Source(error)
    }
}

const TOO_FEW: Fault = Fault::Problem("too few values");

impl TextRows {
    /// The rows after a header of `lines` lines.
    pub(super) fn new(lines: usize) -> Self {
        Self {
            lines: TextLines::new(lines, None),
            line: lines,
            first: Vec::new(),
            has_several: false,
        }
    }

    /// Reads the next row, which is number `index`.
    pub(super) fn next(
        &mut self,
        source: &mut Source<'_>,
        element: &Element,
        index: usize,
        row: &mut Row,
        report: &mut Report,
    ) -> Result<(), LoadError> {
        if !self.lines.next(source)? {
            return Err(LoadError::Truncated {
                file: source.name.to_owned(),
                element: element.name.clone(),
                index,
                count: element.count,
            });
        }
        self.line = self.lines.number;
        self.has_several = false;
        let fault = match self.row(source, element, row) {
            Ok(()) => return Ok(()),
            Err(Fault::Source(error)) => return Err(error),
            Err(fault) => fault,
        };
        let first = if self.has_several {
            &self.first
        } else {
            &self.lines.text
        };
        let error = LoadError::BadLine {
            file: source.name.to_owned(),
            line: self.line,
            problem: format!(
                "{} {index}: {}: {}",
                element.name,
                fault.text(),
                quoted(first)
            ),
        };
        if !matches!(fault, Fault::TooMany) {
            return Err(error);
        }
        let what = "a line has more values than the header declares; they are left out";
        report.leave_out(
            error,
            Some(Place::Line(self.line)),
            WarningCode::LeftOver,
            what,
        )
    }

    fn row(
        &mut self,
        source: &mut Source<'_>,
        element: &Element,
        row: &mut Row,
    ) -> Result<(), Fault> {
        row.corners.clear();
        for property in &element.properties {
            let word = self.word(source)?;
            let item = match property.kind {
                Kind::Scalar(scalar) => {
                    let value = float(&self.lines.text[word], scalar)?;
                    row.set(&property.name, || value);
                    continue;
                }
                Kind::List { item, .. } => item,
            };
            let count =
                integer(&self.lines.text[word]).and_then(|count| usize::try_from(count).ok());
            let count = count.ok_or(Fault::Problem("bad list count"))?;
            let is_corners = super::is_corner_list(&property.name);
            for _ in 0..count {
                let word = self.word(source)?;
                if is_corners {
                    let index =
                        integer(&self.lines.text[word]).ok_or(Fault::Problem("bad number"))?;
                    row.corners.push(Corner::from_zero(index));
                } else {
                    float(&self.lines.text[word], item)?;
                }
            }
        }
        match (self.lines.word(), self.has_several) {
            (None, _) => Ok(()),
            // The values of the next element.
            (Some(_), true) => Err(TOO_FEW),
            (Some(_), false) => Err(Fault::TooMany),
        }
    }

    /// The place in the line of the next word of the element, which may be on another line.
    fn word(&mut self, source: &mut Source<'_>) -> Result<Range<usize>, Fault> {
        loop {
            if let Some(word) = self.lines.word() {
                return Ok(word);
            }
            if !self.has_several {
                self.first.clone_from(&self.lines.text);
                self.has_several = true;
            }
            if !self.lines.next(source)? {
                return Err(TOO_FEW);
            }
        }
    }
}

/// A number, rounded to the nearest `f32` as in a binary file of the declared type.
#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn float(word: &[u8], scalar: Scalar) -> Result<f32, Fault> {
    let value = match scalar {
        Scalar::F32 => number(word),
        _ => std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse::<f64>().ok())
            .map(|value| value as f32),
    };
    let is_text = std::str::from_utf8(word).is_ok();
    value.ok_or(Fault::Problem(if is_text {
        "bad number"
    } else {
        "not text"
    }))
}
