//! Items to divide: the triangles of a mesh, those with an area and those without, or boxes.

use kd_buffer::advise_large_pages;
use kd_core::{Aabb, Mesh, Tree};

use crate::box_tree::Item;

/// The triangles of a mesh.
pub(crate) struct Items {
    pub(crate) with_area: Vec<Item>,
    /// The numbers of those of zero area.
    pub(crate) without: Vec<u32>,
}

/// The triangles of a mesh, each with its box.
pub(crate) fn items_of_mesh(mesh: &Mesh, is_parallel: bool) -> Items {
    let (items, some_are_empty) =
        each_item(mesh.len(), is_parallel, |triangle| item_of(triangle, mesh));
    if some_are_empty {
        return divided_by_area(items);
    }
    Items {
        with_area: items,
        without: Vec::new(),
    }
}

/// The boxes that are finite and not empty, numbered by their places.
pub(crate) fn items_of_boxes(boxes: &[Aabb], is_parallel: bool) -> Vec<Item> {
    let (mut items, some_are_empty) = each_item(boxes.len(), is_parallel, |number| {
        let bounds = boxes[number as usize];
        let is_kept = bounds.min.is_finite() && bounds.max.is_finite() && !bounds.is_empty();
        Item::within(if is_kept { bounds } else { Aabb::EMPTY }, number)
    });
    if some_are_empty {
        items.retain(|item| !item.is_empty());
    }
    items
}

/// Items by number, and whether any of them is empty.
fn each_item(
    count: usize,
    is_parallel: bool,
    item_of: impl Fn(u32) -> Item + Send + Sync,
) -> (Vec<Item>, bool) {
    const CHUNK: usize = 1 << 12;
    // Zeroed pages of the system, untouched: threads share the work of touching them.
    let mut items: Vec<Item> = bytemuck::zeroed_vec(count);
    advise_large_pages(&items);
    let chunks = (0..).step_by(CHUNK).zip(items.chunks_mut(CHUNK));
    let some_are_empty = kd_tasks::map(chunks.collect(), is_parallel, |(first, chunk)| {
        let mut some_are_empty = false;
        for (number, item) in (first..).zip(chunk) {
            *item = item_of(number);
            some_are_empty |= item.is_empty();
        }
        some_are_empty
    });
    (items, some_are_empty.into_iter().any(|some| some))
}

/// The triangles of a kd-tree, each with its box.
pub(crate) fn items_of_tree(tree: &Tree, mesh: &Mesh) -> Items {
    let triangles = (0..).zip(triangles_of(tree, mesh.len()));
    let present = triangles.filter(|(_, is_in_tree)| *is_in_tree);
    let items = present.map(|(triangle, _)| item_of(triangle, mesh));
    divided_by_area(items.collect())
}

/// A triangle, in an empty box if it has no area.
#[inline(always)]
fn item_of(triangle: u32, mesh: &Mesh) -> Item {
    if mesh.is_zero_area(triangle) {
        Item::within(Aabb::EMPTY, triangle)
    } else {
        Item::whole(triangle, mesh)
    }
}

fn divided_by_area(items: Vec<Item>) -> Items {
    let (without, with_area): (Vec<Item>, Vec<Item>) = items.into_iter().partition(Item::is_empty);
    Items {
        with_area,
        without: without.iter().map(Item::number).collect(),
    }
}

/// Which triangles of a mesh are in a leaf that the root of a kd-tree reaches. (An arena may hold other trees too.)
fn triangles_of(tree: &Tree, triangles: usize) -> Vec<bool> {
    let mut is_in_tree = vec![false; triangles];
    let mut is_seen = vec![false; tree.nodes().len()];
    let mut pending = vec![tree.root()];
    while let Some(place) = pending.pop() {
        // Subtrees may be shared.
        if std::mem::replace(&mut is_seen[place.index()], true) {
            continue;
        }
        let node = tree.nodes()[place.index()];
        if node.is_leaf() {
            for slot in tree.leaf_refs(node) {
                is_in_tree[slot.0 as usize] = true;
            }
        } else {
            let first = node.first_child();
            pending.extend([first, first.sibling()]);
        }
    }
    is_in_tree
}
