//! Embree as something to measure: one ray at a time, in packets of eight, and for several hits of a ray.

use std::time::Instant;

use kd::{Hit, Mesh, Ray};

use super::embree_api::{
    FirstHits, Hit1, Input, Moving, NOTHING, Purpose, Quality, QueryContext, Ray1, Ray8, RayHit1,
    RayHit8, Scene,
};
use super::shape_of;
use crate::record::Steps;
use crate::structure::{
    BuilderName, Built, Distances, OrderedHits, Shape, Structure, StructureName, distances_of,
};

/// An Embree scene, and how it is asked.
#[derive(Debug)]
struct Embree {
    scene: Scene,
    packets: bool,
}

/// Builds `structure`, one of the three of Embree's. The clock runs while the scene is committed, with the mesh in
/// Embree's own buffers.
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
        structure: Box::new(Embree {
            scene,
            packets: structure == StructureName::Embree8,
        }),
    })
}

/// A scene of which one mesh stands still and one moves.
#[derive(Debug)]
pub(crate) struct EmbreeMoving(Moving);

/// How Embree follows what moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Following {
    /// Everything is built anew, in medium quality
    Rebuild,
    /// What moves is built anew in medium quality, in a scene that is made for that
    Medium,
    /// What moves is refitted
    Refit,
}

impl EmbreeMoving {
    pub(crate) fn new(
        fixed: &Mesh,
        moving: &Mesh,
        following: Following,
        threads: usize,
    ) -> anyhow::Result<Self> {
        let (scene, purpose, quality) = match following {
            Following::Rebuild => (Quality::Medium, Purpose::Usual, Quality::Medium),
            Following::Medium => (Quality::Low, Purpose::Dynamic, Quality::Medium),
            Following::Refit => (Quality::Low, Purpose::Dynamic, Quality::Refit),
        };
        let input = Input::of_scene(fixed, [scene, Quality::Medium], purpose, threads)?;
        Ok(Self(input.add(moving, quality)?))
    }

    pub(crate) fn update(&mut self, positions: &[[f32; 3]]) -> anyhow::Result<()> {
        self.0.update(positions)
    }

    /// The closest hits, one by one or in packets of eight; triangles have the numbers of their own mesh.
    pub(crate) fn closest(&self, packets: bool, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(&self.0.scene, packets, rays, hits);
    }

    pub(crate) fn any(&self, packets: bool, rays: &[Ray], hits: &mut [bool]) {
        any(&self.0.scene, packets, rays, hits);
    }
}

/// An Embree scene that is asked for several hits of a ray.
#[derive(Debug)]
struct Filtered(Scene);

/// Builds a scene as [`BuilderName::Medium`] does, whose hits can be filtered.
pub(super) fn ordered_hits(mesh: &Mesh, threads: usize) -> anyhow::Result<Box<dyn OrderedHits>> {
    let input = Input::new(mesh, Quality::Medium, Purpose::Filtered, threads)?;
    Ok(Box::new(Filtered(input.commit()?)))
}

impl OrderedHits for Filtered {
    fn first(&self, rays: &[Ray], distances: &mut [Distances]) {
        let Self(scene) = self;
        let mut found = FirstHits::none();
        for (ray, distances) in rays.iter().zip(distances) {
            *distances = distances_of(scene.first_hits(&mut found, &mut with_room_for_hit(ray)));
        }
    }
}

impl Structure for Embree {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(&self.scene, self.packets, rays, hits);
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        any(&self.scene, self.packets, rays, hits);
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        shape_of(self.scene.bytes)
    }

    fn flaw(&self) -> Option<String> {
        None
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

/// Rays of one origin come from a camera, which is when Embree wants to be told that they are coherent.
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

/// Lays up to eight rays side by side; the last one again where there are fewer. That is part of the query's time: rays
/// come one after the other, here as to our own batches.
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
