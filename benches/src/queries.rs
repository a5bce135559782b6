//! [`RayQuery`] for the structures of the libraries, where they do not implement it themselves.

use std::sync::Arc;

use kd::{Accel, FrameData, Hit, KdTree, LazyTree, Mesh, PartId, Ray, RayPacket8};
use kd_bvh::Bvh;
use kd_comparators::{Octree, PolygonBsp};
use kd_grid::UniformGrid;
use kd_trace::RayQuery;

/// A borrowed structure of the facade.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Query<'a, T>(pub(crate) &'a T);

/// A structure whose queries take the mesh, with its mesh.
#[derive(Debug)]
pub(crate) struct WithMesh<T> {
    pub(crate) structure: T,
    pub(crate) mesh: Arc<Mesh>,
}

macro_rules! of_facade {
    ($($type:ty, $hit:ty, $($packets:ident)?;)*) => {$(
        impl RayQuery for Query<'_, $type> {
            type Hit = $hit;

            #[inline]
            fn intersect(&self, ray: &Ray) -> Option<$hit> {
                self.0.intersect(ray)
            }

            #[inline]
            fn occluded(&self, ray: &Ray) -> bool {
                self.0.occluded(ray)
            }

            fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<$hit>) {
                self.0.hits(ray, max, out);
            }

            fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<$hit>]) {
                self.0.intersect_batch(rays, hits);
            }

            fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
                self.0.occluded_batch(rays, occluded);
            }

            $(
                fn intersect8(&self, $packets: &RayPacket8) -> [Option<$hit>; 8] {
                    self.0.intersect8($packets)
                }

                fn occluded8(&self, $packets: &RayPacket8) -> [bool; 8] {
                    self.0.occluded8($packets)
                }
            )?
        }
    )*};
}

of_facade! {
    KdTree, Hit, packet;
    LazyTree, Hit,;
    Accel, Hit,;
    FrameData, (PartId, Hit), packet;
}

macro_rules! with_mesh {
    ($($type:ty),*) => {$(
        impl RayQuery for WithMesh<$type> {
            type Hit = Hit;

            #[inline]
            fn intersect(&self, ray: &Ray) -> Option<Hit> {
                self.structure.intersect(&self.mesh, ray)
            }

            #[inline]
            fn occluded(&self, ray: &Ray) -> bool {
                self.structure.occluded(&self.mesh, ray)
            }

            fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
                self.structure.hits(&self.mesh, ray, max, out);
            }
        }
    )*};
}

with_mesh!(UniformGrid, Bvh, Octree, PolygonBsp);
