//! Divide: from triangles to a binary tree of boxes. The one place that decides between planes and objects.
//!
//! Cells of at most [`PLANES_ABOVE`] triangles are divided by object splits ([`object_split`](crate::object_split)): boxes may
//! overlap where cells of a kd-tree may not, and no triangle is in two leaves. Larger cells may be divided by planes:
//!
//! - *from bins* ([`OfBins`]), where an object split leaves two boxes that overlap much;
//! - *of a kd-tree* ([`OfTree`]), always, down to its leaves.
//!
//! Large cells with a few huge triangles are divided into those and all others first, where that costs less ([`huge`]).
//!
//! A triangle that a plane cuts goes to both sides, with a tight box for each, or to one side as a whole where that costs less
//! ([`Sides`]). An object split replaces a plane that costs more ([`Planes::OBJECTS_BELOW`]). Planes cost much more where a few huge
//! triangles are among many small ones: each plane that cuts off empty space also cuts the huge triangles.
//!
//! Why planes in large cells only, from a throw-away program over a scan, a city and three rooms (2026-11-25): with all planes
//! of a kd-tree (in two of the rooms) rays visit about as many nodes as with objects alone (0.9 to 1.12 times) and more blocks,
//! in 1.5 to 2.3 times the memory. Planes above a thousand triangles have a SAH cost 3 to 13 % below that of objects alone in the
//! rooms, 0.2 % above it on the scan and 2.5 % on the city, and about the same memory.

mod huge;
mod planes;
mod sides;

use kd_core::{Aabb, Axis, MAX_DEPTH, Mesh, Tree};
use kd_tasks::Share;

use crate::box_tree::{Added, BoxTree, Item, Leaves};
use crate::object_split::ObjectSplit;
use crate::work::Work;
use huge::HugeSplit;
use planes::{Allowance, NoPlanes, OfBins, OfTree, Planes};
use sides::Sides;

/// Cells of more triangles may be divided by planes; all others are divided as objects only.
pub const PLANES_ABOVE: usize = 1024;
/// Items that are not divided.
const FEW: usize = 8;
/// Object splits on a path before items are divided in halves by number.
pub(crate) const MOST_DIVISIONS: usize = 32;
/// The largest number of levels of a wide tree: those of a division; below them those of triangles that are not divided; and above
/// them those of a join, which divides by object splits and halves. A ray's stack holds seven children a level.
pub const MAX_LEVELS: usize = MAX_DIVIDED_LEVELS + MOST_UNDIVIDED_LEVELS + MOST_DIVISIONS + 32;
/// Those of a 32-bit number of triangles in one place, eight parts a node, and of the link to triangles of zero area.
const MOST_UNDIVIDED_LEVELS: usize = 32 / 3 + 1;
/// Those of planes, of object splits and of halves of a 32-bit number.
pub(crate) const MAX_DIVIDED_LEVELS: usize = MAX_DEPTH + MOST_DIVISIONS + 32;
/// The fewest items on the smaller side of a split that are worth a task: some hundreds of microseconds.
const TASK: usize = 1 << 11;

/// One over the half area of a box; 0 if the area is 0.
pub(crate) fn per_area(bounds: &Aabb) -> f64 {
    let area = bounds.half_area();
    if area > 0.0 { area.recip() } else { 0.0 }
}

/// Boxes, and their SAH cost relative to the half area of the root's box.
pub(crate) type Costed = (BoxTree, f32);

/// The boxes of triangles of a kd-tree. Its planes divide cells of more than `planes_above` triangles, and always do if it is
/// given; by default that is [`PLANES_ABOVE`], and object splits compete.
pub(crate) fn boxes_of_tree(
    tree: &Tree,
    mesh: &Mesh,
    items: Vec<Item>,
    planes_above: Option<usize>,
    work: Work<'_>,
) -> Costed {
    let divider = Divider {
        planes: OfTree(tree),
        mesh: Some(mesh),
        per_area: per_area(&tree.bounds()),
        planes_above: planes_above.unwrap_or(PLANES_ABOVE),
        objects_compete: planes_above.is_none(),
        work,
    };
    divider.boxes(items, tree.root())
}

