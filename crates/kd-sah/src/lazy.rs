//! Trees that are built where somebody looks (Hunt, Mark, Fussell 2007, *Fast and lazy build of acceleration structures
//! from scene hierarchies*).

use std::sync::{Mutex, OnceLock, PoisonError};

use kd_core::{Axis, PrimSource, Tree};

use crate::Build;
use crate::choose::{ChoosePlane, WithChooser, with_chooser_of};
use crate::driver::{Start, Task};
use crate::options::{BuildError, BuildOptions};
use crate::plane::Plane;
use crate::progress::Tracker;

/// A cell with at most so many primitives is built at once when it is looked into.
const AT_ONCE: usize = 1024;

/// A cell of a tree that is divided when it is [opened](Self::open) for the first time.
///
/// The planes are those that [`build`](crate::build) would choose with the same options, but cells above some size are
/// never taken back to a leaf, since what lies below them is not known. Any number of threads may open cells; one
/// divides, the others wait for it.
#[derive(Debug)]
pub struct LazyNode<L> {
    opened: OnceLock<Opened<L>>,
    /// Taken by whoever opens it.
    pending: Mutex<Option<Start>>,
}

/// What is in a cell.
#[derive(Debug)]
pub enum Opened<L> {
    /// A plane and two cells.
    Interior {
        /// Which axis the plane is perpendicular to.
        axis: Axis,
        /// Where the plane lies on that axis, in scene units.
        split: f32,
        /// The lower and the upper cell.
        children: Box<[LazyNode<L>; 2]>,
    },
    /// A finished tree over the cell, as whoever opened it wanted it. Its bounds are those of the cell, and its
    /// references count as those of the whole tree.
    Subtree(L),
}

impl<L> LazyNode<L> {
    /// The cell of everything. Takes one look at each primitive.
    ///
    /// # Errors
    ///
    /// [`BuildError`]: an option out of range, or a primitive without a finite box.
    pub fn root(source: &impl PrimSource, options: &BuildOptions) -> Result<Self, BuildError> {
        options.check()?;
        let (place, prims) = crate::root_cell(source, false)?;
        Ok(Self::pending(Start::root(place, prims, options)))
    }

    fn pending(start: Start) -> Self {
        Self {
            opened: OnceLock::new(),
            pending: Mutex::new(Some(start)),
        }
    }

    /// Divides the cell, if that has not been done yet: in two, or completely where few primitives are left, which
    /// `finish` then turns into what is kept. Source and options must be those of the root. Works on the calling thread.
    ///
    /// # Panics
    ///
    /// If `source` does, or did when the cell was to be opened before.
    pub fn open(
        &self,
        source: &impl PrimSource,
        options: &BuildOptions,
        finish: impl FnOnce(Tree) -> L,
    ) -> &Opened<L> {
        self.opened.get_or_init(|| {
            let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
            let start = pending.take().expect("a cell is opened once");
            let options = options.clone().with_threads(1);
            let tracker = Tracker::new(None);
            let task = Task {
                source,
                options: &options,
                tracker: &tracker,
            };
            Self::open_now(task, start, finish)
        })
    }

    fn open_now<S: PrimSource>(
        task: Task<'_, S>,
        mut start: Start,
        finish: impl FnOnce(Tree) -> L,
    ) -> Opened<L> {
        let options = task.options;
        if start.prims.len() > AT_ONCE {
            match with_chooser_of(options, Divide { task, start }) {
                Ok((plane, parts)) => {
                    return Opened::Interior {
                        axis: plane.axis,
                        split: plane.position,
                        children: Box::new(parts.map(Self::pending)),
                    };
                }
                // A leaf however large: nothing divides it, as it did not just now.
                Err(leaf) => {
                    start = Start {
                        max_depth: leaf.place.depth,
                        ..leaf
                    }
                }
            }
        }
        let bounds = start.place.bounds;
        let slots = task.source.count();
        let cost = task.options.cost;
        let output = with_chooser_of(options, Build { task, start })
            .expect("nobody cancels, and what fits a cell fits a tree");
        let tree = Tree::from_parts(output.pairs, output.refs, bounds, slots, cost)
            .expect("builders make valid trees")
            .with_limited_cells(output.limited_cells);
        Opened::Subtree(finish(tree))
    }

    /// What is in the cell, if it has been opened.
    pub fn opened(&self) -> Option<&Opened<L>> {
        self.opened.get()
    }
}

/// One division.
struct Divide<'a, S> {
    task: Task<'a, S>,
    start: Start,
}

impl<S: PrimSource> WithChooser for Divide<'_, S> {
    type Outcome = Result<(Plane, [Start; 2]), Start>;

    fn with(self, chooser: &impl ChoosePlane) -> Self::Outcome {
        self.task.divide(chooser, self.start)
    }
}
