//! Rays of a tile that go on one by one, where they diverge.
//!
//! (After C. Benthin, I. Wald, S. Woop, M. Ernst, W. R. Mark, *Combining Single and Packet-Ray Tracing for Arbitrary Ray
//! Distributions on the Intel MIC Architecture*, 2012.)

use kd_core::Ray;
use kd_simd::Task;

use super::RAYS;
use crate::dispatch::TraceSimd;
use crate::planes::Frame;

/// Work after which a tile checks how many rays meet a box: more than coherent rays need.
const PATIENCE: u32 = 48;

/// The work of a ray that goes on alone.
const WALK: u32 = 2;

/// The rays of a tile, each prepared when it is first needed.
pub(super) struct Alone<S: TraceSimd> {
    rays: Vec<Option<S::Ray>>,
    /// A bit for each ray that is prepared.
    ready: u64,
    /// The work of the tile, roughly in boxes tested against a group.
    work: u32,
    /// The initial work: above 0 after a tile that was wary.
    begin: u32,
    /// The number of times a ray of the tile went on alone.
    walks: u32,
    /// The effort of the last tile, in the same unit.
    effort: u32,
}

impl<S: TraceSimd> Alone<S> {
    pub(super) fn new() -> Self {
        Self {
            rays: Vec::new(),
            ready: 0,
            work: 0,
            begin: 0,
            walks: 0,
            effort: 0,
        }
    }

    /// Begins a tile.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
        self.ready = 0;
        self.work = self.begin;
        self.walks = 0;
    }

    /// Ends a tile.
    #[inline(always)]
    pub(super) fn end(&mut self) {
        self.effort = self.work - self.begin + WALK * self.walks;
        self.begin = if self.work > PATIENCE {
            PATIENCE / 2
        } else {
            0
        };
    }

    /// The effort of the last tile, roughly in boxes tested against a group.
    pub(super) fn effort(&self) -> u32 {
        self.effort
    }

    /// Makes the next tile wary sooner.
    pub(super) fn expect_divergence(&mut self) {
        self.begin = PATIENCE / 2;
    }

    #[inline(always)]
    pub(super) fn work(&mut self, amount: u32) {
        self.work += amount;
    }

    /// Whether to check how many rays meet a box.
    #[inline(always)]
    pub(super) fn is_wary(&mut self) -> bool {
        self.work += 1;
        self.work > PATIENCE
    }

    /// One of the rays of the tile; `None` if it cannot hit anything.
    #[inline(always)]
    pub(super) fn ray(
        &mut self,
        simd: S,
        number: usize,
        rays: &[Ray],
        frame: &Frame,
    ) -> Option<&S::Ray> {
        self.walks += 1;
        if self.rays.is_empty() {
            self.rays.resize_with(RAYS, || None);
        }
        if self.ready >> number & 1 == 0 {
            self.ready |= 1 << number;
            let ray = &rays[number];
            self.rays[number] = simd.apart(Prepare { ray, frame });
        }
        self.rays[number].as_ref()
    }
}

/// Prepares a ray, not inlined into the traversal of a tile, where it is rare.
struct Prepare<'a> {
    ray: &'a Ray,
    frame: &'a Frame,
}

impl<S: TraceSimd> Task<S> for Prepare<'_> {
    type Output = Option<S::Ray>;

    #[inline(always)]
    fn run(self, simd: S) -> Option<S::Ray> {
        simd.prepare(self.ray, self.frame)
    }
}
