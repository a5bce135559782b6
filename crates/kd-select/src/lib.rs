//! The choice of the structure that finishes first for a number of rays: a grid is built faster, a hierarchy is faster for each
//! ray.
//!
//! [`paper`] implements the decision of Hapala, Karlík and Havran, *When It Makes Sense to Use Uniform Grids for Ray Tracing*
//! (2011), step by step. [`Estimator`] extends it to every structure of the library, and to estimates from more than the number
//! of triangles. Both use a [`Calibration`]: times measured over a set of scenes. This crate builds and measures nothing.
//!
//! The feature `json` adds `Calibration::read` and `Calibration::to_json`. The calibration that comes with the library is Rust
//! data and does not need it.
//!
//! ```
//! use kd_select::{Calibration, Choice, Estimator, Features, RayScheme, Structure, Times};
//!
//! let calibration = Calibration::built_in();
//! let estimator = Estimator::of(&calibration, RayScheme::Random);
//!
//! // A grid was built in 12 ms; its statistics and a sample of rays are known.
//! let features = Features {
//!     triangles: 200_000,
//!     refs_per_triangle: 2.6,
//!     sigma: 5.1,
//!     sparseness: 0.93,
//!     hit_share: 0.25,
//! };
//! let grid = Times::new(12e-3, 1.5e-6);
//!
//! let costs = estimator.estimate(&features, &grid);
//! let few = Choice::among(&costs, 100.0).expect("the grid at least");
//! assert_eq!(few.structure, Structure::Grid);
//! let many = Choice::among(&costs, 1e9).expect("the grid at least");
//! assert_ne!(many.structure, Structure::Grid);
//! println!("{many}");
//! ```
#![forbid(unsafe_code)]

mod built_in;
mod calibration;
mod choose;
mod estimate;
mod linear;
mod machine;
pub mod paper;
pub mod sample;
mod times;

pub use calibration::{Calibration, CalibrationError, Features, MeasuredScene, RayScheme};
pub use choose::Choice;
pub use estimate::Estimator;
pub use machine::Machine;
pub use times::{Opening, Structure, Times, break_even};
