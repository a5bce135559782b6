//! The questions that rays ask of a structure, as one trait.

use std::fmt::Debug;

use kd_core::{Hit, Ray, RayPacket8};

use crate::PackedTree;

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
/// have default bodies that ask one ray at a time; a structure overrides them where rays can share work.
pub trait RayQuery {
    /// Where a ray meets the structure: [`Hit`] over one mesh, the part and the hit over several.
    type Hit: Copy + Debug + PartialEq;

    /// The closest hit; the lower part, then the lower triangle, among equal `t`. `None` on a miss.
    ///
    /// A ray that [cannot hit](Ray::can_hit) anything is a miss.
    fn intersect(&self, ray: &Ray) -> Option<Self::Hit>;

    /// Whether there is any hit: equal to `intersect(ray).is_some()`, and faster.
    fn occluded(&self, ray: &Ray) -> bool;

    /// The first `max` hits, ordered by `t`, each triangle once. Clears `out` first.
    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Self::Hit>);

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
}

/// Implements [`RayQuery`] for a type that holds what answers: `pattern => target` names, for each form of the type, the value
/// whose methods of the same names answer.
///
/// `single` implements the required methods; `batch` and `packet` replace the default bodies, which ask one ray at a time, by
/// the methods of the target.
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
///     impl RayQuery<Hit = Hit> for Either: single, batch, packet;
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
    impl RayQuery<Hit = Hit> for PackedTree: single;
    tree => tree,
}
