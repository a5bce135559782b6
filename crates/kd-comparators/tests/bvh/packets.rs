//! Packets answer as their rays do, and compare fewer boxes.

use std::sync::Arc;

use glam::Vec3;
use kd_comparators::{Bvh, BvhCounts, BvhOptions};
use kd_core::{Mesh, Ray};
use kd_oracle::rays::that_cannot_hit;
use kd_scene::{Camera, View};
use kd_trace::RayQuery as _;

use crate::check::{self, Pair};
use crate::rng::Rng;
use crate::scenes;

/// Traces rays in packets and one by one. Returns the number that hit.
#[track_caller]
pub(crate) fn check_packet(name: &str, bvh: &Bvh, rays: &[Ray]) -> usize {
    let one_by_one: Vec<_> = rays.iter().map(|ray| bvh.intersect(ray)).collect();
    // Earlier contents must not stay.
    let mut hits = vec![one_by_one.iter().find_map(|hit| *hit); rays.len()];
    bvh.intersect_batch(rays, &mut hits);
    for ((ray, hit), expected) in rays.iter().zip(&hits).zip(&one_by_one) {
        assert_eq!(hit, expected, "{name}: {ray:?}");
    }
    let mut occluded = vec![true; rays.len()];
    bvh.occluded_batch(rays, &mut occluded);
    for ((ray, any), expected) in rays.iter().zip(&occluded).zip(&one_by_one) {
        assert_eq!(*any, expected.is_some(), "{name}, any: {ray:?}");
    }
    one_by_one.iter().filter(|hit| hit.is_some()).count()
}

/// 64 tiles of 16 × 16 pixels, side by side in a picture of 128 × 128, or apart from each other in a larger one.
fn tiles(view: &View, pixels: u32) -> impl Iterator<Item = Vec<Ray>> {
    (0..64).map(move |number| {
        let [column, row] = [number % 8, number / 8].map(|tile| tile * pixels / 8);
        let in_tile = (0..256).map(|pixel| (column + pixel % 16, row + pixel / 16));
        let rays =
            in_tile.map(|(x, y)| Ray::new(view.eye, view.through_pixel(x, y, pixels, pixels)));
        rays.collect()
    })
}

/// A camera that sees all of a mesh.
fn view(mesh: &Mesh) -> View {
    Camera::looking_at_whole(mesh.bounds(), Vec3::Y).view(1.0)
}

#[test]
fn packets_of_pictures_answer_as_their_rays() {
    for (name, mesh) in scenes::generated() {
        let view = view(&mesh);
        let mut hit = 0;
        for Pair { bvh, .. } in Pair::all(&mesh) {
            for rays in tiles(&view, 128) {
                hit += check_packet(name, &bvh, &rays);
            }
        }
        assert!(hit > 5000, "{name}: {hit} hit");
    }
}

#[test]
fn mixed_rays_answer_as_they_do_alone() {
    for (name, mesh) in scenes::nasty().into_iter().chain(scenes::generated()) {
        let pairs = Pair::all(&mesh);
        let mut source = check::rays(&mesh, &pairs, 5);
        let mut rng = Rng(6);
        for length in [0, 1, 2, 3, 4, 5, 31, 256, 257, 600] {
            let mut rays: Vec<Ray> = (0..length).map(|_| source.draw()).collect();
            if length > 20 {
                rays.splice(7..7, that_cannot_hit());
            }
            for Pair { bvh, .. } in &pairs {
                check_packet(name, bvh, &rays);
            }
        }
        // Of one origin or about one direction, with ranges that end at a hit or just before it.
        for _ in 0..15 {
            let base = source.draw();
            let spread = rng.pick(&[0.0, 1e-6, 1e-3, 0.1]);
            let rays: Vec<Ray> = (0..64)
                .map(|_| {
                    let nudge = spread * rng.vec3();
                    let direction = base.direction + nudge * base.direction.abs().max_element();
                    let ray = Ray::new(base.origin, direction);
                    match pairs[0].bvh.intersect(&ray) {
                        Some(hit) if rng.below(3) == 0 => rng.pick(&[
                            ray.with_range(hit.t, hit.t),
                            ray.with_range(0.0, hit.t),
                            ray.with_range(0.0, hit.t.next_down()),
                        ]),
                        _ => ray,
                    }
                })
                .collect();
            for Pair { bvh, .. } in &pairs {
                check_packet(name, bvh, &rays);
            }
        }
    }
}

