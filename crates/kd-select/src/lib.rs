//! Which structure answers so many rays soonest: a grid is there at once, a hierarchy is faster for each ray.
//!
//! [`paper`] has the decision of Hapala, Karlík and Havran, *When It Makes Sense to Use Uniform Grids for Ray Tracing* (2011),
//! step by step. [`Estimator`] widens it: to every structure of the library, and to estimates from more than the number of
//! triangles. Both rest on a [`Calibration`]: what was measured over a set of scenes. Nothing here builds or measures anything.
//!
//! ```
//! use kd_select::{Calibration, Choice, Estimator, Features, RayScheme, Structure, Times};
//!
//! let calibration = Calibration::built_in();
//! let estimator = Estimator::of(&calibration, RayScheme::Random);
//!
//! // A grid was built in 12 ms, its statistics were taken, and some rays were traced through it.
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
