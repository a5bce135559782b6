//! Nothing gets out of a closed mesh.

use glam::Vec3;
use kd_core::{Mesh, Ray};

use crate::check::{Subject, check};
use crate::rng::Rng;
use crate::scenes;

/// From points inside, aims at every corner and at the middle of every edge.
#[track_caller]
fn check_closed(name: &str, mesh: &Mesh, origins: &[Vec3]) {
    check_closed_by(name, mesh, &Subject::all(mesh), origins);
}

#[track_caller]
fn check_closed_by(name: &str, mesh: &Mesh, subjects: &[Subject], origins: &[Vec3]) {
    for &origin in origins {
        for triangle in 0..u32::try_from(mesh.len()).expect("few") {
            let [a, b, c] = mesh.corners(triangle);
            for target in [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a)] {
                let ray = Ray::new(origin, target - origin);
                for ray in [ray, ray.with_range(f32::NEG_INFINITY, 0.0)] {
                    let hits = check(name, mesh, subjects, &ray);
                    assert!(hits > 0, "{name} leaks: {ray:?}");
                }
            }
        }
    }
}

/// Points in the octahedron around the origin, some of which give exact directions.
fn inside() -> Vec<Vec3> {
    let mut rng = Rng(11);
    let mut points = vec![Vec3::ZERO, Vec3::new(0.0, 0.25, 0.0), Vec3::splat(0.125)];
    points.extend([(); 3].map(|()| 0.3 * rng.vec3()));
    points
}

#[test]
fn a_sphere_is_tight() {
    check_closed("sphere", &scenes::sphere(2), &inside());
}

#[test]
fn a_cube_of_coplanar_triangles_is_tight() {
    check_closed("cube", &scenes::cube(3), &inside());
}

#[test]
fn far_from_the_origin_it_is_tight() {
    let place = |p: Vec3| 1e3 * p + Vec3::new(3e4, -7e5, 11.0);
    let points: Vec<Vec3> = inside().into_iter().map(place).collect();
    check_closed(
        "far off",
        &scenes::moved(&scenes::sphere(1), place),
        &points,
    );
}

/// How far boxes are widened follows what was refitted, too.
#[test]
fn what_has_grown_is_tight() {
    let small = scenes::moved(&scenes::sphere(2), |p| 1e-4 * p);
    let off = Vec3::new(30.0, -20.0, 10.0);
    let large = scenes::moved(&scenes::sphere(2), |p| 1e3 * p + off);
    let subjects: Vec<Subject> = Subject::all(&small)
        .into_iter()
        .map(
            |Subject {
                 mut bvh, options, ..
             }| {
                bvh.refit(&large).expect("as many triangles");
                Subject::of(&large, bvh, &options)
            },
        )
        .collect();
    // Where it was, so that what is near there looks near enough.
    let points: Vec<Vec3> = inside().into_iter().map(|p| 1e-4 * p).collect();
    check_closed_by("grown", &large, &subjects, &points);
}
