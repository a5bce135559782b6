//! Statistics of a tree, with one text form.

use std::fmt;

use crate::{Aabb, CostModel, LayoutBytes, Node, NodeIndex, NodeView, Tree};

/// What [`TreeStats`] describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StatsOf {
    /// The nodes and leaves of a kd-tree.
    KdTree,
    /// Wide nodes and their leaves, which were made without a kd-tree.
    WideNodes,
}

/// Counts, histograms and costs of a tree: a kd-tree, or wide nodes.
///
/// `Display` is the text form that snapshots, the README and the bench use. SAH costs are the expected costs of rays that
/// meet the root's box (not padded): the sum over all nodes of the node's cost times its half area, divided by the half
/// area of the root.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct TreeStats {
    /// What the other fields describe.
    pub of: StatsOf,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Triangles of zero area; `None` if unknown, since a tree does not know its mesh.
    pub zero_area: Option<usize>,
    /// Reachable interior nodes and leaves; a node with several parents counts once.
    pub nodes: usize,
    /// Reachable leaves.
    pub leaves: usize,
    /// Leaves without references.
    pub empty_leaves: usize,
    /// References in all leaves; a triangle in several leaves counts several times.
    pub references: usize,
    /// The number of interior nodes above the deepest leaf.
    pub depth: usize,
    /// The number of leaves at each depth; a leaf counts once per path from the root.
    pub leaves_by_depth: Vec<usize>,
    /// The number of leaves by their number of references, in buckets: 0, 1, … 8, then up to 16, 32, 64, … (see
    /// [`leaf_size_label`](Self::leaf_size_label)).
    pub leaves_by_size: Vec<usize>,
    /// SAH cost with K_T 15, K_I 20 and one lane, for comparison with the literature.
    pub sah_cost_15_20: f64,
    /// SAH cost under the model that the tree was built for. For wide nodes: in visits of a node.
    pub sah_cost_own: f64,
    /// Bytes of nodes and of their heights; 0 without a kd-tree.
    pub node_bytes: usize,
    /// Bytes of references.
    pub reference_bytes: usize,
    /// Bytes of the layout that rays traverse; `None` for a tree without one.
    pub layout_bytes: Option<LayoutBytes>,
    /// Cells that were not divided because the limit of references was reached: see [`Tree::limited_cells`].
    pub limited_cells: usize,
}

/// Leaf sizes up to this one have a bucket of their own.
const EXACT_SIZES: usize = 8;

impl TreeStats {
    pub(crate) fn of(tree: &Tree) -> Self {
        let reference_bytes = size_of_val(tree.refs());
        let mut stats = Self {
            depth: tree.depth(),
            leaves_by_depth: vec![0; tree.depth() + 1],
            node_bytes: tree.bytes() - reference_bytes,
            reference_bytes,
            limited_cells: tree.limited_cells(),
            ..Self::empty(StatsOf::KdTree, tree.triangles() as usize)
        };
        StatsVisitor {
            tree,
            root_half_area: tree.bounds().half_area(),
            seen: vec![false; tree.nodes().len()],
            stats: &mut stats,
        }
        .visit(tree.root(), tree.bounds(), 0);
        stats
    }

    /// The statistics of nothing, over a mesh of `triangles`.
    pub fn empty(of: StatsOf, triangles: usize) -> Self {
        Self {
            of,
            triangles,
            zero_area: None,
            nodes: 0,
            leaves: 0,
            empty_leaves: 0,
            references: 0,
            depth: 0,
            leaves_by_depth: Vec::new(),
            leaves_by_size: Vec::new(),
            sah_cost_15_20: 0.0,
            sah_cost_own: 0.0,
            node_bytes: 0,
            reference_bytes: 0,
            layout_bytes: None,
            limited_cells: 0,
        }
    }

    /// Counts a leaf below `depth` interior nodes.
    pub fn add_leaf(&mut self, depth: usize, references: usize) {
        self.depth = self.depth.max(depth);
        if self.leaves_by_depth.len() <= depth {
            self.leaves_by_depth.resize(depth + 1, 0);
        }
        self.leaves_by_depth[depth] += 1;
        self.count_leaf(references);
    }

