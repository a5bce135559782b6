//! Eight rays together: every lane answers as brute force does for its ray alone.

use glam::Vec3;
use kd_core::{Mesh, Ray, RayPacket8};
use kd_sah::{BuildOptions, build};
use kd_trace::{PackedTree, RayQuery, WideTree, brute_force};

use crate::check::{self, Subject, source};
use crate::rng::Rng;
use crate::scenes::{self, moved, soup, sphere};
use crate::tiles::{BUNDLES, bundle, levels};

/// Asks for the closest hits and for any, at every level, and gives the number of hits.
#[track_caller]
fn check(scene: &str, mesh: &Mesh, trees: &[WideTree], rays: &[Ray]) -> usize {
    let expected: Vec<_> = rays
        .iter()
        .map(|ray| brute_force::intersect(mesh, ray))
        .collect();
    for (rays, expected) in rays.chunks(8).zip(expected.chunks(8)) {
        let packet = RayPacket8::new(rays);
        for tree in trees {
            let (hits, occluded) = (tree.intersect8(&packet), tree.occluded8(&packet));
            for lane in 0..8 {
                let place = || {
                    let rays: Vec<String> = rays.iter().map(source).collect();
                    format!("{scene}, {}, lane {lane} of {rays:#?}", tree.level())
                };
                let expected = expected.get(lane).copied().flatten();
                assert_eq!(hits[lane], expected, "closest in {}", place());
                assert_eq!(occluded[lane], expected.is_some(), "any in {}", place());
            }
        }
    }
    expected.iter().flatten().count()
}

#[test]
fn lanes_answer_as_if_alone() {
    let mut rng = Rng(91);
    for (scene, mesh) in scenes::all() {
        if mesh.is_empty() {
            continue;
        }
        let trees = levels(&mesh);
        let mut hits = 0;
        for kind in BUNDLES {
            for width in [0.0, 1e-6, 1e-3, 0.01, 0.05, 0.2, 1.0] {
                let count = 5 + rng.below(30);
                hits += check(
                    scene,
                    &mesh,
                    &trees,
                    &bundle(kind, count, width, &mesh, &mut rng),
                );
            }
        }
        assert!(hits > 20, "{scene}: {hits} hits");
    }
}

#[test]
fn hard_rays_in_lanes() {
    for (scene, mesh) in scenes::all() {
        if mesh.is_empty() {
            continue;
        }
        let trees = levels(&mesh);
        let subject = Subject::new(
            &mesh,
            build(&mesh, &BuildOptions::default()).expect("valid"),
        );
        let mut rays = check::rays(&mesh, std::slice::from_ref(&subject), 92);
        let rays: Vec<Ray> = (0..1000).map(|_| rays.draw()).collect();
        let hits = check(scene, &mesh, &trees, &rays);
        assert!(hits > 50, "{scene}: {hits} hits");
    }
}

/// Neighbors, some of which cannot hit anything, end early, begin behind the mesh, or go another way.
#[test]
fn lanes_need_not_be_alike() {
    let mesh = sphere(4);
    let trees = levels(&mesh);
    let mut rng = Rng(93);
    let mut hits = 0;
    for _ in 0..200 {
        let width = rng.pick(&[1e-3, 0.03, 0.1]);
        let kind = rng.pick(&BUNDLES);
        let mut rays = bundle(kind, 8, width, &mesh, &mut rng);
        for ray in &mut rays {
            match rng.below(12) {
                0 => ray.mask = 0,
                1 => ray.origin.x = f32::NAN,
                2 => ray.direction = Vec3::ZERO,
                3 => *ray = ray.with_range(f32::NEG_INFINITY, f32::INFINITY),
                4 => *ray = ray.with_range(0.5, 0.4),
                5 => ray.direction *= 1e-30,
                6 => ray.direction = -ray.direction,
                7 => ray.direction.y = -0.0,
                8 => ray.t_max = f32::NAN,
                9 => ray.origin *= 1e20,
                _ => {}
            }
        }
        hits += check("sphere", &mesh, &trees, &rays);
    }
    assert!(hits > 300, "{hits} hits");
}

#[test]
fn lanes_at_every_scale() {
    let mut rng = Rng(94);
    for scale in [1e-30_f32, 1e-15, 1e-6, 1e6, 1e15, 1e30] {
        let mesh = moved(&soup(), |p| p * scale);
        let trees = levels(&mesh);
        let mut hits = 0;
        for kind in BUNDLES {
            for length in [1.0, 1.0 / scale.clamp(1e-18, 1e18)] {
                let mut rays = bundle(kind, 40, 0.05, &mesh, &mut rng);
                for ray in &mut rays {
                    ray.direction *= length;
                }
                hits += check("soup", &mesh, &trees, &rays);
            }
        }
        assert!(hits > 20, "{scale:e}: {hits} hits");
    }
}

#[test]
fn packed_leaves_take_lanes_too() {
    let mesh = sphere(3);
    let tree = build(&mesh, &BuildOptions::default()).expect("valid");
    let packed = PackedTree::new(&tree, &mesh);
    let rays = bundle(BUNDLES[0], 7, 0.1, &mesh, &mut Rng(95));
    let packet = RayPacket8::new(&rays);
    let (hits, occluded) = (packed.intersect8(&packet), packed.occluded8(&packet));
    for (lane, ray) in rays.iter().enumerate() {
        assert_eq!(
            hits[lane],
            brute_force::intersect(&mesh, ray),
            "lane {lane}"
        );
        assert_eq!(occluded[lane], hits[lane].is_some(), "lane {lane}");
    }
    assert!(hits[7].is_none() && !occluded[7], "no ray");
}
