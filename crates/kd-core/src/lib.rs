//! Basic types of all kd crates: boxes, rays, hits, meshes, the 8-byte node, trees and their statistics.
//!
//! [`Mesh::new`] checks a mesh once. A builder turns the mesh into pairs of [`Node`]s and references. The validator of
//! [`Tree`] checks these. Traversals rely on both checks and repeat neither.
//!
//! ```
//! use kd_core::{CostModel, Mesh, Node, Pair, Slot, Tree};
//!
//! let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
//!
//! // The smallest tree: one leaf that refers to the only triangle.
//! let leaf = Node::leaf(0, 1).expect("a count of 1 fits");
//! let pairs = vec![Pair([leaf, Node::EMPTY_LEAF])];
//! let tree = Tree::from_parts(pairs, vec![Slot(0)], mesh.bounds(), 1, CostModel::CLASSIC)?;
//!
//! assert_eq!(tree.stats().leaves, 1);
//! tree.check_coverage(&mesh)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod aabb;
mod arena;
mod axis;
mod clip;
mod closed;
mod cost;
mod culling;
mod exact;
mod id;
mod layout;
mod mesh;
mod mesh_origin;
mod moved;
mod node;
mod offset;
mod ray;
mod ray_packet;
#[cfg(feature = "serde")]
mod serde_form;
mod source;
mod stats;
mod transformed;
mod tree;
mod world_mesh;
mod world_ray;
mod zero_area;

pub use aabb::Aabb;
pub use arena::{Arena, MAX_DEPTH, TreeError};
pub use axis::Axis;
pub use clip::{clipped_bounds, clipped_halves};
pub use cost::CostModel;
pub use culling::Culling;
pub use id::{NodeIndex, Slot};
pub use layout::{Layout, LayoutBytes, LayoutError};
pub use mesh::{MAX_TRIANGLES, Mesh, MeshError};
pub use moved::BoundsOnly;
pub use node::{Node, NodeView, Pair};
pub use offset::{offset_origin, offset_origin_of, surface_point_of};
pub use ray::{Hit, Ray};
pub use ray_packet::RayPacket8;
pub use source::PrimSource;
pub use stats::{StatsOf, TreeStats};
pub use transformed::transformed_point;
pub use tree::{Tree, Uncovered};
pub use world_mesh::WorldMesh;
pub use world_ray::WorldRay;
pub use zero_area::is_zero_area;
