//! [`RayQuery`](kd_trace::RayQuery) for types that have its methods already.

/// Implements [`RayQuery`](kd_trace::RayQuery) for a type by the methods of the same names that `$to` has.
macro_rules! delegate_ray_query {
    ($type:ty, $hit:ty, |$this:ident| $to:expr) => {
        impl kd_trace::RayQuery for $type {
            type Hit = $hit;

            #[inline]
            fn intersect(&self, ray: &kd_core::Ray) -> Option<$hit> {
                let $this = self;
                $to.intersect(ray)
            }

            #[inline]
            fn occluded(&self, ray: &kd_core::Ray) -> bool {
                let $this = self;
                $to.occluded(ray)
            }

            fn hits(&self, ray: &kd_core::Ray, max: usize, out: &mut Vec<$hit>) {
                let $this = self;
                $to.hits(ray, max, out);
            }

            fn intersect_batch(&self, rays: &[kd_core::Ray], hits: &mut [Option<$hit>]) {
                let $this = self;
                $to.intersect_batch(rays, hits);
            }

            fn occluded_batch(&self, rays: &[kd_core::Ray], occluded: &mut [bool]) {
                let $this = self;
                $to.occluded_batch(rays, occluded);
            }

            fn intersect8(&self, packet: &kd_core::RayPacket8) -> [Option<$hit>; 8] {
                let $this = self;
                $to.intersect8(packet)
            }

            fn occluded8(&self, packet: &kd_core::RayPacket8) -> [bool; 8] {
                let $this = self;
                $to.occluded8(packet)
            }
        }
    };
}

pub(crate) use delegate_ray_query;
