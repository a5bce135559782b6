//! The one driver of all builders: when to stop, what becomes a leaf, where nodes go, which subtrees are built at once.

use std::sync::{Mutex, PoisonError};

use kd_core::{CostModel, Node, Pair, PrimSource, Slot};

use crate::cell::{Cell, Counted, Division, Place};
use crate::choose::{ChoosePlane, Median, Memoryless as _};
use crate::options::{BuildError, BuildOptions};
use crate::output::{Built, Interior, Output};
use crate::plane::{BestPlane, CellCost, LeafCost, Plane, offer_empty_cuts};
use crate::prim::Prim;
use crate::progress::{Share, Watched};
use crate::tasks;

/// Cells with fewer primitives are built within one task.
const TASK_PRIMS: usize = 1024;

/// What a build is about.
pub(crate) struct Task<'a, S> {
    pub(crate) source: &'a S,
    pub(crate) options: &'a BuildOptions,
    pub(crate) watched: &'a Watched<'a>,
}

impl<S> Clone for Task<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

/// Whatever the source is, it is only referred to.
impl<S> Copy for Task<'_, S> {}

/// The primitives of a cell, and what is known of it.
#[derive(Debug)]
pub(crate) struct Start {
    pub(crate) place: Place,
    pub(crate) prims: Vec<Prim>,
    pub(crate) allowance: Allowance,
    pub(crate) max_depth: u32,
}

impl Start {
    /// All primitives.
    pub(crate) fn root(place: Place, prims: Vec<Prim>, options: &BuildOptions) -> Self {
        Self {
            place,
            allowance: Allowance {
                bad_refines: options.bad_refines,
                refs: options.refs_limit(prims.len()),
                is_limited: false,
                share: Share::ALL,
            },
            max_depth: options.depth_limit(prims.len()),
            prims,
        }
    }
}

impl<S: PrimSource> Task<'_, S> {
    /// Builds the tree over all primitives of a cell. The root is the first node of the first pair.
    pub(crate) fn build(
        &self,
        chooser: &impl ChoosePlane,
        start: Start,
    ) -> Result<Output, BuildError> {
        let driver = self.driver(chooser, start.max_depth);
        let mut worker = Worker::default();
        worker.output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        let (part, prims) = driver.begin(start);
        let built = driver.grow_large(part, prims, &mut worker)?;
        worker.output.pairs[0].0[0] = built.node;
        Ok(worker.output)
    }

    /// Divides a cell once; gives it back if it should be a leaf.
    pub(crate) fn divide(
        &self,
        chooser: &impl ChoosePlane,
        start: Start,
    ) -> Result<(Plane, [Start; 2]), Start> {
        let max_depth = start.max_depth;
        let driver = self.driver(chooser, max_depth);
        let (part, prims) = driver.begin(start);
        let back = |part: Part<_>, prims| Start {
            place: part.place,
            prims,
            allowance: part.allowance,
            max_depth,
        };
        match driver.divide(part, prims) {
            Ok((plane, parts)) => Ok((plane, parts.map(|(part, prims)| back(part, prims)))),
            Err((part, prims)) => Err(back(part, prims)),
        }
    }

    fn driver<'a, C: ChoosePlane>(&'a self, chooser: &'a C, max_depth: u32) -> Driver<'a, S, C> {
        Driver {
            source: self.source,
            chooser,
            options: self.options,
            watched: self.watched,
            model: &self.options.cost,
            leaf_cost: LeafCost::new(&self.options.cost),
            max_depth,
            parallel: self.options.threads != 1 && tasks::threads() > 1,
        }
    }
}

/// What building on one thread needs.
#[derive(Debug, Default)]
struct Worker {
    output: Output,
    /// Primitives of small cells that wait for their turn: the next one's last. Depth first, so that there is never
    /// more than a path's worth of siblings.
    pending: Vec<Prim>,
    /// Primitives of the small cell that was just divided.
    scratch: Vec<Prim>,
}

/// A cell to be built, but for its primitives.
struct Part<K> {
    place: Place,
    /// What the chooser keeps for it.
    kept: K,
    allowance: Allowance,
}

/// A part with a list of its own.
type Large<K> = (Part<K>, Vec<Prim>);

/// A plane and both parts, or the cell itself if it should be a leaf.
type Divided<K> = Result<(Plane, [Large<K>; 2]), Large<K>>;

