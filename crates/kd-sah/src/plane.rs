//! Candidate planes and their cost.

use kd_core::{Aabb, Axis, CostModel};

/// A plane to divide a cell by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    /// Where primitives go that lie in the plane itself: never to both sides.
    pub(crate) planar_side: Side,
    /// Expected cost of the cell when divided here, for a ray that enters it.
    pub(crate) cost: f64,
}

/// One of the two sides of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Side {
    Lower,
    Upper,
}

impl Plane {
    /// The order in which planes are preferred: lower cost, then axis, then position, then planar primitives below.
    ///
    /// It is total, so the winner does not depend on the order in which candidates are looked at.
    fn is_better(&self, other: &Self) -> bool {
        let rank = |plane: &Self| (plane.axis, plane.position, plane.planar_side);
        self.cost < other.cost || (self.cost == other.cost && rank(self) < rank(other))
    }
}

/// How many primitives lie where, as seen from a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Reaching below the plane.
    pub(crate) lower: usize,
    /// Lying in it.
    pub(crate) planar: usize,
    /// Reaching above it. One that straddles the plane counts below and above.
    pub(crate) upper: usize,
}

/// Looks for the best plane of one cell; every chooser offers its candidates here, so that they agree on cost and ties.
pub(crate) struct BestPlane<'a> {
    model: &'a CostModel,
    sides: [Sides; 3],
    best: Option<Plane>,
}

/// The chances of entering either part of a cell, as linear functions of where it is cut along an axis.
#[derive(Clone, Copy)]
struct Sides {
    min: f32,
    max: f32,
    /// Chance of entering a part of no thickness: the area of the face cut out, over the half area of the cell.
    face: f64,
    /// What each unit of thickness adds: the sum of the two edges of that face, over the same.
    per_length: f64,
}

impl Sides {
    fn of(cell: &Aabb, axis: Axis) -> Self {
        let extent = cell.max.as_dvec3() - cell.min.as_dvec3();
        let (a, b) = (
            extent[axis.next().index()],
            extent[axis.next().next().index()],
        );
        let inverse = 1.0 / cell.half_area();
        Self {
            min: cell.min[axis.index()],
            max: cell.max[axis.index()],
            face: a * b * inverse,
            per_length: (a + b) * inverse,
        }
    }

    /// Chances of entering the lower and the upper part, for a ray that enters the cell.
    #[inline]
    fn chances(&self, position: f32) -> (f64, f64) {
        let position = f64::from(position);
        (
            self.face + self.per_length * (position - f64::from(self.min)),
            self.face + self.per_length * (f64::from(self.max) - position),
        )
    }
}

impl<'a> BestPlane<'a> {
    pub(crate) fn new(model: &'a CostModel, cell: &Aabb) -> Self {
        Self {
            model,
            sides: Axis::ALL.map(|axis| Sides::of(cell, axis)),
            best: None,
        }
    }

    /// Considers a plane, with planar primitives on either side. Only planes strictly inside the cell divide it.
    ///
    /// Cost after MacDonald and Booth as in Wald and Havran 2006, eq. 4: K_T plus each side's leaf cost times its
    /// half area over the cell's, with a bonus where a side is empty.
    #[inline]
    pub(crate) fn offer(&mut self, axis: Axis, position: f32, counts: Counts) {
        let sides = self.sides[axis.index()];
        if !(sides.min < position && position < sides.max) {
            return;
        }
        let chances = sides.chances(position);
        self.offer_side(axis, position, counts, Side::Lower, chances);
        if counts.planar > 0 {
            self.offer_side(axis, position, counts, Side::Upper, chances);
        }
    }

    #[inline]
    fn offer_side(
        &mut self,
        axis: Axis,
        position: f32,
        counts: Counts,
        planar_side: Side,
        (chance_lower, chance_upper): (f64, f64),
    ) {
        let (lower, upper) = match planar_side {
            Side::Lower => (counts.lower + counts.planar, counts.upper),
            Side::Upper => (counts.lower, counts.planar + counts.upper),
        };
        let mut cost = f64::from(self.model.traverse)
            + chance_lower * self.model.leaf(lower)
            + chance_upper * self.model.leaf(upper);
        if lower == 0 || upper == 0 {
            cost *= f64::from(self.model.empty_bonus);
        }
        let plane = Plane {
            axis,
            position,
            planar_side,
            cost,
        };
        // A cell without area makes the cost NaN: no plane is better than none there.
        if !cost.is_nan() && self.best.is_none_or(|best| plane.is_better(&best)) {
            self.best = Some(plane);
        }
    }

    pub(crate) fn found(self) -> Option<Plane> {
        self.best
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn best_of(offers: &[(Axis, f32, Counts)]) -> Option<Plane> {
        let cell = Aabb::around([Vec3::ZERO, Vec3::splat(4.0)]);
        let mut best = BestPlane::new(&CostModel::CLASSIC, &cell);
        for &(axis, position, counts) in offers {
            best.offer(axis, position, counts);
        }
        best.found()
    }

    const EVEN: Counts = Counts {
        lower: 4,
        planar: 0,
        upper: 4,
    };

    #[test]
    fn ties_do_not_depend_on_the_order_of_offers() {
        let mut offers = vec![
            (Axis::Z, 1.0, EVEN),
            (Axis::Y, 3.0, EVEN),
            (Axis::Y, 1.0, EVEN),
            (Axis::Z, 3.0, EVEN),
        ];
        for _ in 0..offers.len() {
            offers.rotate_left(1);
            let best = best_of(&offers).expect("a plane");
            assert_eq!(
                (best.axis, best.position),
                (Axis::Y, 1.0),
                "y before z, low before high"
            );
        }
    }

    #[test]
    fn planar_primitives_go_where_they_cost_less() {
        let counts = Counts {
            lower: 0,
            planar: 5,
            upper: 9,
        };
        let low = best_of(&[(Axis::X, 1.0, counts)]).expect("a plane");
        assert_eq!(low.planar_side, Side::Lower, "the small side");
        let counts = Counts {
            lower: 5,
            planar: 5,
            upper: 5,
        };
        let middle = best_of(&[(Axis::X, 2.0, counts)]).expect("a plane");
        assert_eq!(middle.planar_side, Side::Lower, "a tie goes below");
    }

    #[test]
    fn empty_space_has_a_bonus_and_faces_are_no_planes() {
        let none = Counts {
            lower: 0,
            planar: 0,
            upper: 8,
        };
        let cut = best_of(&[(Axis::X, 2.0, none)]).expect("a plane");
        let expected = (15.0 + 2.0 / 3.0 * 160.0) * f64::from(0.9_f32);
        assert!((cut.cost - expected).abs() < 1e-9, "{cut:?}");
        assert_eq!(
            best_of(&[(Axis::X, 0.0, EVEN), (Axis::X, 4.0, EVEN)]),
            None,
            "faces of the cell"
        );
    }
}
