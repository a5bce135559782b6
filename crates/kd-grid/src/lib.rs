//! Uniform grids over triangles: quick to build, and with the same answers as every other structure here.
//!
//! ```
//! use kd_core::{Mesh, Ray};
//! use kd_grid::{GridOptions, UniformGrid};
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let grid = UniformGrid::build(&mesh, &GridOptions::default())?;
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = grid.intersect(&mesh, &ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! assert!(!grid.occluded(&mesh, &ray.with_range(0.0, 1.5)));
//! println!("{}", grid.stats());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # When
//!
//! Where there are few rays: a grid is there long before a hierarchy, and each ray takes longer (Hapala, Karlík and Havran,
//! *When It Makes Sense to Use Uniform Grids for Ray Tracing*, 2011). Where triangles are spread evenly, it may answer as
//! fast. [`GridStats`] tells how evenly.
//!
//! # What holds for every grid
//!
//! - Every hit that testing all triangles finds is found, to the bit, whatever the ray: triangles are entered in cells
//!   with a margin that covers every rounding on a ray's way.
//! - The same mesh and options give the same bytes, whatever the number of threads.
//! - Time and memory are bounded, whatever the triangles: see [`GridOptions::with_max_cells`] and
//!   [`GridOptions::with_max_refs`].
//! - Empty meshes, flat ones, single points and triangles of zero area are valid.
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
pub use kd_tasks::ThreadsError;
pub use options::{BuildError, GridOptions, Overlap};
pub use stats::GridStats;
