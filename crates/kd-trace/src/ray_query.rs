//! The questions that rays ask of a structure, as one trait.

use kd_core::{Hit, Ray, RayPacket8};

use crate::each_hit::EachHit;
use crate::filtered::{self, Verdict};
use crate::hit_lists::HitLists;
use crate::ray_hit::RayHit;
use crate::{PackedTree, parallel};

/// The questions that rays ask of anything that holds triangles.
///
/// All implementations answer alike: each answer equals that of a test of every triangle
/// ([`brute_force`](crate::brute_force)), to the bit. A function that is generic over this trait serves one tree, a lazy tree,
/// a grid, or a frame of many parts:
///
/// ```
/// use kd_core::{Ray, RayPacket8};
/// use kd_trace::RayQuery;
///
/// /// How many of the rays hit something.
/// fn count_occluded(scene: &impl RayQuery, rays: &[Ray]) -> usize {
///     let mut occluded = vec![false; rays.len()];
///     scene.occluded_batch(rays, &mut occluded);
///     occluded.into_iter().filter(|&is_occluded| is_occluded).count()
/// }
/// ```
///
/// The trait is object-safe: `&dyn RayQuery<Hit = Hit>` mixes structures in one list.
///
/// Only [`intersect`](Self::intersect), [`occluded`](Self::occluded) and [`hits`](Self::hits) are required. Batches and packets
/// have default bodies that ask one ray at a time; a structure overrides them where rays can share work. All other queries are
/// made of these.
///
/// # Filters
///
/// A filter is a closure that gets hits in order, and says for each whether it [counts](Verdict). It is called for the hits in
/// the ray's range, ordered by `t`, then by part, then by triangle, once for each triangle, until it accepts enough of them or
/// stops: answers and calls are those of a test of every triangle. It may use the structure itself. A filter that panics leaves
/// the structure as it was.
///
/// # Batches on all threads
///
/// Methods that begin with `par_` divide a batch among the threads of the rayon pool in scope (the global one, if none is), if the
/// feature `parallel` is on. Answers are the same.
pub trait RayQuery {
    /// Where a ray meets the structure: [`Hit`] over one mesh, the part and the hit over several.
    type Hit: RayHit;

    /// The closest hit; the lower part, then the lower triangle, among equal `t`. `None` on a miss.
    ///
    /// A ray that [cannot hit](Ray::can_hit) anything is a miss.
    fn intersect(&self, ray: &Ray) -> Option<Self::Hit>;

    /// Whether there is any hit: equal to `intersect(ray).is_some()`, and faster.
    fn occluded(&self, ray: &Ray) -> bool;