/// The counts of a packet, and the sum of its rays one by one.
fn counts(bvh: &Bvh, rays: &[Ray]) -> (BvhCounts, BvhCounts) {
    let mut alone = BvhCounts::default();
    for ray in rays {
        let (_, counts) = bvh.intersect_counted(ray);
        alone.ray_boxes += counts.ray_boxes;
        alone.triangles += counts.triangles;
    }
    let mut hits = vec![None; rays.len()];
    (bvh.intersect_batch_counted(rays, &mut hits), alone)
}

/// Two triangles, far apart: one in front of all rays, the other missed by all.
#[test]
fn each_step_compares_the_expected_boxes() {
    let at =
        |x: f32| [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(x + y, z, 4.0));
    let mesh = scenes::soup(&[at(0.0), at(40.0)]);
    let options = BvhOptions::new().with_max_leaf(1);
    let bvh = Bvh::build(mesh, &options).expect("valid options");
    assert_eq!(bvh.nodes().len(), 3, "a root and two leaves");
    let rays: Vec<Ray> = (0..100)
        .map(|i| Ray::new([0.0; 3], [0.001 * i as f32, 0.05, 1.0]))
        .collect();
    let (packet, alone) = counts(&bvh, &rays);
    // The root and both leaves, each.
    assert_eq!((alone.ray_boxes, alone.triangles), (300, 100), "one by one");
    // Each ray with the root; the first ray with the root again; all rays with the leaf in front; the first ray and the packet
    // with the other leaf.
    assert_eq!(packet.ray_boxes, 100 + 1 + 100 + 1, "{packet:?}");
    assert_eq!(
        (packet.packet_boxes, packet.triangles),
        (1, 100),
        "{packet:?}"
    );

    // Mirrored rays, mixed in, become a second packet with the same counts.
    let mirrored = |ray: &Ray| Ray::new(ray.origin, ray.direction * Vec3::new(-1.0, 1.0, 1.0));
    let mixed: Vec<Ray> = rays.iter().flat_map(|ray| [*ray, mirrored(ray)]).collect();
    let (both, _) = counts(&bvh, &mixed);
    assert_eq!(both.ray_boxes, 2 * packet.ray_boxes, "{both:?}");
    assert_eq!(both.packet_boxes, 2 * packet.packet_boxes, "{both:?}");

    // The first ten rays miss the leaf, and are skipped below.
    let away = (0..10).map(|_| Ray::new([0.0; 3], [4.9, 0.05, 1.0]));
    let rays: Vec<Ray> = away.chain(rays).collect();
    let (packet, _) = counts(&bvh, &rays);
    assert_eq!(packet.triangles, 100, "{packet:?}");
    // In the leaf in front the bounds do not decide: ten rays that miss, one that hits, then the 99 others.
    assert_eq!(packet.ray_boxes, 110 + 1 + (11 + 99) + 1, "{packet:?}");
    assert_eq!(packet.packet_boxes, 2, "{packet:?}");
}

/// Packets save little where triangles are much smaller than tiles or most rays miss, and much elsewhere.
#[test]
fn coherent_packets_compare_fewer_boxes() {
    let scenes = scenes::generated();
    let mut ratios = Vec::new();
    for (name, mesh) in &scenes {
        let view = view(mesh);
        let bvh = Bvh::build(Arc::clone(mesh), &BvhOptions::new()).expect("valid options");
        let (mut together, mut alone) = (0, 0);
        for rays in tiles(&view, 1024) {
            let (packet, single) = counts(&bvh, &rays);
            together += packet.ray_boxes + 2 * packet.packet_boxes;
            alone += single.ray_boxes;
        }
        ratios.push((name, together as f64 / alone as f64));
    }
    assert!(ratios.iter().all(|(_, ratio)| *ratio < 1.1), "{ratios:?}");
    let most = ratios.iter().filter(|(_, ratio)| *ratio < 0.5).count();
    assert!(most >= 4, "{ratios:?}");
}

#[test]
#[should_panic(expected = "one hit per ray")]
fn slices_are_of_one_length() {
    let mesh = scenes::confetti(3, 1);
    let bvh = Bvh::build(mesh, &BvhOptions::new()).expect("valid options");
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    bvh.intersect_batch(&[ray], &mut []);
}
