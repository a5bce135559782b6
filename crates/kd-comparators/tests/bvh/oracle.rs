//! Every query of every hierarchy equals brute force.

use std::sync::Arc;

use glam::Vec3;
use kd_core::{Mesh, Ray};
use kd_oracle::effort;
use kd_oracle::rays::that_cannot_hit;
use kd_trace::RayQuery as _;

use crate::check::{self, Pair, check};
use crate::scenes;

const RAYS: usize = effort::count(1_000, 10_000);

/// Traces rays. Returns the number that hit.
#[track_caller]
fn check_rays(name: &str, mesh: &Arc<Mesh>, count: usize) -> usize {
    let pairs = Pair::all(mesh);
    let mut rays = check::rays(mesh, &pairs, 1);
    for ray in that_cannot_hit() {
        assert_eq!(check(name, mesh, &pairs, &ray), 0, "{name}: {ray:?}");
    }
    (0..count)
        .filter(|_| check(name, mesh, &pairs, &rays.draw()) > 0)
        .count()
}

#[test]
fn generated_scenes() {
    for (name, mesh) in scenes::generated() {
        let hit = check_rays(name, &mesh, RAYS);
        assert!(hit > RAYS / 3, "{name}: {hit} hit");
    }
}

#[test]
fn nasty_scenes() {
    for (name, mesh) in scenes::nasty() {
        let hit = check_rays(name, &mesh, RAYS);
        // Far from the origin few coordinates differ, and at the limits of f32 most rays are not finite.
        let least = if name == "largest" {
            RAYS / 100
        } else {
            RAYS / 20
        };
        assert!(hit > least, "{name}: {hit} hit");
    }
}

#[test]
fn an_empty_hierarchy_has_no_nodes() {
    let mesh = Arc::new(scenes::soup(&[]));
    let pairs = Pair::all(&mesh);
    for Pair { bvh, .. } in pairs {
        assert!(bvh.nodes().is_empty() && bvh.bounds().is_empty(), "{bvh:?}");
        let stats = bvh.stats();
        assert_eq!((stats.nodes, stats.sah_cost_15_20), (0, 0.0), "{stats}");
    }
}

/// A ray through a row of triangles tests only the first of them.
#[test]
fn triangles_behind_a_hit_are_skipped() {
    let row: Vec<[Vec3; 3]> = (0..512)
        .map(|i| [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, i as f32)))
        .collect();
    let mesh = Arc::new(scenes::soup(&row));
    for Pair { bvh, options, .. } in Pair::all(&mesh) {
        // A leaf of one of the options holds up to a hundred.
        let in_leaf = bvh.stats().references.div_ceil(bvh.stats().leaves);
        for (start, direction) in [(-3.0, 1.0), (600.0, -1.0)] {
            let ray = Ray::new([0.01, 0.02, start], [0.0, 0.0, direction]);
            let (hit, counts) = bvh.intersect_counted(&ray);
            assert_eq!(hit, bvh.intersect(&ray), "counting changes nothing");
            assert!(hit.is_some(), "straight ahead");
            let most = 2 * in_leaf as u64;
            assert!(
                counts.triangles <= most,
                "{options:?}, {counts:?}, {in_leaf}"
            );
            // On the path to one leaf, two at each node.
            let most = 1 + 2 * bvh.stats().depth as u64;
            assert!(counts.ray_boxes <= most, "{options:?}, {counts:?}");

            let mut hits = [None; 20];
            let counts = bvh.intersect_batch_counted(&[ray; 20], &mut hits);
            let most = 20 * 2 * in_leaf as u64;
            assert!(counts.triangles <= most, "packet, {options:?}, {counts:?}");
        }
    }
}

#[test]
fn rays_beside_the_mesh_take_one_box() {
    let mesh = Arc::new(scenes::sphere(3));
    for Pair { bvh, .. } in Pair::all(&mesh) {
        let beside = Ray::new([3.0; 3], [0.0, 0.0, 1.0]);
        let (hit, counts) = bvh.intersect_counted(&beside);
        assert_eq!(hit, None, "beside");
        assert_eq!((counts.ray_boxes, counts.triangles), (1, 0), "the root's");
    }
}
