//! What a commit makes, and rays are traced through.

use std::ops::Deref;
use std::sync::Arc;

use kd_core::{Aabb, Hit, Mesh, Ray, RayPacket8, TracedBytes};

use kd_trace::{RayQuery as _, WideTree};

use super::PartId;
use super::grove::Grove;
use super::merged::MergedTrees;
use crate::traced::{Traced, TracedRef};

/// All parts of a [`Scene`](crate::Scene) as they were at its last commit. It borrows the scene, and gives all queries of
/// [`FrameData`].
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    data: &'a FrameData,
}

impl<'a> Frame<'a> {
    pub(super) fn new(data: &'a FrameData) -> Self {
        Self { data }
    }

    /// The parts, for as long as the scene is borrowed.
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
/// Every query gives what testing all triangles of all parts would give, to the bit: equal distances are settled by the lower
/// part, then by the lower triangle. A hit's triangle is that of the part's own mesh.
#[derive(Clone, Debug)]
pub struct FrameData {
    pub(super) shape: Shape,
    /// In the order of their ids, and so of the numbers of their triangles.
    pub(super) parts: Vec<FramePart>,
    pub(super) bounds: Aabb,
}

/// What rays go through.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// One after the other.
    Groves(Vec<Grove>),
    Whole(Box<Traced>),
    Merged(Box<MergedTrees>),
}

/// A part where it was.
#[derive(Clone, Debug)]
pub(super) struct FramePart {
    pub(super) id: PartId,
    /// The number of its first triangle.
    pub(super) first: u32,
    pub(super) mesh: Arc<Mesh>,
}

impl Default for Shape {
    fn default() -> Self {
        Self::Groves(Vec::new())
    }
}

/// A frame of no parts.
impl Default for FrameData {
    fn default() -> Self {
        Self {
            shape: Shape::default(),
            parts: Vec::new(),
            bounds: Aabb::EMPTY,
        }
    }
}

impl FrameData {
    /// The parts, in the order in which they were added to the scene.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = PartId> + '_ {
        self.parts.iter().map(|part| part.id)
    }

    /// A part's mesh where it is in this frame: to look up corners and normals of hits. `None` if it is not in the frame.
    pub fn mesh(&self, part: PartId) -> Option<&Arc<Mesh>> {
        let place = self
            .parts
            .binary_search_by_key(&part, |part| part.id)
            .ok()?;
        Some(&self.parts[place].mesh)
    }

    /// The box around all triangles; [`Aabb::EMPTY`] without any.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bytes that rays may read.
    pub fn bytes(&self) -> TracedBytes {
        let nothing = TracedBytes {
            nodes: 0,
            blocks: 0,
        };
        self.trees().fold(nothing, |sum, tree| {
            let bytes = tree.bytes();
            TracedBytes {
                nodes: sum.nodes + bytes.nodes,
                blocks: sum.blocks + bytes.blocks,
            }
        })
    }

    /// The closest hit and the part that it is of, as [`KdTree::intersect`](crate::KdTree::intersect).
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

    /// The first `max` hits in `out`, which is cleared before, as [`KdTree::hits`](crate::KdTree::hits): ordered by `t`, then
    /// by part, then by triangle.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<(PartId, Hit)>) {
        out.clear();
        let mut of_one = Vec::new();
        for tree in self.trees() {
            tree.hits(ray, max, &mut of_one);
            out.extend(of_one.iter().map(|hit| self.of_part(*hit)));
        }
        if self.trees().count() > 1 {
            let key = |(part, hit): &(PartId, Hit)| (*part, hit.triangle);
            out.sort_by(|a, b| a.1.t.total_cmp(&b.1.t).then(key(a).cmp(&key(b))));
            out.truncate(max);
        }
    }

    /// [`intersect`](Self::intersect) for many rays, as [`KdTree::intersect_batch`](crate::KdTree::intersect_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<(PartId, Hit)>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        /// So many hits are kept beside those that are asked for.
        const CHUNK: usize = 4096;
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

    /// The wide tree that rays go through, if it is the only one, as in most frames.
    #[inline]
    fn only_tree(&self) -> Option<&WideTree> {
        match &self.shape {
            Shape::Groves(groves) if groves.len() == 1 => Some(groves[0].forest.tree()),
            _ => None,
        }
    }

    /// What rays go through, one after the other.
    #[inline]
    fn trees(&self) -> impl Iterator<Item = TracedRef<'_>> {
        let (groves, other): (&[Grove], _) = match &self.shape {
            Shape::Groves(groves) => (groves, None),
            Shape::Whole(traced) => (&[], Some(traced.borrowed())),
            Shape::Merged(trees) => (&[], Some(TracedRef::Binary(trees.packed().tree()))),
        };
        let groves = groves
            .iter()
            .map(|grove| TracedRef::Wide(grove.forest.tree()));
        groves.chain(other)
    }

    /// Which part a hit is of, and the hit with that part's own triangle.
    #[inline]
    fn of_part(&self, hit: Hit) -> (PartId, Hit) {
        // Of parts with the same number only the last has triangles.
        let after = self
            .parts
            .partition_point(|part| part.first <= hit.triangle);
        let part = &self.parts[after - 1];
        let triangle = hit.triangle - part.first;
        (part.id, Hit { triangle, ..hit })
    }
}

/// A ray as far as a hit, which may be met again.
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
