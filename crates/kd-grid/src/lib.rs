//! Uniform grids over triangles: quick to build, with the same answers as every other structure here.
//!
//! ```
//! use kd_core::{Mesh, Ray};
//! use kd_grid::{GridOptions, UniformGrid};
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let grid = UniformGrid::build(mesh, &GridOptions::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = grid.intersect(&ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! assert!(!grid.occluded(&ray.with_range(0.0, 1.5)));
//! println!("{}", grid.stats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # When to use a grid
//!
//! A grid suits few rays: its build is much faster than that of a hierarchy, and each ray is slower (Hapala, Karlík and Havran,
//! *When It Makes Sense to Use Uniform Grids for Ray Tracing*, 2011). Over evenly distributed triangles its rays may be as fast.
//! [`GridStats`] measures the distribution.
//!
//! # Guarantees of every grid
//!
//! - Every query equals [`kd_trace::brute_force`] bit for bit, for every ray: triangles are entered in cells with a margin that
//!   covers all rounding errors of the traversal.
//! - The same mesh and options give the same bytes, at any number of threads.
//! - Time and memory are bounded for every mesh: see [`GridOptions::with_max_cells`] and [`GridOptions::with_max_refs`].
//! - Empty meshes, flat meshes, single points and triangles of zero area are valid.
#![deny(unsafe_code)]

mod build;
mod entries;
mod grid;
mod lattice;
mod mailbox;
mod options;
mod overlap;
mod small_boxes;
mod stats;
mod walk;

pub use grid::UniformGrid;
pub use options::{GridError, GridOptions, Overlap};
pub use stats::GridStats;
