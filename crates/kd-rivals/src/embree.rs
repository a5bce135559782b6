//! Embree 3 or 4: one ray at a time, in packets of eight, and for several hits of a ray.

mod api;

use std::array;
use std::time::Instant;

use kd_core::{Hit, Mesh, Ray, RayPacket8};
use kd_trace::{Primitives, RayQuery};

use crate::queries::restarted_hits;
use crate::{
    Built, Bytes, EmbreeBuild, FIRST, Following, Moving, PointQueries, Purpose, Queries, RivalError,
};
use api::{
    Committed, Embree, Geometry, Hit1, Input, NOTHING, Quality, Ray1, Ray8, RayHit1, RayHit8,
    Scene, SceneFlags, Version,
};

/// The name of the library with its version.
pub(crate) fn name() -> Result<String, RivalError> {
    Ok(api::library()?.name())
}

/// The clock covers the commit of the scene, with the mesh in Embree's own buffers.
pub(crate) fn build(
    build: EmbreeBuild,
    purpose: Purpose,
    mesh: &Mesh,
    threads: usize,
) -> Result<Built, RivalError> {
    let quality = match build {
        EmbreeBuild::Low => Quality::Low,
        EmbreeBuild::Medium => Quality::Medium,
        EmbreeBuild::High => Quality::High,
    };
    let flags = match purpose {
        Purpose::Usual => SceneFlags::Usual,
        Purpose::Robust => SceneFlags::Robust,
        Purpose::FirstHits => SceneFlags::Filtered,
    };
    match api::library()? {
        Embree::V3(functions) => {
            let input = Input::new(functions, mesh, [quality; 2], flags, threads)?;
            committed(input, purpose)
        }
        Embree::V4(functions) => {
            let input = Input::new(functions, mesh, [quality; 2], flags, threads)?;
            committed(input, purpose)
        }
    }
}

fn committed<V: Version>(input: Input<V>, purpose: Purpose) -> Result<Built, RivalError> {
    let start = Instant::now();
    let scene = input.commit()?;
    let seconds = start.elapsed().as_secs_f64();
    let bytes = Bytes {
        peak: scene.peak_bytes,
        kept: scene.bytes,
    };
    let structure: Box<dyn Queries> = match purpose {
        Purpose::FirstHits => Box::new(Filtered(scene)),
        Purpose::Usual | Purpose::Robust => Box::new(scene),
    };
    Ok(Built {
        structure,
        seconds,
        bytes,
    })
}

/// The clock covers the commit of the scene, for which Embree asks for the boxes.
pub(crate) fn build_primitives<P: Primitives + Send + 'static>(
    primitives: P,
    threads: usize,
) -> Result<Built, RivalError> {
    match api::library()? {
        Embree::V3(functions) => committed_primitives(Geometry::new(
            functions,
            primitives,
            Quality::Medium,
            threads,
        )?),
        Embree::V4(functions) => committed_primitives(Geometry::new(
            functions,
            primitives,
            Quality::Medium,
            threads,
        )?),
    }
}

fn committed_primitives<V: Version, P: Primitives + Send + 'static>(
    geometry: Geometry<V, P>,
) -> Result<Built, RivalError> {
    let start = Instant::now();
    let structure = geometry.commit()?;
    let seconds = start.elapsed().as_secs_f64();
    let bytes = Bytes {
        peak: structure.scene.peak_bytes,
        kept: structure.scene.bytes,
    };
    Ok(Built {
        structure: Box::new(structure),
        seconds,
        bytes,
    })
}

/// One ray at a time: the functions of primitives are for one.
impl<V: Version, P: Primitives + Send> RayQuery for Committed<V, P> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.scene.intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene.occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        restarted_hits(&self.scene, ray, max, out);
    }
}

impl<V: Version, P: Primitives + Send> Queries for Committed<V, P> {
    fn intersect_each(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.scene.intersect_each(rays, hits);
    }

    fn occluded_each(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.scene.occluded_each(rays, occluded);
    }
}