    /// The same statistics with [`zero_area`](Self::zero_area) set.
    #[must_use]
    pub fn with_zero_area(mut self, zero_area: usize) -> Self {
        self.zero_area = Some(zero_area);
        self
    }

    /// The same statistics with the bytes of the layout filled in.
    #[must_use]
    pub fn with_layout_bytes(mut self, layout_bytes: LayoutBytes) -> Self {
        self.layout_bytes = Some(layout_bytes);
        self
    }

    /// References per triangle; 0 for a tree without triangles.
    pub fn refs_per_triangle(&self) -> f64 {
        if self.triangles == 0 {
            0.0
        } else {
            self.references as f64 / self.triangles as f64
        }
    }

    /// Bytes of the tree, without its mesh and its layout.
    pub fn bytes_total(&self) -> usize {
        self.node_bytes + self.reference_bytes
    }

    /// Bytes of the tree and of its layout, without the mesh.
    pub fn bytes_kept(&self) -> usize {
        self.bytes_total() + self.layout_bytes.unwrap_or_default().total()
    }

    /// The label of a bucket of [`leaves_by_size`](Self::leaves_by_size), such as `"3"` or `"≤16"`.
    pub fn leaf_size_label(bucket: usize) -> String {
        if bucket <= EXACT_SIZES {
            bucket.to_string()
        } else {
            format!("≤{}", EXACT_SIZES << (bucket - EXACT_SIZES))
        }
    }

    fn count_leaf(&mut self, references: usize) {
        self.leaves += 1;
        self.empty_leaves += usize::from(references == 0);
        self.references += references;
        let bucket = if references <= EXACT_SIZES {
            references
        } else {
            EXACT_SIZES + (references.div_ceil(EXACT_SIZES).next_power_of_two().ilog2() as usize)
        };
        if self.leaves_by_size.len() <= bucket {
            self.leaves_by_size.resize(bucket + 1, 0);
        }
        self.leaves_by_size[bucket] += 1;
    }
}

/// The cost of a tree under any model: see [`Tree::sah_cost`].
pub(crate) fn sah_cost(tree: &Tree, model: &CostModel) -> f64 {
    fn below(tree: &Tree, model: &CostModel, index: NodeIndex, cell: Aabb) -> f64 {
        let node = tree.nodes()[index.index()];
        let own = hit_probability(&cell, tree.bounds().half_area()) * node_cost(model, node);
        match node.view() {
            NodeView::Leaf { .. } => own,
            NodeView::Interior { axis, split, first } => {
                let (lower, upper) = cell.split(axis, split);
                let children = [(first, lower), (first.sibling(), upper)];
                let costs = children.map(|(child, cell)| below(tree, model, child, cell));
                own + costs[0] + costs[1]
            }
        }
    }
    below(tree, model, tree.root(), tree.bounds())
}

/// The probability that a ray that meets the root's box meets a cell, by the surface area heuristic. If the root's box has
/// no area, the probability is 1.
fn hit_probability(cell: &Aabb, root_half_area: f64) -> f64 {
    if root_half_area > 0.0 {
        cell.half_area() / root_half_area
    } else {
        1.0
    }
}

/// A traversal of all nodes with their cells, which adds up the statistics.
struct StatsVisitor<'a> {
    tree: &'a Tree,
    root_half_area: f64,
    seen: Vec<bool>,
    stats: &'a mut TreeStats,
}

impl StatsVisitor<'_> {
    /// Adds the subtree of node `index`. Costs are added for every path to the node, counts only once.
    fn visit(&mut self, index: NodeIndex, cell: Aabb, depth: usize) {
        let node = self.tree.nodes()[index.index()];
        let first_time = !std::mem::replace(&mut self.seen[index.index()], true);
        if first_time {
            self.stats.nodes += 1;
        }
        let probability = hit_probability(&cell, self.root_half_area);
        let own = *self.tree.cost();
        self.stats.sah_cost_15_20 += probability * node_cost(&CostModel::CLASSIC, node);
        self.stats.sah_cost_own += probability * node_cost(&own, node);
        match node.view() {
            NodeView::Leaf { count, .. } => {
                self.stats.leaves_by_depth[depth] += 1;
                if first_time {
                    self.stats.count_leaf(count as usize);
                }
            }
            NodeView::Interior { axis, split, first } => {
                let (lower, upper) = cell.split(axis, split);
                self.visit(first, lower, depth + 1);
                self.visit(first.sibling(), upper, depth + 1);
            }
        }
    }
}

