//! Batches of rays that go their own ways, in streams and queues: every answer is that of brute force, whichever rays are on their
//! way together.

use glam::Vec3;
use kd_core::{Mesh, Ray};
use kd_sah::{BuildOptions, build};

use crate::check::{self, Subject};
use crate::rng::Rng;
use crate::scenes::{self, sphere};
use crate::tiles::{check, levels};

/// Many: the first batch through a tree is traced as streams, in turns and one by one, to measure which is fastest. Then fewer than are
/// traced together, as many and a few more.
const COUNTS: [usize; 6] = [3000, 1, 95, 96, 97, 500];

#[test]
fn hard_rays() {
    for (scene, mesh) in scenes::all() {
        if mesh.is_empty() {
            continue;
        }
        let trees = levels(&mesh);
        let subject = Subject::new(
            &mesh,
            build(&mesh, &BuildOptions::default()).expect("valid"),
        );
        let mut rays = check::rays(&mesh, std::slice::from_ref(&subject), 81);
        let mut hits = 0;
        for count in COUNTS {
            let rays: Vec<Ray> = (0..count).map(|_| rays.draw()).collect();
            hits += check(scene, &mesh, &trees, &rays);
        }
        assert!(hits > 50, "{scene}: {hits} hits");
    }
}

#[test]
fn through_nothing() {
    let mesh = Mesh::new(Vec::new(), Vec::new()).expect("valid");
    let trees = levels(&mesh);
    let rays: Vec<Ray> = (0..100)
        .map(|_| Ray::new(Vec3::ZERO, Vec3::splat(1.0)))
        .collect();
    assert_eq!(check("nothing", &mesh, &trees, &rays), 0, "no triangles");
}

/// All that are given cannot hit anything, or all but one.
#[test]
fn rays_that_cannot_hit() {
    let mesh = sphere(3);
    let trees = levels(&mesh);
    let mut rng = Rng(82);
    let towards = |rng: &mut Rng| {
        let origin = 3.0 * rng.direction();
        Ray::new(origin, 0.2 * rng.vec3() - origin)
    };
    let mut rays: Vec<Ray> = (0..200).map(|_| towards(&mut rng).with_mask(0)).collect();
    assert_eq!(check("sphere", &mesh, &trees, &rays), 0, "masked");
    rays[150] = towards(&mut rng);
    assert_eq!(check("sphere", &mesh, &trees, &rays), 1, "all but one");
}

/// Runs that are tiles between others that are not.
#[test]
fn between_tiles() {
    let mesh = sphere(4);
    let trees = levels(&mesh);
    let mut rng = Rng(83);
    let mut hits = 0;
    for _ in 0..20 {
        let mut rays = Vec::new();
        while rays.len() < 64 * 6 {
            let (from, to) = (3.0 * rng.direction(), 0.8 * rng.vec3());
            let width = rng.pick(&[0.01, 1.0]);
            rays.extend((0..64).map(|_| Ray::new(from, to + width * rng.vec3() - from)));
        }
        rays.truncate(64 * 5 + rng.below(64));
        hits += check("sphere", &mesh, &trees, &rays);
    }
    assert!(hits > 2000, "{hits} hits");
}
