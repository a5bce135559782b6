//! The one place that compares a ray's answers.

use std::ops::Deref;

use kd_core::{Hit, Mesh, NodeView, Ray, Tree};
use kd_oracle::rays::Rays;
pub(crate) use kd_oracle::source;
use kd_trace::{
    Division, Join, Level, PackedTree, RayQuery, WideForest, WideTree, brute_force, lazy,
};

use crate::cells::CutTree;

const PLANES: Division = Division::Planes {
    most_references: u64::MAX,
};

/// A tree over a mesh and every way to trace it.
pub(crate) struct Subject<'a> {
    mesh: &'a Mesh,
    tree: Tree,
    packed: [PackedTree; 2],
    wide: [WideTree; 4],
    cut: [CutTree; 2],
}

impl<'a> Subject<'a> {
    pub(crate) fn new(mesh: &'a Mesh, tree: Tree) -> Self {
        let packed = PackedTree::new(&tree, mesh);
        let portable = packed.clone().with_level(Level::portable());
        // Each way to make it, and each level, once: answers take long to check.
        let by_planes = WideTree::with_planes_above(&tree, mesh, 0);
        Self {
            wide: [
                WideTree::new(&tree, mesh),
                by_planes.with_level(Level::portable()),
                WideTree::build(mesh, PLANES, false, None).expect("nothing cancels it"),
                joined(mesh),
            ],
            cut: CutTree::both(&tree, mesh),
            packed: [packed, portable],
            mesh,
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

impl Deref for Subject<'_> {
    type Target = Tree;

    fn deref(&self) -> &Tree {
        &self.tree
    }
}

/// The answers of the tree, after a comparison with every other way to trace it.
impl RayQuery for Subject<'_> {
    type Hit = Hit;

    #[track_caller]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = kd_trace::intersect(&self.tree, self.mesh, ray);
        for packed in &self.packed {
            let place = || format!("packed, {}: {}", packed.level(), source(ray));
            assert_eq!(packed.intersect(ray), hit, "closest, {}", place());
        }
        for wide in &self.wide {
            let place = || format!("wide, {}: {}", wide.level(), source(ray));
            assert_eq!(wide.intersect(ray), hit, "closest, {}", place());
        }
        for cut in &self.cut {
            let found = lazy::intersect(cut, ray);
            assert_eq!(found, hit, "closest, cut into cells: {}", source(ray));
        }
        hit
    }

    #[track_caller]
    fn occluded(&self, ray: &Ray) -> bool {
        let any = kd_trace::occluded(&self.tree, self.mesh, ray);
        for packed in &self.packed {
            let place = || format!("packed, {}: {}", packed.level(), source(ray));
            assert_eq!(packed.occluded(ray), any, "any, {}", place());
        }
        for wide in &self.wide {
            let place = || format!("wide, {}: {}", wide.level(), source(ray));
            assert_eq!(wide.occluded(ray), any, "any, {}", place());
        }
        for cut in &self.cut {
            let found = lazy::occluded(cut, ray);
            assert_eq!(found, any, "any, cut into cells: {}", source(ray));
        }
        any
    }

    #[track_caller]
    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        kd_trace::hits(&self.tree, self.mesh, ray, max, out);
        let mut found = Vec::new();
        for packed in &self.packed {
            packed.hits(ray, max, &mut found);
            let place = || format!("packed, {}: {}", packed.level(), source(ray));
            assert_eq!(found, *out, "first {max}, {}", place());
        }
        for wide in &self.wide {
            wide.hits(ray, max, &mut found);
            let place = || format!("wide, {}: {}", wide.level(), source(ray));
            assert_eq!(found, *out, "first {max}, {}", place());
        }
        for cut in &self.cut {
            lazy::hits(cut, ray, max, &mut found);
            let place = || format!("cut into cells: {}", source(ray));
            assert_eq!(found, *out, "first {max}, {}", place());
        }
    }
}

impl Subject<'_> {
    /// Axis and position of the planes of the tree.
    pub(crate) fn planes(&self) -> Vec<(usize, f32)> {
        let nodes = self.tree.nodes().iter();
        let planes = nodes.filter_map(|node| match node.view() {
            NodeView::Interior { axis, split, .. } => Some((axis.index(), split)),
            NodeView::Leaf { .. } => None,
        });
        planes.collect()
    }
}

/// Asks every query about a ray, in each of the trees and in every way, and expects what brute force says. Gives the
/// number of hits.
#[track_caller]
pub(crate) fn check<'a>(
    scene: &str,
    mesh: &Mesh,
    trees: impl IntoIterator<Item = &'a Subject<'a>>,
    ray: &Ray,
) -> usize {
    let trees: Vec<&dyn RayQuery<Hit = Hit>> = trees.into_iter().map(|tree| tree as _).collect();
    kd_oracle::check(scene, mesh, &trees, ray)
}

/// Rays around one mesh and the planes of its trees.
pub(crate) fn rays<'a>(mesh: &'a Mesh, trees: &[Subject<'_>], seed: u64) -> Rays<'a> {
    let planes = trees.iter().flat_map(Subject::planes);
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
