//! The constants of the surface area heuristic.

/// Costs of traversal steps for the surface area heuristic (SAH), in any common unit.
///
/// An interior node costs [`traverse`](Self::traverse). A leaf of `n` references costs
/// `intersect * lanes * ceil(n / lanes)`: `intersect` is the cost of one lane of a block of `lanes` triangles that are
/// tested together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    /// K_T, the cost of one step through an interior node. Positive and finite.
    pub traverse: f32,
    /// K_I, the cost of one lane of a leaf. Positive and finite.
    pub intersect: f32,
    /// The number of triangles that a leaf tests at once. At least 1.
    pub lanes: u32,
    /// The factor on the cost of a split that cuts off empty space. In (0, 1]; 1 gives no bonus.
    pub empty_bonus: f32,
}

impl CostModel {
    /// K_T 15, K_I 20, one lane, empty bonus 0.9: the model of most of the literature and of Mitsuba, for comparison.
    pub const CLASSIC: Self = Self {
        traverse: 15.0,
        intersect: 20.0,
        lanes: 1,
        empty_bonus: 0.9,
    };

    /// The model of kd's traversal of blocks: testing eight triangles together costs 0.8 steps through a node.
    ///
    /// It follows from a recorded run over the binary layout. A fit over the rays of that run gives 11.3 ns for a block
    /// and 7.2 ns for a node, so K_I is 0.20. Trees are not sensitive to K_I. This model uses half of the fit: its trees
    /// take 1.03 times the time to trace (geometric mean; primary and shadow rays 1.05, random rays 0.99), have 14 %
    /// fewer references and build faster. The wide layout divides cells of up to a thousand triangles again in any case.
    ///
    /// Other values of K_I, as multiples of the fit: a quarter takes 1.09 times the time to trace, 1.5 and 2 times take
    /// 1.00 and 1.01. An empty bonus of 0.9 takes 0.99 times the time, 0.5 takes 1.06. (`cargo xtask calibrate --scenes
    /// DIR`, five kinds of rays on 25 scenes, AVX2; `benches/records/2026-11-25-calibrate.json`.)
    pub const PACKED: Self = Self {
        traverse: 1.0,
        intersect: 0.1,
        lanes: 8,
        empty_bonus: 0.8,
    };

    /// The first field that is out of range, such as `cost.traverse`, and its valid range; `None` if all are in range.
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

    /// The cost of testing one ray against a leaf of `count` references, in the unit of the model.
    #[inline]
    pub fn leaf(&self, count: usize) -> f64 {
        let slots = match self.lanes as usize {
            // Builders call this for every candidate plane, so one lane avoids the division.
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
    fn leaf_cost_counts_whole_blocks() {
        let packed = CostModel {
            lanes: 8,
            ..CostModel::CLASSIC
        };
        let costs = [0, 1, 8, 9].map(|n| packed.leaf(n));
        assert_eq!(costs, [0.0, 160.0, 160.0, 320.0], "blocks of eight");
        assert_eq!(CostModel::CLASSIC.leaf(3), 60.0, "single triangles");
    }

    #[test]
    fn problem_names_the_field() {
        let with = |change: fn(&mut CostModel)| {
            let mut model = CostModel::PACKED;
            change(&mut model);
            model.problem().map(|(field, _)| field)
        };
        assert_eq!(with(|_| ()), None, "valid");
        assert_eq!(
            with(|m| m.traverse = 0.0),
            Some("cost.traverse"),
            "zero cost"
        );
        assert_eq!(
            with(|m| m.intersect = f32::NAN),
            Some("cost.intersect"),
            "NaN"
        );
        assert_eq!(with(|m| m.lanes = 0), Some("cost.lanes"), "no lanes");
        assert_eq!(
            with(|m| m.empty_bonus = 1.5),
            Some("cost.empty_bonus"),
            "above 1"
        );
        assert_eq!(
            with(|m| m.empty_bonus = f32::NAN),
            Some("cost.empty_bonus"),
            "NaN"
        );
    }
}
