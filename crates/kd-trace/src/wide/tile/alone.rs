//! Rays of a tile that go on one by one, where they diverge.
//!
//! (After C. Benthin, I. Wald, S. Woop, M. Ernst, W. R. Mark, *Combining Single and Packet-Ray Tracing for Arbitrary Ray
//! Distributions on the Intel MIC Architecture*, 2012.)

/// Work after which a tile checks how many rays meet a box: more than coherent rays need.
const PATIENCE: u32 = 48;

/// The work of a ray that goes on alone.
const WALK: u32 = 2;

/// When the rays of a tile go on alone, and what they take.
pub(super) struct Alone {
    /// The work of the tile, roughly in boxes tested against a group.
    work: u32,
    /// The initial work: above 0 after a tile that was wary.
    begin: u32,
    /// The number of times a ray of the tile went on alone.
    walks: u32,
    /// The effort of the last tile, in the same unit.
    effort: u32,
}

impl Alone {
    pub(super) fn new() -> Self {
        Self {
            work: 0,
            begin: 0,
            walks: 0,
            effort: 0,
        }
    }

    /// Begins a tile.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
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

    /// A ray goes on alone.
    #[inline(always)]
    pub(super) fn walk(&mut self) {
        self.walks += 1;
    }
}
