//! What a commit makes: the parts of a scene, ready to trace.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use glam::Vec3;
use kd_core::{Aabb, Culling, Hit, Layout, LayoutBytes, Mesh, Ray, RayPacket8};
use kd_points::WindingNumbers;
use kd_trace::kit::{Any, Closest, Collect, Ordered, rest_of};
use kd_trace::{RayQuery, WideForest, WideTree, delegate_ray_query};

use super::PartId;
#[cfg(doc)]
use super::Strategy;
use super::frame_parts::FrameParts;
use super::merged::MergedTrees;
use super::shared::{PartMesh, SharedParts};
use super::sight::Sieve;
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
    /// Parts that share trees, which `shape` does not have.
    pub(super) shared: Arc<SharedParts>,
    pub(super) parts: FrameParts,
    /// Made on demand, for these parts.
    pub(super) winding: OnceLock<Arc<WindingNumbers>>,
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
    ///
    /// The mesh of an instance that [shares](Strategy#instances-that-share) is made at the first call, and kept.
    /// [`corners`](Self::corners) makes none.
    pub fn mesh(&self, part: PartId) -> Option<&Arc<Mesh>> {
        self.parts.mesh(part).map(PartMesh::mesh)
    }

    /// The corners of a triangle of a part, transformed as in this frame. `None` if the part is not in the frame, or has no such
    /// triangle.
    pub fn corners(&self, part: PartId, triangle: u32) -> Option<[Vec3; 3]> {
        let mesh = self.parts.mesh(part)?;
        ((triangle as usize) < mesh.len()).then(|| mesh.corners(triangle))
    }

    /// A box around all triangles, the smallest one if no parts [share](Strategy#instances-that-share) trees; [`Aabb::EMPTY`] without
    /// any.
    pub fn bounds(&self) -> Aabb {
        self.parts.bounds()
    }

    /// Bytes of the frame's layout. A tree that parts share counts once.
    pub fn bytes(&self) -> LayoutBytes {
        let of_trees: LayoutBytes = self.trees().map(TreeLayoutRef::bytes).sum();
        of_trees + self.shared.bytes()
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
        if let Some(tree) = self.only_tree()
            && self.parts.sights().sees_all(ray)
        {
            return tree.intersect(ray).map(|hit| self.of_part(hit));
        }
        let mut closest = Closest::default();
        self.collect(ray, &mut closest);
        closest.0.map(|hit| self.of_part(hit))
    }

    /// Whether there is any hit, as [`KdTree::occluded`](crate::KdTree::occluded).
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if let Some(tree) = self.only_tree()
            && self.parts.sights().sees_all(ray)
        {
            return tree.occluded(ray);
        }
        let mut any = Any::default();
        self.collect(ray, &mut any);
        any.0
    }

    /// The first `max` hits, ordered by `t`, then by part, then by triangle, as [`KdTree::hits`](crate::KdTree::hits). Clears `out`
    /// first.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<(PartId, Hit)>) {
        let mut found = Vec::new();
        Ordered::fill(&mut found, max, |ordered| self.collect(ray, ordered));
        out.clear();
        out.extend(found.into_iter().map(|hit| self.of_part(hit)));
    }

    /// The first `max` hits behind a place in the order of [`hits`](Self::hits), as
    /// [`KdTree::hits_behind`](crate::KdTree::hits_behind). Clears `out` first.
    pub fn hits_behind(
        &self,
        ray: &Ray,
        last: &(PartId, Hit),
        max: usize,
        out: &mut Vec<(PartId, Hit)>,
    ) {
        let (part, hit) = *last;
        let last = match self.parts.slot_of(part, hit.triangle) {
            Some(slot) => Hit {
                triangle: slot,
                ..hit
            },
            // Before the first part: before all hits at this distance.
            None => Hit {
                t: hit.t.next_down(),
                triangle: u32::MAX,
                ..hit
            },
        };
        let rest = rest_of(ray, &hit);
        let mut found = Vec::new();
        Ordered::fill_behind(&mut found, Some(last), max, |ordered| {
            self.collect(&rest, ordered);
        });
        out.clear();
        out.extend(found.into_iter().map(|hit| self.of_part(hit)));
    }

    /// [`intersect`](Self::intersect) for many rays, as [`KdTree::intersect_batch`](crate::KdTree::intersect_batch). Rays that do not
    /// see all parts, or that cull sides where a part is mirrored, are traced one by one.
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
            self.answer_together(
                rays,
                found,
                |rays, hits| self.batch(rays, hits),
                |ray| {
                    let mut closest = Closest::default();
                    self.collect(ray, &mut closest);
                    closest.0
                },
            );
            for (hit, found) in hits.iter_mut().zip(found) {
                *hit = found.take().map(|hit| self.of_part(hit));
            }
        }
    }

    /// [`occluded`](Self::occluded) for many rays, as [`KdTree::occluded_batch`](crate::KdTree::occluded_batch). Rays that do not see
    /// all parts, or that cull sides where a part is mirrored, are traced one by one.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        self.answer_together(
            rays,
            occluded,
            |rays, occluded| self.batch_occluded(rays, occluded),
            |ray| self.occluded(ray),
        );
    }

    /// [`intersect`](Self::intersect) for the ray of each lane, as [`KdTree::intersect8`](crate::KdTree::intersect8).
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<(PartId, Hit)>; 8] {
        if !self.all_lanes_see_all(packet) {
            return packet.rays().map(|ray| self.intersect(&ray));
        }
        let mut hits = [None; 8];
        for tree in self.trees() {
            for (hit, other) in hits.iter_mut().zip(tree.intersect8(packet)) {
                *hit = first_of(*hit, other);
            }
        }
        if !self.shared.is_empty() {
            for (ray, hit) in packet.rays().iter().zip(&mut hits) {
                self.add_shared(ray, hit);
            }
        }
        hits.map(|hit| hit.map(|hit| self.of_part(hit)))
    }

    /// [`occluded`](Self::occluded) for the ray of each lane, as [`KdTree::occluded8`](crate::KdTree::occluded8).
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        if !self.all_lanes_see_all(packet) {
            return packet.rays().map(|ray| self.occluded(&ray));
        }
        let mut occluded = [false; 8];
        for tree in self.trees() {
            for (occluded, by_this) in occluded.iter_mut().zip(tree.occluded8(packet)) {
                *occluded |= by_this;
            }
        }
        if !self.shared.is_empty() {
            for (ray, occluded) in packet.rays().iter().zip(&mut occluded) {
                self.add_shared_occluded(ray, occluded);
            }
        }
        occluded
    }

    /// Replaces the closest hit of a ray that sees all parts, if one in a part that shares is before it.
    fn add_shared(&self, ray: &Ray, hit: &mut Option<Hit>) {
        let mut closest = Closest(*hit);
        self.shared.collect(ray, &mut closest);
        *hit = closest.0;
    }

    /// Notes whether a ray that sees all parts hits one that shares.
    fn add_shared_occluded(&self, ray: &Ray, occluded: &mut bool) {
        if !*occluded {
            let mut any = Any::default();
            self.shared.collect(ray, &mut any);
            *occluded = any.0;
        }
    }

    /// Gives the collector every hit of the ray that it may want, with slots for triangles.
    fn collect<C: Collect>(&self, ray: &Ray, collector: &mut C) {
        if !ray.can_hit() {
            return;
        }
        if self.parts.sights().sees_all(ray) {
            return self.collect_all(ray, collector);
        }
        let all = ray.with_mask(u32::MAX).with_culling(Culling::NONE);
        self.collect_all(&all, &mut Sieve::new(&self.parts, ray, collector));
    }

    /// [`collect`](Self::collect) for a ray that sees all parts.
    fn collect_all<C: Collect>(&self, ray: &Ray, collector: &mut C) {
        for tree in self.trees() {
            tree.collect(&up_to(ray, collector.limit()), collector);
            if collector.is_done() {
                return;
            }
        }
        if !self.shared.is_empty() {
            self.shared.collect(ray, collector);
        }
    }

    fn all_lanes_see_all(&self, packet: &RayPacket8) -> bool {
        let sights = self.parts.sights();
        // A lane with mask 0 has no ray.
        let mut rays = packet.rays().into_iter().filter(|ray| ray.mask != 0);
        rays.all(|ray| sights.sees_all(&ray))
    }

    /// Answers rays that see all parts together, and each of the others alone.
    fn answer_together<A: Copy + Default>(
        &self,
        rays: &[Ray],
        answers: &mut [A],
        together: impl Fn(&[Ray], &mut [A]),
        alone: impl Fn(&Ray) -> A,
    ) {
        let sights = self.parts.sights();
        if rays.iter().all(|ray| sights.sees_all(ray)) {
            return together(rays, answers);
        }
        let (mut seeing, mut places) = (Vec::new(), Vec::new());
        for (place, (ray, answer)) in rays.iter().zip(&mut *answers).enumerate() {
            if sights.sees_all(ray) {
                seeing.push(*ray);
                places.push(place);
            } else {
                *answer = alone(ray);
            }
        }
        let mut answers_of_seeing = vec![A::default(); seeing.len()];
        together(&seeing, &mut answers_of_seeing);
        for (place, answer) in places.into_iter().zip(answers_of_seeing) {
            answers[place] = answer;
        }
    }

    /// The closest hit of each of some rays that see all parts, with slots for triangles.
    fn batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let mut trees = self.trees();
        match trees.next() {
            Some(first) => first.intersect_batch(rays, hits),
            None => hits.fill(None),
        }
        for tree in trees {
            let pairs = rays.iter().zip(&*hits);
            let shorter = pairs.map(|(ray, hit)| hit.map_or(*ray, |hit| up_to(ray, hit.t)));
            let shorter: Vec<Ray> = shorter.collect();
            let mut others = vec![None; rays.len()];
            tree.intersect_batch(&shorter, &mut others);
            for (hit, other) in hits.iter_mut().zip(others) {
                *hit = first_of(*hit, other);
            }
        }
        if !self.shared.is_empty() {
            for (ray, hit) in rays.iter().zip(hits) {
                self.add_shared(ray, hit);
            }
        }
    }

    /// Whether each of some rays that see all parts hits anything.
    fn batch_occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        let mut trees = self.trees();
        match trees.next() {
            Some(first) => first.occluded_batch(rays, occluded),
            None => occluded.fill(false),
        }
        for tree in trees {
            let mut by_this = vec![false; rays.len()];
            tree.occluded_batch(rays, &mut by_this);
            for (occluded, by_this) in occluded.iter_mut().zip(by_this) {
                *occluded |= by_this;
            }
        }
        if !self.shared.is_empty() {
            for (ray, occluded) in rays.iter().zip(occluded) {
                self.add_shared_occluded(ray, occluded);
            }
        }
    }

    /// The wide tree, if rays traverse no other, as in most frames.
    #[inline]
    fn only_tree(&self) -> Option<&WideTree> {
        match &self.shape {
            Shape::Forests(forests) if forests.len() == 1 && self.shared.is_empty() => {
                Some(forests[0].tree())
            }
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
        let part = self.parts.of_slot(hit.triangle);
        let triangle = hit.triangle - part.first_slot;
        (part.id, Hit { triangle, ..hit })
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
        self.shared.clone_from(&with.shared);
        self.parts.clone_from(&with.parts);
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = (PartId, Hit)> for FrameData: single, behind, batch, packet;
    frame => frame,
}

delegate_ray_query! {
    impl RayQuery<Hit = (PartId, Hit)> for Frame<'_>: single, behind, batch, packet;
    frame => frame.data,
}

/// A ray that can hit, up to a limit, inclusive.
#[inline]
fn up_to(ray: &Ray, limit: f32) -> Ray {
    ray.with_range(ray.t_min, ray.t_max.min(limit))
}

#[inline]
fn first_of(a: Option<Hit>, b: Option<Hit>) -> Option<Hit> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.is_before(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}