/// The boxes of triangles, all within `bounds`, divided by planes from bins where objects overlap. At most `most_items` items are in
/// leaves, or as many as there are.
pub(crate) fn boxes_of_bins(
    mesh: &Mesh,
    items: Vec<Item>,
    bounds: &Aabb,
    most_items: u64,
    work: Work<'_>,
) -> Costed {
    let per_area = per_area(bounds);
    let root = Allowance::of_root(items.len(), most_items);
    let divider = Divider {
        planes: OfBins { per_area },
        mesh: Some(mesh),
        per_area,
        planes_above: PLANES_ABOVE,
        objects_compete: true,
        work,
    };
    divider.boxes(items, root)
}

/// The boxes of items, all within `bounds`, divided by object splits alone.
pub(crate) fn boxes_of_objects(items: Vec<Item>, bounds: &Aabb, work: Work<'_>) -> Costed {
    let divider = Divider {
        planes: NoPlanes,
        mesh: None,
        per_area: per_area(bounds),
        planes_above: PLANES_ABOVE,
        objects_compete: true,
        work,
    };
    divider.boxes(items, ())
}

/// Makes the boxes of items.
struct Divider<'a, P> {
    planes: P,
    /// The triangles that planes may cut; `None` where there are no planes.
    mesh: Option<&'a Mesh>,
    /// One over the half area of the root's box.
    per_area: f64,
    /// Cells of more items may be divided by planes.
    planes_above: usize,
    /// Whether they may be divided as objects too.
    objects_compete: bool,
    work: Work<'a>,
}

/// A cell, without its items.
#[derive(Clone, Copy)]
struct Cell<C> {
    planes: C,
    /// Object splits above.
    divisions: usize,
    /// Its share of the work.
    share: Share,
}

/// The memory of a thread.
#[derive(Default)]
struct Memory {
    /// A stack: the items of the cell that is divided are the last ones.
    items: Vec<Item>,
    sides: Sides,
}

