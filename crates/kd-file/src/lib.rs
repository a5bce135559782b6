//! Files of arrays that are used as they lie: what trees and scenes are saved in.
//!
//! ```text
//! offset  bytes   content (numbers are little-endian)
//! 0       8       magic "kd-tree\n"
//! 8       4       version, 2
//! 12      4       byte order: 0x04030201
//! 16      8       bytes of the file
//! 24      4       number of sections
//! 28      4       CRC-32 of the header and the table, with zero in this place
//! 32      32      zero
//! 64      32 each table: for each section
//!                     4  kind (SectionKind)
//!                     4  part: the number of the object that it belongs to, from 0
//!                     8  offset, a multiple of 64
//!                     8  number of elements
//!                     4  bytes of an element
//!                     4  CRC-32 of the elements and the zeros behind them
//!                 sections in the order of the table, each followed by zeros up to a multiple of 64
//! ```
//!
//! All elements consist of 4-byte words, in the order that mappings on little-endian machines need. [`Contents`] writes a file;
//! [`SavedFile`] reads one, or maps it into memory. What the elements of a section mean is up to the caller: `kd` saves meshes, the
//! nodes and blocks that rays traverse, and scenes.
//!
//! ```
//! use kd_file::{Contents, SavedFile, Section, SectionKind};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("positions.kd");
//! let id = Section::new(SectionKind::Positions, 0);
//! let mut contents = Contents::new();
//! contents.add(id, &[[0.5_f32, 1.0, 2.0]]);
//! contents.save(&path)?;
//!
//! let file = SavedFile::open(&path)?;
//! assert_eq!(file.elements::<[f32; 3]>(id)?[..], [[0.5, 1.0, 2.0]]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod header;
mod read;
mod section;
mod write;

pub use error::FileError;
pub use read::{SavedFile, Verify};
pub use section::{Section, SectionKind};
pub use write::Contents;
