//! Frames whose kd-trees are merged, by the methods of *kd-tree merging* (Eleftheriades 2010).

use std::sync::Arc;

use glam::Vec3;
use kd_core::{Aabb, Arena, Axis, Mesh, PrimSource, Slot, Tree};
use kd_merge::{
    Census, MergeError, MergeOptions, Merged, Placed, bsp_merge, insert, partition_trees,
};
use kd_trace::PackedArena;

use super::part::PartVersion;
use super::strategy::MergeMethod;

/// Trees in one arena: first those of the static parts, merged once, then the nodes of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct MergedTrees {
    arena: Arena,
    census: Census,
    packed: PackedArena,
    static_parts: Vec<PartVersion>,
    /// The merged tree of the static parts; `None` without any triangles.
    static_tree: Option<Placed>,
    static_segments: usize,
    /// The end of the scene's slots when the static trees were merged.
    static_end: u32,
}

/// A part to merge.
pub(super) struct MergedPart<'a> {
    pub(super) version: PartVersion,
    pub(super) mesh: &'a Arc<Mesh>,
    pub(super) is_static: bool,
}

impl MergedTrees {
    pub(super) fn packed(&self) -> &PackedArena {
        &self.packed
    }

    /// Whether the static parts have a tree.
    pub(super) fn has_static_tree(&self) -> bool {
        self.static_tree.is_some()
    }

