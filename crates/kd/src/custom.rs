//! Trees over primitives other than triangles: rays, and queries of your own.
//!
//! # Rays
//!
//! Implement [`Primitives`]: a number, a box for each primitive, and the first hit of a ray with one of them. A [`PrimitiveTree`] over
//! them has every query of [`RayQuery`](crate::RayQuery): closest, any and ordered hits, filters, batches, all on several threads.
//!
//! ```
//! use kd::custom::{PrimitiveHit, PrimitiveTree, Primitives};
//! use kd::{Aabb, BuildOptions, Ray, RayQuery};
//! use kd::glam::Vec3;
//!
//! /// Disks of radius 1 across the z axis.
//! struct Disks(Vec<Vec3>);
//!
//! impl Primitives for Disks {
//!     fn count(&self) -> u32 {
//!         u32::try_from(self.0.len()).expect("few")
//!     }
//!
//!     fn bounds(&self, disk: u32) -> Aabb {
//!         let (center, radius) = (self.0[disk as usize], Vec3::new(1.0, 1.0, 0.0));
//!         Aabb { min: center - radius, max: center + radius }
//!     }
//!
//!     fn intersect(&self, disk: u32, ray: &Ray) -> Option<PrimitiveHit> {
//!         let center = self.0[disk as usize];
//!         let t = (center.z - ray.origin.z) / ray.direction.z;
//!         let is_in_range = ray.t_min <= t && t <= ray.t_max;
//!         let is_hit = is_in_range && ray.at(t).distance(center) <= 1.0;
//!         is_hit.then(|| PrimitiveHit::at(t))
//!     }
//! }
//!
//! let disks = Disks((1..100_u8).map(|i| Vec3::new(0.0, 0.0, f32::from(i))).collect());
//! let tree = PrimitiveTree::build(disks, &BuildOptions::balanced())?;
//! let ray = Ray::new([0.0, 0.5, 0.0], [0.0, 0.0, 1.0]);
//! let hit = tree.intersect(&ray).expect("the nearest disk");
//! assert_eq!((hit.triangle, hit.t), (0, 1.0));
//! assert_eq!(tree.count_hits(&ray), 99);
//! # Ok::<(), kd::BuildError>(())
//! ```
//!
//! The examples `spheres` and `curves` of this crate have primitives with numerically good intersections.
//!
//! # Queries of your own
//!
//! Implement [`PrimSource`], and [`build`] returns a [`Tree`](crate::tree::Tree): nodes, and the numbers of the primitives in each leaf. A
//! query descends from [`Tree::root`](crate::tree::Tree::root) through [`Tree::nodes`](crate::tree::Tree::nodes), whose
//! [`view`](crate::tree::Node::view) is a plane with two children or a leaf, and tests the primitives of
//! [`Tree::leaf_refs`](crate::tree::Tree::leaf_refs):
//!
//! ```
//! use kd::custom::{PrimSource, build};
//! use kd::glam::Vec3;
//! use kd::tree::{NodeView, Tree};
//! use kd::{Aabb, BuildOptions};
//!
//! /// Spheres, each a center and a radius.
//! struct Spheres(Vec<(Vec3, f32)>);
//!
//! impl PrimSource for Spheres {
//!     type Shape = Aabb;
//!
//!     fn count(&self) -> u32 {
//!         u32::try_from(self.0.len()).expect("few")
//!     }
//!
//!     fn bounds(&self, primitive: u32) -> Aabb {
//!         let (center, radius) = self.0[primitive as usize];
//!         Aabb { min: center - radius, max: center + radius }
//!     }
//!
//!     fn shape(&self, primitive: u32) -> Aabb {
//!         self.bounds(primitive)
//!     }
//!
//!     fn clipped_bounds(&self, shape: &Aabb, cell: &Aabb) -> Option<Aabb> {
//!         let clipped = shape.intersection(cell);
//!         (!clipped.is_empty()).then_some(clipped)
//!     }
//! }
//!
//! /// The spheres that contain a point, which is inside the tree's bounds.
//! fn containing(spheres: &Spheres, tree: &Tree, point: Vec3) -> Vec<u32> {
//!     let mut at = tree.root();
//!     loop {
//!         let node = tree.nodes()[at.index()];
//!         match node.view() {
//!             NodeView::Interior { axis, split, first } => {
//!                 let is_upper = point[axis.index()] > split;
//!                 at = if is_upper { first.sibling() } else { first };
//!             }
//!             NodeView::Leaf { .. } => {
//!                 let numbers = tree.leaf_refs(node).iter().map(|slot| slot.0);
//!                 return numbers
//!                     .filter(|&number| {
//!                         let (center, radius) = spheres.0[number as usize];
//!                         center.distance(point) <= radius
//!                     })
//!                     .collect();
//!             }
//!         }
//!     }
//! }
//!
//! let row = (0..100_u8).map(|i| (Vec3::new(f32::from(i), 0.0, 0.0), 0.75));
//! let spheres = Spheres(row.collect());
//! let tree = build(&spheres, &BuildOptions::balanced())?;
//! let mut found = containing(&spheres, &tree, Vec3::new(41.5, 0.1, 0.0));
//! found.sort_unstable();
//! assert_eq!(found, [41, 42]);
//! # Ok::<(), kd::BuildError>(())
//! ```

mod primitive_tree;
mod source;

pub use kd_core::PrimSource;
pub use kd_sah::build;
pub use kd_trace::{PrimitiveHit, Primitives};
pub use primitive_tree::PrimitiveTree;
