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
    /// Whether it is done on the threads of the pool in scope (rayon's), where there are many parts. The result is the same.
    /// Without feature `parallel` it is one thread.
    pub is_parallel: bool,
}

impl Default for Join {
    /// Opens above 0.3. (Rays of ten frames of a car in a kitchen, over a tree built anew, geometric means, a throw-away
    /// program of 2026-11-25: 1.00 for 0.1, 0.99 for 0.3 with half of the nodes opened, 1.05 for none opened; 0.01 and 0.03
    /// as 0.1 within the noise.) One thread.
    fn default() -> Self {
        Self {
            open_above: 0.3,
            is_parallel: false,
        }
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

/// Subtrees below which those on either side of a division are not worth a thread of their own.
#[cfg(feature = "parallel")]
const TASK: usize = 256;

struct Joiner<'a> {
    arrays: &'a Arrays,
    options: Join,
    per_area: f64,
}

/// What has been joined of a place, and what of.
struct Part {
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
    let joiner = Joiner {
        arrays,
        options,
        per_area: per_area(&bounds),
    };
    let mut part = Part::new(links);
    if !items.is_empty() {
        joiner.add(items, 0, &mut part);
    }
    let Part {
        links,
        opened,
        boxes,
    } = part;
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

impl Part {
    fn new(links: Vec<Link>) -> Self {
        Self {
            links,
            opened: 0,
            boxes: BoxTree::new(Leaves::Links),
        }
    }
}

impl Joiner<'_> {
    /// Adds the boxes of what lies in a place. `divisions` is how often that was divided.
    fn add(&self, mut items: Vec<Item>, divisions: usize, to: &mut Part) -> Added {
        if divisions < MOST_DIVISIONS {
            self.open(&mut items, to);
        }
        if items.len() == 1 {
            return to.boxes.add_leaf(&items, self.per_area);
        }
        let place = to.boxes.reserve();
        let division = (divisions < MOST_DIVISIONS)
            .then(|| ObjectSplit::best(&items))
            .flatten();
        let (axis, middle) = match division {
            Some(division) => (division.axis, division.apply(&mut items)),
            None => (Axis::X, items.len() / 2),
        };
        let upper = items.split_off(middle);
        let parts = self.add_both(items, upper, divisions + 1, to);
        to.boxes.set_split(place, axis, parts, self.per_area)
    }

    fn add_both(
        &self,
        lower: Vec<Item>,
        upper: Vec<Item>,
        divisions: usize,
        to: &mut Part,
    ) -> [Added; 2] {
        #[cfg(feature = "parallel")]
        if self.options.is_parallel && lower.len().min(upper.len()) >= TASK {
            let mut upper = upper;
            let mut other = Part::new(to.take_links(&mut upper));
            let (lower, added) = rayon::join(
                || self.add(lower, divisions, to),
                || self.add(upper, divisions, &mut other),
            );
            return [lower, to.append(&other, added)];
        }
        let lower = self.add(lower, divisions, to);
        [lower, self.add(upper, divisions, to)]
    }

    /// Opens what is large among them, and overlaps with something of another part.
    fn open(&self, items: &mut Vec<Item>, to: &mut Part) {
        let least = self.options.open_above * Item::around(items).half_area();
        let mut next = 0;
        while next < items.len() {
            let item = items[next];
            let link = to.links[item.number as usize];
            let is_large = !link.child.is_leaf() && item.bounds().half_area() >= least;
            if is_large && items.iter().any(|other| to.is_mixed(&item, other)) {
                items.swap_remove(next);
                to.opened += 1;
                let node = &self.arrays.nodes()[link.child.index()];
                for lane in node.lanes() {
                    items.push(Item::within(node.bounds(lane), to_u32(to.links.len())));
                    to.links.push(Link {
                        child: node.children[lane],
                        ..link
                    });
                }
            } else {
                next += 1;
            }
        }
    }
}

impl Part {
    /// Whether two overlap, and are of different parts.
    fn is_mixed(&self, a: &Item, b: &Item) -> bool {
        let overlap = a.min.cmple(b.max) & b.min.cmple(a.max);
        overlap.all() && self.links[a.number as usize].part != self.links[b.number as usize].part
    }

    /// The links of some items, which are numbered anew for them.
    #[cfg(feature = "parallel")]
    fn take_links(&self, items: &mut [Item]) -> Vec<Link> {
        let numbered = items.iter_mut().zip(0..);
        numbered
            .map(|(item, number)| self.links[std::mem::replace(&mut item.number, number) as usize])
            .collect()
    }

    /// Adds all of what was joined elsewhere, whose root was added to it last as `root`.
    #[cfg(feature = "parallel")]
    fn append(&mut self, other: &Self, root: Added) -> Added {
        let links = to_u32(self.links.len());
        self.links.extend(&other.links);
        self.opened += other.opened;
        self.boxes.append(&other.boxes, root, links)
    }
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("fewer nodes than 2^31")
}
