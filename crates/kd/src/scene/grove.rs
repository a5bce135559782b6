//! Parts that are traced together, kept from frame to frame.

use std::sync::Arc;

use kd_core::Mesh;
use kd_trace::{Refit, WideForest, WideTree};

use super::PartId;

/// The nodes of some parts, in the order in which they were built: so those that stand still come first, and what is built
/// anew for every frame does not move the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Grove {
    pub(super) forest: WideForest,
    trees: Vec<Key>,
}

/// Which nodes a part has, and where they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Key {
    pub(super) part: PartId,
    /// The commit that made its nodes.
    pub(super) built: u64,
    /// The commit that put its triangles where they are.
    pub(super) moved: u64,
    /// The number of its first triangle.
    pub(super) first_slot: u32,
}

/// A part as it is to be.
#[derive(Debug)]
pub(super) struct Wanted<'a> {
    pub(super) key: Key,
    pub(super) mesh: &'a Arc<Mesh>,
    pub(super) origin: Origin<'a>,
}

/// Where nodes come from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Origin<'a> {
    /// The frame before.
    Before,
    /// They have just been built, with triangles numbered from 0.
    New(&'a WideTree),
    /// Those of another part, which comes before it.
    Other(Key),
}

impl Key {
    /// What tells nodes apart, and the order that they are in.
    pub(super) fn nodes(&self) -> (u64, PartId) {
        (self.built, self.part)
    }
}

impl Grove {
    /// Where the nodes of a part are, wherever its triangles were then.
    pub(super) fn position(&self, wanted: &Key) -> Option<usize> {
        let found = self.trees.binary_search_by_key(&wanted.nodes(), Key::nodes);
        found.ok()
    }

    /// What a part costs, which is here.
    pub(super) fn cost(&self, key: &Key) -> Option<f64> {
        Some(self.forest.cost(self.position(key)?))
    }

    /// Makes it hold what is wanted, which is in the order of [`Key::nodes`]. Nodes that are here already stay where they
    /// are, or are moved where something before them has gone; others come from where they are told to, of these groves.
    pub(super) fn update(&mut self, wanted: &[Wanted<'_>], others: &[&[Self]], is_parallel: bool) {
        let pairs = self.trees.iter().zip(wanted);
        let same = pairs.take_while(|(key, wanted)| key.nodes() == wanted.key.nodes());
        let same = same.count();
        let own = self.split_off(same, &wanted[same..]);
        // Whose nodes there are, and where their triangles were.
        let mut states = self.trees.clone();
        for Wanted { key, origin, .. } in &wanted[same..] {
            let state = match origin {
                Origin::New(tree) => {
                    self.forest.push(tree, key.first_slot);
                    *key
                }
                Origin::Before => self.push_found(key, &own, others),
                Origin::Other(of) => match self.position(of) {
                    Some(number) => {
                        self.forest.push_again(number);
                        states[number]
                    }
                    None => self.push_found(of, &own, others),
                },
            };
            states.push(state);
            self.trees.push(*key);
        }
        let mut refits = Vec::new();
        for ((number, wanted), state) in wanted.iter().enumerate().zip(states) {
            let Wanted { key, mesh, .. } = wanted;
            self.trees[number] = *key;
            let slots = key.first_slot.wrapping_sub(state.first_slot);
            self.forest.add_to_slots(number, slots);
            if (state.part, state.moved) != (key.part, key.moved) {
                refits.push(Refit {
                    number,
                    mesh,
                    first_slot: key.first_slot,
                });
            }
        }
        self.forest.refit_all(&refits, is_parallel);
    }

    /// Takes out all parts from a number on, and gives back those of them that are wanted.
    fn split_off(&mut self, number: usize, wanted: &[Wanted<'_>]) -> Self {
        let mut kept = Self::default();
        for place in number..self.trees.len() {
            let key = self.trees[place];
            let found = wanted.binary_search_by_key(&key.nodes(), |wanted| wanted.key.nodes());
            if found.is_ok() {
                kept.forest.push_copy(&self.forest, place);
                kept.trees.push(key);
            }
        }
        self.forest.truncate(number);
        self.trees.truncate(number);
        kept
    }

    /// Adds a copy of nodes that are in one of these, and tells where its triangles are.
    fn push_found(&mut self, key: &Key, own: &Self, others: &[&[Self]]) -> Key {
        let mut groves = std::iter::once(own).chain(others.iter().copied().flatten());
        let found = groves.find_map(|grove| Some((grove, grove.position(key)?)));
        let (grove, number) = found.expect("nodes that were planned with are there");
        self.forest.push_copy(&grove.forest, number);
        grove.trees[number]
    }
}
