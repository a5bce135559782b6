//! Wide nodes: leaves of every fullness, what cannot be divided, and that threads do not show.

use glam::Vec3;
use kd_core::{Arena, CostModel, Node, Pair, Ray, Slot, Tree};
use kd_sah::{BuildOptions, build};
use kd_trace::{CountedQuery, Division, RayQuery, WideTree};

use crate::check::{Subject, check, source};
use crate::rng::Rng;
use crate::scenes::{Soup, soup};

/// Triangles in pairs at one place, each pair a little further along z.
fn pile(triangles: usize) -> kd_core::Mesh {
    let mut pile = Soup::default();
    for i in 0..triangles {
        // A pile of pairs, so that there are equal distances too.
        let z = (i / 2) as f32;
        pile.triangle([
            Vec3::new(-1.0, -1.0, z),
            Vec3::new(1.0, -1.0, -z),
            Vec3::new(0.0, 1.0, 0.0),
        ]);
    }
    pile.mesh()
}

#[test]
fn what_cannot_be_divided_is_dealt_out() {
    // About the size of a leaf, of eight, and of more.
    for triangles in [1, 7, 8, 9, 24, 25, 55, 56, 57, 64, 65, 449, 1030] {
        let mesh = pile(triangles);
        let tree = build(&mesh, &BuildOptions::best()).expect("valid");
        let subject = Subject::new(&mesh, tree);
        let mut rng = Rng(41);
        for _ in 0..20 {
            let target = Vec3::new(0.2 * rng.unit(), 0.2 * rng.unit(), 0.0);
            let origin = target + Vec3::new(0.1 * rng.unit(), 0.0, -900.0);
            let ray = Ray::new(origin, target - origin);
            let hits = check("pile", &mesh, [&subject], &ray);
            assert_eq!(hits, triangles, "{}", source(&ray));
        }
    }
}

/// Enough triangles for several tasks, and planes above a cell of them.
#[test]
fn threads_do_not_show() {
    let mut field = Soup::default();
    for i in 0..60_000_u16 {
        let (x, y) = (f32::from(i % 250), f32::from(i / 250));
        let z = f32::from(i % 13);
        field.triangle([
            Vec3::new(x, y, 0.0),
            Vec3::new(x + 1.5, y, z),
            Vec3::new(x, y + 0.5, z),
        ]);
    }
    let mesh = field.mesh();
    let tree = build(&mesh, &BuildOptions::fast()).expect("valid");
    let of_kd_tree =
        |is_parallel| WideTree::of_kd_tree(&tree, &mesh, is_parallel, None).expect("not cancelled");
    let (one, many) = (of_kd_tree(false), of_kd_tree(true));
    assert!(one == many, "the same to the bit");
    assert!(one.bytes().nodes > 256 * 1000, "{:?}", one.bytes());
    let most_references = 2 * mesh.len() as u64;
    let mut references = Vec::new();
    for division in [
        Division::Objects,
        Division::Planes { most_references },
        Division::Cheapest { most_references },
    ] {
        let build = |is_parallel| {
            WideTree::build(&mesh, division, is_parallel, None).expect("not cancelled")
        };
        let (one, many) = (build(false), build(true));
        assert!(one == many, "{division:?}: the same to the bit");
        references.push(one.stats(&mesh).references);
    }
    assert!(
        references[0] < references[1],
        "planes cut triangles: {references:?}"
    );
}

#[test]
fn what_misses_the_box_of_one_leaf_looks_at_no_triangle() {
    let mesh = pile(3);
    let tree = build(&mesh, &BuildOptions::default()).expect("valid");
    let wide = WideTree::new(&tree, &mesh);
    let past = Ray::new([9.0, 9.0, -9.0], [0.0, 0.0, 1.0]);
    let (hit, counts) = wide.intersect_counted(&past);
    assert_eq!((hit, counts.blocks), (None, 0), "{counts:?}");
    let through = Ray::new([0.0, 0.0, -9.0], [0.0, 0.0, 1.0]);
    let (hit, counts) = wide.intersect_counted(&through);
    assert!(hit.is_some() && counts.blocks == 1, "{hit:?} {counts:?}");
}

/// A tree may be over a part of an arena: what its root does not reach is not in it.
#[test]
fn what_the_root_does_not_reach_is_not_hit() {
    let mesh = pile(2);
    let leaf = Node::leaf(0, 1).expect("small");
    let pairs = [Pair([leaf, Node::EMPTY_LEAF])];
    let mut arena = Arena::new();
    arena.append(&pairs, &[Slot(0)]).expect("small");
    let root = arena.append(&pairs, &[Slot(1)]).expect("small");
    arena.freeze(2).expect("valid");
    let tree = Tree::from_arena(arena, root, mesh.bounds(), CostModel::PACKED).expect("valid");
    let through = Ray::new([0.0, 0.0, -9.0], [0.0, 0.0, 1.0]);
    let (mut hits, mut expected) = (Vec::new(), Vec::new());
    kd_trace::hits(&tree, &mesh, &through, usize::MAX, &mut expected);
    assert_eq!(expected.len(), 1, "the other one is below another root");
    WideTree::new(&tree, &mesh).hits(&through, usize::MAX, &mut hits);
    assert_eq!(hits, expected, "the same one");
}

#[test]
fn steps_are_counted() {
    let mesh = soup();
    let tree = build(&mesh, &BuildOptions::default()).expect("valid");
    let wide = WideTree::new(&tree, &mesh);
    let mut rng = Rng(44);
    for _ in 0..500 {
        let ray = Ray::new(rng.vec3(), rng.direction());
        let (hit, counts) = wide.intersect_counted(&ray);
        assert_eq!(hit, wide.intersect(&ray), "{}", source(&ray));
        assert!(
            counts.leaves <= counts.blocks && counts.triangles <= 8 * counts.blocks,
            "{counts:?}"
        );
        assert!(
            hit.is_none() || counts.nodes > 0 && counts.decisions > 0,
            "{counts:?}"
        );
        let (occluded, any) = wide.occluded_counted(&ray);
        assert_eq!(occluded, hit.is_some(), "{}", source(&ray));
        assert!(
            any.nodes <= counts.nodes || hit.is_some(),
            "{any:?} {counts:?}"
        );
    }
}
