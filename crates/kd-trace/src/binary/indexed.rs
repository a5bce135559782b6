//! Queries of a tree and its mesh, triangle by triangle. They need nothing prepared; [`PackedTree`](crate::PackedTree) is
//! faster.

use std::ops::ControlFlow;

use kd_core::{Aabb, Hit, Mesh, Node, NodeIndex, Ray, Tree};

use crate::binary::walk::{Walkable, walk};
use crate::collect::{Any, Closest, Collect, Ordered};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// The closest hit, the lower triangle among equals, or `None`.
///
/// `None` for an empty tree, and for a ray that is not finite, has a zero direction, `t_min > t_max` or mask 0. The origin may be
/// on a surface, on a plane of the tree or outside the box. Expected time is logarithmic in the number of triangles. Allocates
/// nothing.
///
/// # Panics
///
/// If `mesh` is not the one that the tree was built from, and has fewer triangles.
pub fn intersect(tree: &Tree, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
    let mut closest = Closest::default();
    walk(&Indexed { tree, mesh }, ray, &mut closest, &mut ());
    closest.0
}

/// Whether there is any hit: equal to `intersect(..).is_some()`, and faster, since it stops at the first hit found.
///
/// # Panics
///
/// As [`intersect`].
pub fn occluded(tree: &Tree, mesh: &Mesh, ray: &Ray) -> bool {
    let mut any = Any::default();
    walk(&Indexed { tree, mesh }, ray, &mut any, &mut ());
    any.0
}

/// The first `max` hits in `out`, which is cleared before: ordered by `t`, then by triangle, each triangle once.
///
/// A ray through an edge hits all triangles around it, so a closed surface may give more than two hits there. No hits where
/// [`intersect`] returns `None`, and for `max` 0; all hits for `usize::MAX`. Allocates only in `out`: keep it for the next
/// ray.
///
/// # Panics
///
/// As [`intersect`].
pub fn hits(tree: &Tree, mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
    Ordered::fill(out, max, |ordered| {
        walk(&Indexed { tree, mesh }, ray, ordered, &mut ());
    });
}

/// Leaves are lists of triangles of the mesh.
pub(crate) struct Indexed<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) mesh: &'a Mesh,
}

impl<C: Collect> Walkable<C> for Indexed<'_> {
    #[inline]
    fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    #[inline]
    fn root(&self) -> NodeIndex {
        self.tree.root()
    }

    #[inline]
    fn nodes(&self) -> &[Node] {
        self.tree.nodes()
    }

    #[inline]
    fn visit<P: Probe>(
        &self,
        leaf: Node,
        test: &TriangleTest,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        for &slot in self.tree.leaf_refs(leaf) {
            let corners = self.mesh.corners(slot.0);
            if test.certainly_misses(corners) {
                continue;
            }
            probe.decision();
            if let Some(hit) = test.hit(corners, slot.0) {
                collector.take(hit)?;
            }
        }
        ControlFlow::Continue(())
    }
}
