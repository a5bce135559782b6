//! What may be wrong with a file.

use std::io;

use kd_core::{LayoutError, MeshError, TreeError};
use thiserror::Error;

use crate::header::VERSION;
use crate::section::Section;

/// The reason why a file could not be written, read, or used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file could not be opened, read or written.
    #[error("{file}: {source}")]
    Io {
        /// Name of the file.
        file: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The file does not start with the magic bytes.
    #[error("{file}: not a kd-tree file")]
    WrongMagic {
        /// Name of the file.
        file: String,
    },
    /// The file has another version of the format.
    #[error("{file}: format version {version} is not supported, expected {VERSION}")]
    UnsupportedVersion {
        /// Name of the file.
        file: String,
        /// The version in the header.
        version: u32,
    },
    /// The numbers of the file are in another byte order than the format says, or than a mapping on this machine needs.
    #[error("{file}: numbers are in another byte order")]
    WrongByteOrder {
        /// Name of the file.
        file: String,
    },
    /// The file is shorter or longer than its header says.
    #[error("{file}: {found} bytes, the header requires {expected}")]
    WrongLength {
        /// Name of the file.
        file: String,
        /// The number of bytes that the header requires, at least the size of a header.
        expected: u64,
        /// The number of bytes of the file.
        found: u64,
    },
    /// The header does not match its checksum, or says what cannot be.
    #[error("{file}: the header is damaged")]
    DamagedHeader {
        /// Name of the file.
        file: String,
    },
    /// A section does not match its checksum.
    #[error("{file}: {section} are damaged, the checksum does not match")]
    Damaged {
        /// Name of the file.
        file: String,
        /// The section.
        section: Section,
    },
    /// The file has no section that is needed.
    #[error("{file}: has no {section}")]
    MissingSection {
        /// Name of the file.
        file: String,
        /// The section.
        section: Section,
    },
    /// The elements of a section have another size, or there are more or fewer than belong together.
    #[error("{file}: {section}: {problem}")]
    BadSection {
        /// Name of the file.
        file: String,
        /// The section.
        section: Section,
        /// What is wrong.
        problem: String,
    },
    /// The mesh in the file is invalid.
    #[error("{file}: {source}")]
    Mesh {
        /// Name of the file.
        file: String,
        /// The reason.
        source: MeshError,
    },
    /// The kd-tree in the file is invalid.
    #[error("{file}: {source}")]
    Tree {
        /// Name of the file.
        file: String,
        /// The reason.
        source: TreeError,
    },
    /// The nodes and blocks in the file are not a layout of the mesh.
    #[error("{file}: {source}")]
    Layout {
        /// Name of the file.
        file: String,
        /// The reason.
        source: LayoutError,
    },
    /// The bounds in the file are not those of the mesh.
    #[error("{file}: the bounds differ from those of the mesh")]
    WrongBounds {
        /// Name of the file.
        file: String,
    },
}
