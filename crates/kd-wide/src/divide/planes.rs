//! Where the planes of a division come from.

use kd_core::{Axis, MAX_DEPTH, NodeIndex, NodeView, Tree};

use crate::box_tree::Item;
use crate::object_split::Measured;
use crate::plane_split::PlaneSplit;

/// A plane that divides a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) axis: Axis,
    pub(super) position: f32,
}

/// Chooses planes.
pub(super) trait Planes: Sync {
    /// What is known of a cell before its items are.
    type Cell: Copy + Send + Sync;

    /// An object split replaces a plane where it costs less than this part of it.
    const OBJECTS_BELOW: f64;

    /// Whether a plane of this SAH cost is preferred to an object split.
    fn is_cheap(plane: f64, objects: &Measured) -> bool {
        f64::from(objects.split.cost) >= Self::OBJECTS_BELOW * plane
    }

    /// The plane that may divide these items; `None` for an object split. `objects` is the best one, if objects compete.
    fn plane(
        &self,
        cell: &Self::Cell,
        items: &[Item],
        objects: Option<&Measured>,
        is_parallel: bool,
    ) -> Option<Plane>;

    /// The cells on both sides of a plane, which have this many items.
    fn both(&self, cell: &Self::Cell, counts: [usize; 2]) -> [Self::Cell; 2];

    /// The cell on one side of a plane, where the other side has no items.
    fn one(&self, cell: &Self::Cell, side: usize) -> Self::Cell;

    /// The cells of both sides of an object split, which have this many items.
    fn objects(&self, cell: &Self::Cell, counts: [usize; 2]) -> [Self::Cell; 2];
}

/// No planes: objects alone.
pub(super) struct NoPlanes;

impl Planes for NoPlanes {
    type Cell = ();

    const OBJECTS_BELOW: f64 = 1.0;

    fn plane(&self, (): &(), _: &[Item], _: Option<&Measured>, _: bool) -> Option<Plane> {
        None
    }

    fn both(&self, (): &(), _: [usize; 2]) -> [(); 2] {
        [(); 2]
    }

    fn one(&self, (): &(), _: usize) {}

    fn objects(&self, (): &(), _: [usize; 2]) -> [(); 2] {
        [(); 2]
    }
}

/// The planes of a kd-tree. A cell is a node.
pub(super) struct OfTree<'a>(pub(super) &'a Tree);

impl OfTree<'_> {
    fn children(&self, node: NodeIndex) -> Option<(Plane, [NodeIndex; 2])> {
        match self.0.nodes()[node.index()].view() {
            NodeView::Interior { axis, split, first } => {
                let position = split;
                Some((Plane { axis, position }, [first, first.sibling()]))
            }
            NodeView::Leaf { .. } => None,
        }
    }
}

impl Planes for OfTree<'_> {
    type Cell = NodeIndex;

    /// (At 0.9, rays take 1 to 8 % longer in a cathedral. Without object splits, AO rays take 25 % longer in a game level with huge
    /// walls. Throw-away program, 2026-11-30.)
    const OBJECTS_BELOW: f64 = 0.5;

    fn plane(&self, node: &NodeIndex, _: &[Item], _: Option<&Measured>, _: bool) -> Option<Plane> {
        self.children(*node).map(|(plane, _)| plane)
    }

    fn both(&self, node: &NodeIndex, _: [usize; 2]) -> [NodeIndex; 2] {
        self.children(*node)
            .map_or([*node; 2], |(_, children)| children)
    }

    fn one(&self, node: &NodeIndex, side: usize) -> NodeIndex {
        self.both(node, [0; 2])[side]
    }

    fn objects(&self, node: &NodeIndex, _: [usize; 2]) -> [NodeIndex; 2] {
        [*node; 2]
    }
}

/// Planes between bins, where an object split leaves boxes that overlap.
pub(super) struct OfBins {
    /// One over the half area of the root's box.
    pub(super) per_area: f64,
}

/// What planes may still do in a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowance {
    /// Planes on a path.
    levels: usize,
    /// Items in all leaves together.
    items: u64,
}

