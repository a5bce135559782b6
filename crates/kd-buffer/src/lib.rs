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
//! let own = Buffer::from(vec![1_u32, 2, 3]);
//! let bytes: Arc<[u8]> = bytemuck::cast_slice(&own).into();
//! match Buffer::<u32>::shared(&Arc::new(bytes), 4..12) {
//!     Ok(shared) => assert_eq!(shared[..], [2, 3]),
//!     Err(error) => assert_eq!(error.to_string(), "bytes 4 to 12 are not at a multiple of 4"),
//! }
//! ```

mod buffer;
mod large_pages;

pub use buffer::{Buffer, BufferMut, NotElements};
pub use large_pages::advise_large_pages;
