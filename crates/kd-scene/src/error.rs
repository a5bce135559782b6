//! The error of all readers: what is wrong with a file, and where.

use std::io;

use kd_core::MeshError;
use thiserror::Error;

use crate::report::Warning;

/// Why a file cannot be read as a mesh or a scene.
///
/// Every variant holds `file`, the name that the reader was given. Lines count from 1; vertices, faces and other elements count
/// from 0, in file order. `line` is `None` in formats without lines.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be opened.
    #[error("{file}: cannot open: {source}")]
    Open {
        /// Name of the file.
        file: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file was opened, but cannot be read to its end.
    #[error("{file}: cannot read: {source}")]
    Read {
        /// Name of the file.
        file: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The format is read only with the feature `scenes`.
    #[error("{file}: {format} files need the feature `scenes` of kd-scene")]
    UnsupportedFormat {
        /// Name of the file.
        file: String,
        /// Name of the format, for example `glTF`.
        format: &'static str,
    },
    /// Neither the content nor the extension identifies the format.
    #[error(
        "{file}: unknown format, expected .obj, .ply, .stl, .off, .gltf, .glb, .3mf, .aff or .nff"
    )]
    UnknownFormat {
        /// Name of the file.
        file: String,
    },
    /// A line of a text file is invalid.
    #[error("{file}: line {line}: {problem}")]
    BadLine {
        /// Name of the file.
        file: String,
        /// Line number, from 1.
        line: usize,
        /// Description of the fault.
        problem: String,
    },
    /// The header is missing or invalid, or declares something that is not a mesh.
    #[error("{file}: header: {problem}")]
    BadHeader {
        /// Name of the file.
        file: String,
        /// Description of the fault.
        problem: String,
    },
    /// A value of a JSON file is missing or invalid.
    #[error("{file}: {pointer}: {problem}")]
    BadValue {
        /// Name of the file.
        file: String,
        /// Where the value is, as a JSON pointer (RFC 6901).
        pointer: String,
        /// Description of the fault.
        problem: String,
    },
    /// An element of a binary file is invalid.
    #[error("{file}: {element} {index}: {problem}")]
    BadElement {
        /// Name of the file.
        file: String,
        /// Kind of the element, for example `face`.
        element: String,
        /// Index of the element, from 0.
        index: usize,
        /// Description of the fault.
        problem: String,
    },
    /// The data ends before the last element that the header declares.
    #[error("{file}: ends at {element} {index} of {count}")]
    Truncated {
        /// Name of the file.
        file: String,
        /// Kind of the missing element, for example `vertex`.
        element: String,
        /// Index of the first missing or incomplete element, from 0.
        index: usize,
        /// Number of elements that the header declares.
        count: usize,
    },
    /// A coordinate is NaN, infinite, or too large for `f32`.
    #[error("{file}: {}vertex {vertex} is not finite", line_prefix(*line))]
    NotFinite {
        /// Name of the file.
        file: String,
        /// Line number, from 1.
        line: Option<usize>,
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// A face refers to a vertex that does not exist.
    #[error(
        "{file}: {}face {face}: index {index} is out of range, there are {vertices} vertices",
        line_prefix(*line)
    )]
    IndexOutOfRange {
        /// Name of the file.
        file: String,
        /// Line number, from 1.
        line: Option<usize>,
        /// Index of the face, from 0.
        face: usize,
        /// The index as the file writes it.
        index: i64,
        /// Number of vertices, normals or texture coordinates that the index selects from.
        vertices: usize,
    },
    /// A face has fewer than three corners. It is refused, unless the reader is lenient, because the file is damaged.
    #[error("{file}: {}face {face} has {corners} corners, at least 3 are needed", line_prefix(*line))]
    TooFewCorners {
        /// Name of the file.
        file: String,
        /// Line number, from 1.
        line: Option<usize>,
        /// Index of the face, from 0.
        face: usize,
        /// Number of corners: 0, 1 or 2.
        corners: usize,
    },
    /// The reader is [strict](crate::Strictness::Strict), and the file has something that is left out or replaced.
    #[error("{warning}{}", others_suffix(*others))]
    Warned {
        /// The first warning.
        warning: Warning,
        /// The number of others.
        others: usize,
    },
    /// The file was read, but [`Mesh`](kd_core::Mesh) refuses its content.
    #[error("{file}: {source}")]
    Mesh {
        /// Name of the file.
        file: String,
        /// Error of the mesh.
        source: MeshError,
    },
    /// The file was read as a scene, but copies of its instances make too large a mesh.
    #[error("{file}: {problem}")]
    TooManyCopies {
        /// Name of the file.
        file: String,
        /// Description of the fault.
        problem: String,
    },
}

impl LoadError {
    /// The file: the one that was loaded, or one that it names.
    pub fn file(&self) -> &str {
        match self {
            Self::Open { file, .. }
            | Self::Read { file, .. }
            | Self::UnsupportedFormat { file, .. }
            | Self::UnknownFormat { file }
            | Self::BadLine { file, .. }
            | Self::BadHeader { file, .. }
            | Self::BadValue { file, .. }
            | Self::BadElement { file, .. }
            | Self::Truncated { file, .. }
            | Self::NotFinite { file, .. }
            | Self::IndexOutOfRange { file, .. }
            | Self::TooFewCorners { file, .. }
            | Self::Mesh { file, .. }
            | Self::TooManyCopies { file, .. } => file,
            Self::Warned { warning, .. } => &warning.file,
        }
    }
}

fn others_suffix(others: usize) -> String {
    match others {
        0 => String::new(),
        _ => format!(" (and {others} other warnings)"),
    }
}

fn line_prefix(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

/// The first 60 characters of a text in backquotes, for an error text; longer texts end in an ellipsis.
pub(crate) fn quoted(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.trim().chars().take(60).collect();
    if short.len() < text.trim().len() {
        short.push('…');
    }
    format!("`{}`", short.escape_debug())
}
