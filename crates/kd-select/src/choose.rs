//! The structure whose total is least.

use std::fmt;

use crate::times::{Structure, Times};

/// A structure for so many rays, with what all would have cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The one that is chosen.
    pub structure: Structure,
    /// How many rays it is for.
    pub rays: f64,
    /// What each costs, by its total: least first. Those of the grid are measured, others estimated.
    pub costs: Vec<(Structure, Times)>,
}

impl Choice {
    /// The structure of the least total, building included, for so many rays; the earlier one among equals. `None` without
    /// any.
    pub fn among(costs: &[(Structure, Times)], rays: f64) -> Option<Self> {
        let mut costs = costs.to_vec();
        costs.sort_by(|a, b| a.1.total(rays).total_cmp(&b.1.total(rays)));
        let structure = costs.first()?.0;
        Some(Self {
            structure,
            rays,
            costs,
        })
    }

    /// The total of a structure in seconds, if it was looked at.
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
                write!(f, " and {opened:.2} ms for what rays open")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let text = Choice::among(&costs, 1e4).expect("three").to_string();
        assert!(
            text.starts_with(
                "grid for 10000 rays:\ngrid           30.00 ms = 10.00 ms and 2.000 µs"
            ),
            "{text}"
        );
    }
}
