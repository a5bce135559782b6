//! Builders of kd-trees: one driver, and several ways to choose the plane that divides a cell.
//!
//! ```
//! use kd_core::Mesh;
//! use kd_sah::{BuildOptions, Method, build};
//!
//! // Two triangles far apart.
//! let corners = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 1.0]];
//! let positions = [corners(0.0), corners(10.0)].concat();
//! let mesh = Mesh::new(positions, vec![[0, 1, 2], [3, 4, 5]])?;
//!
//! let tree = build(&mesh, &BuildOptions::best().with_method(Method::Exact))?;
//! println!("{}", tree.stats());
//! tree.check_coverage(&mesh)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Which method
//!
//! The presets choose a method. [`Method::Exact`] finds the plane of least cost in every cell. [`Method::Hybrid`] does so
//! only in cells of at most `exact_below` primitives and bins larger ones; it builds faster, and its trees cost almost the same.
//!
//! | method | planes | from |
//! |---|---|---|
//! | [`Median`](Method::Median) | the middle of the cell | slides |
//! | [`Naive`](Method::Naive) | exact, O(N²) | slides |
//! | [`Resort`](Method::Resort) | exact, events sorted in each cell | slides |
//! | [`Sweep`](Method::Sweep) | exact, events sorted once | Wald and Havran 2006 |
//! | [`Exact`](Method::Exact) | exact, bins that bound what is in them | here |
//! | [`Binned`](Method::Binned) | between bins, adjusted | Shevtsov et al. 2007 |
//! | [`Sampled`](Method::Sampled) | piecewise quadratic cost | Hunt et al. 2006 |
//! | [`Hybrid`](Method::Hybrid) | binned above, exact below | here |
//!
//! The four exact methods give the same tree, bit for bit; the slow ones serve as its proof.
//!
//! # What holds for every tree
//!
//! - A primitive is referenced in every leaf whose cell it overlaps; [`Tree::check_coverage`] checks it.
//! - A primitive that lies in a plane goes to one side, the cheaper one.
//! - The same input and options give the same bytes at any number of threads.
//! - Empty input gives one empty leaf. Zero-area primitives are kept, and count like any other when the builder decides whether to stop.
#![forbid(unsafe_code)]

mod bins;
mod bits;
mod cell;
mod choose;
mod collect;
mod division;
mod driver;
mod events;
mod lazy;
mod options;
mod output;
mod plane;
mod prim;
mod promising;
mod small;
mod words;

use kd_core::{MAX_TRIANGLES, PrimSource, Tree};
use kd_tasks::Tracker;

pub use kd_tasks::{Progress as BuildProgress, ThreadsError};
pub use lazy::{LazyNode, Opened};
pub use options::{BuildError, BuildOptions, Method, WideNodes};

use cell::Place;
use choose::{ChoosePlane, WithChooser, with_chooser_of};
use driver::{Start, Task};
use output::Output;
use prim::{Around, Prim};

/// Primitives in a chunk of a cell that several threads share.
const CHUNK: usize = 1 << 13;

/// Builds a tree over `source`.
///
/// Time and memory depend on the [`Method`]. [`Method::Exact`] takes about O(N log N) time, and 64 bytes per reference: 32 for
/// pending cells on the current path, and 32 for the cells that they are divided into. The bench records the peak, tree
/// included, as `peak_build_bytes`.
///
/// # Errors
///
/// [`BuildError`]: an option out of range, a primitive without a finite box, or a tree too large for its indices.
/// A mesh and default options give none short of hundreds of millions of triangles.
pub fn build<S: PrimSource>(source: &S, options: &BuildOptions) -> Result<Tree, BuildError> {
    build_tracked(source, options, &Tracker::new(None))
}

/// [`build`] for long builds: calls `progress` up to 256 times with the fraction that is done, from 0 to 1; `progress` can cancel
/// the build by breaking.
///
/// ```
/// use std::ops::ControlFlow;
/// # use kd_core::Mesh;
/// # use kd_sah::{BuildError, BuildOptions, build_with_progress};
/// # let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// let options = BuildOptions::default();
/// let tree = build_with_progress(&mesh, &options, &|done| {
///     println!("{:.0} %", 100.0 * done);
///     ControlFlow::Continue(())
/// })?;
///
/// let cancelled = build_with_progress(&mesh, &options, &|_| ControlFlow::Break(()));
/// assert_eq!(cancelled.err(), Some(BuildError::Cancelled));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Those of [`build`], and [`BuildError::Cancelled`] soon after `progress` has broken.
pub fn build_with_progress<S: PrimSource>(
    source: &S,
    options: &BuildOptions,
    progress: &BuildProgress<'_>,
) -> Result<Tree, BuildError> {
    build_tracked(source, options, &Tracker::new(Some(progress)))
}

fn build_tracked<S: PrimSource>(
    source: &S,
    options: &BuildOptions,
    tracker: &Tracker<'_>,
) -> Result<Tree, BuildError> {
    options.check()?;
    let threads = kd_tasks::useful_threads(options.threads, source.count() as usize);
    let (output, bounds) = kd_tasks::in_pool_of(threads, || {
        let (place, prims) = root_cell(source, options.threads != 1)?;
        let task = Task {
            source,
            options,
            tracker,
        };
        let start = Start::root(place, prims, options);
        let output = with_chooser_of(options, Build { task, start })?;
        Ok::<_, BuildError>((output, place.bounds))
    })??;
    let tree = Tree::from_parts(
        output.pairs,
        output.refs,
        bounds,
        source.count(),
        options.cost,
    )?;
    Ok(tree.with_limited_cells(output.limited_cells))
}

/// A build with the chooser still open.
struct Build<'a, S> {
    task: Task<'a, S>,
    start: Start,
}

impl<S: PrimSource> WithChooser for Build<'_, S> {
    type Outcome = Result<Output, BuildError>;

    fn with(self, chooser: &impl ChoosePlane) -> Self::Outcome {
        self.task.build(chooser, self.start)
    }
}

/// The root cell: all primitives with their unclipped boxes.
fn root_cell(source: &impl PrimSource, parallel: bool) -> Result<(Place, Vec<Prim>), BuildError> {
    let primitives = source.count();
    if primitives as usize > MAX_TRIANGLES {
        return Err(BuildError::TooManyPrimitives { primitives });
    }
    let mut prims = Prim::room_for(primitives as usize);
    let chunks = (0..primitives).step_by(CHUNK).zip(prims.chunks_mut(CHUNK));
    let around = kd_tasks::map(chunks.collect(), parallel, |(first, chunk)| {
        let mut around = Around::NOTHING;
        for (slot, prim) in (first..).zip(chunk) {
            let bounds = source.bounds(slot);
            if bounds.is_empty() || !(bounds.min.is_finite() && bounds.max.is_finite()) {
                return Err(BuildError::NotFinite { primitive: slot });
            }
            *prim = Prim::new(slot, &bounds);
            around.add(prim);
        }
        Ok(around)
    });
    let mut all = Around::NOTHING;
    for around in around {
        all = all.and(&around?);
    }
    let place = Place {
        bounds: all.bounds(),
        tight: all.bounds(),
        depth: 0,
    };
    Ok((place, prims))
}
