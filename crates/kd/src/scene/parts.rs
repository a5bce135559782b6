//! The parts of a scene: found by id, added and removed in constant time on average.

use std::ops::{Deref, DerefMut};

use super::PartId;
use super::part::Part;

/// Parts in the order of their ids.
///
/// A removed part keeps its place until the parts are [settled](Self::settle), so that a removal moves no others. Settled parts are a
/// slice.
#[derive(Debug, Default)]
pub(super) struct Parts {
    all: Vec<Part>,
    /// Those of `all` that are removed.
    removed: usize,
    triangles: usize,
}

impl Parts {
    /// The number of triangles of all parts.
    pub(super) fn triangles(&self) -> usize {
        self.triangles
    }

    /// Adds a part, whose id is above all others.
    pub(super) fn push(&mut self, part: Part) {
        self.triangles += part.mesh.len();
        self.all.push(part);
    }

    /// Removes the part at an index.
    pub(super) fn remove(&mut self, place: usize) {
        let part = &mut self.all[place];
        part.is_removed = true;
        self.triangles -= part.mesh.len();
        self.removed += 1;
        // Half of the parts pay for moving the others.
        if 2 * self.removed > self.all.len() {
            self.settle();
        }
    }

    /// Drops what was removed.
    pub(super) fn settle(&mut self) {
        if self.removed > 0 {
            self.all.retain(|part| !part.is_removed);
            self.removed = 0;
        }
    }

    /// The index of a part.
    pub(super) fn place(&self, id: PartId) -> Option<usize> {
        let place = self.all.binary_search_by_key(&id, |part| part.id).ok()?;
        (!self.all[place].is_removed).then_some(place)
    }

    /// The part at an index, settled or not.
    pub(super) fn at(&self, place: usize) -> &Part {
        &self.all[place]
    }

    /// The part at an index, settled or not.
    pub(super) fn at_mut(&mut self, place: usize) -> &mut Part {
        &mut self.all[place]
    }

    /// All parts, settled or not.
    pub(super) fn all(&self) -> impl Iterator<Item = &Part> {
        self.all.iter().filter(|part| !part.is_removed)
    }

    /// All parts, settled or not.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut Part> {
        self.all.iter_mut().filter(|part| !part.is_removed)
    }
}

/// Settled parts.
impl Deref for Parts {
    type Target = [Part];

    fn deref(&self) -> &[Part] {
        debug_assert_eq!(self.removed, 0, "settled");
        &self.all
    }
}

impl DerefMut for Parts {
    fn deref_mut(&mut self) -> &mut [Part] {
        debug_assert_eq!(self.removed, 0, "settled");
        &mut self.all
    }
}