/// A scene for closest points, of medium quality.
pub(crate) fn points(mesh: &Mesh, threads: usize) -> Result<Box<dyn PointQueries>, RivalError> {
    let (qualities, flags) = ([Quality::Medium; 2], SceneFlags::Usual);
    Ok(match api::library()? {
        Embree::V3(functions) => Box::new(Points {
            scene: Input::new(functions, mesh, qualities, flags, threads)?.commit()?,
            mesh: mesh.clone(),
        }),
        Embree::V4(functions) => Box::new(Points {
            scene: Input::new(functions, mesh, qualities, flags, threads)?.commit()?,
            mesh: mesh.clone(),
        }),
    })
}

/// A scene and its mesh, which closest points need.
struct Points<V: Version> {
    scene: Scene<V>,
    mesh: Mesh,
}

impl<V: Version> PointQueries for Points<V> {
    fn distances(&self, points: &[[f32; 3]], out: &mut [f32]) {
        for (point, distance) in points.iter().zip(out) {
            *distance = self.scene.distance(&self.mesh, *point);
        }
    }
}

/// A scene of a static and a moving mesh.
pub(crate) fn follow(
    following: Following,
    fixed: &Mesh,
    moving: &Mesh,
) -> Result<Box<dyn Moving>, RivalError> {
    let (scene, flags, quality) = match following {
        Following::Rebuild => (Quality::Medium, SceneFlags::Usual, Quality::Medium),
        Following::RebuildMoving => (Quality::Low, SceneFlags::Dynamic, Quality::Medium),
        Following::Refit => (Quality::Low, SceneFlags::Dynamic, Quality::Refit),
    };
    let qualities = [scene, Quality::Medium];
    Ok(match api::library()? {
        Embree::V3(functions) => {
            let input = Input::new(functions, fixed, qualities, flags, 1)?;
            Box::new(input.add(moving, quality)?)
        }
        Embree::V4(functions) => {
            let input = Input::new(functions, fixed, qualities, flags, 1)?;
            Box::new(input.add(moving, quality)?)
        }
    })
}

impl<V: Version> Moving for api::Moving<V> {
    fn update(&mut self, positions: &[[f32; 3]]) -> Result<(), RivalError> {
        self.move_to(positions)
    }

    fn structure(&self) -> &dyn Queries {
        &self.scene
    }
}

impl<V: Version> RayQuery for Scene<V> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut single = with_room_for_hit(ray);
        self.intersect_one(&mut V::arguments(false), &mut single);
        hit_of(&single)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        let mut single = single_of(ray);
        self.occluded_one(&mut V::arguments(false), &mut single);
        single.t_max < 0.0
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        restarted_hits(self, ray, max, out);
    }

    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let mut arguments = V::arguments(have_one_origin(rays));
        let mut packet = EMPTY_HITS8;
        for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
            fill(&mut packet.ray, rays);
            packet.geometry = [NOTHING; 8];
            self.intersect_packet(&mut arguments, &mut packet);
            for (lane, hit) in hits.iter_mut().enumerate() {
                *hit = hit_of_lane(&packet, lane);
            }
        }
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let mut arguments = V::arguments(have_one_origin(rays));
        let mut packet = EMPTY8;
        for (rays, occluded) in rays.chunks(8).zip(occluded.chunks_mut(8)) {
            fill(&mut packet, rays);
            self.occluded_packet(&mut arguments, &mut packet);
            for (occluded, t_max) in occluded.iter_mut().zip(packet.t_max) {
                *occluded = t_max < 0.0;
            }
        }
    }

    fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        let mut hits = [None; 8];
        self.intersect_batch(&packet.rays(), &mut hits);
        array::from_fn(|lane| hits[lane].filter(|_| packet.mask[lane] != 0))
    }

    fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        let mut occluded = [false; 8];
        self.occluded_batch(&packet.rays(), &mut occluded);
        array::from_fn(|lane| occluded[lane] && packet.mask[lane] != 0)
    }
}

