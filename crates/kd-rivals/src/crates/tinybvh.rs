//! The C++ library tinybvh, by the crate `tinybvh-rs`, which compiles it for the machine's own processor.
//!
//! In a program that is compiled for AVX2, rays go through nodes of eight children with blocks of four triangles, the library's
//! fastest form for single rays; in others through binary nodes, since the crate offers the wide ones only there. So tests cover the
//! wide nodes only with `RUSTFLAGS=-Ctarget-cpu=native` on a processor with AVX2.
//!
//! The crate passes on neither the library's query for any hit, so that it is a closest hit here, nor its tuning of leaves for wide
//! nodes, nor its bytes. From 50 000 triangles on the library builds on all processors, whatever the options say, unless
//! `NO_THREADED_BUILDS` is defined where it is compiled (`CXXFLAGS`).
#![allow(
    unsafe_code,
    reason = "the crate declares nothing about threads, and its binary nodes borrow the triangles"
)]

use std::slice;

use kd_core::{Hit, Mesh, Ray};
use tinybvh_rs::{Error, INFINITE, Intersection, Intersector as _, bvh};
#[cfg(target_feature = "avx2")]
use tinybvh_rs::{bvh8_cpu, mbvh};

use super::{Trace, unit};
use crate::{Built, Bytes, Options, RivalError, TinybvhBuild};

#[cfg(target_feature = "avx2")]
type Nodes = bvh8_cpu::BVH;
#[cfg(not(target_feature = "avx2"))]
type Nodes = bvh::BVH<'static>;

struct Tree {
    nodes: Nodes,
    /// Three for each triangle. Binary nodes read them, so they are dropped last, and never change.
    _corners: Vec<[f32; 4]>,
}

// SAFETY: the library keeps no data of a thread in a tree.
unsafe impl Send for Tree {}
// SAFETY: the only calls through a shared tree are queries, which are const in C++ and write to their rays only.
unsafe impl Sync for Tree {}

/// Builds; bytes are unknown, since the library has an allocator of its own.
pub(crate) fn build(
    build: TinybvhBuild,
    mesh: &Mesh,
    options: Options,
) -> Result<Built, RivalError> {
    if mesh.is_empty() {
        return Err(RivalError::Failed("tinybvh builds no empty mesh".into()));
    }
    let corners = mesh.triangles().iter().flatten().map(|corner| {
        let [x, y, z] = mesh.positions()[*corner as usize];
        [x, y, z, 0.0]
    });
    let corners: Vec<[f32; 4]> = corners.collect();
    let built = super::build(options, || Tree::new(build, corners))?;
    Ok(Built {
        bytes: Bytes::default(),
        ..built
    })
}

impl Tree {
    fn new(build: TinybvhBuild, corners: Vec<[f32; 4]>) -> Result<Self, Error> {
        let (first, count) = (corners.as_ptr(), corners.len());
        // SAFETY: these are the elements of a vector that does not change and is dropped after everything that borrows them.
        let borrowed: &'static [[f32; 4]] = unsafe { slice::from_raw_parts(first, count) };
        let binary = match build {
            TinybvhBuild::Medium => bvh::BVH::new(borrowed.into())?,
            TinybvhBuild::High => bvh::BVH::new_hq(borrowed.into())?,
        };
        Ok(Self {
            nodes: finished(binary)?,
            _corners: corners,
        })
    }
}

#[cfg(target_feature = "avx2")]
fn finished(mut binary: bvh::BVH<'static>) -> Result<Nodes, Error> {
    binary.split_leaves(4);
    bvh8_cpu::BVH::new(&mbvh::BVH::new(&binary))
}

#[cfg(not(target_feature = "avx2"))]
#[allow(clippy::unnecessary_wraps, reason = "an error for AVX2")]
fn finished(binary: bvh::BVH<'static>) -> Result<Nodes, Error> {
    Ok(binary)
}

/// A ray with the size and the alignment of its C++ type. Those of the crate are smaller, so that its function for new rays writes
/// outside them; queries use the fields of the crate only.
#[repr(C, align(64))]
struct Room {
    ray: tinybvh_rs::Ray,
    _rest: [u32; 16],
}

/// The library's ray, and the divisor of its `t`. Its ranges start at 0, and directions have unit length.
#[inline]
fn ray_of(ray: &Ray) -> (Room, f32) {
    const ALL: u32 = 0xffff;
    const NOTHING: u32 = u32::MAX;
    let (direction, length) = unit(ray.direction);
    let room = Room {
        ray: tinybvh_rs::Ray {
            origin: ray.at(ray.t_min).to_array(),
            padding_0: ALL,
            dir: direction.to_array(),
            padding_1: 0,
            r_d: direction.to_array().map(inverse),
            padding_2: 0,
            hit: Intersection {
                t: ((ray.t_max - ray.t_min) * length).min(INFINITE),
                u: 0.0,
                v: 0.0,
                prim: NOTHING,
            },
        },
        _rest: [0; 16],
    };
    (room, length)
}

/// As the library inverts a direction: it multiplies the result by coordinates, and infinity times 0 would be NaN.
#[inline]
fn inverse(x: f32) -> f32 {
    if x.abs() > 1e-12 {
        x.recip()
    } else {
        INFINITE.copysign(x)
    }
}

impl Trace for Tree {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let (mut room, length) = ray_of(ray);
        self.nodes.intersect(&mut room.ray);
        let Intersection { t, u, v, prim } = room.ray.hit;
        (prim != u32::MAX).then_some(Hit {
            t: ray.t_min + t / length,
            u,
            v,
            triangle: prim,
        })
    }

    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}