fn node_cost(model: &CostModel, node: Node) -> f64 {
    if node.is_leaf() {
        model.leaf(node.count() as usize)
    } else {
        f64::from(model.traverse)
    }
}

impl fmt::Display for TreeStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let per_triangle = |bytes: usize| bytes as f64 / self.triangles.max(1) as f64;
        let of = match self.of {
            StatsOf::KdTree => "kd-tree",
            StatsOf::WideNodes => "wide nodes",
        };
        writeln!(f, "statistics of    {of:>12}")?;
        writeln!(f, "triangles        {:>12}", self.triangles)?;
        if let Some(zero_area) = self.zero_area {
            writeln!(f, "  of zero area   {zero_area:>12}")?;
        }
        writeln!(f, "nodes            {:>12}", self.nodes)?;
        writeln!(f, "leaves           {:>12}", self.leaves)?;
        writeln!(f, "  empty          {:>12}", self.empty_leaves)?;
        writeln!(f, "references       {:>12}", self.references)?;
        writeln!(f, "  per triangle   {:>12.3}", self.refs_per_triangle())?;
        if self.limited_cells > 0 {
            writeln!(f, "  cells limited  {:>12}", self.limited_cells)?;
        }
        writeln!(f, "depth            {:>12}", self.depth)?;
        writeln!(f, "SAH cost (15:20) {:>12.3}", self.sah_cost_15_20)?;
        writeln!(f, "SAH cost (own)   {:>12.3}", self.sah_cost_own)?;
        if self.of == StatsOf::KdTree {
            let bytes = self.bytes_total();
            writeln!(f, "bytes            {bytes:>12}")?;
            writeln!(f, "  per triangle   {:>12.1}", per_triangle(bytes))?;
        }
        if let Some(layout) = self.layout_bytes {
            let LayoutBytes { nodes, blocks } = layout;
            writeln!(f, "bytes to trace   {:>12}", nodes + blocks)?;
            writeln!(f, "  nodes          {nodes:>12}")?;
            writeln!(f, "    per triangle {:>12.1}", per_triangle(nodes))?;
            writeln!(f, "  blocks         {blocks:>12}")?;
            writeln!(f, "    per triangle {:>12.1}", per_triangle(blocks))?;
        }
        write!(f, "leaves by depth  ")?;
        write_histogram(f, &self.leaves_by_depth, |depth| depth.to_string())?;
        write!(f, "leaves by size   ")?;
        write_histogram(f, &self.leaves_by_size, Self::leaf_size_label)
    }
}

