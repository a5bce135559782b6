//! Clusters as groups with their costs.

use kd_trace::kit::{Item, clusters};

use crate::bvh::bounds::Bounds;
use crate::bvh::build::cost_as_leaf;
use crate::bvh::options::BvhOptions;

/// A tree of groups. Numbers from 0 on are items; the numbers after them are groups, in order of creation. The last group is
/// the root.
#[derive(Debug)]
pub(super) struct Clusters {
    items: usize,
    groups: Vec<Group>,
}

/// Two merged clusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub(super) bounds: Bounds,
    pub(super) members: [u32; 2],
    /// Number of triangles.
    pub(super) triangles: u32,
    /// Whether one leaf costs less than the group's nodes.
    pub(super) is_leaf: bool,
    /// SAH cost, times half areas.
    cost: f64,
}

impl Clusters {
    pub(super) fn new(
        items: &[Item],
        radius: usize,
        options: &BvhOptions,
        is_parallel: bool,
    ) -> Self {
        let mut all = Self {
            items: items.len(),
            groups: Vec::with_capacity(items.len() - 1),
        };
        for members in clusters(items, radius, is_parallel) {
            let group = all.merged(members, items, options);
            all.groups.push(group);
        }
        all
    }

    /// The number of the root.
    pub(super) fn root(&self) -> usize {
        self.items + self.groups.len() - 1
    }

    /// The group of a number; `None` for an item.
    pub(super) fn group(&self, number: usize) -> Option<&Group> {
        number.checked_sub(self.items).map(|at| &self.groups[at])
    }

    /// The box of an item or a group.
    pub(super) fn bounds(&self, number: usize, items: &[Item]) -> Bounds {
        let group = self.group(number);
        group.map_or_else(|| Bounds::of(&items[number]), |group| group.bounds)
    }

    fn merged(&self, members: [u32; 2], items: &[Item], options: &BvhOptions) -> Group {
        let boxes = members.map(|member| self.bounds(member as usize, items));
        let bounds = boxes[0].union(&boxes[1]);
        let (mut triangles, mut cost) = (0, f64::from(options.cost.traverse) * bounds.half_area());
        for (member, own) in members.into_iter().zip(&boxes) {
            match self.group(member as usize) {
                Some(group) => {
                    triangles += group.triangles;
                    cost += group.cost;
                }
                None => {
                    triangles += 1;
                    cost += cost_as_leaf(own, 1, &options.cost);
                }
            }
        }
        let as_leaf = cost_as_leaf(&bounds, triangles as usize, &options.cost);
        let is_leaf = triangles <= options.max_leaf && as_leaf <= cost;
        Group {
            bounds,
            members,
            triangles,
            is_leaf,
            cost: if is_leaf { as_leaf } else { cost },
        }
    }
}
