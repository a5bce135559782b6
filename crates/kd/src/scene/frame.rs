//! What a commit makes: the parts of a scene, ready to trace.

use std::ops::Deref;
use std::sync::Arc;

use kd_core::{Aabb, Hit, Layout, LayoutBytes, Mesh, Ray, RayPacket8};
use kd_trace::{RayQuery, WideForest, WideTree, delegate_ray_query};

use super::PartId;
use super::frame_parts::FrameParts;
use super::merged::MergedTrees;
use crate::layout::{TreeLayout, TreeLayoutRef};

/// All parts of a [`Scene`](crate::Scene) as they were at its last commit. It borrows the scene, and dereferences to
/// [`FrameData`], which has the queries.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    data: &'a FrameData,
}

impl<'a> Frame<'a> {
    pub(super) fn new(data: &'a FrameData) -> Self {
        Self { data }
    }

    /// The frame's data, for as long as the scene is borrowed.
    pub fn data(self) -> &'a FrameData {
        self.data
    }
}

impl Deref for Frame<'_> {
    type Target = FrameData;

    fn deref(&self) -> &FrameData {
        self.data
    }
}

/// All parts of a [`Scene`](crate::Scene) as they were at one commit, ready to trace. Queries may run on any number of threads.
///
/// Every query returns what a test of all triangles of all parts returns, to the bit; among equal distances the lower part, then
/// the lower triangle, wins. A hit's triangle is a number in the part's own mesh.
#[derive(Clone, Debug, Default)]
pub struct FrameData {
    pub(super) shape: Shape,
    pub(super) parts: FrameParts,
}

/// What rays traverse.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// Wide nodes of parts, one forest after the other.
    Forests(Vec<WideForest>),
    /// One tree over the triangles of all parts.
    Whole(Box<TreeLayout>),
    /// One kd-tree, merged from those of the parts.
    Merged(Box<MergedTrees>),
}

impl Default for Shape {
    fn default() -> Self {
        Self::Forests(Vec::new())
    }
}

