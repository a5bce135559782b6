//! Rays through kd-trees and wide nodes: the closest hit, any hit, or all hits in order. Watertight, and equal to brute force
//! bit for bit.
//!
//! ```
//! use kd_core::{Mesh, Ray};
//! use kd_sah::{BuildOptions, build};
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let tree = build(&mesh, &BuildOptions::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = kd_trace::intersect(&tree, &mesh, &ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//!
//! // A shadow ray that ends before the square.
//! assert!(!kd_trace::occluded(&tree, &mesh, &ray.with_range(0.0, 1.5)));
//!
//! // Both triangles contain their shared edge, and both are reported.
//! let mut hits = Vec::new();
//! let through_edge = Ray::new([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
//! kd_trace::hits(&tree, &mesh, &through_edge, usize::MAX, &mut hits);
//! assert_eq!(hits.iter().map(|h| h.triangle).collect::<Vec<_>>(), [0, 1]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Layouts
//!
//! [`intersect`], [`occluded`] and [`hits`] traverse the kd-tree itself, and need nothing prepared. Rays are faster through a
//! *layout*, a copy of the tree and its triangles with the same answers:
//!
//! - [`WideTree`] has nodes of up to eight children over blocks of eight triangles, which a ray tests together. Rays take a
//!   quarter to a half of the time. It follows the planes of the kd-tree in cells of more than 1024 triangles only, and divides
//!   smaller cells as objects (why: crate `kd-wide`).
//! - [`PackedTree`] has the 8-byte nodes of the kd-tree over such blocks. It shows what a builder built.
//!
//! All layouts implement [`RayQuery`].
//!
//! ```
//! # use kd_core::{Mesh, Ray};
//! # use kd_sah::{BuildOptions, build};
//! # let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! # let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let tree = build(&mesh, &BuildOptions::default())?;
//! use kd_trace::RayQuery;
//! let wide = kd_trace::WideTree::new(&tree, &mesh);
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! assert_eq!(wide.intersect(&ray), kd_trace::intersect(&tree, &mesh, &ray));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Other structures answer by the same triangle test: [`kit`] has the pieces. With the feature `counters`, `CountedQuery` counts
//! the nodes, leaves and triangles of a ray.
//!
//! # Files
//!
//! | file | content |
//! |---|---|
//! | `triangle.rs`, `decision.rs` | the triangle test: early rejection in f32, the decision in f64 |
//! | `planes.rs` | crossings of planes and boxes, with the bound of their errors |
//! | `binary/` | traversal of 8-byte nodes: one ray at a time |
//! | `wide/` | traversal of wide nodes: single rays, packets, tiles, streams, queues |
//! | `dispatch.rs` | the entries of traversals of both layouts, compiled for each level |
//! | `collect.rs` | which hits a query keeps |
//! | `ray_query.rs`, `ray_hit.rs` | the query trait, and what it knows of hits |
//! | `each_hit.rs`, `filtered.rs` | hits one after another, and filters |
//! | `hit_lists.rs`, `parallel.rs` | the hits of many rays, and batches on all threads |
//! | `items.rs`, `primitives.rs` | what a ray may meet that is no triangle, and its hits |
//! | `brute_force.rs` | every triangle, one by one |
//!
//! # What is a hit
//!
//! One function of a ray and a triangle decides, and every query returns exactly the answer of applying it to every triangle
//! ([`brute_force`]): the tree, its planes and their rounding are not visible in any answer. `occluded` accepts a triangle in
//! f32 where the bound of the error proves that the function accepts it, and `intersect` orders triangles in f32 where the bounds
//! prove their order, and applies the function to the first.
//!
//! - Triangles are closed and have two sides: a ray through an edge or a corner hits every triangle around it, so
//!   no ray slips through a closed surface. A triangle seen edge-on, or of no area, is not hit, except where the
//!   rounding below widens it.
//! - A hit counts at `t_min <= t <= t_max`, compared after `t` has been rounded to f32; both ends may be equal, and
//!   negative. `t` is finite even where `t_max` is not.
//! - `t`, `u` and `v` are computed in f64 and rounded to f32. Where the ray passes an edge too closely, or sees a triangle too
//!   nearly edge-on for that, they are those of a triangle with corners moved by up to 2⁻²⁶ of their distance from the ray.
//! - Equal `t` goes to the lower triangle.
//! - A ray that is not finite, has no direction, no range or no mask ([`Ray::can_hit`]) hits nothing. Neither does a
//!   ray in an empty tree.
//!
//! The mesh given to a query must be the one that the tree was built from.
//!
//! [`Ray::can_hit`]: kd_core::Ray::can_hit
#![deny(unsafe_code)]

mod binary;
pub mod brute_force;
mod collect;
#[cfg(feature = "counters")]
mod counters;
mod decision;
mod dispatch;
mod each_hit;
mod filtered;
mod hit_lists;
mod items;
pub mod kit;
mod parallel;
mod planes;
mod primitives;
mod probe;
mod ray_hit;
mod ray_query;
#[cfg(test)]
mod search;
mod triangle;
mod wide;

pub use binary::indexed::{hits, intersect, occluded};
pub use binary::lazy;
pub use binary::packed::{PackedArena, PackedTree};
#[cfg(feature = "counters")]
pub use counters::{CountedQuery, TraversalCounts, intersect_counted};
pub use each_hit::EachHit;
pub use filtered::Verdict;
pub use hit_lists::HitLists;
pub use kd_simd::Level;
pub use kd_wide::{Division, Join, Joined, MemberSize, Refit, WideForest, WideTree};
pub use primitives::{PrimitiveHit, Primitives};
pub use ray_hit::RayHit;
pub use ray_query::RayQuery;
