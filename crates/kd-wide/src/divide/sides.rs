//! The division of items by a plane: first measured, then done in place.

use kd_core::{Aabb, Mesh, clipped_halves};

use super::planes::Plane;
use crate::bins::Group;
use crate::box_tree::Item;
use crate::chunks;

/// What happens to an item that a plane cuts.
#[derive(Clone, Copy, Debug)]
enum Cut {
    /// It goes to one side as a whole: 0 is the lower one.
    Whole(usize),
    /// Each side gets a part.
    Parts([Aabb; 2]),
}

/// An item that a plane cuts, by its place.
type CutAt = (usize, Cut);

/// Where a plane puts each item. Reuses its memory.
#[derive(Debug, Default)]
pub(super) struct Sides {
    /// By ascending place.
    cuts: Vec<CutAt>,
    /// Items on the lower and the upper side.
    counts: [usize; 2],
    cost: f64,
}

impl Sides {
    /// Items on the lower and the upper side.
    pub(super) fn counts(&self) -> [usize; 2] {
        self.counts
    }

    /// The SAH cost: the half area of each side's box times its number of items, in squared scene units.
    pub(super) fn cost(&self) -> f64 {
        self.cost
    }

    /// Decides for each item, and moves none. One that the plane cuts goes to both sides, with a tight box for each part, or to one
    /// side as a whole where that costs less (Stich, Friedrich, Dietrich 2009, section 4.4: reference unsplitting).
    pub(super) fn measure(&mut self, items: &[Item], plane: Plane, mesh: &Mesh, is_parallel: bool) {
        self.cuts.clear();
        let mut sides = if is_parallel && chunks::are_many(items) {
            let scanned = chunks::reduce(
                items,
                true,
                |items| Scanned::of(items, plane, mesh),
                Scanned::followed_by,
            );
            self.cuts = scanned.cuts;
            scanned.sides
        } else {
            scan(items, plane, mesh, &mut self.cuts)
        };
        for (place, cut) in &self.cuts {
            match cut {
                Cut::Whole(side) => sides[*side].add(&Group::of(&items[*place])),
                Cut::Parts(parts) => {
                    for (side, part) in sides.iter_mut().zip(parts) {
                        side.add(&Group::of(&Item::within(*part, 0)));
                    }
                }
            }
        }
        let mut sides = sides.map(|side| Side {
            bounds: Aabb {
                min: side.min.into(),
                max: side.max.into(),
            },
            count: side.count as usize,
        });
        for (place, cut) in &mut self.cuts {
            if matches!(cut, Cut::Whole(_)) {
                continue;
            }
            let whole = items[*place].bounds();
            if let Some(side) = cheaper_whole(&whole, &sides) {
                *cut = Cut::Whole(side);
                sides[side].bounds = sides[side].bounds.union(&whole);
                sides[side ^ 1].count -= 1;
            }
        }
        self.counts = sides.map(|side| side.count);
        self.cost = sides.iter().map(Side::cost).sum();
    }

    /// Moves the items from `first` on, which were measured: first those of the lower side. Returns where the upper side begins.
    pub(super) fn apply(&self, items: &mut Vec<Item>, first: usize, plane: Plane) -> usize {
        let along = plane.axis.index();
        let end = items.len();
        let mut cuts = self.cuts.iter().peekable();
        let mut upper = first;
        for at in first..end {
            let mut is_lower = items[at].max_on(along) <= plane.position;
            if let Some((_, cut)) = cuts.next_if(|(place, _)| first + place == at) {
                match cut {
                    Cut::Whole(side) => is_lower = *side == 0,
                    Cut::Parts([below, above]) => {
                        is_lower = true;
                        let number = items[at].number();
                        items[at] = Item::within(*below, number);
                        items.push(Item::within(*above, number));
                    }
                }
            }
            // Always swapped, and counted or not: a branch on the side would be unpredictable.
            items.swap(at, upper);
            upper += usize::from(is_lower);
        }
        upper
    }
}

/// The items of a chunk.
struct Scanned {
    count: usize,
    /// Those on the two sides of a plane that are not cut.
    sides: [Group; 2],
    cuts: Vec<CutAt>,
}

impl Scanned {
    fn of(items: &[Item], plane: Plane, mesh: &Mesh) -> Self {
        let mut cuts = Vec::new();
        Self {
            count: items.len(),
            sides: scan(items, plane, mesh, &mut cuts),
            cuts,
        }
    }

    fn followed_by(mut self, other: Self) -> Self {
        for (side, more) in self.sides.iter_mut().zip(&other.sides) {
            side.add(more);
        }
        let before = self.count;
        let cuts = other.cuts.into_iter();
        self.cuts
            .extend(cuts.map(|(place, cut)| (before + place, cut)));
        self.count += other.count;
        self
    }
}

/// Adds the items that a plane cuts to `cuts`. Returns the others, by side.
fn scan(items: &[Item], plane: Plane, mesh: &Mesh, cuts: &mut Vec<CutAt>) -> [Group; 2] {
    let along = plane.axis.index();
    let mut sides = [Group::NOTHING; 2];
    for (place, item) in items.iter().enumerate() {
        let is_lower = item.max_on(along) <= plane.position;
        if is_lower | (item.min_on(along) >= plane.position) {
            sides[usize::from(!is_lower)].add(&Group::of(item));
            continue;
        }
        let corners = mesh.corners(item.number());
        let cut = match clipped_halves(corners, &item.bounds(), plane.axis, plane.position) {
            [Some(below), Some(above)] => Cut::Parts([below, above]),
            [below, _] => Cut::Whole(usize::from(below.is_none())),
        };
        cuts.push((place, cut));
    }
    sides
}

#[derive(Clone, Copy)]
struct Side {
    bounds: Aabb,
    count: usize,
}

impl Side {
    fn cost(&self) -> f64 {
        self.bounds.half_area() * self.count as f64
    }
}

/// The side on which a triangle that counts on both costs less as a whole.
fn cheaper_whole(whole: &Aabb, sides: &[Side; 2]) -> Option<usize> {
    let as_cut = sides[0].cost() + sides[1].cost();
    let whole_on = [0, 1].map(|side: usize| {
        let grown = Side {
            bounds: sides[side].bounds.union(whole),
            ..sides[side]
        };
        let other = Side {
            count: sides[side ^ 1].count - 1,
            ..sides[side ^ 1]
        };
        grown.cost() + other.cost()
    });
    if whole_on[0] <= whole_on[1] && whole_on[0] <= as_cut {
        Some(0)
    } else if whole_on[1] <= as_cut {
        Some(1)
    } else {
        None
    }
}