impl<P: Planes> Divider<'_, P> {
    fn boxes(&self, items: Vec<Item>, root: P::Cell) -> Costed {
        let mut boxes = BoxTree::with_room_for(items.len(), Leaves::Triangles);
        if items.is_empty() {
            return (boxes, 0.0);
        }
        let root = Cell {
            planes: root,
            divisions: 0,
            share: self.work.share,
        };
        let mut memory = Memory {
            items,
            sides: Sides::default(),
        };
        let root = self.divide(root, &mut memory, 0, &mut boxes);
        (boxes, root.cost())
    }

    /// Adds the boxes of the items from `first` on, at least one, and removes these items.
    fn divide(
        &self,
        mut cell: Cell<P::Cell>,
        memory: &mut Memory,
        first: usize,
        to: &mut BoxTree,
    ) -> Added {
        loop {
            let Memory { items, sides } = memory;
            let own = &mut items[first..];
            if own.len() <= self.planes_above || self.work.tracker.check().is_err() {
                return self.finish(cell, memory, first, to);
            }
            let is_parallel = self.work.is_parallel;
            let objects = (self.objects_compete && cell.divisions < MOST_DIVISIONS)
                .then(|| ObjectSplit::measured(own, is_parallel))
                .flatten();
            let huge = objects
                .as_ref()
                .and_then(|objects| HugeSplit::of(own, objects, is_parallel));
            let plane = self
                .planes
                .plane(&cell.planes, own, objects.as_ref(), is_parallel);
            let plane = plane.zip(self.mesh).filter(|(plane, mesh)| {
                sides.measure(own, *plane, mesh, is_parallel);
                objects.is_none_or(|objects| P::is_cheap(sides.cost(), &objects))
            });
            let cost = match (plane, objects) {
                (Some(_), _) => sides.cost(),
                (None, Some(objects)) => f64::from(objects.split.cost),
                (None, None) => f64::INFINITY,
            };
            if let Some(huge) = huge.filter(|huge| huge.is_cheaper(cost)) {
                let upper = first + huge.lower;
                let counts = [huge.lower, items.len() - upper];
                cell.divisions += 1;
                let cells = cell.both(self.planes.objects(&cell.planes, counts), counts);
                return self.split(huge.axis, cells, memory, [first, upper], to);
            }
            if let Some((plane, _)) = plane {
                let counts = sides.counts();
                if let Some(empty) = counts.iter().position(|count| *count == 0) {
                    cell.planes = self.planes.one(&cell.planes, empty ^ 1);
                    continue;
                }
                let upper = sides.apply(items, first, plane);
                let planes = self.planes.both(&cell.planes, counts);
                let cells = cell.both(planes, counts);
                return self.split(plane.axis, cells, memory, [first, upper], to);
            }
            let Some(objects) = objects else {
                return self.finish(cell, memory, first, to);
            };
            let upper = first + objects.split.apply(&mut items[first..]);
            let counts = [upper - first, items.len() - upper];
            cell.divisions += 1;
            let cells = cell.both(self.planes.objects(&cell.planes, counts), counts);
            return self.split(objects.split.axis, cells, memory, [first, upper], to);
        }
    }

    /// Divides the items from `first` on as objects, on this thread.
    fn finish(
        &self,
        cell: Cell<P::Cell>,
        memory: &mut Memory,
        first: usize,
        to: &mut BoxTree,
    ) -> Added {
        let own = &mut memory.items[first..];
        let added = if self.work.tracker.done(cell.share).is_ok() {
            by_objects(own, cell.divisions, self.per_area, to)
        } else {
            to.add_leaf(own, self.per_area)
        };
        memory.items.truncate(first);
        added
    }

    /// Adds a box over two cells: the items from the first place on, and those from the second on.
    fn split(
        &self,
        axis: Axis,
        [lower, upper]: [Cell<P::Cell>; 2],
        memory: &mut Memory,
        [first, middle]: [usize; 2],
        to: &mut BoxTree,
    ) -> Added {
        let place = to.reserve();
        let smaller = (middle - first).min(memory.items.len() - middle);
        let [upper, lower] = if self.work.is_parallel && smaller >= TASK {
            let mut beside = Memory {
                items: memory.items.split_off(middle),
                sides: Sides::default(),
            };
            let mut other = BoxTree::with_room_for(middle - first, Leaves::Triangles);
            let (lower, upper) = kd_tasks::join_if(
                true,
                || self.divide(lower, memory, first, &mut other),
                || self.divide(upper, &mut beside, 0, to),
            );
            [upper, to.append(&other, lower, 0)]
        } else {
            // The items of the upper side are the last ones.
            let upper = self.divide(upper, memory, middle, to);
            [upper, self.divide(lower, memory, first, to)]
        };
        to.set_split(place, axis, [lower, upper], self.per_area)
    }
}

impl<C: Copy> Cell<C> {
    fn both(&self, planes: [C; 2], counts: [usize; 2]) -> [Self; 2] {
        let shares = self.share.divide(counts);
        [0, 1].map(|side: usize| Self {
            planes: planes[side],
            share: shares[side],
            ..*self
        })
    }
}

/// Adds the boxes of items, at least one, by object splits. `divisions` counts those above; `per_area` is one over the half area
/// of the root's box.
fn by_objects(items: &mut [Item], divisions: usize, per_area: f64, to: &mut BoxTree) -> Added {
    let division = (items.len() > FEW)
        .then(|| ObjectSplit::best(items))
        .flatten();
    let Some(division) = division else {
        return to.add_leaf(items, per_area);
    };
    let place = to.reserve();
    let middle = if divisions < MOST_DIVISIONS {
        division.apply(items)
    } else {
        items.len() / 2
    };
    let (lower, upper) = items.split_at_mut(middle);
    let parts = [lower, upper].map(|part| by_objects(part, divisions + 1, per_area, to));
    to.set_split(place, division.axis, parts, per_area)
}
