//! The driver of all builders. It stops the recursion, makes leaves and nodes, and builds subtrees in parallel.

use std::sync::{Mutex, PoisonError};

use kd_core::{CostModel, Node, Pair, PrimSource, Slot};
use kd_tasks::{Share, Tracker};

use crate::CHUNK;
use crate::cell::{Cell, Counted, Place};
use crate::choose::{ChoosePlane, Median, Memoryless as _};
use crate::division::{Block, ChunkCounts, Divided, Division, Room};
use crate::options::{BuildError, BuildOptions};
use crate::output::{Built, Interior, Output};
use crate::plane::{BestPlane, CellCost, LeafCost, Plane, Side, as_count, offer_empty_cuts};
use crate::prim::Prim;

/// A cell with fewer primitives is built within one task.
const TASK_PRIMS: usize = 1024;

/// A cell with fewer primitives is divided by one thread.
const CHUNKED_PRIMS: usize = 2 * CHUNK;

/// The inputs of a build.
pub(crate) struct Task<'a, S> {
    pub(crate) source: &'a S,
    pub(crate) options: &'a BuildOptions,
    pub(crate) tracker: &'a Tracker<'a>,
}

impl<S> Clone for Task<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

/// A derived implementation would require `S: Copy`, but a task holds only references.
impl<S> Copy for Task<'_, S> {}

/// A cell to build: its geometry, primitives and limits.
#[derive(Debug)]
pub(crate) struct Start {
    pub(crate) place: Place,
    pub(crate) prims: Vec<Prim>,
    pub(crate) allowance: Allowance,
    pub(crate) max_depth: u32,
}

impl Start {
    /// The root cell, with the limits of the options.
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
        let driver = self.driver(chooser, &start);
        let mut worker = Worker::default();
        worker.output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        let (state, mut prims) = driver.begin(start);
        let mut free = Prim::room_for(with_reserve(prims.len()));
        let built = driver.grow(state, &mut prims, &mut free, &mut worker)?;
        worker.output.pairs[0].0[0] = built.node;
        Ok(worker.output)
    }

    /// Divides a cell once. Returns the cell as an error if it should be a leaf.
    pub(crate) fn divide(
        &self,
        chooser: &impl ChoosePlane,
        start: Start,
    ) -> Result<(Plane, [Start; 2]), Start> {
        let max_depth = start.max_depth;
        let driver = self.driver(chooser, &start);
        let (mut state, mut prims) = driver.begin(start);
        let Some(plane) = driver.plane(&prims, &mut state) else {
            return Err(Start {
                place: state.place,
                prims,
                allowance: state.allowance,
                max_depth,
            });
        };
        let mut free = Prim::room_for(prims.len());
        let memory = (&mut *prims, &mut *free);
        let (divided, [lower, upper]) =
            driver.divide(state, &plane, memory, None, &mut Worker::default());
        let [below, above] = divided.both(&mut prims, &mut free);
        let starts = [(lower, below), (upper, above)].map(|(state, room)| Start {
            place: state.place,
            prims: room.prims.to_vec(),
            allowance: state.allowance,
            max_depth,
        });
        Ok((plane, starts))
    }

    fn driver<'a, C: ChoosePlane>(&'a self, chooser: &'a C, start: &Start) -> Driver<'a, S, C> {
        let threads = match self.options.threads {
            1 => 1,
            _ => kd_tasks::threads(),
        };
        let parallel = threads > 1;
        // A cell of at most one thread's share of the work is divided by one thread: others divide other cells meanwhile.
        let share = start.prims.len() / threads;
        Driver {
            source: self.source,
            chooser,
            options: self.options,
            tracker: self.tracker,
            model: &self.options.cost,
            leaf_cost: LeafCost::new(&self.options.cost),
            max_depth: start.max_depth,
            parallel,
            chunked_prims: if parallel {
                share.max(CHUNKED_PRIMS)
            } else {
                usize::MAX
            },
        }
    }
}

/// The output and memory of one building thread.
#[derive(Debug, Default)]
struct Worker {
    output: Output,
    block: Block,
    /// Memory for a task whose free memory is too small.
    spare: Vec<Prim>,
}

/// An amount of memory, in primitives, that is likely to suffice for all cells below a cell of `prims` primitives: at least
/// half of the primitives of a cell stay in place, and planes cut some.
fn with_reserve(prims: usize) -> usize {
    prims + prims / 16
}

/// New memory to divide a cell into; empty if the free memory suffices.
fn more_memory<S: PrimSource>(
    division: &Division<'_, S>,
    prims: &[Prim],
    free: usize,
    chunks: Option<&ChunkCounts>,
    worker: &mut Worker,
) -> Vec<Prim> {
    let count = prims.len();
    if chunks.is_none() && free >= count {
        return Vec::new();
    }
    if count < TASK_PRIMS {
        // The spare memory of tasks is available; counting the primitives that move would take longer.
        let spare = std::mem::take(&mut worker.spare);
        return if spare.is_empty() {
            Prim::room_for(2 * TASK_PRIMS)
        } else {
            spare
        };
    }
    let needed = chunks.map_or_else(|| division.moving(prims), ChunkCounts::total);
    if free >= needed {
        Vec::new()
    } else {
        Prim::room_for(with_reserve(needed))
    }
}

