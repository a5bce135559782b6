//! The parts of a scene, with what has changed since the last commit.

use std::sync::Arc;

use kd_core::Mesh;

use super::PartId;
use super::part::{Part, PartNodes};
use super::sharing::Meshes;

/// Parts in the order of their ids, added and removed in constant time on average.
///
/// A removed part keeps its place until the parts are [settled](Self::settle), so that a removal moves no others.
#[derive(Debug, Default)]
pub(super) struct Parts {
    all: Vec<Part>,
    /// Those of `all` that are removed.
    removed: usize,
    triangles: usize,
    meshes: Meshes,
    /// Parts that have changed since the last commit; some may be removed since.
    changed: Vec<PartId>,
    /// Parts that were removed since the last commit.
    gone: Vec<Gone>,
    /// Parts whose masks have changed since the last commit; some may be removed since.
    masked: Vec<PartId>,
}

/// A part that is removed, and its nodes in the last frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gone {
    pub(super) id: PartId,
    pub(super) nodes: Option<PartNodes>,
    /// Whether it shared a tree there.
    pub(super) shared: bool,
}

impl Parts {
    /// The number of parts.
    pub(super) fn count(&self) -> usize {
        self.all.len() - self.removed
    }

    /// The number of triangles of all parts.
    pub(super) fn triangles(&self) -> usize {
        self.triangles
    }

    /// Adds a part, whose id is above all others. It has changed.
    pub(super) fn push(&mut self, part: Part) {
        self.triangles += part.mesh.len();
        self.meshes.add(&part.mesh);
        self.changed.push(part.id);
        self.all.push(part);
    }

    /// Removes the part at an index.
    pub(super) fn remove(&mut self, place: usize) {
        let part = &mut self.all[place];
        part.is_removed = true;
        self.triangles -= part.mesh.len();
        self.meshes.remove(&part.mesh);
        self.removed += 1;
        self.gone.push(Gone {
            id: part.id,
            nodes: part.nodes,
            shared: part.shared.is_some(),
        });
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

    /// The part at an index.
    pub(super) fn at(&self, place: usize) -> &Part {
        &self.all[place]
    }

    /// The part at an index, for a commit.
    pub(super) fn at_mut(&mut self, place: usize) -> &mut Part {
        &mut self.all[place]
    }

    /// The part at an index, to be changed from the next commit on.
    pub(super) fn change(&mut self, place: usize) -> &mut Part {
        let part = &mut self.all[place];
        if !part.is_changed {
            part.is_changed = true;
            self.changed.push(part.id);
        }
        part
    }

    /// Replaces the mesh of the part at an index, from the next commit on.
    pub(super) fn set_mesh(&mut self, place: usize, mesh: &Arc<Mesh>) {
        self.meshes.add(mesh);
        let before = std::mem::replace(&mut self.change(place).mesh, Arc::clone(mesh));
        self.meshes.remove(&before);
    }

    /// The meshes of all parts.
    pub(super) fn meshes(&self) -> &Meshes {
        &self.meshes
    }

    pub(super) fn meshes_mut(&mut self) -> &mut Meshes {
        &mut self.meshes
    }

    /// Sets the mask of the part at an index, from the next commit on.
    pub(super) fn set_mask(&mut self, place: usize, mask: u32) {
        let part = &mut self.all[place];
        if part.mask != mask {
            part.mask = mask;
            self.masked.push(part.id);
        }
    }

    /// Whether nothing but masks has changed since the last commit.
    pub(super) fn are_unchanged(&self) -> bool {
        self.changed.is_empty() && self.gone.is_empty()
    }

    /// The parts whose masks have changed since the last commit, each at least once. Ends these changes.
    pub(super) fn take_masked(&mut self) -> Vec<PartId> {
        std::mem::take(&mut self.masked)
    }

    /// All parts.
    pub(super) fn all(&self) -> impl Iterator<Item = &Part> {
        self.all.iter().filter(|part| !part.is_removed)
    }

    /// All parts.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut Part> {
        self.all.iter_mut().filter(|part| !part.is_removed)
    }

    /// The indices of all parts, in the order of their ids.
    pub(super) fn places(&self) -> Vec<usize> {
        let places = 0..self.all.len();
        places
            .filter(|place| !self.all[*place].is_removed)
            .collect()
    }

    /// The indices of the parts that have changed since the last commit, in the order of their ids.
    pub(super) fn changed(&self) -> Vec<usize> {
        let places = self.changed.iter().filter_map(|id| self.place(*id));
        let mut places: Vec<usize> = places.collect();
        places.sort_unstable();
        places
    }

    /// Ends the changes, at a commit of this number. Returns the parts that were removed.
    pub(super) fn take_changes(&mut self, commit: u64) -> Vec<Gone> {
        for place in self.changed() {
            let part = &mut self.all[place];
            part.moved = commit;
            part.is_changed = false;
        }
        self.changed.clear();
        std::mem::take(&mut self.gone)
    }
}
