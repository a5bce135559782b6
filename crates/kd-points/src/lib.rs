//! Questions that points ask of a triangle mesh: which point of it is closest, whether they are inside, how far they are from its surface
//! and on which side, how often it winds around them, and which triangles are in a box or a sphere.
//!
//! ```
//! use kd_core::Mesh;
//! use kd_points::{Feature, PointTree, closest_point, contains, signed_distance};
//! use kd_wide::WideTree;
//!
//! // A tetrahedron.
//! let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
//! let tree = WideTree::from_objects(&mesh);
//! let trees = [PointTree::from(&tree)];
//!
//! let nearest = closest_point(&trees, [0.25, 0.25, -2.0], f32::INFINITY).expect("there are triangles");
//! assert_eq!((nearest.triangle, nearest.distance), (0, 2.0));
//! assert_eq!(nearest.feature, Feature::Face);
//! assert!(contains(&trees, [0.2, 0.2, 0.2]));
//! assert_eq!(signed_distance(&trees, [0.125, 0.25, 0.25]), Some(-0.125));
//! # Ok::<(), kd_core::MeshError>(())
//! ```
//!
//! # Answers
//!
//! Every answer but the winding number equals that of a test of every triangle ([`brute_force`]), to the bit: in both layouts, at every
//! level, on any number of threads, one by one and in batches. Triangles of zero area are left out everywhere, as by rays.
//!
//! Queries take several trees, whose triangles they ask together. Triangles are known by their slots; no slot is in two trees.
//!
//! # Files
//!
//! | file | content |
//! |---|---|
//! | `decision.rs` | the closest point of a triangle, in f64: the one decision |
//! | `exact.rs` | exact predicates: on a triangle, crossed by a ray, in a box |
//! | `reach.rs`, `triangles.rs` | boxes and triangles in f32, eight at a time: what is certainly too far, with the bound of every error |
//! | `closest.rs` | the closest point: nodes from near to far |
//! | `gather.rs`, `within.rs`, `inside.rs` | all triangles of a region: boxes, spheres, and what a ray crosses |
//! | `winding.rs` | winding numbers and their hierarchy |
//! | `batch.rs`, `order.rs` | many points at once, neighbors one after the other |
//! | `brute_force.rs` | every triangle, one by one |
#![forbid(unsafe_code)]

mod batch;
pub mod brute_force;
mod closest;
mod decision;
mod exact;
mod gather;
mod inside;
mod nearest;
mod order;
mod reach;
mod tree;
mod triangles;
mod winding;
mod within;

pub use batch::{
    TriangleLists, closest_point_batch, contains_batch, signed_distance_batch,
    triangles_in_box_batch, triangles_in_sphere_batch, winding_number_batch,
};
pub use closest::closest_point;
pub use inside::{contains, signed_distance};
pub use nearest::{Feature, Nearest};
pub use tree::PointTree;
pub use winding::{WINDING_ERROR, WindingNumbers};
pub use within::{triangles_in_box, triangles_in_sphere};