/// Writes `label:count` for every bucket that is not empty.
fn write_histogram(
    f: &mut fmt::Formatter<'_>,
    buckets: &[usize],
    label: impl Fn(usize) -> String,
) -> fmt::Result {
    for (bucket, count) in buckets.iter().enumerate().filter(|(_, count)| **count > 0) {
        write!(f, " {}:{count}", label(bucket))?;
    }
    writeln!(f)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Arena, Axis, Pair, Slot};

    fn unit_box() -> Aabb {
        Aabb::around([Vec3::ZERO, Vec3::ONE])
    }

    #[test]
    fn costs_are_weighted_by_area() {
        // The unit cube, split in half: the half area is 3 for the root and 2 for each child.
        let leaf = |first, count| Node::leaf(first, count).expect("small");
        let root = Node::interior(Axis::Z, 0.5, NodeIndex(2)).expect("small");
        let pairs = [
            Pair([root, Node::EMPTY_LEAF]),
            Pair([leaf(0, 1), leaf(1, 2)]),
        ];
        let own = CostModel {
            traverse: 1.0,
            intersect: 2.0,
            lanes: 4,
            empty_bonus: 1.0,
        };
        let tree =
            Tree::from_parts(pairs.to_vec(), vec![Slot(0); 3], unit_box(), 1, own).expect("valid");
        let stats = tree.stats();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(
            close(stats.sah_cost_15_20, 15.0 + 2.0 / 3.0 * 20.0 * 3.0),
            "{stats}"
        );
        assert!(
            close(stats.sah_cost_own, 1.0 + 2.0 / 3.0 * 2.0 * 8.0),
            "{stats}"
        );
        let by_model = [CostModel::CLASSIC, own].map(|model| tree.sah_cost(&model));
        assert!(
            close(by_model[0], stats.sah_cost_15_20) && close(by_model[1], stats.sah_cost_own),
            "{by_model:?} {stats}"
        );
        assert_eq!(
            (stats.nodes, stats.leaves, stats.references, stats.depth),
            (3, 2, 3, 1),
            "{stats}"
        );
        assert_eq!(stats.leaves_by_depth, [0, 2], "both leaves at depth 1");
        assert_eq!(stats.leaves_by_size, [0, 1, 1], "one and two references");
    }

    #[test]
    fn the_text_form_shows_limited_cells() {
        let leaf = vec![Pair([Node::EMPTY_LEAF; 2])];
        let tree =
            Tree::from_parts(leaf, vec![], unit_box(), 0, CostModel::CLASSIC).expect("valid");
        let text = tree.stats().to_string();
        assert!(!text.contains("limited"), "no limited cells: {text}");
        let text = tree.with_limited_cells(12).stats().to_string();
        let line = "\n  cells limited            12\n";
        assert!(text.contains(line), "12 limited cells: {text}");
    }

    #[test]
    fn sizes_above_eight_share_buckets() {
        let labels: Vec<String> = (8..12).map(TreeStats::leaf_size_label).collect();
        assert_eq!(labels, ["8", "≤16", "≤32", "≤64"], "limits double");
        for (size, label) in [(8, "8"), (9, "≤16"), (16, "≤16"), (17, "≤32"), (33, "≤64")] {
            let leaf = Pair([Node::leaf(0, size).expect("small"), Node::EMPTY_LEAF]);
            let refs = vec![Slot(0); size as usize];
            let tree = Tree::from_parts(vec![leaf], refs, unit_box(), 1, CostModel::CLASSIC)
                .expect("valid");
            let bucket = tree.stats().leaves_by_size.len() - 1;
            assert_eq!(
                TreeStats::leaf_size_label(bucket),
                label,
                "{size} references"
            );
        }
    }

    #[test]
    fn shared_subtrees_count_once() {
        let root = Node::interior(Axis::Z, 0.5, NodeIndex(2)).expect("small");
        let child = Node::interior(Axis::X, 0.5, NodeIndex(4)).expect("small");
        let leaf = Node::leaf(0, 1).expect("small");
        let pairs = [
            Pair([root, Node::EMPTY_LEAF]),
            Pair([child, child]),
            Pair([leaf, leaf]),
        ];
        let mut arena = Arena::new();
        let root = arena.append(&pairs, &[Slot(0)]).expect("fits");
        arena.freeze(1).expect("valid");
        let tree = Tree::from_arena(arena, root, unit_box(), CostModel::CLASSIC).expect("valid");
        let stats = tree.stats();
        assert_eq!(
            (stats.nodes, stats.leaves),
            (5, 2),
            "shared nodes count once"
        );
        assert_eq!(
            stats.leaves_by_depth,
            [0, 0, 4],
            "four paths lead to the two leaves"
        );
    }

    #[test]
    fn an_empty_tree_has_finite_statistics() {
        let pairs = [Pair([Node::EMPTY_LEAF; 2])];
        let tree = Tree::from_parts(pairs.to_vec(), vec![], Aabb::EMPTY, 0, CostModel::CLASSIC)
            .expect("valid");
        let text = tree.stats().to_string();
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        assert_eq!(tree.stats().empty_leaves, 1, "{text}");
    }
}
