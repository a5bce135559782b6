//! The wide nodes of parts that rays traverse together, kept from frame to frame.

use std::sync::Arc;

use kd_core::Mesh;
use kd_trace::{Refit, WideForest, WideTree};

use super::PartId;

/// The wide nodes of some parts, in the order in which they were built: static parts come first, so that parts that are rebuilt
/// for every frame do not move their nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct PartGroup {
    pub(super) forest: WideForest,
    versions: Vec<PartVersion>,
}

/// Which nodes a part has, and where its triangles are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PartVersion {
    pub(super) part: PartId,
    /// The commit that built its nodes.
    pub(super) built: u64,
    /// The commit that moved its triangles to where they are.
    pub(super) moved: u64,
    /// The slot of its first triangle.
    pub(super) first_slot: u32,
}

/// A part as the next frame has it.
#[derive(Debug)]
pub(super) struct Wanted<'a> {
    pub(super) version: PartVersion,
    pub(super) mesh: &'a Arc<Mesh>,
    pub(super) origin: Origin<'a>,
}

/// Where the nodes of a part come from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Origin<'a> {
    /// The frame before.
    Before,
    /// A tree that was just built, with slots from 0.
    New(&'a WideTree),
    /// The nodes of another part, which precedes this one.
    Other(PartVersion),
}

impl PartVersion {
    /// Identifies nodes, and orders them.
    pub(super) fn nodes_id(&self) -> (u64, PartId) {
        (self.built, self.part)
    }
}

impl PartGroup {
    /// The number of a part's nodes in this group; its triangles may have been elsewhere.
    pub(super) fn position(&self, wanted: &PartVersion) -> Option<usize> {
        let found = self
            .versions
            .binary_search_by_key(&wanted.nodes_id(), PartVersion::nodes_id);
        found.ok()
    }

    /// The SAH cost of a part in this group.
    pub(super) fn cost(&self, version: &PartVersion) -> Option<f64> {
        Some(self.forest.cost(self.position(version)?))
    }

    /// Makes the group hold `wanted`, which is in the order of [`PartVersion::nodes_id`]. Nodes of this group stay in place, or are
    /// moved where nodes before them have gone; others are copied from their [`Origin`], found in `others`.
    pub(super) fn update(&mut self, wanted: &[Wanted<'_>], others: &[&[Self]], is_parallel: bool) {
        let pairs = self.versions.iter().zip(wanted);
        let same =
            pairs.take_while(|(version, wanted)| version.nodes_id() == wanted.version.nodes_id());
        let same = same.count();
        let own = self.split_off(same, &wanted[same..]);
        // The parts whose nodes the group holds, and where their triangles were.
        let mut states = self.versions.clone();
        for Wanted {
            version, origin, ..
        } in &wanted[same..]
        {
            let state = match origin {
                Origin::New(tree) => {
                    self.forest.push(tree, version.first_slot);
                    *version
                }
                Origin::Before => self.push_found(version, &own, others),
                Origin::Other(of) => match self.position(of) {
                    Some(number) => {
                        self.forest.push_again(number);
                        states[number]
                    }
                    None => self.push_found(of, &own, others),
                },
            };
            states.push(state);
            self.versions.push(*version);
        }
        let mut refits = Vec::new();
        for ((number, wanted), state) in wanted.iter().enumerate().zip(states) {
            let Wanted { version, mesh, .. } = wanted;
            self.versions[number] = *version;
            let slots = version.first_slot.wrapping_sub(state.first_slot);
            self.forest.add_to_slots(number, slots);
            if (state.part, state.moved) != (version.part, version.moved) {
                refits.push(Refit {
                    number,
                    mesh,
                    first_slot: version.first_slot,
                });
            }
        }
        self.forest.refit_all(&refits, is_parallel);
    }

    /// Removes all parts from `number` on, and returns those of them that are wanted.
    fn split_off(&mut self, number: usize, wanted: &[Wanted<'_>]) -> Self {
        let mut kept = Self::default();
        for place in number..self.versions.len() {
            let version = self.versions[place];
            let found = wanted
                .binary_search_by_key(&version.nodes_id(), |wanted| wanted.version.nodes_id());
            if found.is_ok() {
                kept.forest.push_copy(&self.forest, place);
                kept.versions.push(version);
            }
        }
        self.forest.truncate(number);
        self.versions.truncate(number);
        kept
    }

    /// Appends a copy of a part's nodes, found in `own` or `others`; returns the version that was copied.
    fn push_found(&mut self, version: &PartVersion, own: &Self, others: &[&[Self]]) -> PartVersion {
        let mut groups = std::iter::once(own).chain(others.iter().copied().flatten());
        let found = groups.find_map(|group| Some((group, group.position(version)?)));
        let (group, number) = found.expect("nodes that were planned with are there");
        self.forest.push_copy(&group.forest, number);
        group.versions[number]
    }
}
