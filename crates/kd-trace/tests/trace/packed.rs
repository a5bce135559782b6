//! Leaves of every fullness.

use glam::Vec3;
use kd_core::{CostModel, Mesh, Node, Pair, Ray, Slot, Tree};
use kd_trace::{CountedQuery, PackedTree, intersect_counted};

use crate::check::{Subject, check, source};
use crate::rng::Rng;
use crate::scenes::Soup;

/// One leaf that holds all triangles.
fn one_leaf(mesh: &Mesh) -> Tree {
    let count = u32::try_from(mesh.len()).expect("small");
    let leaf = Pair([Node::leaf(0, count).expect("small"), Node::EMPTY_LEAF]);
    let slots = (0..count).map(Slot).collect();
    Tree::from_parts(vec![leaf], slots, mesh.bounds(), count, CostModel::PACKED).expect("valid")
}

/// Triangles in a row along x, each hit by rays of its own.
fn row(triangles: usize) -> Mesh {
    let mut soup = Soup::default();
    for i in 0..triangles {
        let corner = |x: f32, y: f32| Vec3::new(2.0 * i as f32 + x, y, 0.25 * i as f32);
        soup.triangle([corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)]);
    }
    soup.mesh()
}

#[test]
fn every_lane_of_every_block_is_hit_and_none_is_added() {
    for (triangles, blocks) in [(0, 0), (1, 1), (7, 1), (8, 1), (9, 2), (16, 2), (17, 3)] {
        let mesh = row(triangles);
        let subject = Subject::new(&mesh, one_leaf(&mesh));
        let packed = PackedTree::new(&subject, &mesh);
        let bytes = packed.bytes();
        assert_eq!(
            (bytes.nodes, bytes.blocks),
            (16, 320 * blocks),
            "{triangles} triangles"
        );
        for i in 0..triangles + 3 {
            let down = Ray::new([2.0 * i as f32 + 0.25, 0.25, 9.0], [0.0, 0.0, -1.0]);
            let hits = check("row", &mesh, [&subject], &down);
            assert_eq!(hits, usize::from(i < triangles), "{}", source(&down));
        }
        let along = Ray::new([-1.0, 0.3, -0.1625], [1.0, 0.0, 0.125]);
        assert_eq!(
            check("row", &mesh, [&subject], &along),
            triangles,
            "all of them: {}",
            source(&along)
        );
        let (_, counts) = packed.intersect_counted(&along);
        let expected = if triangles == 0 { (0, 0) } else { (1, blocks) };
        assert_eq!(
            (counts.leaves as usize, counts.blocks as usize),
            expected,
            "{counts:?}"
        );
    }
}

/// Where the filter is off, padding gets as far as the decision, and is not hit there either.
#[test]
fn padding_is_not_hit_at_the_end_of_f32() {
    for scale in [1e19_f32, 1e30, 1e37] {
        let mesh = crate::scenes::moved(&row(3), |p| p * scale);
        let subject = Subject::new(&mesh, one_leaf(&mesh));
        let mut rng = Rng(31);
        let mut hit = 0;
        for _ in 0..2000 {
            let target = Vec3::new(6.0 * rng.unit(), rng.unit(), 0.5 * rng.unit()) * scale;
            let origin = scale * rng.direction();
            let ray = Ray::new(origin, target - origin);
            hit += check("row", &mesh, [&subject], &ray);
        }
        assert!(hit > 100, "{scale:e}: {hit} hits");
    }
}

/// The same nodes, leaves and decisions: packing changes nothing but how triangles are looked at.
#[test]
fn counts_are_those_of_the_tree() {
    let mesh = crate::scenes::soup();
    let tree = kd_sah::build(&mesh, &kd_sah::BuildOptions::best()).expect("valid");
    let packed = PackedTree::new(&tree, &mesh);
    let mut rng = Rng(32);
    for _ in 0..1000 {
        let ray = Ray::new(rng.vec3(), rng.direction());
        let (hit, counts) = intersect_counted(&tree, &mesh, &ray);
        let (packed_hit, packed_counts) = packed.intersect_counted(&ray);
        assert_eq!(packed_hit, hit, "{}", source(&ray));
        let without_blocks = kd_trace::TraversalCounts {
            blocks: 0,
            ..packed_counts
        };
        assert_eq!(without_blocks, counts, "{}", source(&ray));
        assert!(
            packed_counts.blocks * 8 >= counts.triangles,
            "{packed_counts:?}"
        );
        let (occluded, _) = packed.occluded_counted(&ray);
        assert_eq!(occluded, hit.is_some(), "{}", source(&ray));
    }
}
