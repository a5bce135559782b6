//! Nothing gets out of a closed mesh.

use glam::Vec3;
use kd_core::{Mesh, Ray};
use kd_sah::{BuildOptions, build};

use crate::check::{Subject, check, source};
use crate::random_tree::random_tree;
use crate::rng::Rng;
use crate::scenes;

/// Aims from inside at every corner, every edge's middle and other points on edges.
#[track_caller]
fn check_closed(name: &str, mesh: &Mesh, origins: &[Vec3]) {
    let trees = [
        build(mesh, &BuildOptions::default()).expect("valid"),
        random_tree(mesh, 3),
    ]
    .map(|tree| Subject::new(mesh, tree));
    let mut rng = Rng(10);
    let mut rays = 0;
    for &origin in origins {
        for triangle in 0..u32::try_from(mesh.len()).expect("small") {
            let [a, b, c] = mesh.corners(triangle);
            let middles = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
            let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| p.lerp(q, rng.unit()));
            for target in [[a, b, c], middles, edges].concat() {
                check_inside(name, mesh, &trees, &Ray::new(origin, target - origin));
                rays += 1;
            }
        }
    }
    assert!(rays >= 9 * 12 * 10, "{name}: only {rays} rays");
}

/// From inside, the ray hits, in both directions.
#[track_caller]
fn check_inside(name: &str, mesh: &Mesh, trees: &[Subject], ray: &Ray) {
    let back = ray.with_range(f32::NEG_INFINITY, 0.0);
    for ray in [ray, &back] {
        let hits = check(name, mesh, trees, ray);
        assert!(hits > 0, "{name} leaks: {}", source(ray));
    }
}

/// Points within `radius` of the origin, among them some that give exact directions.
fn points(radius: f32) -> Vec<Vec3> {
    let mut rng = Rng(11);
    let mut points = vec![
        Vec3::ZERO,
        Vec3::new(0.0, 0.25, 0.0),
        Vec3::new(0.25, 0.25, -0.25),
        Vec3::new(-0.125, 0.0, 0.0625),
    ];
    points.extend((0..12).map(|_| radius * rng.unit() * rng.direction()));
    points
}

#[test]
fn sphere() {
    check_closed("sphere", &scenes::sphere(2), &points(0.95));
}

#[test]
fn cube_of_many_coplanar_triangles() {
    let mut inside = points(0.99);
    // On lattice lines, so that rays run exactly through corners and along edges' planes.
    inside.extend([
        Vec3::splat(0.5),
        Vec3::new(0.5, -0.5, 0.0),
        Vec3::new(0.0, 0.0, 0.5),
    ]);
    check_closed("cube", &scenes::cube(4), &inside);
}

#[test]
fn bumpy_surface() {
    check_closed("bumpy", &scenes::bumpy(), &points(0.45));
}

#[test]
fn any_size_anywhere() {
    for scale in [1e-3, 1.0, 1e4] {
        for offset in [0.0, 30.0, -1000.0] {
            for mesh in [scenes::sphere(0), scenes::sphere(1)] {
                let place = |p: Vec3| (p + offset) * scale;
                let inside: Vec<Vec3> = points(0.7).into_iter().map(place).collect();
                let name = format!("sphere * {scale} + {offset}");
                check_closed(&name, &scenes::moved(&mesh, place), &inside);
            }
        }
    }
}

/// Both triangles at an edge report the same place.
#[test]
fn neighbours_agree_about_their_edge() {
    let mesh = scenes::sphere(2);
    let mut hits = Vec::new();
    let (mut shared, mut equal) = (0, 0);
    for origin in points(0.9) {
        for &[i, j, _] in mesh.triangles() {
            let [a, b] = [i, j].map(|i| Vec3::from(mesh.positions()[i as usize]));
            let ray = Ray::new(origin, a.midpoint(b) - origin);
            kd_trace::brute_force::hits(&mesh, &ray, usize::MAX, &mut hits);
            if let [first, second] = hits[..] {
                shared += 1;
                equal += usize::from(first.t == second.t);
                assert!(
                    (first.t - second.t).abs() <= 4.0 * f32::EPSILON * first.t,
                    "{} and {}: {}",
                    first.t,
                    second.t,
                    source(&ray)
                );
                if first.t == second.t {
                    assert!(first.triangle < second.triangle, "{}", source(&ray));
                }
            }
        }
    }
    assert!(shared > 100, "only {shared} rays met both triangles");
    assert!(2 * equal > shared, "{equal} of {shared} at the same t");
}
