//! Embree under measurement: one ray at a time, in packets of eight, and for several hits of a ray.

use std::time::Instant;

use kd::{Hit, Mesh, Ray};
use kd_trace::RayQuery;

use super::embree_api::{
    FirstHits, Hit1, Input, Moving, NOTHING, Purpose, Quality, QueryContext, Ray1, Ray8, RayHit1,
    RayHit8, Scene,
};
use super::{Following, shape_of};
use crate::names::{BuilderName, StructureName};
use crate::structure::{Built, Manner, Shape, Structure};

/// Builds `structure`, one of Embree's three. The clock covers the commit of the scene, with the mesh in Embree's own buffers.
pub(super) fn build(
    structure: StructureName,
    builder: BuilderName,
    mesh: &Mesh,
    threads: usize,
) -> anyhow::Result<Built> {
    let quality = match builder {
        BuilderName::Low => Quality::Low,
        BuilderName::High => Quality::High,
        _ => Quality::Medium,
    };
    let purpose = match structure {
        StructureName::EmbreeRobust => Purpose::Robust,
        _ => Purpose::Usual,
    };
    let input = Input::new(mesh, quality, purpose, threads)?;
    let start = Instant::now();
    let scene = input.commit()?;
    Ok(Built {
        seconds: start.elapsed().as_secs_f64(),
        peak_bytes: scene.peak_bytes,
        structure: match structure {
            StructureName::Embree8 => Box::new(InPackets(scene)),
            _ => Box::new(scene),
        },
    })
}

/// A scene of a static and a moving mesh.
#[derive(Debug)]
pub(super) struct Moved(Moving);

impl Moved {
    pub(super) fn new(way: &str, fixed: &Mesh, moving: &Mesh) -> anyhow::Result<Self> {
        let (scene, purpose, quality) = match way {
            "rebuild" => (Quality::Medium, Purpose::Usual, Quality::Medium),
            "medium" => (Quality::Low, Purpose::Dynamic, Quality::Medium),
            _ => (Quality::Low, Purpose::Dynamic, Quality::Refit),
        };
        let input = Input::of_scene(fixed, [scene, Quality::Medium], purpose, 1)?;
        Ok(Self(input.add(moving, quality)?))
    }
}

impl Following for Moved {
    fn update(&mut self, positions: &[[f32; 3]]) -> anyhow::Result<()> {
        self.0.update(positions)
    }

    fn structure(&self) -> &dyn Structure {
        &self.0.scene
    }
}

/// An Embree scene for several hits of a ray.
#[derive(Debug)]
struct Filtered(Scene);

/// A scene like that of [`BuilderName::Medium`], with a filter for hits.
pub(super) fn filtered(
    mesh: &Mesh,
    threads: usize,
) -> anyhow::Result<Box<dyn RayQuery<Hit = Hit>>> {
    let input = Input::new(mesh, Quality::Medium, Purpose::Filtered, threads)?;
    Ok(Box::new(Filtered(input.commit()?)))
}

impl RayQuery for Filtered {
    type Hit = Hit;

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = [None];
        closest(&self.0, false, std::slice::from_ref(ray), &mut hit);
        hit[0]
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let mut hit = [false];
        any(&self.0, false, std::slice::from_ref(ray), &mut hit);
        hit[0]
    }

    /// At most [`FIRST`](crate::structure::FIRST) hits.
    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        let mut found = FirstHits::none();
        let hits = self.0.first_hits(&mut found, &mut with_room_for_hit(ray));
        out.clear();
        out.extend(hits.iter().take(max));
    }
}

impl Structure for Scene {
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(self, by != Manner::Single, rays, hits);
    }

    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
        any(self, by != Manner::Single, rays, occluded);
    }

    fn shape(&self) -> Shape {
        shape_of(self.bytes)
    }
}

/// An Embree scene that is always traced in packets.
#[derive(Debug)]
struct InPackets(Scene);

impl Structure for InPackets {
    fn closest(&self, _: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(&self.0, true, rays, hits);
    }

    fn any(&self, _: Manner, rays: &[Ray], occluded: &mut [bool]) {
        any(&self.0, true, rays, occluded);
    }

    fn shape(&self) -> Shape {
        self.0.shape()
    }
}

fn closest(scene: &Scene, packets: bool, rays: &[Ray], hits: &mut [Option<Hit>]) {
    let mut context = QueryContext::new(have_one_origin(rays));
    if packets {
        let mut packet = EMPTY_HITS8;
        for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
            fill(&mut packet.ray, rays);
            packet.geometry = [NOTHING; 8];
            scene.intersect8(&mut context, &mut packet);
            for (lane, hit) in hits.iter_mut().enumerate() {
                *hit = hit_of_lane(&packet, lane);
            }
        }
    } else {
        for (ray, hit) in rays.iter().zip(hits) {
            let mut single = with_room_for_hit(ray);
            scene.intersect1(&mut context, &mut single);
            *hit = hit_of(&single);
        }
    }
}

fn any(scene: &Scene, packets: bool, rays: &[Ray], hits: &mut [bool]) {
    let mut context = QueryContext::new(have_one_origin(rays));
    if packets {
        let mut packet = EMPTY8;
        for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
            fill(&mut packet, rays);
            scene.occluded8(&mut context, &mut packet);
            for (hit, t_max) in hits.iter_mut().zip(packet.t_max) {
                *hit = t_max < 0.0;
            }
        }
    } else {
        for (ray, hit) in rays.iter().zip(hits) {
            let mut single = single_of(ray);
            scene.occluded1(&mut context, &mut single);
            *hit = single.t_max < 0.0;
        }
    }
}

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
    }
}

#[inline]
fn hit_of(traced: &RayHit1) -> Option<Hit> {
    let RayHit1 { ray, hit } = traced;
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
