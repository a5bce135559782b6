//! The one driver of all builders: when to stop, what becomes a leaf, where nodes go, which subtrees are built at once.

use kd_core::{CostModel, Node, NodeIndex, Pair, PrimSource, Slot, TreeError};

use crate::cell::{Cell, Prim};
use crate::choose::ChoosePlane;
use crate::options::{BuildError, BuildOptions};
use crate::tasks;

/// Cells with fewer primitives are built within one task.
const TASK_PRIMS: usize = 2048;

/// A cell that costs this much more to divide than to keep is not worth a bad refine, if it is small.
/// (Constants of Mitsuba and pbrt's builders.)
const HOPELESS_FACTOR: f64 = 4.0;
const HOPELESS_BELOW: usize = 16;

/// Nodes below some root, indices counting from 0, in depth-first order: a pair, all below its lower node, all below
/// its upper node. The order does not depend on which thread built what.
#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) refs: Vec<Slot>,
}

/// A finished node, not yet put in its place, and its expected cost for a ray that enters it.
struct Built {
    node: Node,
    cost: f64,
}

/// What a cell inherits on its way down.
#[derive(Clone, Copy)]
struct Allowance {
    /// Splits that may still cost more than they save.
    bad_refines: u32,
    /// References the leaves of the cell may have together.
    refs: u64,
}

/// Builds the tree over all primitives of `source`. The root is the first node of the first pair.
pub(crate) fn build<S: PrimSource, C: ChoosePlane>(
    source: &S,
    options: &BuildOptions,
    chooser: &C,
    root: Cell,
) -> Result<Output, BuildError> {
    let driver = Driver {
        source,
        chooser,
        options,
        model: &options.cost,
        max_depth: options.depth_limit(root.prims.len()),
        parallel: options.threads != 1,
    };
    let allowance = Allowance {
        bad_refines: options.bad_refines,
        refs: options.refs_limit(root.prims.len()),
    };
    let kept = chooser.begin(&root);
    let mut output = Output::default();
    output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
    let built = driver.grow(root, kept, allowance, &mut output)?;
    output.pairs[0].0[0] = built.node;
    Ok(output)
}

struct Driver<'a, S, C> {
    source: &'a S,
    chooser: &'a C,
    options: &'a BuildOptions,
    model: &'a CostModel,
    max_depth: u32,
    parallel: bool,
}

