//! Partition trees: the surface area heuristic over trees in place of primitives (Eleftheriades 2010, §3.4 and algorithm 9).
//!
//! Planes are looked for among the faces of the trees' boxes. One that cuts no tree is taken. Where there is none, every tree
//! is *dissolved*: its root is taken away and its two children stand in its place, which gives twice the planes, once; then
//! the best plane is taken whatever it cuts, by algorithm 7.
//!
//! What the listing leaves open: a box may have no face inside the volume, since trees may fill it, and then they are dissolved
//! again; a plane counts a tree that it cuts on both sides, as far as [`estimate`](crate::estimate) tells; and where a path would
//! become too long, the part is built anew.

use kd_core::{Aabb, Axis, CostModel, PrimSource, Slot};
use kd_sah::BuildError;

use crate::draft::{Draft, Subtree, View};
use crate::estimate::{Sides, estimate_below};
use crate::partition::cut;
use crate::{Census, Resplit};

/// How many nodes of a tree an estimate visits, of a plane that cuts it.
const VISITS: usize = 8;

/// A tree in its cell, outside of which none of its primitives count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) tree: Subtree,
    pub(crate) cell: Aabb,
}

/// What trees are partitioned with.
pub(crate) struct TreePartition<'a, 'd, S> {
    pub(crate) draft: &'d mut Draft<'a>,
    pub(crate) census: &'a Census,
    pub(crate) source: &'a S,
    pub(crate) resplit: &'a Resplit,
}

/// A plane between, or through, trees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    cost: f64,
    axis: Axis,
    position: f32,
    /// Whether it cuts no tree.
    is_clean: bool,
}

impl<S: PrimSource> TreePartition<'_, '_, S> {
    /// One tree of `items`, in `volume`, of no more than `depth` levels.
    pub(crate) fn partition(
        &mut self,
        mut items: Vec<Item>,
        volume: &Aabb,
        comes_from_dissolve: bool,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        items.retain(|item| !self.draft.is_empty(item.tree));
        let highest = items.iter().map(|item| self.draft.height(item.tree));
        match items.as_slice() {
            [] => return Ok(Subtree::Empty),
            [one] if is_tight(&one.cell, volume) && self.draft.height(one.tree) <= depth => {
                return Ok(one.tree);
            }
            _ if 1 + highest.max().unwrap_or(0) > depth => {
                return self.rebuild(&items, volume, depth);
            }
            _ => {}
        }
        let best = self.best_plane(&items, volume);
        let plane = best.filter(|plane| plane.is_clean || comes_from_dissolve);
        let Some(plane) = plane else {
            if !self.dissolve(&mut items) {
                return self.of_leaves(&items, volume, depth);
            }
            return self.partition(items, volume, true, depth);
        };
        let (axis, position) = (plane.axis, plane.position);
        let (mut below, mut above) = (Vec::new(), Vec::new());
        for item in items {
            let [min, max] = range(&item.cell, axis);
            if max <= position {
                below.push(item);
            } else if min >= position {
                above.push(item);
            } else {
                self.draft.counts.cut += 1;
                let parts = cut(
                    self.draft,
                    self.source,
                    item.tree,
                    &item.cell,
                    axis,
                    position,
                );
                let (lower, upper) = item.cell.split(axis, position);
                below.push(Item {
                    tree: parts[0],
                    cell: lower,
                });
                above.push(Item {
                    tree: parts[1],
                    cell: upper,
                });
            }
        }
        let (lower, upper) = volume.split(axis, position);
        let below = self.partition(below, &lower, false, depth - 1)?;
        let above = self.partition(above, &upper, false, depth - 1)?;
        Ok(self.draft.split(axis, position, [below, above]))
    }

