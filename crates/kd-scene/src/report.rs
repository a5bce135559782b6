//! What readers leave out or replace: warnings, with their places.

use std::collections::HashMap;
use std::fmt;

use crate::LoadError;

/// How a reader treats what it cannot use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strictness {
    /// Every warning is an error.
    Strict,
    /// What is not used, or harms nothing else, is a warning; a damaged element is an error.
    #[default]
    Usual,
    /// Damaged elements are left out too, with a warning, where the rest of the file can be read without them.
    Lenient,
}

/// A file that was read, and what was left out or replaced.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded<T> {
    /// What was read.
    pub value: T,
    /// In the order in which they were met; equal ones are one, with a count.
    pub warnings: Vec<Warning>,
}

/// Something that a reader has left out or replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file: the one that was loaded, or one that it names.
    pub file: String,
    /// The first place; `None` where it is the whole file.
    pub place: Option<Place>,
    /// What kind it is, for programs.
    pub code: WarningCode,
    /// What it is, for people.
    pub message: String,
    /// At how many places it is.
    pub count: usize,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line, from 1.
    Line(usize),
    /// An element of a kind, such as `face`, from 0.
    Element(String, usize),
    /// A value of a JSON file, as a JSON pointer (RFC 6901).
    Pointer(String),
}

/// The kinds of warnings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WarningCode {
    /// The file has something that is not used.
    Unused,
    /// A file that this one names cannot be read.
    MissingFile,
    /// A material is used that no file defines.
    UnknownMaterial,
    /// A statement about materials has no meaning.
    BadMaterial,
    /// A face of fewer than three corners is left out.
    FewCorners,
    /// A normal or a texture coordinate has no meaning, or is not there.
    BadAttribute,
    /// A polygon crosses itself or has no area; it becomes a fan of triangles.
    BadPolygon,
    /// A vertex is not finite; it is left out, with the faces that use it.
    NotFinite,
    /// A face has an index out of range, and is left out.
    BadIndex,
    /// An element is damaged, and left out.
    BadElement,
    /// Key frames are out of order, or of nothing.
    BadAnimation,
    /// The file does not say which of its content is the scene; all of it is.
    NoScene,
    /// The statement that ends the file is missing: the file may have been longer.
    MissingEnd,
    /// Data follows the last element.
    LeftOver,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file)?;
        match &self.place {
            Some(Place::Line(line)) => write!(f, "line {line}: ")?,
            Some(Place::Element(kind, index)) => write!(f, "{kind} {index}: ")?,
            Some(Place::Pointer(pointer)) => write!(f, "{pointer}: ")?,
            None => {}
        }
        f.write_str(&self.message)?;
        match self.count {
            1 => Ok(()),
            count => write!(f, " (and {} more)", count - 1),
        }
    }
}

/// The warnings about a file while it is read.
#[derive(Debug)]
pub(crate) struct Report {
    strictness: Strictness,
    warnings: Vec<Warning>,
    /// The index of each warning, by its file and message.
    known: HashMap<(String, String), usize>,
    /// The index of the warning that was met last.
    last: usize,
}

impl Report {
    pub(crate) fn new(strictness: Strictness) -> Self {
        Self {
            strictness,
            warnings: Vec::new(),
            known: HashMap::new(),
            last: 0,
        }
    }

    pub(crate) fn is_lenient(&self) -> bool {
        self.strictness == Strictness::Lenient
    }

    /// Notes a warning.
    pub(crate) fn warn(
        &mut self,
        file: &str,
        place: Option<Place>,
        code: WarningCode,
        message: impl AsRef<str>,
    ) {
        let message = message.as_ref();
        // Every vertex may have the same one.
        if let Some(last) = self.warnings.get_mut(self.last)
            && last.message == message
            && last.file == file
        {
            last.count += 1;
            return;
        }
        let next = self.warnings.len();
        let key = (file.to_owned(), message.to_owned());
        self.last = *self.known.entry(key).or_insert(next);
        if let Some(known) = self.warnings.get_mut(self.last) {
            known.count += 1;
            return;
        }
        self.warnings.push(Warning {
            file: file.to_owned(),
            place,
            code,
            message: message.to_owned(),
            count: 1,
        });
    }

    /// Notes that a damaged element is left out, if the reader is lenient; else fails with the error.
    pub(crate) fn leave_out(
        &mut self,
        error: LoadError,
        place: Option<Place>,
        code: WarningCode,
        message: &str,
    ) -> Result<(), LoadError> {
        if !self.is_lenient() {
            return Err(error);
        }
        self.warn(error.file(), place, code, message);
        Ok(())
    }

    pub(crate) fn finish(self) -> Vec<Warning> {
        self.warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_warnings_are_one() {
        let mut report = Report::new(Strictness::Usual);
        for (line, message) in [(1, "a"), (2, "a"), (3, "b"), (4, "a"), (5, "b"), (6, "b")] {
            report.warn("f", Some(Place::Line(line)), WarningCode::Unused, message);
        }
        report.warn("g", None, WarningCode::Unused, "b");
        let texts: Vec<String> = report.finish().iter().map(ToString::to_string).collect();
        let expected = [
            "f: line 1: a (and 2 more)",
            "f: line 3: b (and 2 more)",
            "g: b",
        ];
        assert_eq!(texts, expected);
    }

    #[test]
    fn only_a_lenient_report_leaves_out_damage() {
        let error = || LoadError::TooFewCorners {
            file: "f".into(),
            line: None,
            face: 7,
            corners: 2,
        };
        for strictness in [Strictness::Strict, Strictness::Usual, Strictness::Lenient] {
            let mut report = Report::new(strictness);
            let place = Some(Place::Element("face".into(), 7));
            let left_out = report.leave_out(error(), place, WarningCode::FewCorners, "gone");
            let is_lenient = strictness == Strictness::Lenient;
            assert_eq!(left_out.is_ok(), is_lenient, "{strictness:?}");
            let texts: Vec<String> = report.finish().iter().map(ToString::to_string).collect();
            let expected: &[&str] = if is_lenient {
                &["f: face 7: gone"]
            } else {
                &[]
            };
            assert_eq!(texts, expected, "{strictness:?}");
        }
    }
}
