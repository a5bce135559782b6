//! Arrays that are either in memory of their own or in memory that something else keeps, such as a mapped file.
//!
//! A mesh and the nodes over it are [`Buffer`]s. A tree that was built owns them; a tree that was opened from a file refers to the bytes
//! of the file, so that nothing is copied and only what rays touch is read.
//!
//! ```
//! use std::sync::Arc;
//!
//! use kd_buffer::Buffer;
//!
//! /// In place of a mapped file.
//! struct Words(Vec<u32>);
//!
//! impl AsRef<[u8]> for Words {
//!     fn as_ref(&self) -> &[u8] {
//!         bytemuck::cast_slice(&self.0)
//!     }
//! }
//!
//! let bytes = Arc::new(Words(vec![1, 2, 3]));
//! let shared = Buffer::<u32>::shared(&bytes, 4..12)?;
//! assert_eq!(shared, Buffer::from(vec![2, 3]));
//! assert!(shared.is_shared());
//! let error = Buffer::<u32>::shared(&bytes, 2..6).expect_err("between two elements");
//! assert_eq!(error.to_string(), "bytes 2 to 6 are not at a multiple of 4");
//! # Ok::<(), kd_buffer::NotElements>(())
//! ```

mod buffer;
mod large_pages;

pub use buffer::{Buffer, BufferMut, NotElements};
pub use large_pages::advise_large_pages;
