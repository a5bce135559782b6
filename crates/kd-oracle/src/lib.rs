//! For tests of [`RayQuery`](kd_trace::RayQuery): small meshes that are hard in different ways, hard rays, and a comparison of
//! every query with brute force, to the bit.
//!
//! [`trials`](mod@trials) are the tests that every structure passes. Only tests depend on this crate.
//!
//! ```
//! use kd_core::{Hit, Mesh, Ray};
//! use kd_oracle::rays::Rays;
//! use kd_oracle::{check, scenes};
//! use kd_trace::{RayQuery, brute_force};
//!
//! struct Slow<'a>(&'a Mesh);
//!
//! impl RayQuery for Slow<'_> {
//!     type Hit = Hit;
//!
//!     fn intersect(&self, ray: &Ray) -> Option<Hit> {
//!         brute_force::intersect(self.0, ray)
//!     }
//!     fn occluded(&self, ray: &Ray) -> bool {
//!         brute_force::occluded(self.0, ray)
//!     }
//!     fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
//!         brute_force::hits(self.0, ray, max, out);
//!     }
//! }
//!
//! let mesh = scenes::sphere(1);
//! let mut rays = Rays::new(&mesh, Vec::new(), 1);
//! for _ in 0..100 {
//!     check("sphere", &mesh, &[&Slow(&mesh)], &rays.draw());
//! }
//! ```
#![allow(
    clippy::missing_panics_doc,
    reason = "a panic here is a failed test or a wrong argument of a test"
)]

mod check;
pub mod effort;
pub mod rays;
pub mod rng;
pub mod scenes;
pub mod strategies;
pub mod trials;
pub mod watertight;

pub use check::{check, check_batch, check_ray, source};