    /// The first `max` hits, ordered by `t`, each triangle once. Clears `out` first.
    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Self::Hit>);

    /// The first `max` hits behind a hit of the ray, in the order of [`hits`](Self::hits). Clears `out` first.
    ///
    /// `last` need not be a hit of the ray: it stands for its place in the order. Behind a NaN there is nothing.
    fn hits_behind(&self, ray: &Ray, last: &Self::Hit, max: usize, out: &mut Vec<Self::Hit>) {
        let rest = rest_of(ray, last);
        let mut count = max;
        loop {
            self.hits(&rest, count, out);
            let are_all = out.len() < count;
            out.retain(|hit| last.is_before(hit));
            if are_all || out.len() >= max {
                out.truncate(max);
                return;
            }
            // Some are at the place of the last one or before it.
            count = count.saturating_mul(2);
        }
    }

    /// The number of hits: of triangles that the ray meets in its range.
    fn count_hits(&self, ray: &Ray) -> usize {
        let mut hits = Vec::new();
        self.hits(ray, usize::MAX, &mut hits);
        hits.len()
    }

    /// [`intersect`](Self::intersect) for each ray, in order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Self::Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }

    /// [`occluded`](Self::occluded) for each ray, in order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// [`intersect`](Self::intersect) for the ray of each lane; `None` in a lane without a ray.
    fn intersect8(&self, packet: &RayPacket8) -> [Option<Self::Hit>; 8] {
        packet.rays().map(|ray| self.intersect(&ray))
    }

    /// [`occluded`](Self::occluded) for the ray of each lane; `false` in a lane without a ray.
    fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        packet.rays().map(|ray| self.occluded(&ray))
    }

    /// The hits of the ray one after another, in order, found as they are asked for.
    ///
    /// ```
    /// # use kd_core::{Mesh, Ray};
    /// use kd_trace::{RayQuery, WideTree};
    ///
    /// # let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
    /// # let tree = WideTree::from_objects(&Mesh::new(corners, vec![[0, 1, 2]; 5])?);
    /// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
    /// let odd = tree.each_hit(&ray).find(|hit| hit.triangle % 2 == 1);
    /// assert_eq!(odd.expect("the second of five").triangle, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn each_hit(&self, ray: &Ray) -> EachHit<'_, Self>
    where
        Self: Sized,
    {
        EachHit::new(self, ray, 1)
    }

    /// The closest hit that a [filter](RayQuery#filters) accepts. Costs as much as [`intersect`](Self::intersect) if that is the
    /// first one.
    fn intersect_filtered(
        &self,
        ray: &Ray,
        filter: impl FnMut(&Self::Hit) -> Verdict,
    ) -> Option<Self::Hit>
    where
        Self: Sized,
    {
        filtered::first_from(self, ray, self.intersect(ray)?, filter)
    }

    /// Whether a [filter](RayQuery#filters) accepts any hit: equal to `intersect_filtered(ray, filter).is_some()`, with the same
    /// calls.
    fn occluded_filtered(&self, ray: &Ray, filter: impl FnMut(&Self::Hit) -> Verdict) -> bool
    where
        Self: Sized,
    {
        self.intersect_filtered(ray, filter).is_some()
    }

    /// The first `max` hits that a [filter](RayQuery#filters) accepts, in order. Clears `out` first.
    fn hits_filtered(
        &self,
        ray: &Ray,
        max: usize,
        out: &mut Vec<Self::Hit>,
        filter: impl FnMut(&Self::Hit) -> Verdict,
    ) where
        Self: Sized,
    {
        filtered::collect(self, ray, max, out, filter);
    }

    /// [`intersect_filtered`](Self::intersect_filtered) for each ray, in order; the filter gets the number of the ray, too.
    /// Closest hits are found as in [`intersect_batch`](Self::intersect_batch); rays whose first hit is rejected go on alone.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn intersect_filtered_batch(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Self::Hit>],
        filter: impl FnMut(usize, &Self::Hit) -> Verdict,
    ) where
        Self: Sized,
    {
        self.intersect_batch(rays, hits);
        filtered::first_of_each(self, rays, 0, hits, filter);
    }

    /// [`occluded_filtered`](Self::occluded_filtered) for each ray, in order; the filter gets the number of the ray, too.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn occluded_filtered_batch(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        filter: impl FnMut(usize, &Self::Hit) -> Verdict,
    ) where
        Self: Sized,
    {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        filtered::any_of_each(self, rays, 0, occluded, filter);
    }

    /// [`hits_filtered`](Self::hits_filtered) for each ray, in order; the filter gets the number of the ray, too.
    fn hits_filtered_batch(
        &self,
        rays: &[Ray],
        max: usize,
        filter: impl FnMut(usize, &Self::Hit) -> Verdict,
    ) -> HitLists<Self::Hit>
    where
        Self: Sized,
    {
        filtered::lists(self, rays, 0, max, filter)
    }

    /// [`hits`](Self::hits) for each ray, in order. Takes memory for at most `max` hits a ray.
    fn hits_batch(&self, rays: &[Ray], max: usize) -> HitLists<Self::Hit>
    where
        Self: Sized,
    {
        HitLists::of_each(self, rays, max)
    }

    /// [`count_hits`](Self::count_hits) for each ray, in order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn count_hits_batch(&self, rays: &[Ray], counts: &mut [usize])
    where
        Self: Sized,
    {
        assert_eq!(rays.len(), counts.len(), "one count per ray");
        let mut hits = Vec::new();
        for (ray, count) in rays.iter().zip(counts) {
            self.hits(ray, usize::MAX, &mut hits);
            *count = hits.len();
        }
    }

    /// [`intersect_batch`](Self::intersect_batch) on [all threads](RayQuery#batches-on-all-threads).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn par_intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Self::Hit>])
    where
        Self: Sized + Sync,
    {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        parallel::answer(rays, hits, |_, rays, hits| self.intersect_batch(rays, hits));
    }

    /// [`occluded_batch`](Self::occluded_batch) on [all threads](RayQuery#batches-on-all-threads).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn par_occluded_batch(&self, rays: &[Ray], occluded: &mut [bool])
    where
        Self: Sized + Sync,
    {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        parallel::answer(rays, occluded, |_, rays, occluded| {
            self.occluded_batch(rays, occluded);
        });
    }

    /// [`hits_batch`](Self::hits_batch) on [all threads](RayQuery#batches-on-all-threads).
    fn par_hits_batch(&self, rays: &[Ray], max: usize) -> HitLists<Self::Hit>
    where
        Self: Sized + Sync,
    {
        HitLists::joined(parallel::map(rays, |_, rays| self.hits_batch(rays, max)))
    }

    /// [`count_hits_batch`](Self::count_hits_batch) on [all threads](RayQuery#batches-on-all-threads).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn par_count_hits_batch(&self, rays: &[Ray], counts: &mut [usize])
    where
        Self: Sized + Sync,
    {
        assert_eq!(rays.len(), counts.len(), "one count per ray");
        parallel::answer(rays, counts, |_, rays, counts| {
            self.count_hits_batch(rays, counts);
        });
    }

    /// [`intersect_filtered_batch`](Self::intersect_filtered_batch) on [all threads](RayQuery#batches-on-all-threads): the calls
    /// for one ray are in order, those for several rays are not.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn par_intersect_filtered_batch(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Self::Hit>],
        filter: impl Fn(usize, &Self::Hit) -> Verdict + Sync + Send,
    ) where
        Self: Sized + Sync,
    {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        parallel::answer(rays, hits, |start, rays, hits| {
            self.intersect_batch(rays, hits);
            filtered::first_of_each(self, rays, start, hits, &filter);
        });
    }

    /// [`occluded_filtered_batch`](Self::occluded_filtered_batch) on [all threads](RayQuery#batches-on-all-threads): the calls for
    /// one ray are in order, those for several rays are not.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn par_occluded_filtered_batch(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        filter: impl Fn(usize, &Self::Hit) -> Verdict + Sync + Send,
    ) where
        Self: Sized + Sync,
    {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        parallel::answer(rays, occluded, |start, rays, occluded| {
            filtered::any_of_each(self, rays, start, occluded, &filter);
        });
    }

    /// [`hits_filtered_batch`](Self::hits_filtered_batch) on [all threads](RayQuery#batches-on-all-threads): the calls for one ray
    /// are in order, those for several rays are not.
    fn par_hits_filtered_batch(
        &self,
        rays: &[Ray],
        max: usize,
        filter: impl Fn(usize, &Self::Hit) -> Verdict + Sync + Send,
    ) -> HitLists<Self::Hit>
    where
        Self: Sized + Sync,
    {
        HitLists::joined(parallel::map(rays, |start, rays| {
            filtered::lists(self, rays, start, max, &filter)
        }))
    }
}

