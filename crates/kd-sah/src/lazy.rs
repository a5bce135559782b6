//! Trees that are built on demand, cell by cell (Hunt, Mark, Fussell 2007, *Fast and lazy build of acceleration structures
//! from scene hierarchies*).

use std::sync::{Mutex, OnceLock, PoisonError};

use kd_core::{Axis, PrimSource, Tree};
use kd_tasks::Tracker;

use crate::Build;
use crate::choose::{ChoosePlane, WithChooser, with_chooser_of};
use crate::driver::{Start, Task};
use crate::options::{BuildError, BuildOptions};
use crate::plane::Plane;

/// The greatest number of primitives of a cell whose whole subtree is built when it is opened.
const MAX_EAGER: usize = 1024;

/// A cell of a tree, divided when it is [opened](Self::open) for the first time.
///
/// The planes are those that [`build`](crate::build) chooses with the same options. Cells of more than 1024 primitives are
/// never turned back into leaves, since the cost of their subtrees is unknown. Any number of threads may open cells: one
/// thread divides a cell, and the others wait for it.
#[derive(Debug)]
pub struct LazyNode<L> {
    opened: OnceLock<Opened<L>>,
    /// The primitives of a cell that is not yet open; taken by the thread that opens it.
    pending: Mutex<Option<Start>>,
}

/// The contents of an open cell.
#[derive(Debug)]
pub enum Opened<L> {
    /// A plane and two cells.
    Interior {
        /// The axis perpendicular to the plane.
        axis: Axis,
        /// The coordinate of the plane on that axis, in scene units.
        split: f32,
        /// The lower and the upper cell.
        children: Box<[LazyNode<L>; 2]>,
    },
    /// The result of `finish` for a complete tree over the cell. The bounds of the tree are those of the cell, and its
    /// references are slots of the whole source.
    Subtree(L),
}

impl<L> LazyNode<L> {
    /// The root cell, over all primitives of `source`. Linear: it reads the box of each primitive.
    ///
    /// # Errors
    ///
    /// [`BuildError`] if an option is out of range, the source has too many primitives, or a primitive has no finite box.
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

    /// The contents of the cell, which the first call computes on the calling thread. A cell of more than 1024 primitives
    /// is divided in two. For any other cell, its whole subtree is built, and `finish` converts the subtree to the stored
    /// form. `source` and `options` must be those of the root.
    ///
    /// # Panics
    ///
    /// If `source` or `finish` panics, or did so when the cell was first opened.
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
        if start.prims.len() > MAX_EAGER {
            match with_chooser_of(options, Divide { task, start }) {
                Ok((plane, starts)) => {
                    return Opened::Interior {
                        axis: plane.axis,
                        split: plane.position,
                        children: Box::new(starts.map(Self::pending)),
                    };
                }
                // No plane divides the cell, so it is a leaf of any size: the depth limit stops the build at its root.
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
            .expect("no watch cancels the build, and the subtree of a cell fits a tree");
        let tree = Tree::from_parts(output.pairs, output.refs, bounds, slots, cost)
            .expect("builders make valid trees")
            .with_limited_cells(output.limited_cells);
        Opened::Subtree(finish(tree))
    }

    /// The contents of the cell; `None` if it is not open. Constant time.
    pub fn opened(&self) -> Option<&Opened<L>> {
        self.opened.get()
    }
}

/// The division of one cell by the chooser of the options.
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