/// What a cell inherits on its way down.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowance {
    /// Splits that may still cost more than they save.
    bad_refines: u32,
    /// References the leaves of the cell may have together.
    refs: u64,
    /// Whether the cell would have been divided, had there been references enough.
    is_limited: bool,
    /// Its part of the whole work.
    share: Share,
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
    /// A cell whose ancestors this driver did not build.
    fn begin(&self, start: Start) -> Large<C::Kept> {
        let kept = self.chooser.begin(Cell {
            place: &start.place,
            prims: &start.prims,
        });
        let part = Part {
            place: start.place,
            kept,
            allowance: start.allowance,
        };
        (part, start.prims)
    }

    /// Builds the subtree of a cell with a list of its own; what lies below its root goes to the output.
    fn grow_large(
        &self,
        part: Part<C::Kept>,
        prims: Vec<Prim>,
        worker: &mut Worker,
    ) -> Result<Built, BuildError> {
        let count = prims.len();
        if count < TASK_PRIMS {
            let first = worker.pending.len();
            worker.pending.extend_from_slice(&prims);
            drop(prims);
            return self.grow_small(part, first, worker);
        }
        let place = part.place;
        let (plane, [lower, upper]) = match self.divide(part, prims) {
            Ok(divided) => divided,
            Err((part, prims)) => {
                return self.leaf(&prims, &part.allowance, &mut worker.output);
            }
        };
        let places = [lower.0.place, upper.0.place];
        let interior = Interior::begin(&place, &places, &mut worker.output);
        let children = if self.parallel {
            self.grow_both(lower, upper, worker)?
        } else {
            let lower = self.grow_large(lower.0, lower.1, worker)?;
            [lower, self.grow_large(upper.0, upper.1, worker)?]
        };
        self.finish(&interior, &plane, count, &children, &mut worker.output)
    }

    /// Divides a cell with a list of its own into two such; gives it back if it should be a leaf.
    fn divide(&self, mut part: Part<C::Kept>, prims: Vec<Prim>) -> Divided<C::Kept> {
        let place = part.place;
        let cell = Cell {
            place: &place,
            prims: &prims,
        };
        let divided = self.plane(cell, &mut part).and_then(|plane| {
            let counts = Counted::in_chunks(&prims, &plane, self.parallel);
            let allowances = part.allowance.divide(counts.0)?;
            Some((plane, counts, allowances))
        });
        let Some((plane, counts, allowances)) = divided else {
            return Err((part, prims));
        };
        let [(lower, lower_prims), (upper, upper_prims)] =
            self.division(&place, &plane)
                .in_chunks(&prims, &counts, self.parallel);
        let parts = [(&lower, &lower_prims), (&upper, &upper_prims)]
            .map(|(place, prims)| Cell { place, prims });
        let kept = self
            .chooser
            .divide(part.kept, cell, &plane, parts, self.parallel);
        let [lower, upper] = Part::both([lower, upper], kept, allowances);
        Ok((plane, [(lower, lower_prims), (upper, upper_prims)]))
    }

    /// Builds the subtree of a cell whose primitives are the pending ones from `first` on, and takes them away.
    fn grow_small(
        &self,
        mut part: Part<C::Kept>,
        first: usize,
        worker: &mut Worker,
    ) -> Result<Built, BuildError> {
        let place = part.place;
        let prims = &worker.pending[first..];
        let count = prims.len();
        let cell = Cell {
            place: &place,
            prims,
        };
        let divided = self.plane(cell, &mut part).and_then(|plane| {
            let counted = Counted::of(prims, &plane);
            let allowances = part.allowance.divide(counted)?;
            Some((plane, counted, allowances))
        });
        let Some((plane, counted, allowances)) = divided else {
            let built = self.leaf(prims, &part.allowance, &mut worker.output);
            worker.pending.truncate(first);
            return built;
        };
        let (pending, scratch) = (&mut worker.pending, &mut worker.scratch);
        let (places, middle) = self
            .division(&place, &plane)
            .in_place(pending, first, counted, scratch);
        let cell = Cell {
            place: &place,
            prims: scratch,
        };
        let lists = [&pending[middle..], &pending[first..middle]];
        let parts = [0, 1].map(|side: usize| Cell {
            place: &places[side],
            prims: lists[side],
        });
        let kept = self
            .chooser
            .divide(part.kept, cell, &plane, parts, self.parallel);
        let interior = Interior::begin(&place, &places, &mut worker.output);
        let [lower, upper] = Part::both(places, kept, allowances);
        let lower = self.grow_small(lower, middle, worker)?;
        let children = [lower, self.grow_small(upper, first, worker)?];
        self.finish(&interior, &plane, count, &children, &mut worker.output)
    }

    /// The plane to divide a cell by; `None` if it should be a leaf.
    fn plane(&self, cell: Cell<'_>, part: &mut Part<C::Kept>) -> Option<Plane> {
        let (count, place) = (cell.prims.len(), cell.place);
        let small_leaf = self.options.small_leaf as usize;
        if count == 0 || count <= small_leaf || place.depth >= self.max_depth {
            return None;
        }
        let mut cost = CellCost::new(self.leaf_cost, &place.bounds);
        if self.options.longest_axis {
            cost = cost.with_longest_axis(&place.bounds);
        }
        let choose = || self.chooser.choose(cell, &part.kept, &cost, self.parallel);
        if !C::BY_COST {
            return choose();
        }
        if place.depth < self.options.median_levels {
            return Median.plane(cell, &cost, self.parallel);
        }
        let leaf_cost = self.leaf_cost.of(count);
        if self.leaf_cost.is_settled(count) {
            let mut best = BestPlane::new(&cost);
            offer_empty_cuts(&mut best, &place.tight, count);
            return best.found().filter(|plane| plane.cost < leaf_cost);
        }
        let plane = choose()?;
        if plane.cost >= leaf_cost {
            if part.allowance.bad_refines == 0 {
                return None;
            }
            part.allowance.bad_refines -= 1;
        }
        Some(plane)
    }

    fn division<'b>(&'b self, place: &'b Place, plane: &'b Plane) -> Division<'b, S> {
        Division {
            source: self.source,
            place,
            plane,
        }
    }

    /// Builds the subtrees of both parts of a large cell, possibly at the same time.
    fn grow_both(
        &self,
        lower: Large<C::Kept>,
        upper: Large<C::Kept>,
        worker: &mut Worker,
    ) -> Result<[Built; 2], BuildError> {
        // Locked by the lower part until it is finished. If no other thread has taken the upper part by then, it goes
        // straight behind the lower one; only what is built at the same time has to be moved there.
        let shared = Mutex::new(std::mem::take(worker));
        let grow_here = |(part, prims)| {
            let mut worker = shared.lock().unwrap_or_else(PoisonError::into_inner);
            self.grow_large(part, prims, &mut worker)
        };
        let (lower, upper) = tasks::join(
            || grow_here(lower),
            |taken| {
                if !taken {
                    return Ok::<_, BuildError>((grow_here(upper)?, None));
                }
                let mut beside = Worker::default();
                let built = self.grow_large(upper.0, upper.1, &mut beside)?;
                Ok((built, Some(beside.output)))
            },
        );
        *worker = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (lower, (upper, beside)) = (lower?, upper?);
        let upper = match beside {
            Some(beside) => worker.output.append(&beside, upper)?,
            None => upper,
        };
        Ok([lower, upper])
    }

    /// Puts an interior node over two finished subtrees, or a leaf in place of all of it if that costs no more.
    fn finish(
        &self,
        interior: &Interior,
        plane: &Plane,
        count: usize,
        children: &[Built; 2],
        output: &mut Output,
    ) -> Result<Built, BuildError> {
        let cost = f64::from(self.model.traverse) + interior.cost_below(children);
        if C::BY_COST && self.options.retraction && cost >= self.model.leaf(count) {
            return output.retract(interior, self.model);
        }
        output.finish(interior, plane, children, cost)
    }

    fn leaf(
        &self,
        prims: &[Prim],
        allowance: &Allowance,
        output: &mut Output,
    ) -> Result<Built, BuildError> {
        self.watched.done(allowance.share)?;
        output.limited_cells += usize::from(allowance.is_limited);
        let refs = prims.iter().map(|prim| Slot(prim.slot()));
        output.leaf(refs, self.model)
    }
}

impl<K> Part<K> {
    fn both(places: [Place; 2], kept: [K; 2], allowances: [Allowance; 2]) -> [Self; 2] {
        let ([lower, upper], [lower_kept, upper_kept]) = (places, kept);
        [
            (lower, lower_kept, allowances[0]),
            (upper, upper_kept, allowances[1]),
        ]
        .map(|(place, kept, allowance)| Self {
            place,
            kept,
            allowance,
        })
    }
}

impl Allowance {
    /// What both parts inherit; `None`, of which it takes note, if there are not even references enough for what they
    /// hold.
    fn divide(&mut self, counted: Counted) -> Option<[Self; 2]> {
        let counts = [counted.lower, counted.upper];
        let Some(refs) = share_refs(self.refs, counts) else {
            self.is_limited = true;
            return None;
        };
        let shares = self.share.divide(counts);
        Some([0, 1].map(|side: usize| Self {
            refs: refs[side],
            share: shares[side],
            ..*self
        }))
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
