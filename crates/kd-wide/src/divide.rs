//! Divide: from a kd-tree or a list of triangles to a binary tree of boxes. The one place that decides which splits come from
//! the kd-tree.
//!
//! Cells of more than [`PLANES_ABOVE`] triangles are divided by the planes of the kd-tree. A triangle that a plane cuts goes to
//! both sides, with a tight box for each, or to one side as a whole where that costs less (M. Stich, H. Friedrich,
//! A. Dietrich, *Spatial Splits in Bounding Volume Hierarchies*, 2009, section 4.4: reference unsplitting). Smaller cells are
//! divided by object splits ([`object_split`](crate::object_split)): boxes may overlap where cells may not, and no triangle is
//! in two leaves.
//!
//! A large cell is divided by an object split too where the plane costs much more. That happens where a few huge triangles are
//! among many small ones: each plane that cuts off empty space also cuts the huge triangles.
//!
//! Why both, from a throw-away program over a scan, a city and three rooms (2026-11-25): with all planes of a kd-tree (in
//! two of the rooms) rays visit about as many nodes as with objects alone (0.9 to 1.12 times) and more blocks, in 1.5 to
//! 2.3 times the memory. Planes above a thousand triangles have a SAH cost 3 to 13 % below that of objects alone in the
//! rooms, 0.2 % above it on the scan and 2.5 % on the city, and about the same memory.

use kd_core::{Aabb, Axis, MAX_DEPTH, Mesh, NodeIndex, NodeView, Tree, clipped_halves};

use crate::box_tree::{Added, BoxTree, Item, Leaves};
use crate::object_split::ObjectSplit;

/// Cells of more triangles may be divided by the planes of the kd-tree; all others are divided as objects only.
pub const PLANES_ABOVE: usize = 1024;
/// Items that are not divided.
const FEW: usize = 8;
/// An object split replaces a plane that costs more than one over this as much.
///
/// (At 0.9, rays take 1 to 8 % longer in a cathedral. Without object splits, AO rays take 25 % longer in a game level with huge
/// walls. Throw-away program; `cargo xtask rays --scenes DIR --scene sibenik,czest2ctf` measures the same scenes, 2026-11-30.)
const CHEAPER: f64 = 0.5;
/// Object splits on a path before items are divided in halves by number.
pub(crate) const MOST_DIVISIONS: usize = 32;
/// The largest number of levels of a wide tree: those of planes, of object splits and of halves of a 32-bit number; and above
/// them those of a join, which divides by object splits and halves. A ray's stack holds seven children a level.
pub const MAX_LEVELS: usize = MAX_DEPTH + 2 * (MOST_DIVISIONS + 32);
/// The fewest triangles on the smaller side of a plane that are worth a task.
const TASK: usize = 1 << 14;
/// The fewest items on the smaller side of an object split that are worth a task: some hundreds of microseconds.
const OBJECT_TASK: usize = 1 << 11;

/// One over the half area of a box; 0 if the area is 0.
pub(crate) fn per_area(bounds: &Aabb) -> f64 {
    let area = bounds.half_area();
    if area > 0.0 { area.recip() } else { 0.0 }
}

/// Boxes, and their SAH cost relative to the half area of the root's box.
pub(crate) type Costed = (BoxTree, f32);

/// The boxes of all triangles of a tree, which are the items. Planes divide cells of more than `planes_above` triangles, and
/// always do if it is given; by default that is [`PLANES_ABOVE`], and object splits compete.
pub(crate) fn boxes_of_tree(
    tree: &Tree,
    mesh: &Mesh,
    items: Vec<Item>,
    planes_above: Option<usize>,
    is_parallel: bool,
) -> Costed {
    let mut boxes = BoxTree::new(Leaves::Triangles);
    let divider = Divider {
        tree,
        mesh,
        per_area: per_area(&tree.bounds()),
        planes_above: planes_above.unwrap_or(PLANES_ABOVE),
        objects_compete: planes_above.is_none(),
        is_parallel,
    };
    if items.is_empty() {
        return (boxes, 0.0);
    }
    let root = divider.by_planes(tree.root(), items, 0, &mut boxes);
    (boxes, root.cost())
}

