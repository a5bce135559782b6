//! Lists of hits as they are collected: those of some rays, one ray after the other.

use kd::HitLists;

/// All hits, and where those of each ray end.
#[derive(Debug)]
pub(crate) struct Lists<H> {
    pub(crate) ends: Vec<usize>,
    pub(crate) hits: Vec<H>,
}

impl<H: Copy> Lists<H> {
    pub(crate) fn with_room_for(rays: usize) -> Self {
        Self {
            ends: Vec::with_capacity(rays),
            hits: Vec::new(),
        }
    }

    /// Adds the hits of the next ray.
    pub(crate) fn push(&mut self, hits: &[H]) {
        self.hits.extend_from_slice(hits);
        self.ends.push(self.hits.len());
    }

    /// Lists one after the other.
    pub(crate) fn joined(all: Vec<Self>) -> Self {
        let mut joined = Self::with_room_for(all.iter().map(|lists| lists.ends.len()).sum());
        joined
            .hits
            .reserve(all.iter().map(|lists| lists.hits.len()).sum());
        for lists in all {
            let before = joined.hits.len();
            joined.hits.extend_from_slice(&lists.hits);
            joined
                .ends
                .extend(lists.ends.iter().map(|end| before + end));
        }
        joined
    }
}

impl<H> From<HitLists<H>> for Lists<H> {
    fn from(lists: HitLists<H>) -> Self {
        let (mut ends, hits) = lists.into_parts();
        ends.remove(0);
        Self { ends, hits }
    }
}