/// The part of a ray from a hit on.
pub fn rest_of(ray: &Ray, last: &impl RayHit) -> Ray {
    ray.with_range(ray.t_min.max(last.t()), ray.t_max)
}

/// Implements [`RayQuery`] for a type that holds what answers: `pattern => target` names, for each form of the type, the value
/// whose methods of the same names answer.
///
/// `single` implements the required methods; `behind` ([`RayQuery::hits_behind`]), `batch` and `packet` replace the default bodies,
/// which ask one ray at a time, by the methods of the target.
///
/// ```
/// use kd_core::Hit;
/// use kd_trace::{PackedTree, RayQuery, WideTree, delegate_ray_query};
///
/// enum Either {
///     Packed(PackedTree),
///     Wide(WideTree),
/// }
///
/// delegate_ray_query! {
///     impl RayQuery<Hit = Hit> for Either: single, behind, batch, packet;
///     Self::Packed(tree) => tree,
///     Self::Wide(tree) => tree,
/// }
/// ```
#[macro_export]
macro_rules! delegate_ray_query {
    (
        impl RayQuery<Hit = $hit:ty> for $type:ty: $($queries:ident),+;
        $($pattern:pat => $target:expr),+ $(,)?
    ) => {
        impl $crate::RayQuery for $type {
            type Hit = $hit;

            $crate::delegate_ray_query!(@all [$($queries),+] $hit, [$($pattern => $target),+]);
        }
    };
    (@all [$($queries:ident),+] $hit:ty, $arms:tt) => {
        $($crate::delegate_ray_query!(@$queries $hit, $arms);)+
    };
    (@single $hit:ty, [$($pattern:pat => $target:expr),+]) => {
        #[inline]
        fn intersect(&self, ray: &$crate::kit::Ray) -> Option<$hit> {
            match self {
                $($pattern => $target.intersect(ray),)+
            }
        }

        #[inline]
        fn occluded(&self, ray: &$crate::kit::Ray) -> bool {
            match self {
                $($pattern => $target.occluded(ray),)+
            }
        }

        fn hits(&self, ray: &$crate::kit::Ray, max: usize, out: &mut Vec<$hit>) {
            match self {
                $($pattern => $target.hits(ray, max, out),)+
            }
        }
    };
    (@behind $hit:ty, [$($pattern:pat => $target:expr),+]) => {
        fn hits_behind(
            &self,
            ray: &$crate::kit::Ray,
            last: &$hit,
            max: usize,
            out: &mut Vec<$hit>,
        ) {
            match self {
                $($pattern => $target.hits_behind(ray, last, max, out),)+
            }
        }
    };
    (@batch $hit:ty, [$($pattern:pat => $target:expr),+]) => {
        fn intersect_batch(&self, rays: &[$crate::kit::Ray], hits: &mut [Option<$hit>]) {
            match self {
                $($pattern => $target.intersect_batch(rays, hits),)+
            }
        }

        fn occluded_batch(&self, rays: &[$crate::kit::Ray], occluded: &mut [bool]) {
            match self {
                $($pattern => $target.occluded_batch(rays, occluded),)+
            }
        }
    };
    (@packet $hit:ty, [$($pattern:pat => $target:expr),+]) => {
        fn intersect8(&self, packet: &$crate::kit::RayPacket8) -> [Option<$hit>; 8] {
            match self {
                $($pattern => $target.intersect8(packet),)+
            }
        }

        fn occluded8(&self, packet: &$crate::kit::RayPacket8) -> [bool; 8] {
            match self {
                $($pattern => $target.occluded8(packet),)+
            }
        }
    };
}

/// A borrowed structure answers as the structure does.
impl<Q: RayQuery + ?Sized> RayQuery for &Q {
    type Hit = Q::Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Q::Hit> {
        (**self).intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        (**self).occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Q::Hit>) {
        (**self).hits(ray, max, out);
    }

    fn hits_behind(&self, ray: &Ray, last: &Q::Hit, max: usize, out: &mut Vec<Q::Hit>) {
        (**self).hits_behind(ray, last, max, out);
    }

    fn count_hits(&self, ray: &Ray) -> usize {
        (**self).count_hits(ray)
    }

    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Q::Hit>]) {
        (**self).intersect_batch(rays, hits);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        (**self).occluded_batch(rays, occluded);
    }

    fn intersect8(&self, packet: &RayPacket8) -> [Option<Q::Hit>; 8] {
        (**self).intersect8(packet)
    }

    fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        (**self).occluded8(packet)
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for PackedTree: single, behind;
    tree => tree,
}