impl OfBins {
    /// Planes are tried where the boxes of an object split overlap by more than this part of the half area of the root's box.
    ///
    /// (From 0.0003 to 0.001, rays of five kinds over 13 meshes are equally fast, and builds at 0.001 take 4 % less time; at 0.003
    /// rays in a stadium take 13 % longer. With 0, and so planes everywhere, rays on terrain take 4 % longer. A throw-away program,
    /// 2026-11-30.)
    const OVERLAP: f64 = 0.001;
    /// A plane may cut at most this part of the items of a cell.
    const MOST_CUT: f64 = 0.5;
}

impl Allowance {
    /// Planes may cut one for this many items of the root. The limit is for meshes where planes would cut each item often, for nothing:
    /// overlapping triangles in one plane, needles.
    const ITEMS_OF_A_CUT: usize = 2;

    /// The allowance of a root with this many items, of which `most_items` may be in leaves.
    pub(super) fn of_root(items: usize, most_items: u64) -> Self {
        Self {
            levels: MAX_DEPTH,
            items: most_items
                .min((items + items / Self::ITEMS_OF_A_CUT) as u64)
                .max(items as u64),
        }
    }

    /// Divides the allowance in proportion to the items of both sides.
    fn divide(self, levels: usize, [lower, upper]: [usize; 2]) -> [Self; 2] {
        let (lower, upper) = (lower as u64, upper as u64);
        let spare = u128::from(self.items.saturating_sub(lower + upper));
        let of_lower = spare * u128::from(lower) / u128::from((lower + upper).max(1));
        [(lower, of_lower), (upper, spare - of_lower)].map(|(items, spare)| Self {
            levels,
            items: items + u64::try_from(spare).expect("at most the allowance"),
        })
    }
}

impl Planes for OfBins {
    type Cell = Allowance;

    /// (Rays of five kinds over 20 meshes, relative to planes of a kd-tree: 1.011 times as fast at 0.7, 1.017 at 0.95, 1.009 at 1. In
    /// batches over 12 meshes: 1.006, 1.015, and 1.001 over 7 at 1. At 1, rays in a stadium take 10 % longer, in a church 4 %. At 0.7,
    /// rays in a game level take 5 % longer. A throw-away program, 2026-11-30.)
    const OBJECTS_BELOW: f64 = 0.95;

    fn plane(
        &self,
        cell: &Allowance,
        items: &[Item],
        objects: Option<&Measured>,
        is_parallel: bool,
    ) -> Option<Plane> {
        if cell.levels == 0 {
            return None;
        }
        let around = match objects {
            Some(objects) if f64::from(objects.overlap()) * self.per_area < Self::OVERLAP => {
                return None;
            }
            Some(objects) => objects.around(),
            None => {
                let around = Item::around(items);
                (around.min.into(), around.max.into())
            }
        };
        let found = PlaneSplit::best(items, around, is_parallel)?;
        let [lower, upper] = found.counts.map(u64::from);
        let cut = lower + upper - items.len() as u64;
        let is_allowed =
            lower + upper <= cell.items && cut as f64 <= Self::MOST_CUT * items.len() as f64;
        let is_cheap = objects.is_none_or(|objects| Self::is_cheap(f64::from(found.cost), objects));
        (is_allowed && is_cheap).then_some(Plane {
            axis: found.axis,
            position: found.position,
        })
    }

    fn both(&self, cell: &Allowance, counts: [usize; 2]) -> [Allowance; 2] {
        cell.divide(cell.levels - 1, counts)
    }

    /// No plane divides the cell.
    fn one(&self, cell: &Allowance, _: usize) -> Allowance {
        Allowance { levels: 0, ..*cell }
    }

    fn objects(&self, cell: &Allowance, counts: [usize; 2]) -> [Allowance; 2] {
        cell.divide(cell.levels, counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_allowance_is_divided_without_a_rest() {
        let whole = Allowance::of_root(10, 13);
        for counts in [[5, 5], [1, 9], [10, 2], [0, 10]] {
            let [lower, upper] = whole.divide(3, counts);
            assert_eq!(lower.items + upper.items, 13, "{counts:?}");
            assert!(lower.items >= counts[0] as u64, "{counts:?}: {lower:?}");
            assert!(upper.items >= counts[1] as u64, "{counts:?}: {upper:?}");
        }
        let most = Allowance::of_root(10, 99).items;
        assert_eq!(most, 15, "half of the items may be cut");
        let [lower, upper] = Allowance::of_root(10, 3).divide(3, [6, 5]);
        assert_eq!((lower.items, upper.items), (6, 5), "at least what is there");
    }
}
