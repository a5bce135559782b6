//! The one driver of all builders: when to stop, what becomes a leaf, where nodes go, which subtrees are built at once.

use std::sync::{Mutex, PoisonError};

use kd_core::{CostModel, Node, NodeIndex, Pair, PrimSource, Slot, TreeError};

use crate::cell::Cell;
use crate::choose::{ChoosePlane, Median, Memoryless as _};
use crate::options::{BuildError, BuildOptions};
use crate::plane::{BestPlane, CellCost, LeafCost, Plane, offer_empty_cuts};
use crate::prim::Prim;
use crate::progress::{Share, Watched};
use crate::tasks;

/// Cells with fewer primitives are built within one task.
const TASK_PRIMS: usize = 1024;

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
    /// Its part of the whole work.
    share: Share,
}

/// Builds the tree over all primitives of `source`. The root is the first node of the first pair.
pub(crate) fn build<S: PrimSource, C: ChoosePlane>(
    source: &S,
    options: &BuildOptions,
    watched: &Watched<'_>,
    chooser: &C,
    root: Cell,
) -> Result<Output, BuildError> {
    let driver = Driver {
        source,
        chooser,
        options,
        watched,
        model: &options.cost,
        leaf_cost: LeafCost::new(&options.cost),
        max_depth: options.depth_limit(root.prims.len()),
        parallel: options.threads != 1 && tasks::threads() > 1,
    };
    let allowance = Allowance {
        bad_refines: options.bad_refines,
        refs: options.refs_limit(root.prims.len()),
        share: Share::ALL,
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
    watched: &'a Watched<'a>,
    model: &'a CostModel,
    leaf_cost: LeafCost,
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
        let Some(plane) = self.plane(&cell, &kept, &mut allowance) else {
            return self.leaf(&cell.prims, allowance.share, output);
        };
        let (lower, upper) = cell.divide(self.source, &plane, self.parallel);
        let counts = [lower.prims.len(), upper.prims.len()];
        let Some([lower_refs, upper_refs]) = share_refs(allowance.refs, counts) else {
            return self.leaf(&cell.prims, allowance.share, output);
        };
        let parts = [&lower, &upper];
        let [lower_kept, upper_kept] =
            self.chooser
                .divide(kept, &cell, &plane, parts, self.parallel);
        let half_area = cell.bounds.half_area();
        drop(cell);
        let chance_lower = lower.bounds.half_area() / half_area;
        let chance_upper = upper.bounds.half_area() / half_area;

        let mark = (output.pairs.len(), output.refs.len());
        output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        let [lower_share, upper_share] = allowance.share.divide(counts);
        let inherit = |refs, share| Allowance {
            refs,
            share,
            ..allowance
        };
        let lower = (lower, lower_kept, inherit(lower_refs, lower_share));
        let upper = (upper, upper_kept, inherit(upper_refs, upper_share));
        let (lower, upper) = if self.parallel && count >= TASK_PRIMS {
            self.grow_both(lower, upper, output)?
        } else {
            let lower = self.grow(lower.0, lower.1, lower.2, output)?;
            (lower, self.grow(upper.0, upper.1, upper.2, output)?)
        };

        let cost =
            f64::from(self.model.traverse) + chance_lower * lower.cost + chance_upper * upper.cost;
        if C::BY_COST && self.options.retraction && cost >= self.model.leaf(count) {
            return self.retract(mark, output);
        }
        output.pairs[mark.0] = Pair([lower.node, upper.node]);
        let node = u32::try_from(2 * mark.0)
            .ok()
            .and_then(|first| Node::interior(plane.axis, plane.position, NodeIndex(first)))
            .ok_or_else(|| output.too_large())?;
        Ok(Built { node, cost })
    }

    /// The plane to divide a cell by; `None` if it should be a leaf.
    fn plane(&self, cell: &Cell, kept: &C::Kept, allowance: &mut Allowance) -> Option<Plane> {
        let count = cell.prims.len();
        if count == 0 || count <= self.options.small_leaf as usize || cell.depth >= self.max_depth {
            return None;
        }
        let cost = CellCost::new(self.leaf_cost, &cell.bounds);
        if !C::BY_COST {
            return self.chooser.choose(cell, kept, &cost, self.parallel);
        }
        if cell.depth < self.options.median_levels {
            return Median.plane(cell, &cost, self.parallel);
        }
        let leaf_cost = self.leaf_cost.of(count);
        if self.leaf_cost.is_settled(count) {
            let mut best = BestPlane::new(&cost);
            offer_empty_cuts(&mut best, &cell.tight, count);
            return best.found().filter(|plane| plane.cost < leaf_cost);
        }
        let plane = self.chooser.choose(cell, kept, &cost, self.parallel)?;
        if plane.cost >= leaf_cost {
            if allowance.bad_refines == 0 {
                return None;
            }
            allowance.bad_refines -= 1;
        }
        Some(plane)
    }

    /// Builds the subtrees of both parts of a large cell, possibly at the same time.
    fn grow_both(
        &self,
        lower: (Cell, C::Kept, Allowance),
        upper: (Cell, C::Kept, Allowance),
        output: &mut Output,
    ) -> Result<(Built, Built), BuildError> {
        // Locked by the lower part until it is finished. If no other thread has taken the upper part by then, it goes
        // straight behind the lower one; only what is built at the same time has to be moved there.
        let shared = Mutex::new(std::mem::take(output));
        let grow = |part: (Cell, C::Kept, Allowance), output: &mut Output| {
            self.grow(part.0, part.1, part.2, output)
        };
        let grow_here = |part| {
            let mut output = shared.lock().unwrap_or_else(PoisonError::into_inner);
            grow(part, &mut output)
        };
        let (lower, upper) = tasks::join(
            || grow_here(lower),
            |taken| {
                if !taken {
                    return Ok::<_, BuildError>((grow_here(upper)?, None));
                }
                let mut beside = Output::default();
                Ok((grow(upper, &mut beside)?, Some(beside)))
            },
        );
        *output = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (lower, (upper, beside)) = (lower?, upper?);
        let upper = match beside {
            Some(beside) => output.append(&beside, upper)?,
            None => upper,
        };
        Ok((lower, upper))
    }

    fn leaf(&self, prims: &[Prim], share: Share, output: &mut Output) -> Result<Built, BuildError> {
        self.watched.done(share)?;
        let first = output.refs.len();
        output
            .refs
            .extend(prims.iter().map(|prim| Slot(prim.slot())));
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
fn share_refs(allowance: u64, [lower, upper]: [usize; 2]) -> Option<[u64; 2]> {
    let (lower, upper) = (lower as u64, upper as u64);
    let spare = allowance.checked_sub(lower + upper)?;
    let spare_lower = u128::from(spare) * u128::from(lower) / u128::from((lower + upper).max(1));
    let spare_lower = u64::try_from(spare_lower).expect("no more than the spare itself");
    Some([lower + spare_lower, upper + spare - spare_lower])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_cover_what_is_there() {
        assert_eq!(share_refs(10, [3, 3]), Some([5, 5]), "even");
        assert_eq!(share_refs(10, [0, 4]), Some([0, 10]), "all to one");
        assert_eq!(share_refs(10, [1, 8]), Some([1, 9]), "the odd one goes up");
        assert_eq!(share_refs(6, [3, 4]), None, "not enough");
        assert_eq!(
            share_refs(u64::MAX, [1, 1]),
            Some([u64::MAX / 2, u64::MAX / 2 + 1]),
            "no overflow"
        );
    }
}
