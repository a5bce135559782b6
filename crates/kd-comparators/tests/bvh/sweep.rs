//! The sweep equals a search of all divisions; the other methods come near it.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhMethod, BvhNodeView, BvhOptions};
use kd_core::{Aabb, Axis, CostModel, Mesh};

use crate::check::METHODS;
use crate::scenes;

/// A hierarchy built by comparing all pairs of triangles in each node: O(N²), without sorting.
struct Naive<'a> {
    mesh: &'a Mesh,
    model: CostModel,
    max_leaf: usize,
    nodes: Vec<(Aabb, BvhNodeView)>,
    triangles: Vec<u32>,
}

impl Naive<'_> {
    fn bounds(&self, triangles: &[u32]) -> Aabb {
        Aabb::around(triangles.iter().flat_map(|t| self.mesh.corners(*t)))
    }

    /// The sort key of a triangle on an axis.
    fn key(&self, axis: Axis, triangle: u32) -> (f32, u32) {
        let center = self.bounds(&[triangle]).center();
        (center[axis.index()], triangle)
    }

    fn cost(&self, triangles: &[u32]) -> f64 {
        self.bounds(triangles).half_area() * self.model.leaf(triangles.len())
    }

    /// The cheapest division below a triangle on an axis; among equals the first axis, then the fewest triangles below.
    fn division(&self, triangles: &[u32]) -> Option<(Axis, [Vec<u32>; 2], f64)> {
        let mut best: Option<(Axis, [Vec<u32>; 2], f64)> = None;
        for axis in Axis::ALL {
            for &other in triangles {
                let is_below = |t: &u32| self.key(axis, *t) < self.key(axis, other);
                let sides: [Vec<u32>; 2] = triangles.iter().partition(|t| is_below(t)).into();
                if sides[0].is_empty() {
                    continue;
                }
                let cost = self.cost(&sides[0]) + self.cost(&sides[1]);
                let is_better = best.as_ref().is_none_or(|(by, [below, _], least)| {
                    let is_first = axis == *by && sides[0].len() < below.len();
                    cost < *least || cost == *least && is_first
                });
                if is_better {
                    best = Some((axis, sides, cost));
                }
            }
        }
        best
    }

    fn add(&mut self, mut triangles: Vec<u32>) {
        let bounds = self.bounds(&triangles);
        let as_leaf = self.cost(&triangles);
        let own = f64::from(self.model.traverse) * bounds.half_area();
        let division = self
            .division(&triangles)
            .filter(|(_, _, cost)| own + cost < as_leaf || triangles.len() > self.max_leaf);
        let place = self.nodes.len();
        let Some((_, [mut lower, mut upper], _)) = division else {
            triangles.sort_unstable();
            let [first, count] = [&self.triangles, &triangles].map(|list| list.len());
            let [first, count] = [first, count].map(|n| u32::try_from(n).expect("few"));
            self.triangles.extend(triangles);
            self.nodes
                .push((bounds, BvhNodeView::Leaf { first, count }));
            return;
        };
        self.nodes
            .push((bounds, BvhNodeView::Leaf { first: 0, count: 0 }));
        let centers = [&lower, &upper].map(|part| self.bounds(part).center());
        let apart = (centers[1] - centers[0]).to_array();
        let wider = |best: Axis, axis: Axis| {
            let is_wider = apart[axis.index()].abs() > apart[best.index()].abs();
            if is_wider { axis } else { best }
        };
        let axis = Axis::ALL.into_iter().reduce(wider).expect("three");
        if apart[axis.index()] < 0.0 {
            std::mem::swap(&mut lower, &mut upper);
        }
        self.add(lower);
        let second = u32::try_from(self.nodes.len()).expect("few");
        self.add(upper);
        self.nodes[place].1 = BvhNodeView::Interior { axis, second };
    }
}

/// Compares the sweep with the naive search, node by node.
#[track_caller]
pub(crate) fn check_same_tree(mesh: &Arc<Mesh>, model: CostModel, max_leaf: u32) {
    let options = BvhOptions::new()
        .with_method(BvhMethod::Sweep)
        .with_cost(model)
        .with_max_leaf(max_leaf);
    let bvh = Bvh::build(Arc::clone(mesh), &options).expect("valid options");
    let mut naive = Naive {
        mesh,
        model,
        max_leaf: max_leaf as usize,
        nodes: Vec::new(),
        triangles: Vec::new(),
    };
    if !mesh.is_empty() {
        naive.add((0..u32::try_from(mesh.len()).expect("few")).collect());
    }
    for (place, (node, (bounds, view))) in bvh.nodes().iter().zip(&naive.nodes).enumerate() {
        let found = (node.bounds(), node.view());
        assert_eq!(found, (*bounds, *view), "node {place}");
    }
    assert_eq!(bvh.nodes().len(), naive.nodes.len(), "as many nodes");
    assert_eq!(bvh.triangles(), naive.triangles, "the same leaves");
}

#[test]
fn the_sweep_finds_the_best_division() {
    for (_, mesh) in scenes::nasty().into_iter().chain(scenes::generated()) {
        // Few triangles: splitting off one at a time stays within the depth limit.
        let few = mesh.triangles().iter().step_by(mesh.len().div_ceil(60));
        let few = Mesh::new(mesh.positions().to_vec(), few.copied().collect());
        let few = Arc::new(few.expect("a part of a mesh"));
        check_same_tree(&few, CostModel::CLASSIC, 4);
        check_same_tree(&few, CostModel::PACKED, 16);
    }
}

/// The SAH cost of each method over that of the sweep.
#[test]
fn sah_costs_of_methods_are_in_order() {
    let mut sums = [0.0; METHODS.len()];
    let scenes = scenes::generated();
    for (_, mesh) in &scenes {
        let costs = METHODS.map(|method| {
            let options = BvhOptions::new().with_method(method);
            let bvh = Bvh::build(Arc::clone(mesh), &options).expect("valid options");
            bvh.stats().sah_cost_own
        });
        for (sum, cost) in sums.iter_mut().zip(costs) {
            *sum += (cost / costs[0]).ln();
        }
    }
    let [_, binned, midpoint, equal, bottom_up] = sums.map(|sum| (sum / scenes.len() as f64).exp());
    let ratios = format!("{binned:.3} {midpoint:.3} {equal:.3} {bottom_up:.3}");
    assert!(
        binned < 1.05,
        "bins are nearly as good as a sweep: {ratios}"
    );
    assert!(bottom_up < 1.2, "bottom-up is near the sweep: {ratios}");
    assert!(
        midpoint > binned && equal > binned,
        "SAH is worth it: {ratios}"
    );
}
