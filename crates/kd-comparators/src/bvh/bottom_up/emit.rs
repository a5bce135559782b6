//! Groups as nodes in depth-first order.

use kd_trace::kit::Item;

use crate::bvh::bounds::{Around, Bounds, apart};
use crate::bvh::build::{Driver, EqualCounts, Output, index, must_be_halved};
use crate::bvh::node::BvhNode;
use crate::bvh::options::BvhOptions;

use super::clusters::Clusters;

/// Writes the nodes of groups.
pub(super) struct Emitter<'a> {
    items: &'a [Item],
    clusters: &'a Clusters,
    options: &'a BvhOptions,
    output: Output<()>,
    triangles: Vec<u32>,
}

impl<'a> Emitter<'a> {
    pub(super) fn new(items: &'a [Item], clusters: &'a Clusters, options: &'a BvhOptions) -> Self {
        Self {
            items,
            clusters,
            options,
            output: Output::default(),
            triangles: Vec::with_capacity(items.len()),
        }
    }

    /// All nodes, and the triangle list.
    pub(super) fn emit(mut self) -> (Vec<BvhNode>, Vec<u32>) {
        self.add(self.clusters.root(), 0);
        (self.output.nodes, self.triangles)
    }

    fn add(&mut self, number: usize, depth: usize) {
        let Some(group) = self.clusters.group(number) else {
            return self.add_leaf(vec![self.items[number]]);
        };
        if group.is_leaf {
            return self.add_leaf(self.items_of(number));
        }
        if must_be_halved(group.triangles as usize, depth) {
            return self.add_halves(self.items_of(number), depth);
        }
        let [a, b] = group.members.map(|member| member as usize);
        let (axis, is_second_lower) = apart(
            &self.clusters.bounds(a, self.items),
            &self.clusters.bounds(b, self.items),
        );
        let [lower, upper] = if is_second_lower { [b, a] } else { [a, b] };
        let bounds = group.bounds.aabb();
        let place = self.output.nodes.len();
        // Replaced once the index of the second child is known.
        self.output.nodes.push(BvhNode::leaf(&bounds, 0, 0));
        self.add(lower, depth + 1);
        let second = index(&self.output.nodes);
        self.add(upper, depth + 1);
        self.output.nodes[place] = BvhNode::interior(&bounds, axis, second);
    }

    fn add_leaf(&mut self, mut items: Vec<Item>) {
        items.sort_unstable_by_key(|item| item.number());
        let [first, count] = [self.triangles.len(), items.len()]
            .map(|count| u32::try_from(count).expect("30 bits count triangles"));
        let leaf = BvhNode::leaf(&Bounds::of_all(&items).aabb(), first, count);
        self.output.nodes.push(leaf);
        self.triangles
            .extend(items.iter().map(|item| item.number()));
    }

    /// Adds items in halves, where the depth limit leaves room for nothing else.
    fn add_halves(&mut self, mut items: Vec<Item>, depth: usize) {
        let driver = Driver {
            divide: &EqualCounts(self.options.cost),
            model: self.options.cost,
            max_leaf: self.options.max_leaf as usize,
            is_parallel: false,
        };
        let first = u32::try_from(self.triangles.len()).expect("30 bits count triangles");
        let around = Around::of(&items);
        driver.add(&mut items, &around, first, depth, &mut self.output);
        self.triangles
            .extend(items.iter().map(|item| item.number()));
    }

    /// The items of a group. Iterative: a group may be as deep as its number of triangles.
    fn items_of(&self, number: usize) -> Vec<Item> {
        let (mut items, mut pending) = (Vec::new(), vec![number]);
        while let Some(number) = pending.pop() {
            match self.clusters.group(number) {
                Some(group) => pending.extend(group.members.map(|member| member as usize)),
                None => items.push(self.items[number]),
            }
        }
        items
    }
}
