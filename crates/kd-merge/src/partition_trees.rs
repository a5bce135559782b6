//! Partition trees: the surface area heuristic over trees in place of primitives (Eleftheriades 2010, §3.4 and algorithm 9).
//!
//! Planes are looked for among the faces of the trees' boxes. One that cuts no tree is taken. Where there is none, every tree
//! is *dissolved*: its root is taken away and its two children stand in its place, which gives twice the planes, once; then
//! the best plane is taken whatever it cuts, by algorithm 7.
//!
//! What the listing leaves open: a box may have no face inside the volume, since trees may fill it, and then they are dissolved
//! again; what a plane cuts is taken for evenly spread, and looked at by [`estimate`](crate::estimate) where the plane is among
//! the best few; and where a path would become too long, the part is built anew.

use kd_core::{Aabb, Axis, PrimSource};
use kd_sah::BuildError;

use crate::MergeOptions;
use crate::draft::{Draft, Subtree, View};
use crate::estimate::{Sides, estimate_below};
use crate::partition::cut;

/// How many nodes of a tree an estimate visits, of a plane that cuts it.
const VISITS: usize = 8;

/// A tree in its cell, outside of which none of its primitives count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) tree: Subtree,
    pub(crate) cell: Aabb,
}

/// What trees are partitioned with.
pub(crate) struct TreePartition<'s, 'd, 'a, S> {
    pub(crate) draft: &'d mut Draft<'a>,
    pub(crate) source: &'s S,
    pub(crate) options: &'s MergeOptions,
}

/// Trees below which it does not pay to look at those on either side on a thread of their own.
const TASK: usize = 8;

/// How many of the planes that cut trees are looked at with estimates.
const LOOKED_AT: usize = 4;

/// A plane between, or through, trees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    /// References on either side, times half the area there. (What a step costs, and the volume's area, are the same for all
    /// planes of a volume.)
    cost: f64,
    axis: Axis,
    position: f32,
}

impl Candidate {
    fn new(volume: &Aabb, axis: Axis, position: f32, sides: &Sides) -> Self {
        let (lower, upper) = volume.split(axis, position);
        let cost = lower.half_area() * (sides.left + sides.on)
            + upper.half_area() * (sides.right + sides.on);
        Self {
            cost,
            axis,
            position,
        }
    }
}

/// A tree along an axis.
#[derive(Clone, Copy, Debug)]
struct Span {
    range: [f32; 2],
    weight: f64,
}

/// Tells for each end of a span inside the volume, from low to high, what lies where, and whether no span is cut there. What is
/// cut is taken for evenly spread.
fn sweep(spans: &[Span], [start, end]: [f32; 2], mut tell: impl FnMut(f32, Sides, bool)) {
    let faces = spans.iter().flat_map(|span| span.range);
    let mut positions: Vec<f32> = faces.filter(|x| start < *x && *x < end).collect();
    positions.sort_by(f32::total_cmp);
    positions.dedup();
    let sorted_by = |side: usize| {
        let mut order: Vec<usize> = (0..spans.len()).collect();
        order.sort_by(|a, b| spans[*a].range[side].total_cmp(&spans[*b].range[side]));
        order
    };
    let (begins, ends) = (sorted_by(0), sorted_by(1));
    let (mut begun, mut ended) = (begins.iter().peekable(), ends.iter().peekable());
    let mut cut = Cut::default();
    let mut left = 0.0;
    let total: f64 = spans.iter().map(|span| span.weight).sum();
    for position in positions {
        while let Some(span) = begun.next_if(|i| spans[**i].range[0] < position) {
            cut.change(&spans[*span], 1.0);
        }
        while let Some(i) = ended.next_if(|i| spans[**i].range[1] <= position) {
            let span = &spans[*i];
            left += span.weight;
            cut.change(span, -1.0);
        }
        let below = cut.slope * f64::from(position) + cut.at_zero;
        let sides = Sides {
            left: left + below,
            right: total - left - below,
            on: 0.0,
        };
        tell(position, sides, cut.count == 0.0);
    }
}

/// The spans that a plane cuts, and how the share of them that lies below it grows.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    count: f64,
    slope: f64,
    at_zero: f64,
}

impl Cut {
    /// One that begins or ends. What has no extent is not cut.
    fn change(&mut self, span: &Span, sign: f64) {
        let [min, max] = span.range.map(f64::from);
        if min == max {
            return;
        }
        let slope = span.weight / (max - min);
        self.count += sign;
        self.slope += sign * slope;
        self.at_zero -= sign * slope * min;
        if self.count == 0.0 {
            *self = Self::default();
        }
    }
}

