//! Vectors of eight lanes, and run-time dispatch to the instructions of the processor.
//!
//! A computation is a [`Task`], written once over the traits [`Simd`], [`F32x8`], [`F64x8`], [`U32x8`] and [`Mask`].
//! [`Level::run`] compiles it twice, for AVX2 and for every processor, and runs the version of the level:
//!
//! ```
//! use kd_simd::{F32x8, LANES, Level, Mask, Number, Simd, Task};
//!
//! /// Counts the numbers below a limit.
//! struct CountBelow<'a> {
//!     numbers: &'a [[f32; LANES]],
//!     limit: f32,
//! }
//!
//! impl<S: Simd> Task<S> for CountBelow<'_> {
//!     type Output = u32;
//!
//!     #[inline(always)]
//!     fn run(self, simd: S) -> u32 {
//!         let limit = simd.splat(self.limit);
//!         let below = |row| simd.load(row).lt(limit).bits().count_ones();
//!         self.numbers.iter().map(below).sum()
//!     }
//! }
//!
//! let numbers = [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]; 2];
//! let task = || CountBelow { numbers: &numbers, limit: 2.5 };
//! assert_eq!(Level::detect().run(task()), 6);
//! assert_eq!(Level::portable().run(task()), 6);
//! ```
//!
//! Every operation rounds alike at both levels, so both give the same bits. The one exception is
//! [`F32x8::mul_add`], which AVX2 rounds once and the portable level twice: use it only where an error bound covers both.
//!
//! # Safety
//!
//! Callers need no `unsafe`. A value of type [`Level`] or `Avx2` proves what the processor can do: safe code obtains the AVX2
//! ones only from [`Level::detect`], after the processor has confirmed every instruction that this crate uses. Lanes come from such
//! a value only, so that each operation on lanes may use those instructions. Loads and stores take arrays of eight, by
//! reference.
//!
//! # Cost
//!
//! Operations on lanes are inlined always, across crates too. That makes vector instructions of them only inside
//! [`Task::run`], which must be `#[inline(always)]` itself, like every function it calls with lanes. A closure is inlined only
//! where the compiler chooses to: loops over lanes are written as loops.
#![deny(unsafe_code)]

#[cfg(target_arch = "x86_64")]
pub mod avx2;
mod each;
mod float;
mod lanes;
mod level;
pub mod portable;
mod scalar;
mod triple;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
pub use each::each;
pub use float::{max, min};
pub use lanes::{F32x8, F64x8, LANES, Mask, Number, Real, Simd, Task, U32x8, max_lane, min_lane};
pub use level::Level;
pub use portable::Portable;
pub use triple::{Three, Triple};
