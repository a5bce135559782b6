//! Partition trees: the surface area heuristic over trees instead of primitives (Eleftheriades 2010, §3.4 and algorithm 9).
//!
//! Candidate planes are the faces of the trees' boxes. The cheapest plane that cuts no tree is taken. If every plane cuts a
//! tree, each tree is *dissolved*: its two children replace it, which doubles the number of candidates, once. Then the
//! cheapest plane is taken even if it cuts trees, which algorithm 7 does.
//!
//! The listing leaves three cases open. If no box has a face inside the volume, since trees may fill it, the trees are
//! dissolved again. References of a cut tree are assumed to be evenly distributed, and the best few planes are evaluated by
//! [`estimate`](crate::estimate). Where a path would become too long, the subtree is built again.

use kd_core::{Aabb, Axis, PrimSource};
use kd_sah::BuildError;

use crate::MergeOptions;
use crate::draft::{Draft, Subtree, SubtreeView};
use crate::estimate::{Sides, estimate_below};
use crate::partition::cut;

/// The number of nodes of a cut tree that an estimate visits.
const VISITS: usize = 8;

/// A tree and its cell. Primitives outside of the cell do not count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeInCell {
    pub(crate) tree: Subtree,
    pub(crate) cell: Aabb,
}

/// The recursion of [`partition_trees`](crate::partition_trees()).
pub(crate) struct TreePartition<'s, 'd, 'a, S> {
    pub(crate) draft: &'d mut Draft<'a>,
    pub(crate) source: &'s S,
    pub(crate) options: &'s MergeOptions,
}

/// The smallest number of trees on each side of a plane for which the two sides run on two threads.
const MIN_TASK: usize = 8;

/// The number of planes that cut trees whose cost is estimated more precisely.
const ESTIMATED: usize = 4;

/// A candidate plane, between trees or through them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    /// The sum over both sides of the number of references times the half area. (The cost of a step and the area of the
    /// volume are the same for all planes of a volume, so they are left out.)
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

/// The extent of a tree's cell along an axis, and the number of its references.
#[derive(Clone, Copy, Debug)]
struct Span {
    range: [f32; 2],
    weight: f64,
}

/// Visits each end of a span inside the volume, in ascending order. `visit` receives the position, the weights on both
/// sides, and whether no span is cut there. The weight of a cut span is assumed to be evenly distributed over its extent.
fn sweep(spans: &[Span], [start, end]: [f32; 2], mut visit: impl FnMut(f32, Sides, bool)) {
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
    let mut cut = CrossedSpans::default();
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
        visit(position, sides, cut.count == 0.0);
    }
}

/// The spans that the current plane of a sweep cuts. Their weight below a plane at `x` is `slope * x + at_zero`.
#[derive(Clone, Copy, Debug, Default)]
struct CrossedSpans {
    count: f64,
    slope: f64,
    at_zero: f64,
}

impl CrossedSpans {
    /// Adds a span (`sign` 1) or removes it (`sign` -1). A span without extent is never cut.
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
    /// Merges `items` in `volume` into one subtree of at most `depth` levels.
    pub(crate) fn partition(
        &mut self,
        mut items: Vec<TreeInCell>,
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
                return self.leaf_of(&items, volume, depth);
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
                let halves = cut(
                    self.draft,
                    self.source,
                    item.tree,
                    &item.cell,
                    axis,
                    position,
                );
                let (lower, upper) = item.cell.split(axis, position);
                below.push(TreeInCell {
                    tree: halves[0],
                    cell: lower,
                });
                above.push(TreeInCell {
                    tree: halves[1],
                    cell: upper,
                });
            }
        }
        let (lower, upper) = volume.split(axis, position);
        let (source, options) = (self.source, self.options);
        let children = self.draft.both(
            options.is_parallel && below.len().min(above.len()) >= MIN_TASK,
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
        Ok(self.draft.split(axis, position, children))
    }

    /// The cheapest plane among the faces of boxes inside the volume. Planes that cut no tree take precedence; other planes
    /// are considered only if `may_cut`.
    fn best_plane(&self, items: &[TreeInCell], volume: &Aabb, may_cut: bool) -> Option<Candidate> {
        let weight = |item: &TreeInCell| f64::from(self.draft.references(item.tree));
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
        // These costs assume an even distribution of references. Estimate the best few more precisely.
        cutting.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let estimated = cutting.iter().take(ESTIMATED).map(|candidate| {
            let Candidate { axis, position, .. } = *candidate;
            let sides = self.sides(items, axis, position);
            Candidate::new(volume, axis, position, &sides)
        });
        estimated.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The estimated numbers of references of all trees on the sides of a plane.
    fn sides(&self, items: &[TreeInCell], axis: Axis, position: f32) -> Sides {
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

    /// The same of one tree that the plane cuts.
    fn sides_of_cut(&self, item: &TreeInCell, axis: Axis, position: f32) -> Sides {
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

    /// Replaces each tree by its children. Returns false if all trees are leaves.
    fn dissolve(&mut self, items: &mut Vec<TreeInCell>) -> bool {
        let mut replaced = Vec::with_capacity(2 * items.len());
        let mut has_dissolved = false;
        for item in items.drain(..) {
            match self.draft.view(item.tree) {
                SubtreeView::Leaf(_) => replaced.push(item),
                SubtreeView::Split {
                    axis,
                    split,
                    children,
                } => {
                    has_dissolved = true;
                    self.draft.counts.dissolved += 1;
                    let (lower, upper) = item.cell.split(axis, split);
                    for (tree, cell) in children.into_iter().zip([lower, upper]) {
                        if !self.draft.is_empty(tree) {
                            replaced.push(TreeInCell { tree, cell });
                        }
                    }
                }
            }
        }
        *items = replaced;
        has_dissolved
    }

    /// A leaf, or a subtree if it would be too large, over all primitives of `items` (`MakeTreeFromLeafs` of the listing).
    fn leaf_of(
        &mut self,
        items: &[TreeInCell],
        volume: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        let slots = self.draft.slots(items.iter().map(|item| item.tree));
        self.options
            .leaf(self.draft, self.source, &slots, volume, depth)
    }

    /// Builds the primitives of `items` again, into at most `depth` levels.
    fn rebuild(
        &mut self,
        items: &[TreeInCell],
        volume: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        let slots = self.draft.slots(items.iter().map(|item| item.tree));
        self.options
            .rebuild(self.draft, self.source, &slots, volume, depth)
    }
}

/// Whether a cell fills the volume, so that no plane can cut off empty space.
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

    /// The reference for one position of [`sweep`], span by span.
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
        fn a_sweep_equals_counting_span_by_span(
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