/// A cell to build, without its primitives.
struct CellState<K> {
    place: Place,
    /// The data that the chooser keeps for the cell.
    kept: K,
    allowance: Allowance,
}

/// Limits that a cell inherits from its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowance {
    /// The number of splits that may still cost more than they save.
    bad_refines: u32,
    /// The greatest total number of references of the cell's leaves.
    refs: u64,
    /// Whether the limit of references kept the cell from being divided.
    is_limited: bool,
    /// The cell's share of the work of the build.
    share: Share,
}

struct Driver<'a, S, C> {
    source: &'a S,
    chooser: &'a C,
    options: &'a BuildOptions,
    tracker: &'a Tracker<'a>,
    model: &'a CostModel,
    leaf_cost: LeafCost,
    max_depth: u32,
    parallel: bool,
    /// The smallest number of primitives of a cell that is divided in chunks.
    chunked_prims: usize,
}

impl<S: PrimSource, C: ChoosePlane> Driver<'_, S, C> {
    /// Prepares a cell whose ancestors this driver did not build.
    fn begin(&self, start: Start) -> (CellState<C::Kept>, Vec<Prim>) {
        let kept = self.chooser.begin(Cell {
            place: &start.place,
            prims: &start.prims,
        });
        let state = CellState {
            place: start.place,
            kept,
            allowance: start.allowance,
        };
        (state, start.prims)
    }

    /// Builds the subtree of a cell and returns its root. Nodes below the root are appended to the output. Overwrites the
    /// primitives and the free memory.
    fn grow(
        &self,
        mut state: CellState<C::Kept>,
        prims: &mut [Prim],
        free: &mut [Prim],
        worker: &mut Worker,
    ) -> Result<Built, BuildError> {
        let count = prims.len();
        let Some(plane) = self.plane(prims, &mut state) else {
            return self.leaf(prims, &state.allowance, &mut worker.output);
        };
        let place = state.place;
        let division = self.division(&place, &plane);
        let chunks = if count >= self.chunked_prims {
            ChunkCounts::of(&division, prims)
        } else {
            None
        };
        let mut more = more_memory(&division, prims, free.len(), chunks.as_ref(), worker);
        let free = if more.is_empty() { free } else { &mut more };
        let (divided, [lower, upper]) = self.divide(state, &plane, (prims, free), chunks, worker);
        let interior = Interior::begin(&place, &divided.places, &mut worker.output);
        let children = if self.parallel && count >= TASK_PRIMS {
            let [below, above] = divided.both(prims, free);
            self.grow_both((lower, below), (upper, above), worker)?
        } else {
            let below = divided.one(Side::Lower, prims, free);
            let lower = self.grow(lower, below.prims, below.free, worker)?;
            let above = divided.one(Side::Upper, prims, free);
            [lower, self.grow(upper, above.prims, above.free, worker)?]
        };
        if count < TASK_PRIMS && !more.is_empty() {
            worker.spare = more;
        }
        self.finish(&interior, &plane, count, &children, &mut worker.output)
    }

    /// Divides a cell, in chunks if `chunks` are given. The free memory must suffice.
    fn divide(
        &self,
        state: CellState<C::Kept>,
        plane: &Plane,
        (prims, free): (&mut [Prim], &mut [Prim]),
        chunks: Option<ChunkCounts>,
        worker: &mut Worker,
    ) -> (Divided, [CellState<C::Kept>; 2]) {
        let place = state.place;
        let whole = if C::NEEDS_PARENT {
            prims.to_vec()
        } else {
            Vec::new()
        };
        let division = self.division(&place, plane);
        let divided = match chunks {
            Some(chunks) => division.in_chunks(prims, free, &chunks),
            None => division.in_place(prims, free, &mut worker.block),
        };
        let whole = Cell {
            place: &place,
            prims: &whole,
        };
        let rooms = divided.both(prims, free);
        let cells = [0, 1].map(|side: usize| Cell {
            place: &divided.places[side],
            prims: &*rooms[side].prims,
        });
        let kept = self
            .chooser
            .divide(state.kept, whole, plane, cells, self.parallel);
        let children = CellState::both(
            divided.places,
            kept,
            state.allowance.divide(divided.counted),
        );
        (divided, children)
    }

    /// The plane to divide a cell by; `None` if it should be a leaf.
    fn plane(&self, prims: &[Prim], state: &mut CellState<C::Kept>) -> Option<Plane> {
        let plane = self.best_plane(prims, state)?;
        state.allowance.covers(prims, &plane).then_some(plane)
    }

    /// The plane to divide a cell by without the limit of references.
    fn best_plane(&self, prims: &[Prim], state: &mut CellState<C::Kept>) -> Option<Plane> {
        let place = state.place;
        let cell = Cell {
            place: &place,
            prims,
        };
        let count = prims.len();
        let small_leaf = self.options.small_leaf as usize;
        if count == 0 || count <= small_leaf || place.depth >= self.max_depth {
            return None;
        }
        let mut cost = CellCost::new(self.leaf_cost, &place.bounds);
        if self.options.longest_axis {
            cost = cost.with_longest_axis(&place.bounds);
        }
        let choose = || self.chooser.choose(cell, &state.kept, &cost, self.parallel);
        if !C::BY_COST {
            return choose();
        }
        if place.depth < self.options.median_levels {
            return Median.plane(cell, &cost, self.parallel);
        }
        let leaf_cost = self.leaf_cost.of(as_count(count));
        if self.leaf_cost.is_settled(as_count(count)) {
            let mut best = BestPlane::new(&cost);
            offer_empty_cuts(&mut best, &place.tight, count);
            return best.found().filter(|plane| plane.cost < leaf_cost);
        }
        let plane = choose()?;
        if plane.cost >= leaf_cost {
            if state.allowance.bad_refines == 0 {
                return None;
            }
            state.allowance.bad_refines -= 1;
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

    /// Builds the subtrees of both children of a cell, possibly at the same time.
    fn grow_both(
        &self,
        (lower, below): (CellState<C::Kept>, Room<'_>),
        (upper, above): (CellState<C::Kept>, Room<'_>),
        worker: &mut Worker,
    ) -> Result<[Built; 2], BuildError> {
        // The task of the lower child holds the lock until it is finished. If no other thread has taken the upper child by
        // then, its nodes are written directly behind those of the lower child. Otherwise they are appended afterwards.
        let shared = Mutex::new(std::mem::take(worker));
        let grow_here = |state, room: Room<'_>| {
            let mut worker = shared.lock().unwrap_or_else(PoisonError::into_inner);
            self.grow(state, room.prims, room.free, &mut worker)
        };
        let (lower, upper) = kd_tasks::join(
            || grow_here(lower, below),
            |taken| {
                if !taken {
                    return Ok::<_, BuildError>((grow_here(upper, above)?, None));
                }
                let mut beside = Worker::default();
                let built = self.grow(upper, above.prims, above.free, &mut beside)?;
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

    /// Makes an interior node over two finished subtrees, or replaces the subtrees by a leaf if the leaf costs no more.
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
        self.tracker.done(allowance.share)?;
        output.limited_cells += usize::from(allowance.is_limited);
        let refs = prims.iter().map(|prim| Slot(prim.slot()));
        output.leaf(refs, self.model)
    }
}

impl<K> CellState<K> {
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
    /// Whether the references allowed suffice for both children; records in `is_limited` if they do not.
    fn covers(&mut self, prims: &[Prim], plane: &Plane) -> bool {
        let is_enough = |needed: usize| needed as u64 <= self.refs;
        let covers = is_enough(2 * prims.len()) || {
            let counted = Counted::of(prims, plane);
            is_enough(counted.lower + counted.upper)
        };
        self.is_limited |= !covers;
        covers
    }

    /// The limits of both children. The allowance must cover them.
    fn divide(&self, counted: Counted) -> [Self; 2] {
        let counts = [counted.lower, counted.upper];
        let refs = share_refs(self.refs, counts);
        let shares = self.share.divide(counts);
        [0, 1].map(|side: usize| Self {
            refs: refs[side],
            share: shares[side],
            ..*self
        })
    }
}

/// Divides an allowance of references between two cells in proportion to their numbers of primitives. Each gets at least
/// its number of primitives.
fn share_refs(allowance: u64, [lower, upper]: [usize; 2]) -> [u64; 2] {
    let (lower, upper) = (lower as u64, upper as u64);
    let spare = allowance - (lower + upper);
    let spare_lower = u128::from(spare) * u128::from(lower) / u128::from((lower + upper).max(1));
    let spare_lower = u64::try_from(spare_lower).expect("at most `spare`");
    [lower + spare_lower, upper + spare - spare_lower]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_references_add_up_and_cover_both_cells() {
        assert_eq!(share_refs(10, [3, 3]), [5, 5], "equal cells");
        assert_eq!(share_refs(10, [0, 4]), [0, 10], "an empty cell");
        assert_eq!(
            share_refs(10, [1, 8]),
            [1, 9],
            "the remainder goes to the upper cell"
        );
        assert_eq!(
            share_refs(u64::MAX, [1, 1]),
            [u64::MAX / 2, u64::MAX / 2 + 1],
            "no overflow"
        );
    }
}
