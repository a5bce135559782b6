//! For tests of whatever answers rays: small meshes that are nasty, each in its own way, rays that ask for trouble, and
//! whether the answers are those of testing every triangle, to the bit.
//!
//! What all structures are put through are [`trials`](mod@trials). Only tests depend on this crate.
//!
//! ```
//! use kd_core::{Hit, Mesh, Ray};
//! use kd_oracle::rays::Rays;
//! use kd_oracle::{Answers, check, scenes};
//! use kd_trace::brute_force;
//!
//! struct Slow<'a>(&'a Mesh);
//!
//! impl Answers for Slow<'_> {
//!     fn closest(&self, ray: &Ray) -> Option<Hit> {
//!         brute_force::intersect(self.0, ray)
//!     }
//!     fn any(&self, ray: &Ray) -> bool {
//!         brute_force::occluded(self.0, ray)
//!     }
//!     fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
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
    reason = "what panics here is a test that fails, or one that asks for the impossible"
)]

mod check;
pub mod effort;
pub mod rays;
pub mod rng;
pub mod scenes;
pub mod strategies;
pub mod trials;
pub mod watertight;

pub use check::{Answers, check, source};
