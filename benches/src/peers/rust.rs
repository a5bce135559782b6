//! Parts that rivals written in Rust share.

use kd::Hit;
use kd_trace::RayQuery;
use rayon::ThreadPoolBuilder;

use super::shape_of;
use crate::structure::{Built, Measured, Queried};

/// Builds on `threads` threads. `work` starts from the library's own form of input, in memory, and ends with a structure that
/// is ready to trace.
pub(super) fn build<T: RayQuery<Hit = Hit> + Send + Sync + 'static>(
    threads: usize,
    work: impl FnOnce() -> anyhow::Result<T> + Send,
) -> anyhow::Result<Built> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    // Measured on the thread that works, since each thread has its own count of bytes.
    let measured = pool.install(|| Measured::try_of(work))?;
    Ok(measured.into_built(|query, bytes| Queried::new(query, move |_| shape_of(bytes))))
}

/// A hit of a library that returns no position in the triangle.
pub(super) fn hit(t: f32, triangle: u32) -> Hit {
    Hit {
        t,
        u: 0.0,
        v: 0.0,
        triangle,
    }
}
