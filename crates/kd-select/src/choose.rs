//! The structure of the least total.

use std::fmt;

use crate::times::{Structure, Times};

/// The choice of a structure for a number of rays, with the costs that were compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The chosen structure.
    pub structure: Structure,
    /// Number of rays.
    pub rays: f64,
    /// The times of each structure, by ascending total. Those of a grid that was tried are measured, others estimated.
    pub costs: Vec<(Structure, Times)>,
}

/// The factor by which a lazy tree must be cheaper than others: its opening cost is the least certain of all estimates. (With 1
/// some choices took five times as long as the best, with 2 nearly four times, with 3 as long as without lazy trees; from the same
/// throw-away program as in [`estimate`](crate::estimate).)
const CAUTION: f64 = 3.0;

impl Choice {
    /// The structure of the least total, build included, for `rays` rays; the first among equals. A structure that is built
    /// where rays go is chosen only if its total is below a third of every other. `None` without structures.
    pub fn among(costs: &[(Structure, Times)], rays: f64) -> Option<Self> {
        let mut costs = costs.to_vec();
        costs.sort_by(|a, b| a.1.total(rays).total_cmp(&b.1.total(rays)));
        let weighed = |times: &Times| {
            let caution = if times.opening.is_some() {
                CAUTION
            } else {
                1.0
            };
            caution * times.total(rays)
        };
        let cheapest = costs
            .iter()
            .min_by(|a, b| weighed(&a.1).total_cmp(&weighed(&b.1)));
        let structure = cheapest?.0;
        Some(Self {
            structure,
            rays,
            costs,
        })
    }

    /// The total of a structure in seconds, if it was compared.
    pub fn total(&self, structure: Structure) -> Option<f64> {
        let found = self.costs.iter().find(|(other, _)| *other == structure);
        found.map(|(_, times)| times.total(self.rays))
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} for {} rays:", self.structure, self.rays)?;
        for (structure, times) in &self.costs {
            let Times {
                build_seconds,
                ray_seconds,
                ..
            } = times;
            let (total, build) = (1e3 * times.total(self.rays), 1e3 * build_seconds);
            let ray = 1e6 * ray_seconds;
            write!(
                f,
                "\n{structure:<9} {total:>10.2} ms = {build:.2} ms and {ray:.3} µs a ray"
            )?;
            if let Some(opening) = times.opening {
                let opened = 1e3 * opening.after(self.rays);
                write!(f, " and {opened:.2} ms for opened cells")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::times::Opening;

    #[test]
    fn the_least_total_is_chosen() {
        let costs = [
            (Structure::Grid, Times::new(0.01, 2e-6)),
            (Structure::Fast, Times::new(0.1, 5e-7)),
            (Structure::Best, Times::new(0.3, 4.5e-7)),
        ];
        for (rays, structure) in [
            (0.0, Structure::Grid),
            (59_000.0, Structure::Grid),
            (61_000.0, Structure::Fast),
            (3.9e6, Structure::Fast),
            (4.1e6, Structure::Best),
        ] {
            let choice = Choice::among(&costs, rays).expect("three");
            assert_eq!(choice.structure, structure, "{choice}");
            let totals: Vec<f64> = choice
                .costs
                .iter()
                .map(|(_, times)| times.total(rays))
                .collect();
            assert!(totals.is_sorted(), "{choice}");
            assert_eq!(choice.total(structure), totals.first().copied(), "{choice}");
        }
        assert_eq!(Choice::among(&[], 1.0), None, "among none");
        for (seconds, structure) in [(0.002, Structure::Lazy), (0.02, Structure::Grid)] {
            let opening = Some(Opening {
                seconds,
                rays: 10.0,
            });
            let lazy = Times {
                opening,
                ..Times::new(0.001, 1e-9)
            };
            let costs = [costs[0], (Structure::Lazy, lazy)];
            let choice = Choice::among(&costs, 20_000.0).expect("two");
            assert_eq!(choice.structure, structure, "{choice}");
            assert_eq!(
                choice.costs[0].0,
                Structure::Lazy,
                "the least total: {choice}"
            );
        }
        let text = Choice::among(&costs, 1e4).expect("three").to_string();
        assert!(
            text.starts_with(
                "grid for 10000 rays:\ngrid           30.00 ms = 10.00 ms and 2.000 µs"
            ),
            "{text}"
        );
    }
}