impl<S: PrimSource, C: ChoosePlane> Driver<'_, S, C> {
    /// Builds the subtree of a cell; what lies below its root goes to `output`.
    fn grow(
        &self,
        cell: Cell,
        kept: C::Kept,
        mut allowance: Allowance,
        output: &mut Output,
    ) -> Result<Built, BuildError> {
        let count = cell.prims.len();
        if count == 0 || count <= self.options.small_leaf as usize || cell.depth >= self.max_depth {
            return self.leaf(&cell.prims, output);
        }
        let Some(plane) = self.chooser.choose(&cell, &kept) else {
            return self.leaf(&cell.prims, output);
        };
        let leaf_cost = self.model.leaf(count);
        if C::BY_COST && plane.cost >= leaf_cost {
            let hopeless = plane.cost > HOPELESS_FACTOR * leaf_cost && count < HOPELESS_BELOW;
            if hopeless || allowance.bad_refines == 0 {
                return self.leaf(&cell.prims, output);
            }
            allowance.bad_refines -= 1;
        }

        let division = cell.divide(self.source, &plane);
        let (lower_count, upper_count) = (division.lower.prims.len(), division.upper.prims.len());
        let Some((lower_refs, upper_refs)) = share(allowance.refs, lower_count, upper_count) else {
            return self.leaf(&cell.prims, output);
        };
        let bounds = cell.bounds;
        drop(cell);
        let [lower_kept, upper_kept] = self.chooser.divide(kept, &division);
        let (lower, upper) = division.into_cells();
        let chance_lower = lower.bounds.half_area() / bounds.half_area();
        let chance_upper = upper.bounds.half_area() / bounds.half_area();

        let mark = (output.pairs.len(), output.refs.len());
        output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        let lower_allowance = Allowance {
            refs: lower_refs,
            ..allowance
        };
        let upper_allowance = Allowance {
            refs: upper_refs,
            ..allowance
        };
        let (lower, upper) = if self.parallel && count >= TASK_PRIMS {
            let mut beside = Output::default();
            let (lower, upper) = tasks::join(
                || self.grow(lower, lower_kept, lower_allowance, output),
                || self.grow(upper, upper_kept, upper_allowance, &mut beside),
            );
            (lower?, output.append(&beside, upper?)?)
        } else {
            let lower = self.grow(lower, lower_kept, lower_allowance, output)?;
            (
                lower,
                self.grow(upper, upper_kept, upper_allowance, output)?,
            )
        };

        let cost =
            f64::from(self.model.traverse) + chance_lower * lower.cost + chance_upper * upper.cost;
        if C::BY_COST && self.options.retraction && cost >= leaf_cost {
            return self.retract(mark, output);
        }
        output.pairs[mark.0] = Pair([lower.node, upper.node]);
        let node = u32::try_from(2 * mark.0)
            .ok()
            .and_then(|first| Node::interior(plane.axis, plane.position, NodeIndex(first)))
            .ok_or_else(|| output.too_large())?;
        Ok(Built { node, cost })
    }

    fn leaf(&self, prims: &[Prim], output: &mut Output) -> Result<Built, BuildError> {
        let first = output.refs.len();
        output.refs.extend(prims.iter().map(|prim| Slot(prim.slot)));
        self.leaf_from(first, output)
    }

    /// Takes back a subtree that costs no less than a leaf: its references, once each, become that leaf.
    fn retract(
        &self,
        (pairs, refs): (usize, usize),
        output: &mut Output,
    ) -> Result<Built, BuildError> {
        output.pairs.truncate(pairs);
        output.refs[refs..].sort_unstable();
        let mut kept = refs;
        for at in refs..output.refs.len() {
            if at == refs || output.refs[at] != output.refs[kept - 1] {
                output.refs[kept] = output.refs[at];
                kept += 1;
            }
        }
        output.refs.truncate(kept);
        self.leaf_from(refs, output)
    }

    /// The leaf over all references from `first` on.
    fn leaf_from(&self, first: usize, output: &Output) -> Result<Built, BuildError> {
        let count = output.refs.len() - first;
        // Empty leaves are all the same, wherever they stand.
        let first = if count == 0 { 0 } else { first };
        let node = match (u32::try_from(first), u32::try_from(count)) {
            (Ok(first), Ok(count)) => Node::leaf(first, count),
            _ => None,
        };
        Ok(Built {
            node: node.ok_or_else(|| output.too_large())?,
            cost: self.model.leaf(count),
        })
    }
}

impl Output {
    /// Appends what another task built, and gives its root as seen from here.
    fn append(&mut self, other: &Self, root: Built) -> Result<Built, BuildError> {
        let too_large = self.too_large();
        let (Ok(nodes), Ok(refs)) = (
            u32::try_from(2 * self.pairs.len()),
            u32::try_from(self.refs.len()),
        ) else {
            return Err(too_large);
        };
        // An empty leaf has nothing to point to, and stays equal to every other.
        let relocated = |node: Node| {
            if node == Node::EMPTY_LEAF {
                Some(node)
            } else {
                node.relocated(nodes, refs)
            }
        };
        for pair in &other.pairs {
            let [Some(lower), Some(upper)] = pair.0.map(relocated) else {
                return Err(too_large);
            };
            self.pairs.push(Pair([lower, upper]));
        }
        self.refs.extend_from_slice(&other.refs);
        Ok(Built {
            node: relocated(root.node).ok_or(too_large)?,
            ..root
        })
    }

    fn too_large(&self) -> BuildError {
        BuildError::TooLarge(TreeError::TooLarge {
            nodes: 2 * self.pairs.len(),
            refs: self.refs.len(),
        })
    }
}

/// Divides an allowance of references between two cells in proportion to what they hold; `None` if it does not even
/// cover that.
fn share(allowance: u64, lower: usize, upper: usize) -> Option<(u64, u64)> {
    let (lower, upper) = (lower as u64, upper as u64);
    let spare = allowance.checked_sub(lower + upper)?;
    let spare_lower = u128::from(spare) * u128::from(lower) / u128::from((lower + upper).max(1));
    let spare_lower = u64::try_from(spare_lower).expect("no more than the spare itself");
    Some((lower + spare_lower, upper + spare - spare_lower))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_cover_what_is_there() {
        assert_eq!(share(10, 3, 3), Some((5, 5)), "even");
        assert_eq!(share(10, 0, 4), Some((0, 10)), "all to one");
        assert_eq!(share(10, 1, 8), Some((1, 9)), "the odd one goes up");
        assert_eq!(share(6, 3, 4), None, "not enough");
        assert_eq!(
            share(u64::MAX, 1, 1),
            Some((u64::MAX / 2, u64::MAX / 2 + 1)),
            "no overflow"
        );
    }
}
