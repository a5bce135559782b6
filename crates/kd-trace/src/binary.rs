//! Rays through the 8-byte nodes of a kd-tree, one at a time.
//!
//! [`walk`] is the one loop. Leaves are lists of triangles of the mesh ([`indexed`]), blocks of eight triangles ([`packed`]),
//! cells that are divided when a ray first enters them ([`lazy`]), or lists of items of any kind ([`references`]).

pub(crate) mod indexed;
pub mod lazy;
pub(crate) mod packed;
pub(crate) mod references;
pub(crate) mod walk;