impl FrameData {
    /// The parts, in the order in which they were added to the scene.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = PartId> + '_ {
        self.parts.ids()
    }

    /// A part's mesh, transformed as in this frame: for corners and normals of hits. `None` for a part that is not in the frame, and
    /// for an id of another scene.
    pub fn mesh(&self, part: PartId) -> Option<&Arc<Mesh>> {
        self.parts.mesh(part)
    }

    /// The bounding box of all triangles; [`Aabb::EMPTY`] without any.
    pub fn bounds(&self) -> Aabb {
        self.parts.bounds()
    }

    /// Bytes of the frame's layout.
    pub fn bytes(&self) -> LayoutBytes {
        self.trees().map(TreeLayoutRef::bytes).sum()
    }

    /// Which layout rays traverse; [`kd::layout`](crate::layout) says why.
    pub fn layout(&self) -> Layout {
        match &self.shape {
            Shape::Forests(_) => Layout::Wide,
            Shape::Whole(layout) => layout.layout(),
            Shape::Merged(_) => Layout::Binary,
        }
    }

    /// The closest hit and its part, as [`KdTree::intersect`](crate::KdTree::intersect).
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<(PartId, Hit)> {
        if let Some(tree) = self.only_tree() {
            return tree.intersect(ray).map(|hit| self.of_part(hit));
        }
        let mut trees = self.trees();
        let mut closest = trees.next()?.intersect(ray);
        for tree in trees {
            closest = first_of(closest, tree.intersect(&up_to(ray, closest)));
        }
        closest.map(|hit| self.of_part(hit))
    }

    /// Whether there is any hit, as [`KdTree::occluded`](crate::KdTree::occluded).
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if let Some(tree) = self.only_tree() {
            return tree.occluded(ray);
        }
        self.trees().any(|tree| tree.occluded(ray))
    }

    /// The first `max` hits, ordered by `t`, then by part, then by triangle, as [`KdTree::hits`](crate::KdTree::hits). Clears `out`
    /// first.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<(PartId, Hit)>) {
        out.clear();
        let mut of_one = Vec::new();
        for (number, tree) in self.trees().enumerate() {
            // Hits beyond the last of `max` do not matter.
            let last = out.last().filter(|_| out.len() == max);
            tree.hits(&up_to(ray, last.map(|(_, hit)| *hit)), max, &mut of_one);
            out.extend(of_one.iter().map(|hit| self.of_part(*hit)));
            if number > 0 {
                // No two are equal: each triangle is in one tree.
                let key = |(part, hit): &(PartId, Hit)| (*part, hit.triangle);
                out.sort_unstable_by(|a, b| a.1.t.total_cmp(&b.1.t).then(key(a).cmp(&key(b))));
                out.truncate(max);
            }
        }
    }

    /// [`intersect`](Self::intersect) for many rays, as [`KdTree::intersect_batch`](crate::KdTree::intersect_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<(PartId, Hit)>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        /// Rays per call to the trees; bounds the memory for their hits.
        const CHUNK: usize = 1 << 16;
        let mut found = vec![None; rays.len().min(CHUNK)];
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            let found = &mut found[..rays.len()];
            self.batch(rays, found);
            for (hit, found) in hits.iter_mut().zip(found) {
                *hit = found.take().map(|hit| self.of_part(hit));
            }
        }
    }

    /// [`occluded`](Self::occluded) for many rays, as [`KdTree::occluded_batch`](crate::KdTree::occluded_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let mut trees = self.trees();
        let Some(first) = trees.next() else {
            occluded.fill(false);
            return;
        };
        first.occluded_batch(rays, occluded);
        for tree in trees {
            let mut by_this = vec![false; rays.len()];
            tree.occluded_batch(rays, &mut by_this);
            for (occluded, by_this) in occluded.iter_mut().zip(by_this) {
                *occluded |= by_this;
            }
        }
    }

    /// [`intersect`](Self::intersect) for the ray of each lane, as [`KdTree::intersect8`](crate::KdTree::intersect8).
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<(PartId, Hit)>; 8] {
        let mut hits = [None; 8];
        for tree in self.trees() {
            for (hit, other) in hits.iter_mut().zip(tree.intersect8(packet)) {
                *hit = first_of(*hit, other);
            }
        }
        hits.map(|hit| hit.map(|hit| self.of_part(hit)))
    }

    /// [`occluded`](Self::occluded) for the ray of each lane, as [`KdTree::occluded8`](crate::KdTree::occluded8).
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        let mut occluded = [false; 8];
        for tree in self.trees() {
            for (occluded, by_this) in occluded.iter_mut().zip(tree.occluded8(packet)) {
                *occluded |= by_this;
            }
        }
        occluded
    }

    fn batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let mut trees = self.trees();
        let Some(first) = trees.next() else {
            hits.fill(None);
            return;
        };
        first.intersect_batch(rays, hits);
        for tree in trees {
            let pairs = rays.iter().zip(&*hits);
            let shorter: Vec<Ray> = pairs.map(|(ray, hit)| up_to(ray, *hit)).collect();
            let mut others = vec![None; rays.len()];
            tree.intersect_batch(&shorter, &mut others);
            for (hit, other) in hits.iter_mut().zip(others) {
                *hit = first_of(*hit, other);
            }
        }
    }

    /// The wide tree, if rays traverse no other, as in most frames.
    #[inline]
    fn only_tree(&self) -> Option<&WideTree> {
        match &self.shape {
            Shape::Forests(forests) if forests.len() == 1 => Some(forests[0].tree()),
            _ => None,
        }
    }

    /// The trees that rays traverse, one after the other.
    #[inline]
    pub(super) fn trees(&self) -> impl Iterator<Item = TreeLayoutRef<'_>> {
        let (forests, other): (&[WideForest], _) = match &self.shape {
            Shape::Forests(forests) => (forests, None),
            Shape::Whole(layout) => (&[], Some(layout.borrowed())),
            Shape::Merged(trees) => (&[], Some(TreeLayoutRef::Binary(trees.packed().tree()))),
        };
        let forests = forests
            .iter()
            .map(|forest| TreeLayoutRef::Wide(forest.tree()));
        forests.chain(other)
    }

    /// The part of a hit, and the hit with the triangle's number in that part.
    #[inline]
    fn of_part(&self, hit: Hit) -> (PartId, Hit) {
        let (part, first_slot) = self.parts.of_slot(hit.triangle);
        let triangle = hit.triangle - first_slot;
        (part, Hit { triangle, ..hit })
    }

    /// Makes this frame equal to `with`. Copies only what has changed, if it is an earlier one of the same scene.
    pub(super) fn catch_up(&mut self, with: &Self) {
        match (&mut self.shape, &with.shape) {
            (Shape::Forests(own), Shape::Forests(others)) if own.len() == others.len() => {
                for (own, other) in own.iter_mut().zip(others) {
                    own.catch_up(other);
                }
            }
            (own, other) => own.clone_from(other),
        }
        self.parts.clone_from(&with.parts);
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = (PartId, Hit)> for FrameData: single, batch, packet;
    frame => frame,
}

delegate_ray_query! {
    impl RayQuery<Hit = (PartId, Hit)> for Frame<'_>: single, batch, packet;
    frame => frame.data,
}

/// The ray up to a hit, inclusive.
#[inline]
fn up_to(ray: &Ray, hit: Option<Hit>) -> Ray {
    hit.map_or(*ray, |hit| ray.with_range(ray.t_min, hit.t))
}

#[inline]
fn first_of(a: Option<Hit>, b: Option<Hit>) -> Option<Hit> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.is_before(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}
