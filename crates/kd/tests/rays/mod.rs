//! Rays of all kinds that hit a mesh often enough.

use fastrand::Rng;
use kd::glam::Vec3;
use kd::{Aabb, Mesh, Ray};

/// Rays of all kinds in turn: across the whole, from surfaces, along axes, at vertices.
pub(crate) fn rays_for(mesh: &Mesh, count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::with_seed(seed);
    let bounds = mesh.bounds();
    (0..count)
        .map(|i| match i % 4 {
            0 => across(&mut rng, &bounds),
            1 => from_surface(&mut rng, mesh),
            2 => along_an_axis(&mut rng, mesh),
            _ => at_a_vertex(&mut rng, mesh, &bounds),
        })
        .collect()
}

fn on_sphere(rng: &mut Rng) -> Vec3 {
    loop {
        let p = Vec3::from_array([(); 3].map(|()| 2.0 * rng.f32() - 1.0));
        if (1e-3..=1.0).contains(&p.length_squared()) {
            return p.normalize();
        }
    }
}

fn across(rng: &mut Rng, bounds: &Aabb) -> Ray {
    let radius = 0.5 * bounds.diagonal();
    let [a, b] = [(); 2].map(|()| bounds.center() + radius * on_sphere(rng));
    Ray::new(a, b - a)
}

fn point_on(rng: &mut Rng, mesh: &Mesh) -> Vec3 {
    let [a, b, c] = mesh.corners(rng.u32(..u32::try_from(mesh.len()).expect("few")));
    let (u, v) = (rng.f32(), rng.f32());
    let (u, v) = if u + v > 1.0 {
        (1.0 - u, 1.0 - v)
    } else {
        (u, v)
    };
    a * (1.0 - u - v) + b * u + c * v
}

/// From a point on some triangle, as secondary rays start; some towards another point of the surface.
fn from_surface(rng: &mut Rng, mesh: &Mesh) -> Ray {
    let (from, to) = (point_on(rng, mesh), point_on(rng, mesh));
    if rng.bool() {
        Ray::between(from, to)
    } else {
        Ray::new(from, to - from)
    }
}

/// Parallel to an axis, through a vertex or a point of the surface, with zeros of either sign.
fn along_an_axis(rng: &mut Rng, mesh: &Mesh) -> Ray {
    let through = if rng.bool() {
        vertex_of(rng, mesh)
    } else {
        point_on(rng, mesh)
    };
    let mut direction = Vec3::from_array([(); 3].map(|()| if rng.bool() { 0.0 } else { -0.0 }));
    direction[rng.usize(..3)] = if rng.bool() { 1.0 } else { -2.0 };
    let back = if rng.bool() {
        mesh.bounds().diagonal()
    } else {
        0.0
    };
    Ray::new(through - back * direction, direction)
}

/// Aimed exactly at a vertex, from within the scene or from 10⁴ diagonals away.
fn at_a_vertex(rng: &mut Rng, mesh: &Mesh, bounds: &Aabb) -> Ray {
    let distance = if rng.u8(..8) == 0 { 1e4 } else { 1.0 };
    let from = bounds.center() + distance * bounds.diagonal() * rng.f32() * on_sphere(rng);
    Ray::new(from, vertex_of(rng, mesh) - from)
}

pub(crate) fn vertex_of(rng: &mut Rng, mesh: &Mesh) -> Vec3 {
    mesh.corners(rng.u32(..u32::try_from(mesh.len()).expect("few")))[rng.usize(..3)]
}
