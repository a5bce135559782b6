//! Every triangle, one by one: the oracle of all other queries, and the faster way for a handful of triangles.
//!
//! No tree and no early rejection: only the function that decides what is a hit. Answers equal those of every layout, bit for
//! bit. Time is linear in the number of triangles.

use kd_core::{Hit, Mesh, Ray};

use crate::triangle::TriangleTest;

/// As [`intersect`](crate::intersect).
pub fn intersect(mesh: &Mesh, ray: &Ray) -> Option<Hit> {
    every_hit(mesh, ray).reduce(|best, hit| if hit.is_before(&best) { hit } else { best })
}

/// As [`occluded`](crate::occluded).
pub fn occluded(mesh: &Mesh, ray: &Ray) -> bool {
    every_hit(mesh, ray).next().is_some()
}

/// As [`hits`](crate::hits).
pub fn hits(mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
    out.clear();
    out.extend(every_hit(mesh, ray));
    // Stable: among equals the lower triangle stays in front. A hit's t is neither NaN nor -0.0.
    out.sort_by(|a, b| a.t.total_cmp(&b.t));
    out.truncate(max);
}

fn every_hit(mesh: &Mesh, ray: &Ray) -> impl Iterator<Item = Hit> {
    let test = ray.can_hit().then(|| TriangleTest::new(ray, f32::INFINITY));
    test.into_iter().flat_map(move |test| {
        (0..)
            .zip(mesh.triangles())
            .filter_map(move |(triangle, _)| test.hit(mesh.corners(triangle), triangle))
    })
}
