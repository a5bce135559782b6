//! Rays of a tile that go on one by one, where they diverge.
//!
//! (After C. Benthin, I. Wald, S. Woop, M. Ernst, W. R. Mark, *Combining Single and Packet-Ray Tracing for Arbitrary Ray
//! Distributions on the Intel MIC Architecture*, 2012.)

/// Work after which a tile checks how many rays meet a box: more than coherent rays need.
const PATIENCE: u32 = 48;

/// When the rays of a tile go on alone.
pub(super) struct Alone {
    /// The work of the tile, roughly in boxes tested against a group.
    work: u32,
    /// The initial work: above 0 after a tile that was wary.
    begin: u32,
}

impl Alone {
    pub(super) fn new() -> Self {
        Self { work: 0, begin: 0 }
    }

    /// Begins a tile.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
        self.work = self.begin;
    }

    /// Ends a tile.
    #[inline(always)]
    pub(super) fn end(&mut self) {
        self.begin = if self.work > PATIENCE {
            PATIENCE / 2
        } else {
            0
        };
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
}
