//! Comparators: structures that the papers name beside the kd-tree, here **only to be measured** beside it, not for use.
//!
//! Eleftheriades, *kd-tree merging*, 2010, lists other ways to subdivide space before it settles on kd-trees: the
//! [`Octree`] (§2.3.2) and the BSP tree whose planes are those of polygons, here [`PolygonBsp`] (§2.3.3). What kd-trees
//! are worth can only be told where the others answer the same rays.
//!
//! ```
//! use kd_comparators::{Octree, Options, PolygonBsp};
//! use kd_core::{Mesh, Ray};
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let octree = Octree::build(&mesh, &Options::default())?;
//! let bsp = PolygonBsp::build(&mesh, &Options::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = octree.intersect(&mesh, &ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! assert_eq!(bsp.intersect(&mesh, &ray), Some(hit));
//! println!("{:?}\n{:?}", octree.stats(), bsp.stats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What holds for both
//!
//! - Every query equals [`kd_trace::brute_force`] bit for bit: the same [`TriangleTest`](kd_trace::kit::TriangleTest)
//!   decides about the mesh's own triangles, and planes are crossed in an interval that bounds every error between them
//!   and a reported hit.
//! - Empty meshes and triangles of no area are valid.
//! - Depth and references are limited, so that no mesh takes more memory than the [`Options`] allow.
//! - The same mesh and options give the same structure. One thread builds.
#![forbid(unsafe_code)]

mod bsp;
mod octree;
mod options;
mod query;
mod spare;
mod stats;

pub use bsp::PolygonBsp;
pub use octree::Octree;
pub use options::{BuildError, Options};
pub use stats::Stats;
