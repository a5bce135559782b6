//! Comparators: structures that the papers name beside the kd-tree. Benches and tests compare kd-trees with them; the library
//! `kd` does not depend on this crate.
//!
//! Eleftheriades, *kd-tree merging*, 2010, lists other hierarchies and other ways to subdivide space before it settles on
//! kd-trees: bounding volume hierarchies (§2.2, here [`Bvh`]), the [`Octree`] (§2.3.2) and the BSP tree whose planes are those
//! of polygons (§2.3.3, here [`PolygonBsp`]). The value of a kd-tree shows only where the others answer the same rays.
//!
//! ```
//! use kd_comparators::{Bvh, BvhOptions, CellOptions, Octree, PolygonBsp};
//! use kd_core::{Mesh, Ray};
//! use kd_trace::RayQuery;
//! use std::sync::Arc;
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Arc::new(Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?);
//! let bvh = Bvh::build(Arc::clone(&mesh), &BvhOptions::default())?;
//! let octree = Octree::build(Arc::clone(&mesh), &CellOptions::default())?;
//! let bsp = PolygonBsp::build(mesh, &CellOptions::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = bvh.intersect(&ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! assert_eq!(octree.intersect(&ray), Some(hit));
//! assert_eq!(bsp.intersect(&ray), Some(hit));
//! // The hierarchy in wide nodes, eight boxes and eight triangles at a time.
//! assert_eq!(bvh.wide().intersect(&ray), Some(hit));
//! println!("{}\n{:?}\n{:?}", bvh.stats(), octree.stats(), bsp.stats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Builders of hierarchies
//!
//! | method | division | time | source |
//! |---|---|---|---|
//! | [`Binned`](BvhMethod::Binned) | SAH between bins | O(N log N) | Wald 2007 |
//! | [`Sweep`](BvhMethod::Sweep) | SAH anywhere along an axis | O(N log² N) | Eleftheriades 2010, algorithm 1 |
//! | [`BottomUp`](BvhMethod::BottomUp) | merges neighbors | O(N · radius) | Eleftheriades 2010, 2.2.1; Meister and Bittner 2018 |
//! | [`Midpoint`](BvhMethod::Midpoint) | in the middle | O(N log N) | Shi 2011, 2.2 |
//! | [`EqualCounts`](BvhMethod::EqualCounts) | in halves | O(N log N) | Shi 2011, 2.2 |
//!
//! All of them end in a leaf where dividing does not pay by the surface area heuristic.
//!
//! # Guarantees of every structure
//!
//! - Every query equals [`kd_trace::brute_force`] bit for bit: the triangle test is that of [`kd_trace::kit`], and each box and
//!   plane is crossed in an interval that bounds all errors between it and a reported hit.
//! - Empty meshes and triangles of zero area are valid.
//! - Depth and references are limited, so that no mesh takes more memory than the options allow.
//! - The same mesh and options give the same structure, at any number of threads.
#![forbid(unsafe_code)]

mod bsp;
mod bvh;
mod cells;
mod error;
mod octree;
mod query;

pub use bsp::PolygonBsp;
pub use bvh::{Bvh, BvhCounts, BvhMethod, BvhNode, BvhNodeView, BvhOptions, BvhStats};
pub use cells::{CellOptions, CellStats};
pub use error::ComparatorError;
pub use octree::Octree;
