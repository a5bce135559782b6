//! What can be wrong with a mesh file, said with the place where it is wrong.

use std::io;

use kd_core::MeshError;
use thiserror::Error;

/// Why a file could not be read as a mesh.
///
/// Every variant holds `file`, the name the reader was given. Lines are counted from 1; vertices,
/// faces and other elements from 0, in file order. `line` is `None` where a format has no lines.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file could not be opened.
    #[error("{file}: cannot open: {source}")]
    Open {
        /// Name of the file.
        file: String,
        /// What the system said.
        source: io::Error,
    },
    /// The file was opened, but reading it failed.
    #[error("{file}: cannot read: {source}")]
    Read {
        /// Name of the file.
        file: String,
        /// What the system said.
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
    #[error("{file}: unknown format, expected .obj, .ply, .gltf, .glb, .aff or .nff")]
    UnknownFormat {
        /// Name of the file.
        file: String,
    },
    /// A line cannot be understood.
    #[error("{file}: line {line}: {problem}")]
    BadLine {
        /// Name of the file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// The header is readable, but what it declares cannot be a mesh.
    #[error("{file}: header: {problem}")]
    BadHeader {
        /// Name of the file.
        file: String,
        /// What is wrong with it.
        problem: String,
    },
    /// An element of a binary file cannot be understood.
    #[error("{file}: {element} {index}: {problem}")]
    BadElement {
        /// Name of the file.
        file: String,
        /// Kind of the element, for example `face`.
        element: String,
        /// Its number, from 0.
        index: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// The data ends before everything the header promises has come.
    #[error("{file}: ends at {element} {index} of {count}")]
    Truncated {
        /// Name of the file.
        file: String,
        /// Kind of the element that is missing, for example `vertex`.
        element: String,
        /// Number of the first element that is missing or cut, from 0.
        index: usize,
        /// How many the header promises.
        count: usize,
    },
    /// There is more data than the header declares.
    #[error("{file}: {bytes} bytes left over after the last element the header declares")]
    LeftOver {
        /// Name of the file.
        file: String,
        /// How many bytes are left.
        bytes: usize,
    },
    /// A coordinate is NaN, infinite or too large for `f32`.
    #[error("{file}: {}vertex {vertex} is not finite", place(*line))]
    NotFinite {
        /// Name of the file.
        file: String,
        /// The line, from 1.
        line: Option<usize>,
        /// The vertex, from 0.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error(
        "{file}: {}face {face}: index {index} is out of range, there are {vertices} vertices",
        place(*line)
    )]
    IndexOutOfRange {
        /// Name of the file.
        file: String,
        /// The line, from 1.
        line: Option<usize>,
        /// The face, from 0.
        face: usize,
        /// The index as the file writes it.
        index: i64,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A face has no area by construction. It is refused, not dropped: the file is damaged.
    #[error("{file}: {}face {face} has {corners} corners, at least 3 are needed", place(*line))]
    TooFewCorners {
        /// Name of the file.
        file: String,
        /// The line, from 1.
        line: Option<usize>,
        /// The face, from 0.
        face: usize,
        /// How many corners it has: 0, 1 or 2.
        corners: usize,
    },
    /// Everything was read, but it is no mesh.
    #[error("{file}: {source}")]
    Mesh {
        /// Name of the file.
        file: String,
        /// What the mesh found.
        source: MeshError,
    },
}

fn place(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

/// At most 60 characters of a line, in backquotes, for an error text.
pub(crate) fn quoted(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.trim().chars().take(60).collect();
    if short.len() < text.trim().len() {
        short.push('…');
    }
    format!("`{}`", short.escape_debug())
}
