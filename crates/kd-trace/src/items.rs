//! Visitors of items that a walk knows by their boxes or cells alone.

use std::ops::ControlFlow;

use crate::collect::Limited;

/// Receives the items that a ray may meet: those whose boxes it meets, or those in the cells of a kd-tree.
pub trait VisitItem {
    /// Whether the order of the items does not matter, because the first one that answers ends the search. Then
    /// [`limit`](Self::limit) may be asked for only once.
    const ANY: bool = false;

    /// Items that the ray meets beyond this `t` do not matter; items that it meets at it may. It never grows.
    fn limit(&self) -> f32;

    /// Receives an item. Breaks if no other item can matter.
    fn visit(&mut self, item: u32) -> ControlFlow<()>;
}

/// A visitor, in the loops that collectors of hits are in, too.
pub(crate) struct Items<'v, V>(pub(crate) &'v mut V);

impl<V: VisitItem> Limited for Items<'_, V> {
    #[inline(always)]
    fn farthest(&self) -> f32 {
        self.0.limit()
    }
}
