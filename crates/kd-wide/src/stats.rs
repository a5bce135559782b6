//! Statistics of wide nodes.

use kd_core::{Aabb, CostModel, Mesh, StatsOf, TreeStats};

use crate::collapse;
use crate::node::Child;
use crate::tree::WideTree;

pub(crate) fn stats(tree: &WideTree, mesh: &Mesh) -> TreeStats {
    let mut stats = TreeStats::empty(StatsOf::WideNodes, mesh.len())
        .with_zero_area(mesh.zero_area_count())
        .with_layout_bytes(tree.bytes());
    let root = tree.root();
    let bounds = bounds_of(tree, root);
    let mut visitor = Visitor {
        tree,
        root_half_area: bounds.half_area(),
        stats: &mut stats,
    };
    visitor.visit(root, &bounds, 0);
    stats
}

/// The box of a node; empty for [`Child::NOTHING`].
fn bounds_of(tree: &WideTree, child: Child) -> Aabb {
    if child.is_leaf() {
        return Aabb::EMPTY;
    }
    let node = &tree.nodes()[child.index()];
    let boxes = node.lanes().map(|lane| node.bounds(lane));
    boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
}

struct Visitor<'a> {
    tree: &'a WideTree,
    root_half_area: f64,
    stats: &'a mut TreeStats,
}

impl Visitor<'_> {
    fn visit(&mut self, child: Child, bounds: &Aabb, depth: usize) {
        let probability = if self.root_half_area > 0.0 {
            bounds.half_area() / self.root_half_area
        } else {
            1.0
        };
        self.stats.nodes += 1;
        let classic = &CostModel::CLASSIC;
        if child.is_leaf() {
            let blocks = &self.tree.blocks()[child.blocks()];
            let references = blocks.iter().map(|block| block.count() as usize).sum();
            self.stats.add_leaf(depth, references);
            self.stats.sah_cost_15_20 += probability * classic.leaf(references);
            self.stats.sah_cost_own += probability * f64::from(collapse::visit(blocks.len()));
            return;
        }
        self.stats.sah_cost_15_20 += probability * f64::from(classic.traverse);
        self.stats.sah_cost_own += probability * f64::from(collapse::visit(0));
        let node = &self.tree.nodes()[child.index()];
        for lane in node.lanes() {
            self.visit(node.children[lane], &node.bounds(lane), depth + 1);
        }
    }
}
