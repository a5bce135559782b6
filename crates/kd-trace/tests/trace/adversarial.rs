//! Trees made by hand, to be awkward.

use kd_core::{Aabb, Axis, CostModel, Mesh, Node, NodeIndex, Pair, Ray, Slot, Tree};
use kd_sah::{BuildOptions, build};
use kd_trace::{intersect, intersect_counted};

use crate::check::{Subject, check, source};
use crate::rng::Rng;
use crate::scenes::{self, Soup};

const INFINITY: f32 = f32::INFINITY;

#[test]
fn a_tree_of_nothing_is_valid() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let empty = Tree::from_parts(
        vec![Pair([Node::EMPTY_LEAF; 2])],
        vec![],
        Aabb::EMPTY,
        0,
        CostModel::CLASSIC,
    )
    .expect("valid");
    let ray = Ray::new([0.0; 3], [1.0; 3]);
    let empty = Subject::new(&mesh, empty);
    assert_eq!(check("empty", &mesh, [&empty], &ray), 0, "nothing there");
}

#[test]
fn counting_changes_nothing_and_the_tree_helps() {
    let mesh = scenes::sphere(2);
    let tree = build(&mesh, &BuildOptions::best()).expect("valid");
    let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
    let (hit, counts) = intersect_counted(&tree, &mesh, &ray);
    assert_eq!(hit, intersect(&tree, &mesh, &ray), "the same hit");
    assert!(hit.is_some(), "it points at the sphere");
    assert!(counts.nodes > 0 && counts.leaves > 0, "{counts:?}");
    assert!(
        counts.decisions >= 1 && counts.decisions <= counts.triangles,
        "{counts:?}"
    );
    assert!(counts.triangles < 40, "a few of 320: {counts:?}");
    let (_, none) = intersect_counted(&tree, &mesh, &Ray::new([3.0; 3], [0.0, 0.0, 1.0]));
    assert_eq!(none, kd_trace::TraversalCounts::default(), "beside the box");
}

/// Rounding corners to 26 bits lets a ray that passes an edge at 1.4e-8 hit. Two planes cut out a cell around the ray
/// that the triangle does not reach into, so that only their pads find it.
#[test]
fn a_hit_beside_its_triangle_is_found() {
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| scenes::turned(axis, [x, y, z]);
        let mut soup = Soup::default();
        // One edge runs through the origin.
        soup.triangle([
            turned(-1.1, -0.75, 0.0),
            turned(1.1, 0.75, 0.0),
            turned(-1.1, 0.75, 0.0),
        ]);
        let mesh = soup.mesh();
        let interior = |axis: usize, split, first| {
            Node::interior(Axis::ALL[axis % 3], split, NodeIndex(first)).expect("small")
        };
        let leaf = |first| Node::leaf(first, 1).expect("small");
        let pairs = vec![
            Pair([interior(axis, 9e-9, 2), Node::EMPTY_LEAF]),
            Pair([leaf(0), interior(axis + 1, 5e-9, 4)]),
            Pair([Node::EMPTY_LEAF, leaf(1)]),
        ];
        let refs = vec![Slot(0); 2];
        let tree = Tree::from_parts(pairs, refs, mesh.bounds(), 1, CostModel::CLASSIC);
        let tree = Subject::new(&mesh, tree.expect("valid"));
        assert_eq!(tree.check_coverage(&mesh), Ok(()), "nothing is missing");
        for sign in [1.0, -1.0] {
            let ray = Ray::new(turned(1.4e-8, 0.0, -3.0 * sign), turned(0.0, 0.0, sign));
            assert_eq!(check("beside", &mesh, [&tree], &ray), 1, "{}", source(&ray));
        }
    }
}

/// With one leaf, each triangle is looked at; only about those that a ray's line meets are not rejected early.
#[test]
fn the_filter_is_worth_having() {
    let mesh = scenes::soup();
    let slots: Vec<Slot> = (0..250).map(Slot).collect();
    let leaf = Pair([Node::leaf(0, 250).expect("small"), Node::EMPTY_LEAF]);
    let tree = Tree::from_parts(vec![leaf], slots, mesh.bounds(), 250, CostModel::CLASSIC);
    let tree = Subject::new(&mesh, tree.expect("valid"));
    let mut rng = Rng(15);
    let (mut hit, mut decided) = (0, 0);
    for _ in 0..1000 {
        let ray = Ray::new(rng.vec3(), rng.direction()).with_range(-INFINITY, INFINITY);
        hit += check("one leaf", &mesh, [&tree], &ray);
        let (_, counts) = intersect_counted(&tree, &mesh, &ray);
        assert_eq!(
            (counts.leaves, counts.triangles),
            (1, 250),
            "{}",
            source(&ray)
        );
        decided += counts.decisions as usize;
    }
    assert!(hit > 500, "{hit} hits");
    assert!(decided < hit + hit / 100, "{decided} decided, {hit} hit");
}
