//! Slots of forests: any 32-bit number, also where the slots of a member pass 2³².

use glam::Vec3;
use kd_core::{Hit, Mesh, Ray, RayPacket8};
use kd_oracle::rays::Rays;
use kd_trace::{Join, Level, RayQuery, WideForest, WideTree, brute_force};

use crate::check::source;
use crate::scenes::{Soup, moved};

const ALONG: u8 = 8;
const ROWS: u8 = 5;

/// Triangles side by side, and a copy of some: for every triangle without a copy, a ray hits only that one.
fn field() -> Mesh {
    let mut soup = Soup::default();
    for copy in 0..2 {
        for [x, y] in places().step_by(1 + 3 * copy) {
            let corner = |dx: f32, dy: f32| Vec3::new(x + dx, y + dy, 0.3 * dx);
            soup.triangle([corner(-0.4, -0.4), corner(0.4, -0.4), corner(0.0, 0.4)]);
        }
    }
    soup.mesh()
}

/// The centers of the triangles of the field.
fn places() -> impl Iterator<Item = [f32; 2]> {
    (0..ALONG * ROWS).map(|i| [f32::from(i % ALONG), f32::from(i / ALONG)])
}

/// First slots for a mesh: each of its triangles gets the largest slot once.
fn first_slots(mesh: &Mesh) -> impl Iterator<Item = u32> {
    let count = u32::try_from(mesh.len()).expect("few");
    (0..=count).map(|below| u32::MAX - below).chain([100])
}

/// Compares every query with a test of all triangles, whose slots begin at `first`.
#[track_caller]
fn check(tree: &WideTree, mesh: &Mesh, first: u32, rays: &[Ray]) {
    let place = |ray: &Ray| format!("{}, from {first}: {}", tree.level(), source(ray));
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    let mut closest = Vec::new();
    for ray in rays {
        brute_force::hits(mesh, ray, usize::MAX, &mut expected);
        for hit in &mut expected {
            hit.triangle = hit.triangle.wrapping_add(first);
        }
        expected.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        let hit: Option<Hit> = expected.first().copied();
        assert_eq!(tree.intersect(ray), hit, "{}", place(ray));
        assert_eq!(tree.occluded(ray), hit.is_some(), "{}", place(ray));
        for max in [2, usize::MAX] {
            tree.hits(ray, max, &mut found);
            assert_eq!(found, expected[..max.min(expected.len())], "{}", place(ray));
        }
        closest.push(hit);
    }
    let mut hits = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut hits);
    assert_eq!(hits, closest, "{}, from {first}: batch", tree.level());
    let mut occluded = vec![false; rays.len()];
    tree.occluded_batch(rays, &mut occluded);
    let are_hit = closest.iter().map(Option::is_some);
    assert!(are_hit.eq(occluded), "{}, from {first}", tree.level());
    for (rays, closest) in rays.chunks_exact(8).zip(closest.chunks_exact(8)) {
        let packet = RayPacket8::new(rays);
        let hits = tree.intersect8(&packet);
        assert_eq!(hits, closest, "{}, from {first}: packet", tree.level());
        let occluded = tree.occluded8(&packet);
        assert_eq!(occluded, hits.map(|hit| hit.is_some()), "from {first}");
    }
}

/// Eight coherent rays for each triangle, so that packets stay together down to its block; then others.
fn rays_through(mesh: &Mesh) -> Vec<Ray> {
    let coherent = places().flat_map(|[x, y]| {
        let lanes = (0..8_u8).map(move |lane| x + 0.01 * f32::from(lane));
        lanes.map(move |x| Ray::new([x, y, -4.0], [0.01, 0.02, 1.0]))
    });
    let mut random = Rays::new(mesh, Vec::new(), 48);
    let others = (0..64).map(|_| random.draw());
    coherent.chain(others).collect()
}

#[test]
fn a_triangle_may_have_any_slot() {
    let mesh = field();
    let rays = rays_through(&mesh);
    let tree = WideTree::from_objects(&mesh);
    for level in [Level::detect(), Level::portable()] {
        for first in first_slots(&mesh) {
            let mut forest = WideForest::new().with_level(level);
            forest.push(&tree, first);
            forest.join(Join::default());
            check(forest.tree(), &mesh, first, &rays);
        }
    }
}

#[test]
fn triangles_move_and_are_renumbered_at_any_slot() {
    let before = field();
    let after = moved(&before, |p| p + Vec3::new(0.1, 0.0, 0.2 * p.x));
    let (rays, later) = (rays_through(&before), rays_through(&after));
    let tree = WideTree::from_objects(&before);
    for level in [Level::detect(), Level::portable()] {
        for first in first_slots(&before) {
            let mut forest = WideForest::new().with_level(level);
            forest.push(&tree, 0);
            forest.add_to_slots(0, first);
            forest.refit(0, &after, first);
            forest.join(Join::default());
            check(forest.tree(), &after, first, &later);

            forest.add_to_slots(0, 77_u32.wrapping_sub(first));
            forest.refit(0, &before, 77);
            forest.join(Join::default());
            check(forest.tree(), &before, 77, &rays);
        }
    }
}
