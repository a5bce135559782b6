//! What rivals written in Rust have in common.

use kd::{Hit, Ray};
use rayon::ThreadPoolBuilder;

use super::shape_of;
use crate::record::Steps;
use crate::structure::{Built, Measured, Shape, Structure};

/// A structure that is asked about one ray at a time.
pub(super) trait SingleRays: Send + Sync {
    fn closest(&self, ray: &Ray) -> Option<Hit>;
    fn any(&self, ray: &Ray) -> bool;
}

/// A structure, and what it takes.
#[derive(Debug)]
struct Rival<T> {
    rays: T,
    bytes: usize,
}

/// Builds on so many threads. `work` starts from the library's own form of input, in memory, and ends with what can be
/// traced.
pub(super) fn build<T: SingleRays + 'static>(
    threads: usize,
    work: impl FnOnce() -> anyhow::Result<T> + Send,
) -> anyhow::Result<Built> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    // Measured where it works: the count of bytes is one for each thread.
    let measured = pool.install(|| Measured::try_of(work))?;
    Ok(measured.into_built(|rays, bytes| Box::new(Rival { rays, bytes })))
}

/// A hit of a library that does not tell where in the triangle it is.
pub(super) fn hit(t: f32, triangle: u32) -> Hit {
    Hit {
        t,
        u: 0.0,
        v: 0.0,
        triangle,
    }
}

impl<T: SingleRays> Structure for Rival<T> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.rays.closest(ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.rays.any(ray);
        }
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        shape_of(self.bytes)
    }

    fn flaw(&self) -> Option<String> {
        None
    }
}
