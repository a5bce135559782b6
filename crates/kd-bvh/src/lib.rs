//! Bounding volume hierarchies over triangle meshes: five ways to build them, single rays and packets, refitting.
//!
//! A hierarchy divides triangles where a kd-tree divides space. Each triangle is in one leaf, so that it is small, built
//! soon, and moves with what is in it: [`Bvh::refit`]. Its boxes overlap, so that a ray may have to look into several at a
//! place. The rest of the workspace is about kd-trees; this is what they are compared with, and it answers as they do.
//!
//! ```
//! use kd_bvh::{Bvh, BvhOptions};
//! use kd_core::{Mesh, Ray};
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let mut bvh = Bvh::build(&mesh, &BvhOptions::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = bvh.intersect(&mesh, &ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//!
//! // The square moves away, and the hierarchy moves with it.
//! let moved = mesh.transformed(&glam::Affine3A::from_translation(glam::Vec3::Z))?;
//! bvh.refit(&moved)?;
//! assert_eq!(bvh.intersect(&moved, &ray).map(|hit| hit.t), Some(3.0));
//! assert_eq!(bvh.quality(), 1.0, "as good as new");
//!
//! // To trace many rays, eight boxes and eight triangles at a time.
//! let wide = bvh.wide(&moved);
//! assert_eq!(wide.intersect(&ray), bvh.intersect(&moved, &ray));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Which method
//!
//! | method | divides | time | from |
//! |---|---|---|---|
//! | [`Binned`](BvhMethod::Binned) | by SAH, between bins | O(N log N) | Wald 2007 |
//! | [`Sweep`](BvhMethod::Sweep) | by SAH, anywhere along an axis | O(N log² N) | Eleftheriades 2010, algorithm 1 |
//! | [`BottomUp`](BvhMethod::BottomUp) | puts neighbours together | O(N · radius) | Eleftheriades 2010, 2.2.1; Meister and Bittner 2018 |
//! | [`Midpoint`](BvhMethod::Midpoint) | in the middle | O(N log N) | Shi 2011, 2.2 |
//! | [`EqualCounts`](BvhMethod::EqualCounts) | in halves | O(N log N) | Shi 2011, 2.2 |
//!
//! All of them end in a leaf where the surface area heuristic says that dividing does not pay.
//!
//! # What holds for every hierarchy
//!
//! - Every triangle of the mesh is in exactly one leaf; a node's box is the smallest around its triangles.
//! - At most [`MAX_DEPTH`](kd_core::MAX_DEPTH) nodes lie above a leaf: where a way to divide would end up deeper, triangles
//!   are halved.
//! - The same mesh and options give the same bytes, whatever the number of threads.
//! - Every query gives what [`kd_trace::brute_force`] gives, bit for bit: the triangle test is that of [`kd_trace::kit`], and
//!   boxes are widened for each ray by a bound of all errors between a box and a hit.
//! - A mesh without triangles has no nodes, and nothing hits it. Triangles of zero area are in leaves like others.
#![forbid(unsafe_code)]

mod bottom_up;
mod build;
mod bvh;
mod counts;
mod item;
mod node;
mod options;
mod packet;
mod query;
mod refit;
mod stats;
mod walk;
mod wide;

pub use bvh::Bvh;
pub use counts::BvhCounts;
pub use kd_tasks::ThreadsError;
pub use node::{BvhNode, BvhNodeView};
pub use options::{BuildError, BvhMethod, BvhOptions};
pub use refit::RefitError;
pub use stats::BvhStats;
