//! The parts of a frame, in groups that a frame shares with the one before.

use std::slice;
use std::sync::Arc;

use kd_core::Aabb;

use super::PartId;
use super::shared::PartMesh;
use super::sight::{Sight, Sights};

/// The most parts of a group. A frame copies the groups of parts that have changed, and visits all groups.
const MOST: usize = 256;

/// A part of a frame.
#[derive(Clone, Debug)]
pub(super) struct FramePart {
    pub(super) id: PartId,
    /// Its first slot.
    pub(super) first_slot: u32,
    pub(super) mesh: PartMesh,
    pub(super) sight: Sight,
}

/// A part of a frame that has a slot.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartOfSlot<'a> {
    pub(super) id: PartId,
    pub(super) first_slot: u32,
    pub(super) mesh: &'a PartMesh,
    pub(super) sight: Sight,
}

/// Parts in the order of their ids, and so of their slots.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameParts {
    groups: Vec<Group>,
    count: usize,
    /// Of all groups. Fitted with their boxes.
    sights: Sights,
}

/// Parts that follow each other. At least one.
#[derive(Clone, Debug)]
struct Group {
    /// Those of its first part, or lower ones of a part that was removed.
    first_id: PartId,
    first_slot: u32,
    /// The box around its meshes, and who sees them; `None` until [`FrameParts::fit`] after a change.
    fitted: Option<(Aabb, Sights)>,
    members: Arc<Members>,
}

#[derive(Clone, Debug, Default)]
struct Members {
    /// The first slot of each.
    first_slots: Vec<u32>,
    ids: Vec<PartId>,
    meshes: Vec<PartMesh>,
    /// The boxes of the meshes.
    boxes: Vec<Aabb>,
    sights: Vec<Sight>,
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
        let boxes = self.groups.iter().map(|group| group.fitted.as_ref());
        around(boxes.map(|fitted| &fitted.expect("fitted after changes").0))
    }

    /// Which rays see all parts. There were no changes since [`fit`](Self::fit).
    #[inline]
    pub(super) fn sights(&self) -> &Sights {
        &self.sights
    }

    /// Fits the box to the meshes, and notes which rays see all of them, after all changes.
    pub(super) fn fit(&mut self) {
        let mut sights = Sights::default();
        for group in &mut self.groups {
            let members = &group.members;
            let fit = || (around(&members.boxes), Sights::of(&members.sights));
            let (_, of_group) = group.fitted.get_or_insert_with(fit);
            sights = sights.and(of_group);
        }
        self.sights = sights;
    }

    /// The mesh of a part.
    pub(super) fn mesh(&self, id: PartId) -> Option<&PartMesh> {
        let members = &self.groups[self.group_of(id)?].members;
        let place = members.ids.binary_search(&id).ok()?;
        (members.ids[place].scene() == id.scene()).then(|| &members.meshes[place])
    }

    /// The part of a slot that has a triangle, and its first slot.
    #[inline]
    pub(super) fn of_slot(&self, slot: u32) -> PartOfSlot<'_> {
        // Of parts with the same first slot only the last has triangles.
        let after = self
            .groups
            .partition_point(|group| group.first_slot <= slot);
        let members = &self.groups[after - 1].members;
        let after = members.first_slots.partition_point(|first| *first <= slot);
        PartOfSlot {
            id: members.ids[after - 1],
            first_slot: members.first_slots[after - 1],
            mesh: &members.meshes[after - 1],
            sight: members.sights[after - 1],
        }
    }

    /// The slot of a triangle of a part. For a part that is not in the frame, the last slot before those of the next part; `None`
    /// if there is none.
    pub(super) fn slot_of(&self, id: PartId, triangle: u32) -> Option<u32> {
        let number = self.group_of(id)?;
        let members = &self.groups[number].members;
        match members.ids.binary_search(&id) {
            Ok(place) => Some(members.first_slots[place].saturating_add(triangle)),
            Err(place) => {
                let next = members.first_slots.get(place);
                let next = next.or_else(|| {
                    let next = self.groups.get(number + 1)?;
                    next.members.first_slots.first()
                });
                next.map_or(Some(u32::MAX), |first| first.checked_sub(1))
            }
        }
    }

    /// Sets who sees a part, if it is there.
    pub(super) fn set_sight(&mut self, id: PartId, sight: Sight) {
        let Some(number) = self.group_of(id) else {
            return;
        };
        let group = &mut self.groups[number];
        if let Ok(place) = group.members.ids.binary_search(&id) {
            group.change(|members| members.sights[place] = sight);
        }
    }

    /// Adds a part behind all others, or replaces it.
    pub(super) fn set(&mut self, part: FramePart) {
        let FramePart {
            id,
            first_slot,
            mesh,
            sight,
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
                members.sights[place] = sight;
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
                    fitted: None,
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
            members.sights.push(sight);
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
            members.sights.remove(place);
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
        self.fitted = None;
    }
}

fn around<'a>(boxes: impl IntoIterator<Item = &'a Aabb>) -> Aabb {
    let boxes = boxes.into_iter();
    boxes.fold(Aabb::EMPTY, |around, bounds| around.union(bounds))
}
