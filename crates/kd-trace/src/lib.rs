//! Rays through kd-trees: the closest hit, any hit, or all hits in order. Watertight, and equal to brute force bit
//! for bit.
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
//! // Both triangles contain their shared edge, and both are told.
//! let mut hits = Vec::new();
//! let through_edge = Ray::new([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
//! kd_trace::hits(&tree, &mesh, &through_edge, usize::MAX, &mut hits);
//! assert_eq!(hits.iter().map(|h| h.triangle).collect::<Vec<_>>(), [0, 1]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Fast
//!
//! [`WideTree`] holds nodes of eight children and the triangles of each leaf in blocks of eight, made from a tree and tested
//! all at once. It has the same queries with the same answers, in a quarter to a half of the time. [`PackedTree`] keeps the tree's
//! own nodes over such blocks.
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
//! Structures that are no kd-trees answer by the same test: [`kit`] has what they need.
//!
//! With the feature `counters`, queries that end in `_counted` tell what a ray took.
//!
//! # What is a hit
//!
//! One function of a ray and a triangle decides, and every query here gives exactly what asking it about every
//! triangle gives ([`brute_force`]): the tree, its planes and their rounding are not visible in any answer.
//!
//! - Triangles are closed and have two sides: a ray through an edge or a corner hits every triangle around it, so
//!   nothing slips through a closed surface. A triangle seen edge-on, or of no area, is not hit, except where the
//!   rounding below opens it by a crack.
//! - A hit counts at `t_min <= t <= t_max`, compared after `t` has been rounded to f32; both ends may be equal, and
//!   negative. `t` is finite even where `t_max` is not.
//! - `t`, `u` and `v` are computed in f64 and rounded to f32. Only where the ray passes an edge so closely, or sees a
//!   triangle so nearly edge-on, that it matters, they are those of a triangle with corners moved by up to 2⁻²⁶ of
//!   their distance from the ray.
//! - Equal `t` goes to the lower triangle.
//! - A ray that is not finite, has no direction, no range or no mask ([`Ray::can_hit`]) hits nothing. Neither does a
//!   ray in an empty tree.
//!
//! The mesh given to a query must be the one that the tree was built from.
//!
//! [`Ray::can_hit`]: kd_core::Ray::can_hit
#![deny(unsafe_code)]

pub mod brute_force;
mod collect;
#[cfg(feature = "counters")]
mod counters;
mod dispatch;
pub mod kit;
pub mod lazy;
mod packed;
mod planes;
mod probe;
mod query;
mod ray_query;
mod triangle;
mod walk;
mod wide;

#[cfg(feature = "counters")]
pub use counters::{CountedQuery, TraversalCounts, intersect_counted};
pub use kd_simd::Level;
pub use kd_wide::{Join, Joined, Refit, WideForest, WideTree};
pub use packed::{PackedArena, PackedTree};
pub use query::{hits, intersect, occluded};
pub use ray_query::RayQuery;
