//! The nodes that join the parts of a tree, which stay as they are.
//!
//! Parts that lie apart are linked whole. Where parts overlap, a node that is large for the place it is in is *opened*: its
//! children take its place, and lie beside what they overlap with, so that rays meet all of it from front to back. Nothing
//! below a node that was not opened is looked at (C. Benthin, S. Woop, I. Wald, A. Áfra, *Improved Two-Level BVHs using
//! Partial Re-Braiding*, 2017).

use kd_core::{Aabb, Axis};

use super::arrays::Arrays;
use super::box_tree::{Added, BoxTree, Item, Leaves};
use super::divide::{MOST_DIVISIONS, per_area};
use super::emit;
use super::node::Child;
use super::object_split::ObjectSplit;

/// How parts are joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Join {
    /// Nodes are opened whose box has at least this part of the half area of the box around all that is joined in a place.
    /// Infinite: none.
    pub open_above: f64,
}

impl Default for Join {
    /// Opens above 0.3. (Rays of ten frames of a car in a kitchen, over a tree built anew, geometric means, a throw-away
    /// program of 2026-11-25: 1.00 for 0.1, 0.99 for 0.3 with half of the nodes opened, 1.05 for none opened; 0.01 and 0.03
    /// as 0.1 within the noise.)
    fn default() -> Self {
        Self { open_above: 0.3 }
    }
}

/// What was joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Joined {
    /// New nodes over the parts.
    pub nodes: usize,
    /// Subtrees of parts that those refer to.
    pub links: usize,
    /// Nodes of parts that were opened, so that rays no longer visit them.
    pub opened: usize,
}

/// A subtree of a part.
#[derive(Clone, Copy, Debug)]
struct Link {
    child: Child,
    part: u32,
}

struct Joiner<'a> {
    arrays: &'a Arrays,
    options: Join,
    per_area: f64,
    links: Vec<Link>,
    opened: usize,
    boxes: BoxTree,
}

/// Puts a top over all parts, and tells the box around them.
pub(super) fn join(arrays: &mut Arrays, options: Join) -> (Joined, Aabb) {
    let mut links = Vec::new();
    let mut items = Vec::new();
    for (part, number) in arrays.parts().iter().zip(0..) {
        let child = part.root();
        if child == Child::NOTHING {
            continue;
        }
        let node = &arrays.nodes()[child.index()];
        let bounds = node.lanes().map(|lane| node.bounds(lane));
        let bounds = bounds.fold(Aabb::EMPTY, |around, bounds| around.union(&bounds));
        items.push(Item::within(bounds, to_u32(links.len())));
        links.push(Link {
            child,
            part: number,
        });
    }
    let bounds = Item::around(&items);
    let mut joiner = Joiner {
        arrays,
        options,
        per_area: per_area(&bounds),
        links,
        opened: 0,
        boxes: BoxTree::new(Leaves::Links),
    };
    if !items.is_empty() {
        joiner.add(items, 0);
    }
    let Joiner {
        links,
        opened,
        boxes,
        ..
    } = joiner;
    let children: Vec<Child> = links.iter().map(|link| link.child).collect();
    let (nodes, root) = emit::emit_links(&boxes, &children, arrays.nodes_of_parts());
    let joined = Joined {
        nodes: nodes.len(),
        links: boxes.root().map_or(0, |root| boxes.items(root).len()),
        opened,
    };
    arrays.set_top(&nodes, root);
    (joined, bounds)
}

impl Joiner<'_> {
    /// Adds the boxes of what lies in a place. `divisions` is how often that was divided.
    fn add(&mut self, mut items: Vec<Item>, divisions: usize) -> Added {
        if divisions < MOST_DIVISIONS {
            self.open(&mut items);
        }
        if items.len() == 1 {
            return self.boxes.add_leaf(&items, self.per_area);
        }
        let place = self.boxes.reserve();
        let division = (divisions < MOST_DIVISIONS)
            .then(|| ObjectSplit::best(&items))
            .flatten();
        let (axis, middle) = match division {
            Some(division) => (division.axis, division.apply(&mut items)),
            None => (Axis::X, items.len() / 2),
        };
        let upper = items.split_off(middle);
        let parts = [items, upper].map(|part| self.add(part, divisions + 1));
        self.boxes.set_split(place, axis, parts, self.per_area)
    }

    /// Opens what is large among them, and overlaps with something of another part.
    fn open(&mut self, items: &mut Vec<Item>) {
        let least = self.options.open_above * Item::around(items).half_area();
        let mut next = 0;
        while next < items.len() {
            let item = items[next];
            let link = self.links[item.number as usize];
            let is_large = !link.child.is_leaf() && item.bounds().half_area() >= least;
            if is_large && items.iter().any(|other| self.is_mixed(&item, other)) {
                items.swap_remove(next);
                self.opened += 1;
                let node = &self.arrays.nodes()[link.child.index()];
                for lane in node.lanes() {
                    items.push(Item::within(node.bounds(lane), to_u32(self.links.len())));
                    self.links.push(Link {
                        child: node.children[lane],
                        ..link
                    });
                }
            } else {
                next += 1;
            }
        }
    }

    /// Whether two overlap, and are of different parts.
    fn is_mixed(&self, a: &Item, b: &Item) -> bool {
        let overlap = a.min.cmple(b.max) & b.min.cmple(a.max);
        overlap.all() && self.links[a.number as usize].part != self.links[b.number as usize].part
    }
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("fewer nodes than 2^31")
}
