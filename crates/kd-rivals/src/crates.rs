//! Rivals written in Rust, which are compiled with the program.

mod bvh;
mod obvhs;
mod parry3d;
#[cfg(feature = "tinybvh")]
pub(crate) mod tinybvh;

use std::fmt::Display;
use std::time::Instant;

use glam::Vec3;
use kd_core::{Hit, Ray, RayPacket8};
use kd_trace::RayQuery;
use rayon::ThreadPoolBuilder;

pub(crate) use bvh::build as bvh;
pub(crate) use obvhs::build as obvhs;
pub(crate) use parry3d::build as parry3d;
pub(crate) use parry3d::points as parry3d_points;

use crate::queries::restarted_hits;
use crate::{Built, Options, Queries, RivalError};

/// They are compiled in.
#[allow(clippy::unnecessary_wraps, reason = "an error without the feature")]
pub(crate) fn check() -> Result<(), RivalError> {
    Ok(())
}

/// A structure of a library that traces one ray at a time.
trait Trace: Send + Sync {
    fn closest(&self, ray: &Ray) -> Option<Hit>;
    fn any(&self, ray: &Ray) -> bool;
}

/// The queries of such a structure.
struct OneByOne<T>(T);

impl<T: Trace> RayQuery for OneByOne<T> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.closest(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.0.any(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        restarted_hits(self, ray, max, out);
    }

    /// Libraries do not expect the lanes without a ray.
    fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        packet.rays().map(|ray| {
            if ray.can_hit() {
                self.0.closest(&ray)
            } else {
                None
            }
        })
    }

    fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        packet.rays().map(|ray| ray.can_hit() && self.0.any(&ray))
    }
}

impl<T: Trace> Queries for OneByOne<T> {}

/// Builds on `options.threads` threads. `work` starts from the library's own form of input, in memory, and ends with a structure
/// that is ready to trace.
fn build<T: Trace + 'static, E: Display + Send>(
    options: Options,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<Built, RivalError> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build();
    let pool = pool.map_err(failed)?;
    let mut work = Some(work);
    let mut result = None;
    // Counted on the thread that works, since a program may have a count for each thread.
    let (seconds, bytes) = pool.install(|| {
        let start = Instant::now();
        let bytes = (options.count)(&mut || result = work.take().map(|work| work()));
        (start.elapsed().as_secs_f64(), bytes)
    });
    let structure = result.expect("the work is run").map_err(failed)?;
    Ok(Built {
        structure: Box::new(OneByOne(structure)),
        seconds,
        bytes,
    })
}

fn failed(why: impl Display) -> RivalError {
    RivalError::Failed(why.to_string())
}

/// A direction at unit length, and its length, which is exactly 1 where it was one up to rounding.
#[inline]
fn unit(direction: Vec3) -> (Vec3, f32) {
    let squared = direction.length_squared();
    let length = if (squared - 1.0).abs() < 1e-5 {
        1.0
    } else {
        squared.sqrt()
    };
    (direction / length, length)
}

/// A hit of a library that returns no position in the triangle.
fn hit(t: f32, triangle: u32) -> Hit {
    Hit {
        t,
        u: 0.0,
        v: 0.0,
        triangle,
    }
}