    /// Whether the static trees are those of `parts`.
    pub(super) fn has_static(&self, parts: &[MergedPart<'_>], end: u32) -> bool {
        let static_parts = parts.iter().filter(|part| part.is_static);
        let is_same = static_parts
            .map(|part| &part.version)
            .eq(&self.static_parts);
        self.static_segments > 0 && is_same && self.static_end <= end
    }

    /// Replaces everything by the trees of the static parts, in the order of `parts`, merged.
    pub(super) fn set_static(
        &mut self,
        parts: &[MergedPart<'_>],
        trees: &[Tree],
        end: u32,
        options: &MergeOptions,
    ) -> Result<(), MergeError> {
        *self = Self::default();
        let source = Slots::new(parts, end);
        let static_parts = parts.iter().filter(|part| part.is_static);
        let placed = self.append(static_parts.clone().zip(trees), end)?;
        self.static_parts = static_parts.map(|part| part.version).collect();
        self.static_tree = match placed.as_slice() {
            [] => None,
            [one] => Some(*one),
            several => {
                let merged =
                    partition_trees(&mut self.arena, &self.census, several, &source, options)?;
                Some(self.freeze(merged, around(several), end)?)
            }
        };
        self.packed
            .extend(&self.arena, |slot| source.corners(slot.0));
        self.static_segments = self.arena.segments();
        self.static_end = end;
        Ok(())
    }

    /// Merges the trees of the other parts, in the order of `parts`, into the static tree.
    ///
    /// [`MergeMethod::Insertion`] uses no `trees` if there is a [static tree](Self::has_static_tree).
    pub(super) fn merge<'t>(
        &mut self,
        method: MergeMethod,
        parts: &[MergedPart<'_>],
        trees: impl Iterator<Item = &'t Tree>,
        end: u32,
        options: &MergeOptions,
    ) -> Result<Option<Merged>, MergeError> {
        self.arena.truncate(self.static_segments);
        self.census.truncate(self.arena.nodes().len());
        self.packed.truncate(self.static_segments);
        let source = Slots::new(parts, end);
        let moving = parts.iter().filter(|part| !part.is_static);
        let mut merged = None;
        let whole = match (method, self.static_tree) {
            (MergeMethod::Insertion, Some(static_tree)) => {
                let slots = moving.clone().flat_map(MergedPart::slots);
                let slots: Vec<Slot> = slots.collect();
                let bounds = moving.fold(static_tree.bounds, |all, part| {
                    all.union(&part.mesh.bounds())
                });
                let tree = insert(
                    &mut self.arena,
                    static_tree.root,
                    &slots,
                    &source,
                    bounds,
                    options,
                )?;
                merged = Some(tree);
                Some(self.freeze(tree, bounds, end)?)
            }
            (method, static_tree) => {
                let mut placed: Vec<Placed> = static_tree.into_iter().collect();
                placed.extend(self.append(moving.zip(trees), end)?);
                self.join(method, &placed, &source, &mut merged, end, options)?
            }
        };
        self.packed
            .extend(&self.arena, |slot| source.corners(slot.0));
        if let Some(whole) = whole {
            self.packed.set_root(whole.root, whole.bounds);
        }
        Ok(merged)
    }

    /// Merges `placed` into one tree; `None` without any.
    fn join(
        &mut self,
        method: MergeMethod,
        placed: &[Placed],
        source: &Slots<'_>,
        merged: &mut Option<Merged>,
        end: u32,
        options: &MergeOptions,
    ) -> Result<Option<Placed>, MergeError> {
        let Some((first, others)) = placed.split_first() else {
            return Ok(None);
        };
        if others.is_empty() {
            return Ok(Some(*first));
        }
        if method != MergeMethod::BspMerge {
            let tree = partition_trees(&mut self.arena, &self.census, placed, source, options)?;
            *merged = Some(tree);
            return self.freeze(tree, around(placed), end).map(Some);
        }
        let mut whole = *first;
        for other in others {
            let bounds = whole.bounds.union(&other.bounds);
            let trees = [whole.root, other.root];
            let tree = bsp_merge(&mut self.arena, trees, source, bounds, options)?;
            *merged = Some(tree);
            whole = self.freeze(tree, bounds, end)?;
        }
        Ok(Some(whole))
    }

    /// Appends a tree for each part that has triangles.
    fn append<'a, 't>(
        &mut self,
        pairs: impl Iterator<Item = (&'a MergedPart<'a>, &'t Tree)>,
        end: u32,
    ) -> Result<Vec<Placed>, MergeError> {
        let mut placed = Vec::new();
        for (part, tree) in pairs {
            if !part.mesh.is_empty() {
                let root = self.arena.append_tree(tree, part.version.first_slot)?;
                let bounds = part.mesh.bounds();
                placed.push(Placed { root, bounds });
            }
        }
        self.arena.freeze(end)?;
        self.census.extend(self.arena.nodes());
        Ok(placed)
    }

    fn freeze(&mut self, merged: Merged, bounds: Aabb, end: u32) -> Result<Placed, MergeError> {
        self.arena.freeze(end)?;
        self.census.extend(self.arena.nodes());
        Ok(Placed {
            root: merged.root,
            bounds,
        })
    }
}

impl MergedPart<'_> {
    fn slots(&self) -> impl Iterator<Item = Slot> {
        let first = self.version.first_slot;
        let end = first + u32::try_from(self.mesh.len()).expect("30 bits count triangles");
        (first..end).map(Slot)
    }
}

fn around(placed: &[Placed]) -> Aabb {
    let boxes = placed.iter().map(|tree| tree.bounds);
    boxes.fold(Aabb::EMPTY, |all, one| all.union(&one))
}

/// The triangles of all parts by slot.
struct Slots<'a> {
    /// The first slot and the mesh of each part with triangles, in the order of slots.
    parts: Vec<(u32, &'a Mesh)>,
    end: u32,
}

impl<'a> Slots<'a> {
    fn new(parts: &'a [MergedPart<'a>], end: u32) -> Self {
        let mut parts: Vec<(u32, &Mesh)> = parts
            .iter()
            .filter(|part| !part.mesh.is_empty())
            .map(|part| (part.version.first_slot, &**part.mesh))
            .collect();
        parts.sort_by_key(|part| part.0);
        Self { parts, end }
    }

    fn corners(&self, slot: u32) -> [Vec3; 3] {
        let after = self.parts.partition_point(|(first, _)| *first <= slot);
        let (first, mesh) = self.parts[after - 1];
        mesh.corners(slot - first)
    }
}

impl PrimSource for Slots<'_> {
    type Shape = [Vec3; 3];

    fn count(&self) -> u32 {
        self.end
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        Aabb::around(self.corners(primitive))
    }

    fn shape(&self, primitive: u32) -> [Vec3; 3] {
        self.corners(primitive)
    }

    fn clipped_bounds(&self, corners: &[Vec3; 3], cell: &Aabb) -> Option<Aabb> {
        kd_core::clipped_bounds(*corners, cell)
    }

    fn clipped_halves(
        &self,
        corners: &[Vec3; 3],
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        kd_core::clipped_halves(*corners, cell, axis, position)
    }
}
