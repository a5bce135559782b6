//! Nothing gets out of a closed mesh.

use glam::Vec3;
use kd_core::{Mesh, Ray};

use crate::check::{Subject, check, source};
use crate::rng::Rng;
use crate::scenes;

/// Aims from inside at every corner and every edge's middle, and the other way.
#[track_caller]
fn check_closed(name: &str, mesh: &Mesh, radius: f32) {
    let [default, fine, _] = Subject::all(mesh);
    let subjects = [default, fine];
    let mut rng = Rng(10);
    let mut origins = vec![Vec3::ZERO, Vec3::new(0.25, 0.25, -0.25)];
    origins.extend((0..2).map(|_| radius * rng.unit() * rng.direction()));
    for origin in origins {
        for triangle in 0..u32::try_from(mesh.len()).expect("small") {
            let [a, b, c] = mesh.corners(triangle);
            let middles = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
            for target in [[a, b, c], middles].concat() {
                let ray = Ray::new(origin, target - origin);
                for ray in [ray, ray.with_range(f32::NEG_INFINITY, 0.0)] {
                    let hits = check(name, mesh, &subjects, &ray);
                    assert!(hits > 0, "{name} leaks: {}", source(&ray));
                }
            }
        }
    }
}

#[test]
fn sphere() {
    check_closed("sphere", &scenes::sphere(2), 0.95);
}

#[test]
fn cube_of_many_coplanar_triangles() {
    check_closed("cube", &scenes::cube(4), 0.99);
}

#[test]
fn bumpy_surface() {
    check_closed("bumpy", &scenes::bumpy(), 0.45);
}
