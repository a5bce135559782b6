//! The one place that compares a ray's answers.

use std::ops::Deref;

use kd_core::{Hit, Mesh, NodeView, Ray, Tree};
use kd_oracle::rays::Rays;
pub(crate) use kd_oracle::source;
use kd_trace::{Join, Level, PackedTree, WideForest, WideTree, brute_force, lazy};

use crate::cells::CutTree;

/// A tree and every way to trace it.
pub(crate) struct Subject {
    tree: Tree,
    packed: [PackedTree; 2],
    wide: [WideTree; 3],
    cut: [CutTree; 2],
}

impl Subject {
    pub(crate) fn new(mesh: &Mesh, tree: Tree) -> Self {
        let packed = PackedTree::new(&tree, mesh);
        let portable = packed.clone().with_level(Level::portable());
        // Each way to make it, and each level, once: answers take long to check.
        let by_planes = WideTree::with_planes_above(&tree, mesh, 0);
        Self {
            wide: [
                WideTree::new(&tree, mesh),
                by_planes.with_level(Level::portable()),
                joined(mesh),
            ],
            cut: CutTree::both(&tree, mesh),
            packed: [packed, portable],
            tree,
        }
    }
}

/// Three parts, of which one was refitted and one copied from another forest.
fn joined(mesh: &Mesh) -> WideTree {
    let third = mesh.len().div_ceil(3).max(1);
    let (mut forest, mut other) = (WideForest::new(), WideForest::new());
    let mut first = 0;
    for (number, triangles) in mesh.triangles().chunks(third).enumerate() {
        let part = Mesh::new(mesh.positions().to_vec(), triangles.to_vec());
        let part = part.expect("a part of a mesh");
        let tree = WideTree::from_objects(&part);
        if number == 1 {
            other.push(&tree, 0);
            forest.push_copy(&other, 0);
            forest.add_to_slots(1, first);
            forest.refit(1, &part, first);
        } else {
            forest.push(&tree, first);
        }
        first += u32::try_from(triangles.len()).expect("few");
    }
    forest.join(Join::default());
    forest.tree().clone()
}

impl Deref for Subject {
    type Target = Tree;

    fn deref(&self) -> &Tree {
        &self.tree
    }
}

/// Asks every query about a ray, in each of the trees and in every way, and expects what brute force says. Gives the
/// number of hits.
#[track_caller]
pub(crate) fn check<'a>(
    scene: &str,
    mesh: &Mesh,
    trees: impl IntoIterator<Item = &'a Subject>,
    ray: &Ray,
) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    let mut found = Vec::new();
    for (number, subject) in trees.into_iter().enumerate() {
        let place = |way: &str| format!("{scene}, tree {number}, {way}: {}", source(ray));
        let tree = &subject.tree;
        let closest = kd_trace::intersect(tree, mesh, ray);
        assert_eq!(closest, expected.first().copied(), "{}", place("closest"));
        let occluded = kd_trace::occluded(tree, mesh, ray);
        assert_eq!(occluded, !expected.is_empty(), "{}", place("any"));
        for max in [2, usize::MAX] {
            kd_trace::hits(tree, mesh, ray, max, &mut found);
            let first = &expected[..max.min(expected.len())];
            assert_eq!(found, first, "{}", place("first hits"));
        }
        for packed in &subject.packed {
            let place = |way: &str| place(&format!("packed, {}, {way}", packed.level()));
            let closest = packed.intersect(ray);
            assert_eq!(closest, expected.first().copied(), "{}", place("closest"));
            let occluded = packed.occluded(ray);
            assert_eq!(occluded, !expected.is_empty(), "{}", place("any"));
            packed.hits(ray, 2, &mut found);
            let first = &expected[..expected.len().min(2)];
            assert_eq!(found, first, "{}", place("first hits"));
        }
        for wide in &subject.wide {
            let place = |way: &str| place(&format!("wide, {}, {way}", wide.level()));
            let closest = wide.intersect(ray);
            assert_eq!(closest, expected.first().copied(), "{}", place("closest"));
            let occluded = wide.occluded(ray);
            assert_eq!(occluded, !expected.is_empty(), "{}", place("any"));
            wide.hits(ray, 2, &mut found);
            let first = &expected[..expected.len().min(2)];
            assert_eq!(found, first, "{}", place("first hits"));
        }
        for cut in &subject.cut {
            let place = |way: &str| place(&format!("cut into cells, {way}"));
            let closest = lazy::intersect(cut, ray);
            assert_eq!(closest, expected.first().copied(), "{}", place("closest"));
            let occluded = lazy::occluded(cut, ray);
            assert_eq!(occluded, !expected.is_empty(), "{}", place("any"));
            lazy::hits(cut, ray, 2, &mut found);
            let first = &expected[..expected.len().min(2)];
            assert_eq!(found, first, "{}", place("first hits"));
        }
    }
    expected.len()
}

/// Rays around one mesh and the planes of its trees.
pub(crate) fn rays<'a>(mesh: &'a Mesh, trees: &[Subject], seed: u64) -> Rays<'a> {
    let nodes = trees.iter().flat_map(|tree| tree.nodes().iter());
    let planes = nodes.filter_map(|node| match node.view() {
        NodeView::Interior { axis, split, .. } => Some((axis.index(), split)),
        NodeView::Leaf { .. } => None,
    });
    Rays::new(mesh, planes.collect(), seed)
}

#[test]
fn the_oracle_agrees_with_itself() {
    let mesh = crate::scenes::soup();
    let mut all = Vec::new();
    let mut rng = crate::rng::Rng(8);
    let mut some = 0;
    for _ in 0..2000 {
        let ray = Ray::new(rng.vec3(), rng.direction());
        brute_force::hits(&mesh, &ray, usize::MAX, &mut all);
        assert!(all.is_sorted_by(Hit::is_before), "{}", source(&ray));
        let closest = brute_force::intersect(&mesh, &ray);
        assert_eq!(closest, all.first().copied(), "{}", source(&ray));
        let any = brute_force::occluded(&mesh, &ray);
        assert_eq!(any, !all.is_empty(), "{}", source(&ray));
        let mut two = Vec::new();
        brute_force::hits(&mesh, &ray, 2, &mut two);
        assert_eq!(two, all[..all.len().min(2)], "{}", source(&ray));
        some += usize::from(any);
    }
    assert!(some > 600, "enough of them hit: {some}");
}
