//! Limits of memory and depth, and determinism.

use std::sync::Arc;

use glam::Vec3;
use kd_comparators::{CellOptions, CellStats, ComparatorError, Octree, PolygonBsp};
use kd_core::Mesh;
use kd_scene::Spd;

use crate::check::Pair;
use crate::rng::Rng;
use crate::scenes::{self, Soup};

fn both(mesh: Mesh, options: &CellOptions) -> [CellStats; 2] {
    Pair::new(&Arc::new(mesh), options).stats()
}

#[test]
fn options_out_of_range_are_refused() {
    let mesh = Arc::new(scenes::cube(1));
    let options = CellOptions::default().with_max_depth(65);
    let octree = Octree::build(Arc::clone(&mesh), &options).err();
    let bsp = PolygonBsp::build(Arc::clone(&mesh), &options).err();
    let refused = |error| {
        matches!(
            error,
            Some(ComparatorError::InvalidOption {
                name: "max_depth",
                ..
            })
        )
    };
    assert!(refused(octree) && refused(bsp), "both of them");
}

#[test]
fn coincident_triangles_are_not_divided() {
    let mut soup = Soup::default();
    for _ in 0..200_000 {
        soup.triangle([Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.9, 0.4)]);
    }
    let mesh = soup.mesh();
    let triangles = mesh.len();
    let [octree, bsp] = both(mesh, &CellOptions::default());
    assert!(octree.references <= 4 * triangles, "{octree:?}");
    assert_eq!((bsp.references, bsp.depth), (triangles, 1), "one plane");
}

/// Each sliver is as long as the box, so that each division adds many references.
#[test]
fn huge_slivers_end_at_the_limit() {
    let mut rng = Rng(12);
    let mut soup = Soup::default();
    for _ in 0..2000 {
        let (a, b) = (rng.vec3(), rng.vec3());
        soup.triangle([a, b, a + 1e-4 * rng.vec3()]);
    }
    let mesh = soup.mesh();
    for (refs, options) in [
        (16, CellOptions::default()),
        (
            3,
            CellOptions::default().with_max_refs(3 * mesh.len() as u64),
        ),
        (1, CellOptions::default().with_max_refs(0)),
    ] {
        for stats in both(mesh.clone(), &options) {
            assert!(stats.references <= refs * mesh.len(), "{stats:?}");
            assert!(stats.large_leaves > 0, "the limit is reported: {stats:?}");
        }
    }
}

#[test]
fn no_depth_is_one_leaf() {
    let mesh = scenes::soup();
    for stats in both(mesh.clone(), &CellOptions::default().with_max_depth(0)) {
        let sizes = (stats.nodes, stats.leaves, stats.depth, stats.references);
        assert_eq!(sizes, (1, 1, 0, mesh.len()), "all in one");
    }
}

/// Dense regions are divided finely, and empty ones not at all: a uniform division as fine has 2⁴⁸ cells.
#[test]
fn empty_octants_cost_nothing() {
    let object = scenes::moved(&scenes::sphere(3), |p| 1e-3 * p + 5.3);
    let mut walls = Soup::default();
    walls.cuboid(Vec3::splat(-70.0), Vec3::splat(70.0));
    let mesh = Mesh::concatenated([&object, &walls.mesh()]).expect("few");
    let triangles = mesh.len();
    let [octree, _] = both(mesh, &CellOptions::default());
    assert!(octree.nodes < 4 * triangles, "{octree:?}");
    assert!(octree.depth > 12, "{octree:?}");
}

#[test]
fn the_same_mesh_gives_the_same_structure() {
    let mesh = Arc::new(Spd::Gears.generate(1).expect("valid").mesh);
    let options = CellOptions::default();
    let text = || {
        let octree = Octree::build(Arc::clone(&mesh), &options).expect("valid");
        let bsp = PolygonBsp::build(Arc::clone(&mesh), &options).expect("valid");
        format!("{octree:?}{bsp:?}")
    };
    assert_eq!(text(), text(), "down to each node");
}
