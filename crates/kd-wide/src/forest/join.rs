//! Join: new nodes over the members of a forest, which do not change.
//!
//! A member that overlaps no other is linked whole. Where members overlap, a node that is large in its surroundings is *opened*:
//! its children replace it, beside the nodes that they overlap, so that rays visit all of them from front to back. Nothing
//! below a node that is not opened is read (C. Benthin, S. Woop, I. Wald, A. Áfra, *Improved Two-Level BVHs using
//! Partial Re-Braiding*, 2017).

use kd_core::Axis;

use super::members::Member;
use crate::arrays::Arrays;
use crate::box_tree::{Added, BoxTree, Item, Leaves, to_u32};
use crate::divide::{MOST_DIVISIONS, per_area};
use crate::emit;
use crate::node::{Child, WideNode};
use crate::object_split::ObjectSplit;

/// Options of a join.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Join {
    /// A node is opened if its box has at least this fraction of the half area of the box around all that is joined beside it,
    /// and overlaps another member. Infinite: never.
    pub open_above: f64,
    /// Whether many members are joined on the threads of the pool in scope (rayon's). The result is the same.
    pub is_parallel: bool,
}

impl Default for Join {
    /// Opens above 0.3, on one thread. (Times of rays of ten frames of a car in a kitchen, relative to a rebuilt tree, geometric
    /// means, a throw-away program of 2026-11-25: 1.00 for 0.1, 0.99 for 0.3 with half of the nodes opened, 1.05 for none
    /// opened; 0.01 and 0.03 as 0.1 within the noise.)
    fn default() -> Self {
        Self {
            open_above: 0.3,
            is_parallel: false,
        }
    }
}

/// The outcome of a join, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Joined {
    /// New nodes over the members.
    pub nodes: usize,
    /// Subtrees of members that the new nodes refer to.
    pub links: usize,
    /// Nodes of members that were opened by the last join: rays no longer visit them.
    pub opened: usize,
}

/// A subtree of a member.
#[derive(Clone, Copy, Debug)]
struct Link {
    child: Child,
    member: u32,
}

/// The fewest subtrees on the smaller side of a split that are worth a task.
const TASK: usize = 256;

struct Joiner<'a> {
    arrays: &'a Arrays,
    options: Join,
    per_area: f64,
}

/// A joined region: its links and the boxes over them.
struct Joint {
    links: Vec<Link>,
    opened: usize,
    boxes: BoxTree,
}

/// Nodes over all members, and the root, which may be a member's.
pub(crate) struct NewTop {
    pub(crate) nodes: Vec<WideNode>,
    pub(crate) root: Child,
    pub(crate) joined: Joined,
}

/// Makes a top over all members, for nodes that will be from `first` on.
///
/// Members whose triangles have no area are not in it: no ray hits them.
pub(crate) fn join(arrays: &Arrays, members: &[Member], options: Join, first: usize) -> NewTop {
    let mut links = Vec::new();
    let mut items = Vec::new();
    for (member, number) in members.iter().zip(0..) {
        let child = member.root();
        if child == Child::NOTHING {
            continue;
        }
        let bounds = arrays.nodes()[child.index()].around();
        if bounds.is_empty() {
            continue;
        }
        items.push(Item::within(bounds, to_u32(links.len())));
        links.push(Link {
            child,
            member: number,
        });
    }
    let bounds = Item::around(&items);
    let joiner = Joiner {
        arrays,
        options,
        per_area: per_area(&bounds),
    };
    let mut all = Joint::new(links);
    if !items.is_empty() {
        joiner.add(items, 0, &mut all);
    }
    let Joint {
        links,
        opened,
        boxes,
    } = all;
    let children: Vec<Child> = links.iter().map(|link| link.child).collect();
    let (nodes, root) = emit::emit_links(&boxes, &children, first);
    let joined = Joined {
        nodes: nodes.len(),
        links: boxes.root().map_or(0, |root| boxes.items(root).len()),
        opened,
    };
    NewTop {
        nodes,
        root,
        joined,
    }
}

impl Joint {
    fn new(links: Vec<Link>) -> Self {
        Self {
            links,
            opened: 0,
            boxes: BoxTree::new(Leaves::Links),
        }
    }
}

impl Joiner<'_> {
    /// Adds the boxes of the items of a region. `divisions` counts the splits above.
    fn add(&self, mut items: Vec<Item>, divisions: usize, to: &mut Joint) -> Added {
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
        let members = self.add_both(items, upper, divisions + 1, to);
        to.boxes.set_split(place, axis, members, self.per_area)
    }

    fn add_both(
        &self,
        lower: Vec<Item>,
        upper: Vec<Item>,
        divisions: usize,
        to: &mut Joint,
    ) -> [Added; 2] {
        if self.options.is_parallel && lower.len().min(upper.len()) >= TASK {
            let mut upper = upper;
            let mut other = Joint::new(to.take_links(&mut upper));
            let (lower, added) = kd_tasks::join_if(
                true,
                || self.add(lower, divisions, to),
                || self.add(upper, divisions, &mut other),
            );
            return [lower, to.append(&other, added)];
        }
        let lower = self.add(lower, divisions, to);
        [lower, self.add(upper, divisions, to)]
    }

    /// Opens the items that are large and overlap an item of another member.
    fn open(&self, items: &mut Vec<Item>, to: &mut Joint) {
        let least = self.options.open_above * Item::around(items).half_area();
        let mut next = 0;
        while next < items.len() {
            let item = items[next];
            let link = to.links[item.number() as usize];
            let is_large = !link.child.is_leaf() && item.bounds().half_area() >= least;
            if is_large && items.iter().any(|other| to.is_mixed(&item, other)) {
                items.swap_remove(next);
                to.opened += 1;
                let node = &self.arrays.nodes()[link.child.index()];
                // Not what has no area: a repair finds links by their boxes.
                for lane in node.lanes().filter(|lane| !node.bounds(*lane).is_empty()) {
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

impl Joint {
    /// Whether two items overlap and are of different members.
    fn is_mixed(&self, a: &Item, b: &Item) -> bool {
        let overlap = a.min().cmple(b.max()) & b.min().cmple(a.max());
        overlap.all()
            && self.links[a.number() as usize].member != self.links[b.number() as usize].member
    }

    /// The links of some items, which get new numbers.
    fn take_links(&self, items: &mut [Item]) -> Vec<Link> {
        let numbered = items.iter_mut().zip(0..);
        numbered
            .map(|(item, number)| self.links[item.replace_number(number) as usize])
            .collect()
    }

    /// Adds another region, whose root was added to it last as `root`.
    fn append(&mut self, other: &Self, root: Added) -> Added {
        let links = to_u32(self.links.len());
        self.links.extend(&other.links);
        self.opened += other.opened;
        self.boxes.append(&other.boxes, root, links)
    }
}
