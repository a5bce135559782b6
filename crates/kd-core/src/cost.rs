//! What a ray is expected to pay: the constants of the surface area heuristic.

/// Costs of the steps of a traversal, in any common unit, as the surface area heuristic (SAH) weighs them.
///
/// An interior node costs [`traverse`](Self::traverse); a leaf of `n` references costs
/// `intersect * lanes * ceil(n / lanes)`, so `intersect` is the cost of one slot of a block of `lanes` triangles
/// tested together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CostModel {
    /// K_T: one step through an interior node. Positive.
    pub traverse: f32,
    /// K_I: one triangle slot of a leaf. Positive.
    pub intersect: f32,
    /// How many triangles a leaf tests at once. At least 1.
    pub lanes: u32,
    /// A split that cuts off empty space has its cost multiplied by this. In (0, 1]; 1 gives no bonus.
    pub empty_bonus: f32,
}

impl CostModel {
    /// K_T 15, K_I 20, one lane, empty space at 0.9: what most of the literature and Mitsuba use, to compare with.
    pub const CLASSIC: Self = Self {
        traverse: 15.0,
        intersect: 20.0,
        lanes: 1,
        empty_bonus: 0.9,
    };

    /// The model of our own traversal of packed leaves: eight triangles tested together cost 0.8 steps to the next node.
    ///
    /// From a recorded run over the binary layout. A fit over its rays makes a block cost 11.3 ns and a node 7.2 ns: K_I
    /// 0.20. Trees are not sensitive to it: those built for half of that trace in 1.03 times the time (geometric mean;
    /// primary and shadow rays 1.05, random ones 0.99) with 14 % fewer references, and build faster, so that it is what is
    /// used; the wide layout divides cells of up to a thousand triangles anew in any case. A quarter of the fit traces in
    /// 1.09 times the time, 1.5 and 2 times the fit in 1.00 and 1.01; an empty bonus of 0.9 traces in 0.99 times the time, 0.5
    /// in 1.06. (`cargo xtask calibrate --scenes DIR`, five kinds of rays on 25 scenes, AVX2;
    /// `benches/records/2026-11-25-calibrate.json`.)
    pub const PACKED: Self = Self {
        traverse: 1.0,
        intersect: 0.1,
        lanes: 8,
        empty_bonus: 0.8,
    };

    /// The first field that is out of range, as `cost.traverse`, and what it must be; `None` if the model makes sense.
    pub fn problem(&self) -> Option<(&'static str, &'static str)> {
        let is_cost = |x: f32| x > 0.0 && x.is_finite();
        if !is_cost(self.traverse) {
            return Some(("cost.traverse", "positive and finite"));
        }
        if !is_cost(self.intersect) {
            return Some(("cost.intersect", "positive and finite"));
        }
        if self.lanes == 0 {
            return Some(("cost.lanes", "at least 1"));
        }
        let has_bonus = self.empty_bonus > 0.0 && self.empty_bonus <= 1.0;
        (!has_bonus).then_some(("cost.empty_bonus", "in (0, 1]"))
    }

    /// Cost of testing a leaf of `count` references, once a ray is in it.
    #[inline]
    pub fn leaf(&self, count: usize) -> f64 {
        let slots = match self.lanes as usize {
            // Builders ask for every candidate plane: spare them the division.
            1 => count,
            lanes => count.div_ceil(lanes) * lanes,
        };
        f64::from(self.intersect) * slots as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_are_paid_by_the_block() {
        let packed = CostModel {
            lanes: 8,
            ..CostModel::CLASSIC
        };
        let costs = [0, 1, 8, 9].map(|n| packed.leaf(n));
        assert_eq!(costs, [0.0, 160.0, 160.0, 320.0], "in blocks of eight");
        assert_eq!(CostModel::CLASSIC.leaf(3), 60.0, "one by one");
    }

    #[test]
    fn problems_are_named() {
        let with = |change: fn(&mut CostModel)| {
            let mut model = CostModel::PACKED;
            change(&mut model);
            model.problem().map(|(field, _)| field)
        };
        assert_eq!(with(|_| ()), None, "nothing wrong");
        assert_eq!(
            with(|m| m.traverse = 0.0),
            Some("cost.traverse"),
            "free steps"
        );
        assert_eq!(
            with(|m| m.intersect = f32::NAN),
            Some("cost.intersect"),
            "not a number"
        );
        assert_eq!(with(|m| m.lanes = 0), Some("cost.lanes"), "no lanes");
        assert_eq!(
            with(|m| m.empty_bonus = 1.5),
            Some("cost.empty_bonus"),
            "a penalty"
        );
        assert_eq!(
            with(|m| m.empty_bonus = f32::NAN),
            Some("cost.empty_bonus"),
            "not a number"
        );
    }
}
