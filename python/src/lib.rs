//! The Python package `kd`: whole arrays of rays and points through the library's structures.
//!
//! | file | content |
//! |---|---|
//! | `arrays.rs` | NumPy arrays as arguments and results |
//! | `rays.rs`, `mesh.rs`, `options.rs` | arguments of queries and builds |
//! | `hits.rs`, `lists.rs` | hits and lists of hits as results |
//! | `ray_queries.rs`, `point_queries.rs`, `queries.rs` | queries of any structure |
//! | `kd_tree.rs`, `scene.rs` | `kd.KdTree`; `kd.Scene` and `kd.Frame` |
//! | `crossings.rs` | hits at edges and corners, counted once |
//! | `trimesh.rs`, `open3d.rs` | what `kd.trimesh` and `kd.open3d` ask |
//! | `threads.rs` | pools of threads, and builds that `Ctrl-C` ends |
//! | `files.rs` | mapped files |
//! | `errors.rs` | exceptions |
//!
//! The interpreter's lock is held while arguments are read and results are made, and released while threads work. No worker ever waits
//! for it.
#![deny(unsafe_code)]

mod arrays;
mod crossings;
mod errors;
mod files;
mod hits;
mod kd_tree;
mod lists;
mod mesh;
mod open3d;
mod options;
mod point_queries;
mod queries;
mod ray_queries;
mod rays;
mod scene;
mod threads;
mod trimesh;

use pyo3::prelude::*;

/// The compiled part of the package `kd`.
#[pymodule]
mod _kd {
    #[pymodule_export]
    use crate::hits::{_hit_lists, _hits, HitArrays, Hits};
    #[pymodule_export]
    use crate::kd_tree::{_kd_tree, PyKdTree};
    #[pymodule_export]
    use crate::open3d::Geometries;
    #[pymodule_export]
    use crate::point_queries::{ClosestPoints, TriangleArrays};
    #[pymodule_export]
    use crate::scene::{PyFrame, PyScene};
    #[pymodule_export]
    use crate::trimesh::Intersector;

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the name that Python has for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
