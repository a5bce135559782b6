//! A ray that traverses among others: in a [stream](super::stream), or in a [queue](super::queue).

use kd_core::Ray;
use kd_wide::{Child, WIDTH, WideNode, WideTree};

use super::stack::Pending;
use super::subtree::Subtree;
use crate::planes::Frame;

/// The order of the lanes themselves.
pub(super) const IN_LANES: u32 = 0o76_543_210;

/// A ray of many: what it has found, and what it needs for triangles.
pub(crate) trait BatchRay<S>: Sized {
    /// Whether the first hit found ends the search.
    const ANY: bool;
    type Answer;
    /// What the ray needs at nodes.
    type Nodes;

    /// `None` for a ray that is traced alone, or that cannot hit anything.
    fn begin(simd: S, ray: &Ray, frame: &Frame) -> Option<(Self::Nodes, Self)>;

    /// The octant of its direction, as in the orders of nodes.
    fn octant(nodes: &Self::Nodes) -> usize;

    /// Children that are entered beyond it cannot matter.
    fn limit(nodes: &Self::Nodes) -> f32;

    /// Divides a list of rays by the children that they meet, up to their limits. The list of a lane begins at the lane times the
    /// number of rays. Returns their lengths. All rays are of one octant.
    ///
    /// # Panics
    ///
    /// If there is no room in `lists` for eight times as many entries, or no ray of some number.
    fn divide(
        simd: S,
        rays: &[Self::Nodes],
        list: &[Entry],
        node: &WideNode,
        lists: &mut [Entry],
    ) -> [u32; WIDTH];

    /// The nearest child that the ray meets, or the one that was pushed last. Pushes the others, the farthest first.
    ///
    /// # Panics
    ///
    /// If the ray meets no child and nothing is pending.
    fn enter_or_pop(nodes: &Self::Nodes, node: &WideNode, pending: &mut Pending<'_>) -> Child;

    /// Traces the ray alone below a child, and lowers its limit. `ray` is the one of [`begin`](Self::begin).
    fn trace_below(&mut self, nodes: &mut Self::Nodes, subtree: Subtree<'_>, ray: &Ray);

    /// What it has found in the tree in the end.
    fn answer(&self, tree: &WideTree) -> Self::Answer;
}

/// A ray in the list of a child, as aligned as one number of its size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(8))]
pub(crate) struct Entry {
    /// Where it enters the child's box.
    pub(super) enter: f32,
    /// Its number among the rays.
    pub(super) ray: u32,
}
