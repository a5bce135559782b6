//! The parts of a frame, in groups that a frame shares with the one before.

use std::slice;
use std::sync::Arc;

use kd_core::{Aabb, Mesh};

use super::PartId;

/// The most parts of a group. A frame copies the groups of parts that have changed, and visits all groups.
const MOST: usize = 256;

/// A part of a frame.
#[derive(Clone, Debug)]
pub(super) struct FramePart {
    pub(super) id: PartId,
    /// Its first slot.
    pub(super) first_slot: u32,
    pub(super) mesh: Arc<Mesh>,
}

/// Parts in the order of their ids, and so of their slots.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameParts {
    groups: Vec<Group>,
    count: usize,
}

/// Parts that follow each other. At least one.
#[derive(Clone, Debug)]
struct Group {
    /// Those of its first part, or lower ones of a part that was removed.
    first_id: PartId,
    first_slot: u32,
    /// The box around its meshes; `None` until [`FrameParts::fit`] after a change.
    bounds: Option<Aabb>,
    members: Arc<Members>,
}

#[derive(Clone, Debug, Default)]
struct Members {
    /// The first slot of each.
    first_slots: Vec<u32>,
    ids: Vec<PartId>,
    meshes: Vec<Arc<Mesh>>,
    /// The boxes of the meshes.
    boxes: Vec<Aabb>,
}

impl FrameParts {
    pub(super) fn ids(&self) -> Ids<'_> {
        Ids {
            groups: self.groups.iter(),
            of_group: [].iter(),
            left: self.count,
        }
    }

    /// The box around all meshes. There were no changes since [`fit`](Self::fit).
    pub(super) fn bounds(&self) -> Aabb {
        let boxes = self.groups.iter().map(|group| group.bounds.as_ref());
        around(boxes.map(|bounds| bounds.expect("fitted after changes")))
    }

    /// Fits the box to the meshes, after all changes.
    pub(super) fn fit(&mut self) {
        let groups = self.groups.iter_mut();
        for group in groups.filter(|group| group.bounds.is_none()) {
            group.bounds = Some(around(&group.members.boxes));
        }
    }

    /// The mesh of a part.
    pub(super) fn mesh(&self, id: PartId) -> Option<&Arc<Mesh>> {
        let members = &self.groups[self.group_of(id)?].members;
        let place = members.ids.binary_search(&id).ok()?;
        (members.ids[place].scene() == id.scene()).then(|| &members.meshes[place])
    }

    /// The part of a slot that has a triangle, and its first slot.
    #[inline]
    pub(super) fn of_slot(&self, slot: u32) -> (PartId, u32) {
        // Of parts with the same first slot only the last has triangles.
        let after = self
            .groups
            .partition_point(|group| group.first_slot <= slot);
        let members = &self.groups[after - 1].members;
        let after = members.first_slots.partition_point(|first| *first <= slot);
        (members.ids[after - 1], members.first_slots[after - 1])
    }

    /// Adds a part behind all others, or replaces it.
    pub(super) fn set(&mut self, part: FramePart) {
        let FramePart {
            id,
            first_slot,
            mesh,
        } = part;
        let bounds = mesh.bounds();
        let number = self.group_of(id);
        let found = number.and_then(|number| {
            let place = self.groups[number].members.ids.binary_search(&id).ok()?;
            Some((number, place))
        });
        if let Some((number, place)) = found {
            self.groups[number].change(|members| {
                members.first_slots[place] = first_slot;
                members.meshes[place] = mesh;
                members.boxes[place] = bounds;
            });
            return;
        }
        self.count += 1;
        let last = self.groups.last_mut();
        let has_room = |group: &&mut Group| group.members.ids.len() < MOST;
        let group = match last.filter(has_room) {
            Some(group) => group,
            None => {
                self.groups.push(Group {
                    first_id: id,
                    first_slot,
                    bounds: None,
                    members: Arc::default(),
                });
                self.groups.last_mut().expect("just added")
            }
        };
        group.change(|members| {
            members.first_slots.push(first_slot);
            members.ids.push(id);
            members.meshes.push(mesh);
            members.boxes.push(bounds);
        });
    }

    /// Removes a part, if it is there.
    pub(super) fn remove(&mut self, id: PartId) {
        let Some(number) = self.group_of(id) else {
            return;
        };
        let group = &mut self.groups[number];
        let Ok(place) = group.members.ids.binary_search(&id) else {
            return;
        };
        self.count -= 1;
        if group.members.ids.len() == 1 {
            self.groups.remove(number);
            return;
        }
        group.change(|members| {
            members.first_slots.remove(place);
            members.ids.remove(place);
            members.meshes.remove(place);
            members.boxes.remove(place);
        });
    }

    /// The group that has a part, if one does.
    fn group_of(&self, id: PartId) -> Option<usize> {
        let after = self.groups.partition_point(|group| group.first_id <= id);
        after.checked_sub(1)
    }
}

/// The ids of all parts.
pub(super) struct Ids<'a> {
    groups: slice::Iter<'a, Group>,
    of_group: slice::Iter<'a, PartId>,
    left: usize,
}

impl Iterator for Ids<'_> {
    type Item = PartId;

    fn next(&mut self) -> Option<PartId> {
        loop {
            if let Some(id) = self.of_group.next() {
                self.left -= 1;
                return Some(*id);
            }
            self.of_group = self.groups.next()?.members.ids.iter();
        }
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }
}

impl ExactSizeIterator for Ids<'_> {}

impl FromIterator<FramePart> for FrameParts {
    /// From parts in the order of their ids.
    fn from_iter<I: IntoIterator<Item = FramePart>>(parts: I) -> Self {
        let mut all = Self::default();
        for part in parts {
            all.set(part);
        }
        all.fit();
        all
    }
}

impl Group {
    /// Changes the parts, in memory that no other frame shares.
    fn change(&mut self, change: impl FnOnce(&mut Members)) {
        change(Arc::make_mut(&mut self.members));
        self.bounds = None;
    }
}

fn around<'a>(boxes: impl IntoIterator<Item = &'a Aabb>) -> Aabb {
    let boxes = boxes.into_iter();
    boxes.fold(Aabb::EMPTY, |around, bounds| around.union(bounds))
}