/// The boxes of triangles, all within `bounds`, divided by object splits alone.
pub(crate) fn boxes_of_objects(mut items: Vec<Item>, bounds: &Aabb, is_parallel: bool) -> Costed {
    let mut boxes = BoxTree::new(Leaves::Triangles);
    if items.is_empty() {
        return (boxes, 0.0);
    }
    let root = by_objects(&mut items, 0, per_area(bounds), is_parallel, &mut boxes);
    (boxes, root.cost())
}

/// Makes the boxes of a subtree of a kd-tree.
struct Divider<'a> {
    tree: &'a Tree,
    mesh: &'a Mesh,
    /// One over the half area of the root's box.
    per_area: f64,
    /// Cells of more triangles are divided by planes of the kd-tree.
    planes_above: usize,
    /// Whether they are divided as objects where that costs less.
    objects_compete: bool,
    is_parallel: bool,
}

impl Divider<'_> {
    /// Adds the boxes of `items`, at least one, divided by the planes of a subtree of the kd-tree. `divisions` counts the object
    /// splits above.
    fn by_planes(
        &self,
        mut at: NodeIndex,
        mut items: Vec<Item>,
        divisions: usize,
        to: &mut BoxTree,
    ) -> Added {
        loop {
            let node = self.tree.nodes()[at.index()].view();
            let NodeView::Interior { axis, split, first } = node else {
                return self.by_objects(&mut items, divisions, to);
            };
            if items.len() <= self.planes_above {
                return self.by_objects(&mut items, divisions, to);
            }
            let sides = Sides::of(&items, axis, split, self.mesh);
            if let Some(objects) = self.cheaper_objects(&items, &sides, divisions) {
                let middle = objects.apply(&mut items);
                let upper = items.split_off(middle);
                let divisions = divisions + 1;
                return self.split(objects.axis, [(at, items), (at, upper)], divisions, to);
            }
            let [lower, upper] = sides.items;
            (items, at) = if upper.is_empty() {
                (lower, first)
            } else if lower.is_empty() {
                (upper, first.sibling())
            } else {
                let parts = [(first, lower), (first.sibling(), upper)];
                return self.split(axis, parts, divisions, to);
            };
        }
    }

    /// On one thread: planes have divided the work into tasks, and a small cell seldom is worth one.
    fn by_objects(&self, items: &mut [Item], divisions: usize, to: &mut BoxTree) -> Added {
        by_objects(items, divisions, self.per_area, false, to)
    }

    /// An object split that costs much less than the plane.
    fn cheaper_objects(
        &self,
        items: &[Item],
        sides: &Sides,
        divisions: usize,
    ) -> Option<ObjectSplit> {
        let may_be = self.objects_compete && divisions < MOST_DIVISIONS;
        let split = may_be.then(|| ObjectSplit::best(items)).flatten();
        split.filter(|split| f64::from(split.cost) < CHEAPER * sides.cost)
    }

    fn split(
        &self,
        axis: Axis,
        [lower, upper]: [(NodeIndex, Vec<Item>); 2],
        divisions: usize,
        to: &mut BoxTree,
    ) -> Added {
        let place = to.reserve();
        if self.is_parallel && upper.1.len().min(lower.1.len()) >= TASK {
            let mut other = BoxTree::new(Leaves::Triangles);
            let (lower, added) = kd_tasks::join_if(
                true,
                || self.by_planes(lower.0, lower.1, divisions, to),
                || self.by_planes(upper.0, upper.1, divisions, &mut other),
            );
            let upper = to.append(&other, added, 0);
            return to.set_split(place, axis, [lower, upper], self.per_area);
        }
        let parts = [lower, upper].map(|(at, items)| self.by_planes(at, items, divisions, to));
        to.set_split(place, axis, parts, self.per_area)
    }
}

