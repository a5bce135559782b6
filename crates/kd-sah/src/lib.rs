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
//! [`Method::Exact`] (Wald and Havran 2006) is the one to use. [`Method::Naive`] and [`Method::Resort`] give the very
//! same tree slowly and are here to prove it; [`Method::Median`] shows what the surface area heuristic is worth.
//!
//! # What holds for every tree
//!
//! - Every part of every primitive is in a leaf whose cell it reaches into; [`Tree::check_coverage`] checks it.
//! - A primitive that lies in a plane goes to one side, the cheaper one.
//! - The same input and options give the same bytes, whatever the number of threads.
//! - Empty input gives one empty leaf. Zero-area primitives are kept, and end the recursion like any other.
#![forbid(unsafe_code)]

mod cell;
mod choose;
mod driver;
mod events;
mod options;
mod plane;
mod tasks;

use kd_core::{Aabb, MAX_TRIANGLES, PrimSource, Tree};

pub use options::{BuildError, BuildOptions, Method};

use cell::{Cell, Prim};
use choose::{Exact, Median, Naive, Resort};

/// Builds a tree over `source`.
///
/// Time and memory are those of the [`Method`]. [`Method::Exact`] takes O(N log N) time, and about 80 bytes per
/// primitive or part of one that lies on the path being worked on; the bench records the peak, tree included, as
/// `peak_build_bytes`.
///
/// # Errors
///
/// [`BuildError`]: an option out of range, a primitive without a finite box, or a tree too large for its indices.
/// A mesh and default options give none short of hundreds of millions of triangles.
pub fn build<S: PrimSource>(source: &S, options: &BuildOptions) -> Result<Tree, BuildError> {
    options.check()?;
    let root = root_cell(source)?;
    let bounds = root.bounds;
    let model = &options.cost;
    let output = tasks::with_threads(options.threads, || match options.method {
        Method::Median => driver::build(source, options, &Median, root),
        Method::Naive => driver::build(source, options, &Naive { model }, root),
        Method::Resort => driver::build(source, options, &Resort { model }, root),
        Method::Exact => driver::build(source, options, &Exact { model }, root),
    })??;
    Ok(Tree::from_parts(
        output.pairs,
        output.refs,
        bounds,
        source.count(),
        options.cost,
    )?)
}

/// All primitives with their whole boxes.
fn root_cell(source: &impl PrimSource) -> Result<Cell, BuildError> {
    let primitives = source.count();
    if primitives as usize > MAX_TRIANGLES {
        return Err(BuildError::TooManyPrimitives { primitives });
    }
    let mut root = Cell {
        bounds: Aabb::EMPTY,
        prims: Vec::with_capacity(primitives as usize),
        depth: 0,
    };
    for slot in 0..primitives {
        let bounds = source.bounds(slot);
        if bounds.is_empty() || !(bounds.min.is_finite() && bounds.max.is_finite()) {
            return Err(BuildError::NotFinite { primitive: slot });
        }
        root.bounds = root.bounds.union(&bounds);
        root.prims.push(Prim { slot, bounds });
    }
    Ok(root)
}
