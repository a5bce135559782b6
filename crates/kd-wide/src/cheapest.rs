//! The cheapest of several trees of boxes by SAH cost.
//!
//! Planes pay among the walls of a church, object splits on a scan. Where many objects lie among each other, neither decides well near the
//! root, and a tree that is optimized as a whole costs less.

use kd_core::{Aabb, Mesh};

use crate::bottom_up::bottom_up;
use crate::box_tree::{BoxTree, Item};
use crate::divide::{Costed, boxes_of_bins, boxes_of_objects, per_area};
use crate::linked::LinkedTree;
use crate::reinsert::reinsert;
use crate::work::Work;

/// An optimized tree replaces another one if its SAH cost is below this part of the other's.
///
/// (Trees that are cheaper by 1 to 3 % after reinsertion do not trace faster, and those of gears 4 % slower. Where they are cheaper by
/// more, as in rooms, rays are 2 to 18 % faster. A throw-away program over 20 meshes, 2026-11-30.)
const WORTH: f32 = 0.97;

/// The boxes of [`Division::Cheapest`](crate::Division::Cheapest).
pub(crate) fn cheapest(
    mesh: &Mesh,
    items: Vec<Item>,
    bounds: &Aabb,
    most_references: u64,
    work: Work<'_>,
) -> Costed {
    let [planes, rest] = work.divide([2, 3]);
    let [objects, rest] = rest.divide([1, 2]);
    let [first, second] = rest.divide([1, 1]);
    let per_area = per_area(bounds);
    let optimized = |tree: Option<LinkedTree>, boxes: &BoxTree, work: Work<'_>| {
        let mut tree = tree?;
        reinsert(&mut tree, work);
        tree.to_boxes(boxes, per_area)
    };
    let all_of_objects = |items| {
        let objects = boxes_of_objects(items, bounds, objects);
        let (reinserted, bottom_up) = kd_tasks::join_if(
            work.is_parallel,
            || optimized(LinkedTree::of(&objects.0), &objects.0, first),
            || {
                let tree = bottom_up(&objects.0, work.is_parallel);
                optimized(tree, &objects.0, second)
            },
        );
        let optimized = cheaper(reinserted, bottom_up, 1.0);
        (objects, optimized)
    };
    let copy = items.clone();
    let (planes, (objects, optimized)) = kd_tasks::join_if(
        work.is_parallel,
        || boxes_of_bins(mesh, items, bounds, most_references, planes),
        || all_of_objects(copy),
    );
    let divided = cheaper(Some(planes), Some(objects), 1.0);
    cheaper(divided, optimized, WORTH).expect("two divisions")
}

/// The second of two if its cost is below `part` of the first one's.
fn cheaper(first: Option<Costed>, second: Option<Costed>, part: f32) -> Option<Costed> {
    match (first, second) {
        (Some(first), Some(second)) if second.1 < part * first.1 => Some(second),
        (None, second) => second,
        (first, _) => first,
    }
}