/// Adds the boxes of items, at least one, by object splits. `divisions` counts those above; `per_area` is one over the half area
/// of the root's box.
fn by_objects(
    items: &mut [Item],
    divisions: usize,
    per_area: f64,
    is_parallel: bool,
    to: &mut BoxTree,
) -> Added {
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
    let divisions = divisions + 1;
    if is_parallel && lower.len().min(upper.len()) >= OBJECT_TASK {
        let mut other = BoxTree::new(Leaves::Triangles);
        let (lower, added) = kd_tasks::join_if(
            true,
            || by_objects(lower, divisions, per_area, true, to),
            || by_objects(upper, divisions, per_area, true, &mut other),
        );
        let upper = to.append(&other, added, 0);
        return to.set_split(place, division.axis, [lower, upper], per_area);
    }
    let parts = [lower, upper].map(|part| by_objects(part, divisions, per_area, is_parallel, to));
    to.set_split(place, division.axis, parts, per_area)
}

/// The items on both sides of a plane, and their SAH cost: the half area of each box times its number of items.
struct Sides {
    items: [Vec<Item>; 2],
    cost: f64,
}

impl Sides {
    fn of(items: &[Item], axis: Axis, split: f32, mesh: &Mesh) -> Self {
        let along = axis.index();
        let half = || Vec::with_capacity(items.len() / 2);
        let (mut lower, mut upper, mut both) = (half(), half(), Vec::new());
        for &item in items {
            if item.min[along] >= split && item.max[along] > split {
                upper.push(item);
            } else if item.max[along] <= split {
                lower.push(item);
            } else {
                both.push(item);
            }
        }
        let halves = both.iter().map(|item| {
            let corners = mesh.corners(item.number);
            clipped_halves(corners, &item.bounds(), axis, split)
        });
        let halves: Vec<[Option<Aabb>; 2]> = halves.collect();
        let around = |items: &[Item], side: usize| {
            let cut = halves.iter().filter_map(|half| half[side]);
            cut.fold(Item::around(items), |bounds, part| bounds.union(&part))
        };
        let mut bounds = [around(&lower, 0), around(&upper, 1)];
        let mut counts = [lower.len() + both.len(), upper.len() + both.len()];
        for (item, half) in both.into_iter().zip(halves) {
            match Self::destination(&item, half, bounds, counts) {
                Destination::Side(side) => {
                    bounds[side] = bounds[side].union(&item.bounds());
                    counts[side ^ 1] -= 1;
                    [&mut lower, &mut upper][side].push(item);
                }
                Destination::Both(parts) => {
                    lower.push(Item::within(parts[0], item.number));
                    upper.push(Item::within(parts[1], item.number));
                }
            }
        }
        let cost = |side: usize| bounds[side].half_area() * counts[side] as f64;
        Self {
            items: [lower, upper],
            cost: cost(0) + cost(1),
        }
    }

    /// The cheapest of three: the triangle cut, or whole on either side.
    fn destination(
        item: &Item,
        half: [Option<Aabb>; 2],
        bounds: [Aabb; 2],
        counts: [usize; 2],
    ) -> Destination {
        let [Some(lower), Some(upper)] = half else {
            return Destination::Side(usize::from(half[0].is_none()));
        };
        let cost = |bounds: &Aabb, count: usize| bounds.half_area() * count as f64;
        let as_cut = [0, 1].map(|side| cost(&bounds[side], counts[side]));
        let whole_on = |side: usize| {
            let grown = cost(&bounds[side].union(&item.bounds()), counts[side]);
            grown + cost(&bounds[side ^ 1], counts[side ^ 1] - 1)
        };
        let (cut, on_lower, on_upper) = (as_cut[0] + as_cut[1], whole_on(0), whole_on(1));
        if on_lower <= on_upper && on_lower <= cut {
            Destination::Side(0)
        } else if on_upper <= cut {
            Destination::Side(1)
        } else {
            Destination::Both([lower, upper])
        }
    }
}

/// Where a triangle that a plane cuts goes.
enum Destination {
    Side(usize),
    Both([Aabb; 2]),
}
