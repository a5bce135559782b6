//! The triangles of a mesh as items: those with an area, and those without.

use kd_core::{Aabb, Mesh, Tree};

use crate::box_tree::Item;
use crate::large_pages;

/// The triangles of a mesh.
pub(crate) struct Items {
    pub(crate) with_area: Vec<Item>,
    /// The numbers of those of zero area.
    pub(crate) without: Vec<u32>,
}

/// The triangles of a mesh, each with its box.
pub(crate) fn items_of_mesh(mesh: &Mesh, is_parallel: bool) -> Items {
    const CHUNK: usize = 1 << 12;
    // Zeroed pages of the system, untouched: threads share the work of touching them.
    let mut items: Vec<Item> = bytemuck::zeroed_vec(mesh.len());
    large_pages::advise(&items);
    let chunks = (0..).step_by(CHUNK).zip(items.chunks_mut(CHUNK));
    let all_have_area = kd_tasks::map(chunks.collect(), is_parallel, |(first, chunk)| {
        let mut all_have_area = true;
        for (triangle, item) in (first..).zip(chunk) {
            *item = item_of(triangle, mesh);
            all_have_area &= !item.is_empty();
        }
        all_have_area
    });
    if all_have_area.into_iter().all(|all| all) {
        return Items {
            with_area: items,
            without: Vec::new(),
        };
    }
    divided_by_area(items)
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
