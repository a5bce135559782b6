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
    /// Data follows the last element.
    LeftOver,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file)?;
        match &self.place {
            Some(Place::Line(line)) => write!(f, "line {line}: ")?,
            Some(Place::Element(kind, index)) => write!(f, "{kind} {index}: ")?,
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
}

impl Report {
    pub(crate) fn new(strictness: Strictness) -> Self {
        Self {
            strictness,
            warnings: Vec::new(),
            known: HashMap::new(),
        }
    }

    /// Notes a warning.
    pub(crate) fn warn(
        &mut self,
        file: &str,
        place: Option<Place>,
        code: WarningCode,
        message: impl Into<String>,
    ) {
        let message = message.into();
        let next = self.warnings.len();
        let key = (file.to_owned(), message.clone());
        let number = *self.known.entry(key).or_insert(next);
        if number < next {
            self.warnings[number].count += 1;
            return;
        }
        self.warnings.push(Warning {
            file: file.to_owned(),
            place,
            code,
            message,
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
        if self.strictness != Strictness::Lenient {
            return Err(error);
        }
        self.warn(error.file(), place, code, message);
        Ok(())
    }

    pub(crate) fn finish(self) -> Vec<Warning> {
        self.warnings
    }
}
