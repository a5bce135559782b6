//! Pieces for other structures over a mesh, so that their answers equal those of these trees to the bit: the triangle test, the
//! collectors of hits, and the bound of every error between a plane and a reported hit.
//!
//! [`walk_boxes`] finds the items of any kind whose boxes a ray meets, and [`walk_references`] those in the cells of a kd-tree.
//! [`AskPrimitives`] asks them for hits.
//!
//! The example is a structure of one box. Grids and bounding volume hierarchies use the pieces in the same way.
//!
//! ```
//! use kd_core::{Hit, Mesh, Ray};
//! use kd_trace::kit::{Closest, Collect, Frame, RayPlanes, TriangleTest};
//!
//! fn closest(mesh: &Mesh, ray: &Ray) -> Option<Hit> {
//!     let bounds = mesh.bounds();
//!     if bounds.is_empty() || !ray.can_hit() {
//!         return None;
//!     }
//!     let planes = RayPlanes::new(ray, &Frame::new(&bounds));
//!     planes.clip(ray, &bounds)?;
//!     let test = TriangleTest::new(ray, planes.reach());
//!     let mut closest = Closest::default();
//!     for triangle in 0..mesh.len() as u32 {
//!         if test.ask(mesh, triangle, &mut closest).is_break() {
//!             break;
//!         }
//!     }
//!     closest.0
//! }
//!
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2]])?;
//! let ray = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! assert_eq!(closest(&mesh, &ray), kd_trace::brute_force::intersect(&mesh, &ray));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use kd_wide::WideTree;

use crate::PackedTree;
use crate::dispatch::{hits_in_placed, hits_of_one};
use crate::wide::placed::InPlaced;

pub use crate::binary::references::walk_references;
pub use crate::collect::{Any, Closest, Collect, Ordered};
pub use crate::items::VisitItem;
pub use crate::planes::{Crossing, Frame, PacketPlanes, RayPlanes, Span};
pub use crate::primitives::AskPrimitives;
pub use crate::probe::Probe;
pub use crate::ray_query::rest_of;
pub use crate::triangle::TriangleTest;
pub use crate::wide::boxes::walk_boxes;
pub use crate::wide::placed::Placement;
pub use kd_core::{Ray, RayPacket8};
pub use kd_simd::{max, min};
pub use kd_wide::{
    BinaryNode, BinaryTree, Item, ObjectSplit, WideBoxes, clusters, in_morton_order,
};

/// Gives a collector every hit of a ray in wide nodes that it may want, some more than once, roughly front to back.
pub fn collect_wide<C: Collect>(tree: &WideTree, ray: &Ray, collector: &mut C) {
    hits_of_one(tree, ray, collector);
}

/// Gives a collector every hit of a ray in 8-byte nodes that it may want, some more than once, roughly front to back.
pub fn collect_packed<C: Collect>(tree: &PackedTree, ray: &Ray, collector: &mut C) {
    tree.walk(ray, collector, &mut ());
}

/// Gives a collector every hit of a ray in a placed tree that it may want, some more than once, roughly front to back. Hits are
/// those of the transformed mesh, to the bit. `frame` is that of a box around the placed tree.
///
/// The triangles of the tree that have no area before the transform are not hit, even where rounding gives them an area.
pub fn collect_placed<C: Collect>(
    tree: &WideTree,
    placement: &Placement,
    frame: &Frame,
    ray: &Ray,
    collector: &mut C,
) {
    hits_in_placed(InPlaced {
        tree,
        placement,
        ray,
        frame,
        collector,
    });
}