    /// The plane of least cost among the faces of boxes inside the volume.
    fn best_plane(&self, items: &[Item], volume: &Aabb) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        for axis in Axis::ALL {
            let [start, end] = range(volume, axis);
            let faces = items.iter().flat_map(|item| range(&item.cell, axis));
            let mut positions: Vec<f32> = faces.filter(|x| start < *x && *x < end).collect();
            positions.sort_by(f32::total_cmp);
            positions.dedup();
            for position in positions {
                let candidate = self.cost(items, volume, axis, position);
                // A clean one first; among equals the first axis, and the lowest.
                let is_better = best.is_none_or(|best| {
                    (candidate.is_clean, -candidate.cost) > (best.is_clean, -best.cost)
                });
                if is_better {
                    best = Some(candidate);
                }
            }
        }
        best
    }

    fn cost(&self, items: &[Item], volume: &Aabb, axis: Axis, position: f32) -> Candidate {
        let mut sides = Sides::default();
        let mut is_clean = true;
        for item in items {
            let references = f64::from(self.draft.references(item.tree));
            let [min, max] = range(&item.cell, axis);
            if max <= position {
                sides.left += references;
            } else if min >= position {
                sides.right += references;
            } else {
                is_clean = false;
                sides.add(self.sides_of_cut(item, axis, position));
            }
        }
        let (lower, upper) = volume.split(axis, position);
        let model = CostModel::PACKED;
        let per_reference = f64::from(model.intersect) / volume.half_area();
        let cost = lower.half_area() * (sides.left + sides.on)
            + upper.half_area() * (sides.right + sides.on);
        Candidate {
            cost: f64::from(model.traverse) + per_reference * cost,
            axis,
            position,
            is_clean,
        }
    }

    /// What lies where, of a tree that the plane cuts.
    fn sides_of_cut(&self, item: &Item, axis: Axis, position: f32) -> Sides {
        if let Subtree::Linked(node) = item.tree {
            let arena = self.draft.arena();
            let cell = range(&item.cell, axis);
            let of = (arena.nodes(), arena.refs(), self.census);
            return estimate_below(of, self.source, node, cell, axis, position, VISITS);
        }
        let references = f64::from(self.draft.references(item.tree));
        let [min, max] = range(&item.cell, axis).map(f64::from);
        let below = (f64::from(position) - min) / (max - min);
        Sides {
            left: references * below,
            right: references * (1.0 - below),
            on: 0.0,
        }
    }

    /// Puts the children of each tree in its place; false if all are leaves.
    fn dissolve(&mut self, items: &mut Vec<Item>) -> bool {
        let mut children = Vec::with_capacity(2 * items.len());
        let mut has_dissolved = false;
        for item in items.drain(..) {
            match self.draft.view(item.tree) {
                View::Leaf(_) => children.push(item),
                View::Split { axis, split, parts } => {
                    has_dissolved = true;
                    self.draft.counts.dissolved += 1;
                    let (lower, upper) = item.cell.split(axis, split);
                    for (tree, cell) in parts.into_iter().zip([lower, upper]) {
                        if !self.draft.is_empty(tree) {
                            children.push(Item { tree, cell });
                        }
                    }
                }
            }
        }
        *items = children;
        has_dissolved
    }

    /// `MakeTreeFromLeafs`.
    fn of_leaves(
        &mut self,
        items: &[Item],
        volume: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        let slots = self.slots(items);
        self.resplit
            .leaf(self.draft, self.source, &slots, volume, depth)
    }

    fn rebuild(
        &mut self,
        items: &[Item],
        volume: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        let slots = self.slots(items);
        self.resplit
            .rebuild(self.draft, self.source, &slots, volume, depth)
    }

    /// All primitives of some trees, each once.
    fn slots(&self, items: &[Item]) -> Vec<Slot> {
        let mut slots = Vec::new();
        for item in items {
            self.draft.collect(item.tree, &mut slots);
        }
        slots.sort_unstable();
        slots.dedup();
        slots
    }
}

/// Whether nothing can be cut off.
fn is_tight(cell: &Aabb, volume: &Aabb) -> bool {
    cell.min.cmple(volume.min).all() && cell.max.cmpge(volume.max).all()
}

fn range(cell: &Aabb, axis: Axis) -> [f32; 2] {
    [cell.min, cell.max].map(|corner| corner[axis.index()])
}