impl<S: PrimSource> TreePartition<'_, '_, '_, S> {
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
        let Some(plane) = self.best_plane(&items, volume, comes_from_dissolve) else {
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
        let (source, options) = (self.source, self.options);
        let parts = self.draft.both(
            options.is_parallel && below.len().min(above.len()) >= TASK,
            |draft| {
                let mut partition = TreePartition {
                    draft,
                    source,
                    options,
                };
                partition.partition(below, &lower, false, depth - 1)
            },
            |draft| {
                let mut partition = TreePartition {
                    draft,
                    source,
                    options,
                };
                partition.partition(above, &upper, false, depth - 1)
            },
        )?;
        Ok(self.draft.split(axis, position, parts))
    }

    /// The plane of least cost among the faces of boxes inside the volume: of those that cut no tree, if there are any, or
    /// else of all, if it may cut.
    fn best_plane(&self, items: &[Item], volume: &Aabb, may_cut: bool) -> Option<Candidate> {
        let weight = |item: &Item| f64::from(self.draft.references(item.tree));
        let mut clean: Option<Candidate> = None;
        let mut cutting: Vec<Candidate> = Vec::new();
        for axis in Axis::ALL {
            let spans = items.iter().map(|item| Span {
                range: range(&item.cell, axis),
                weight: weight(item),
            });
            sweep(
                &spans.collect::<Vec<_>>(),
                range(volume, axis),
                |position, sides, is_clean| {
                    let candidate = Candidate::new(volume, axis, position, &sides);
                    if is_clean {
                        if clean.is_none_or(|clean| candidate.cost < clean.cost) {
                            clean = Some(candidate);
                        }
                    } else if may_cut {
                        cutting.push(candidate);
                    }
                },
            );
        }
        if clean.is_some() || cutting.is_empty() {
            return clean;
        }
        // What is cut was taken for evenly spread. The best few are looked at again.
        cutting.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let looked_at = cutting.iter().take(LOOKED_AT).map(|candidate| {
            let Candidate { axis, position, .. } = *candidate;
            let sides = self.sides(items, axis, position);
            Candidate::new(volume, axis, position, &sides)
        });
        looked_at.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// What lies where, of all trees.
    fn sides(&self, items: &[Item], axis: Axis, position: f32) -> Sides {
        let mut sides = Sides::default();
        for item in items {
            let references = f64::from(self.draft.references(item.tree));
            let [min, max] = range(&item.cell, axis);
            if max <= position {
                sides.left += references;
            } else if min >= position {
                sides.right += references;
            } else {
                sides.add(self.sides_of_cut(item, axis, position));
            }
        }
        sides
    }

    /// What lies where, of a tree that the plane cuts.
    fn sides_of_cut(&self, item: &Item, axis: Axis, position: f32) -> Sides {
        if let (Subtree::Linked(node), Some(census)) = (item.tree, self.draft.census()) {
            let arena = self.draft.arena();
            let cell = range(&item.cell, axis);
            let of = (arena.nodes(), arena.refs(), census);
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
        let slots = self.draft.slots(items.iter().map(|item| item.tree));
        self.options
            .leaf(self.draft, self.source, &slots, volume, depth)
    }

    fn rebuild(
        &mut self,
        items: &[Item],
        volume: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        let slots = self.draft.slots(items.iter().map(|item| item.tree));
        self.options
            .rebuild(self.draft, self.source, &slots, volume, depth)
    }
}

/// Whether nothing can be cut off.
fn is_tight(cell: &Aabb, volume: &Aabb) -> bool {
    cell.min.cmple(volume.min).all() && cell.max.cmpge(volume.max).all()
}

fn range(cell: &Aabb, axis: Axis) -> [f32; 2] {
    [cell.min, cell.max].map(|corner| corner[axis.index()])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same, span by span.
    fn counted(spans: &[Span], position: f32) -> (Sides, bool) {
        let mut sides = Sides::default();
        let mut is_clean = true;
        for span in spans {
            let [min, max] = span.range;
            if max <= position {
                sides.left += span.weight;
            } else if min >= position {
                sides.right += span.weight;
            } else {
                is_clean = false;
                let below = f64::from((position - min) / (max - min));
                sides.left += span.weight * below;
                sides.right += span.weight * (1.0 - below);
            }
        }
        (sides, is_clean)
    }

    proptest! {
        #[test]
        fn a_sweep_counts_as_one_by_one(
            spans in prop::collection::vec((0_u8..9, 0_u8..5, 0_u8..4), 0..20),
        ) {
            let span = |(start, length, weight): &(u8, u8, u8)| Span {
                range: [f32::from(*start), f32::from(start + length)],
                weight: f64::from(*weight),
            };
            let spans: Vec<Span> = spans.iter().map(span).collect();
            let mut positions = Vec::new();
            let mut wrong = Vec::new();
            sweep(&spans, [1.0, 10.0], |position, sides, is_clean| {
                positions.push(position);
                let (expected, is_expected_clean) = counted(&spans, position);
                let is_close = (sides.left - expected.left).abs() < 1e-5
                    && (sides.right - expected.right).abs() < 1e-5;
                if !is_close || is_clean != is_expected_clean {
                    wrong.push((position, sides, expected));
                }
            });
            prop_assert!(wrong.is_empty(), "{wrong:?}");
            prop_assert!(positions.is_sorted(), "{positions:?}");
            let inside = |x: &f32| 1.0 < *x && *x < 10.0;
            let all = spans.iter().flat_map(|span| span.range).filter(inside);
            prop_assert!(all.into_iter().all(|x| positions.contains(&x)), "{positions:?}");
        }
    }
}