/// The same arguments serve all rays of a list.
impl<V: Version> Queries for Scene<V> {
    fn intersect_each(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let mut arguments = V::arguments(have_one_origin(rays));
        for (ray, hit) in rays.iter().zip(hits) {
            let mut single = with_room_for_hit(ray);
            self.intersect_one(&mut arguments, &mut single);
            *hit = hit_of(&single);
        }
    }

    fn occluded_each(&self, rays: &[Ray], occluded: &mut [bool]) {
        let mut arguments = V::arguments(have_one_origin(rays));
        for (ray, occluded) in rays.iter().zip(occluded) {
            let mut single = single_of(ray);
            self.occluded_one(&mut arguments, &mut single);
            *occluded = single.t_max < 0.0;
        }
    }
}

/// A scene with a filter for hits.
#[derive(Debug)]
struct Filtered<V: Version>(Scene<V>);

impl<V: Version> RayQuery for Filtered<V> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.0.occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        if max > FIRST {
            return restarted_hits(&self.0, ray, max, out);
        }
        let found = self.0.first_hits(&mut with_room_for_hit(ray));
        out.clear();
        out.extend(found.hits().iter().take(max));
    }
}

impl<V: Version> Queries for Filtered<V> {}

/// Rays of one origin come from a camera: Embree gets the hint that they are coherent.
fn have_one_origin(rays: &[Ray]) -> bool {
    rays.windows(2).all(|pair| pair[0].origin == pair[1].origin)
}

#[inline]
fn single_of(ray: &Ray) -> Ray1 {
    Ray1 {
        origin: ray.origin.to_array(),
        t_min: ray.t_min,
        direction: ray.direction.to_array(),
        time: 0.0,
        t_max: ray.t_max,
        mask: ray.mask,
        id: 0,
        flags: 0,
    }
}

#[inline]
fn with_room_for_hit(ray: &Ray) -> RayHit1 {
    RayHit1 {
        ray: single_of(ray),
        hit: Hit1 {
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            triangle: NOTHING,
            geometry: NOTHING,
            instance: NOTHING,
        },
        in_instance_array: NOTHING,
    }
}

#[inline]
fn hit_of(traced: &RayHit1) -> Option<Hit> {
    let RayHit1 { ray, hit, .. } = traced;
    (hit.geometry != NOTHING).then_some(Hit {
        t: ray.t_max,
        u: hit.u,
        v: hit.v,
        triangle: hit.triangle,
    })
}

/// A packet without its rays.
const EMPTY8: Ray8 = Ray8 {
    origin: [[0.0; 8]; 3],
    t_min: [0.0; 8],
    direction: [[0.0; 8]; 3],
    time: [0.0; 8],
    t_max: [0.0; 8],
    mask: [u32::MAX; 8],
    id: [0; 8],
    flags: [0; 8],
};

const EMPTY_HITS8: RayHit8 = RayHit8 {
    ray: EMPTY8,
    normal: [[0.0; 8]; 3],
    u: [0.0; 8],
    v: [0.0; 8],
    triangle: [NOTHING; 8],
    geometry: [NOTHING; 8],
    instance: [NOTHING; 8],
    in_instance_array: [NOTHING; 8],
};

/// Fills the lanes with up to eight rays, and the remaining lanes with the last one. This is part of the query's time, since
/// rays come one after the other, as to our own batches.
#[inline]
fn fill(packet: &mut Ray8, rays: &[Ray]) {
    for lane in 0..8 {
        let ray = &rays[lane.min(rays.len() - 1)];
        for axis in 0..3 {
            packet.origin[axis][lane] = ray.origin[axis];
            packet.direction[axis][lane] = ray.direction[axis];
        }
        packet.t_min[lane] = ray.t_min;
        packet.t_max[lane] = ray.t_max;
    }
}

#[inline]
fn hit_of_lane(traced: &RayHit8, lane: usize) -> Option<Hit> {
    (traced.geometry[lane] != NOTHING).then_some(Hit {
        t: traced.ray.t_max[lane],
        u: traced.u[lane],
        v: traced.v[lane],
        triangle: traced.triangle[lane],
    })
}
