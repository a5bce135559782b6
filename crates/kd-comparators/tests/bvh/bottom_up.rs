//! With a window over all clusters, clustering along the curve equals clustering of all pairs.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhMethod, BvhNodeView, BvhOptions};
use kd_core::{Aabb, Mesh};

use crate::scenes;

/// The triangles of each group, if the two clusters with the smallest common box are merged again and again.
fn naive(mesh: &Mesh) -> Vec<Vec<u32>> {
    let all = 0..u32::try_from(mesh.len()).expect("few");
    let mut free: Vec<(Aabb, Vec<u32>)> = all
        .map(|t| (Aabb::around(mesh.corners(t)), vec![t]))
        .collect();
    let mut groups = Vec::new();
    while free.len() > 1 {
        let mut best = (f64::INFINITY, 0, 0);
        for i in 0..free.len() {
            for j in 0..i {
                let area = free[i].0.union(&free[j].0).half_area();
                if area < best.0 {
                    best = (area, i, j);
                }
            }
        }
        let (_, i, j) = best;
        let (bounds, triangles) = free.swap_remove(i);
        free[j].0 = free[j].0.union(&bounds);
        free[j].1.extend(triangles);
        free[j].1.sort_unstable();
        groups.push(free[j].1.clone());
    }
    groups.sort();
    groups
}

/// The triangles below each interior node.
fn groups(bvh: &Bvh, place: u32, groups: &mut Vec<Vec<u32>>) -> Vec<u32> {
    match bvh.nodes()[place as usize].view() {
        BvhNodeView::Leaf { first, count } => {
            bvh.triangles()[first as usize..][..count as usize].to_vec()
        }
        BvhNodeView::Interior { second, .. } => {
            let mut triangles = self::groups(bvh, place + 1, groups);
            triangles.extend(self::groups(bvh, second, groups));
            triangles.sort_unstable();
            groups.push(triangles.clone());
            triangles
        }
    }
}

fn build(mesh: &Arc<Mesh>, radius: u16, max_leaf: u32) -> Bvh {
    let options = BvhOptions::new()
        .with_method(BvhMethod::BottomUp { radius })
        .with_max_leaf(max_leaf);
    Bvh::build(Arc::clone(mesh), &options).expect("valid options")
}

#[test]
fn a_window_over_all_clusters_finds_the_smallest_boxes() {
    for seed in 0..30 {
        let mesh = Arc::new(scenes::confetti(
            2 + usize::try_from(seed).expect("few") * 3,
            seed,
        ));
        let bvh = build(&mesh, 100, 1);
        let mut found = Vec::new();
        groups(&bvh, 0, &mut found);
        found.sort();
        assert_eq!(found, naive(&mesh), "seed {seed}");
    }
}

#[test]
fn leaves_are_where_they_cost_less() {
    for (name, mesh) in scenes::generated() {
        let cost = |max_leaf| build(&mesh, 16, max_leaf).stats().sah_cost_own;
        let (single, few) = (cost(1), cost(8));
        assert!(few < single, "{name}: {few}, {single} without");
    }
}
