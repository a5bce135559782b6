//! The decision of the paper between a grid and a hierarchy (Hapala, Karlík and Havran 2011, section 3), and the earlier rule of
//! Havran, Přikryl and Purgathofer (2000).
//!
//! The eight steps:
//!
//! 1. Build a uniform grid; T_G is the build time.
//! 2. Trace a few hundred rays like those to come through it; t_G is the time of a ray.
//! 3. Estimate T_H, the build time of the hierarchy, by equation 7 ([`Hierarchy::estimate`]).
//! 4. Estimate t_H, the time of a ray in the hierarchy, by equation 8.
//! 5. If t_H is not less than t_G, keep the grid.
//! 6. Otherwise compute R_C = T_H / (t_G (1 + ε) − t_H), the number of rays with equal times, the grid being built already.
//! 7. For fewer rays keep the grid. (The paper prints the inequality reversed; its own discussion has it right.)
//! 8. For more rays build the hierarchy.

use crate::times::Times;

/// The paper's ε, which keeps the divisor away from zero.
pub const EPSILON: f64 = 0.01;

/// The largest standard deviation of references per cell at which a grid is the better structure for any number of rays, as the
/// paper reads the figures of Havran et al.
pub const REGULAR_SIGMA: f64 = 2.0;

/// The estimated times of a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hierarchy {
    /// Time of the build, in seconds.
    pub build_seconds: f64,
    /// Time of a ray, in seconds.
    pub ray_seconds: f64,
}

/// The step that decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Step 5 keeps the grid: its rays are no slower.
    GridIsFaster,
    /// Step 7 keeps the grid: the rays are few.
    FewRays,
    /// Step 8 builds the hierarchy: the rays are many.
    ManyRays,
}

/// A decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperDecision {
    /// The step that decided.
    pub step: Step,
    /// R_C of step 6; infinite if step 5 decides.
    pub critical_rays: f64,
}

impl PaperDecision {
    /// Whether the grid is kept.
    pub fn keeps_grid(&self) -> bool {
        self.step != Step::ManyRays
    }
}

/// log₂ of a number of triangles; a single triangle counts as two.
pub(crate) fn log2(triangles: u64) -> f64 {
    (triangles.max(2) as f64).log2()
}

impl Hierarchy {
    /// Equations 7 and 8: build times grow with N log₂ N and ray times with log₂ N. The factors are means over the scenes of a
    /// calibration, given by their triangles and the hierarchy's times. `None` without scenes.
    pub fn estimate<'a>(
        measured: impl IntoIterator<Item = (u64, &'a Times)>,
        triangles: u64,
    ) -> Option<Self> {
        let (mut scenes, mut build, mut ray) = (0.0, 0.0, 0.0);
        for (n, times) in measured {
            scenes += 1.0;
            build += times.build_seconds / (n.max(1) as f64 * log2(n));
            ray += times.ray_seconds / log2(n);
        }
        (scenes > 0.0).then(|| Self {
            build_seconds: build / scenes * triangles as f64 * log2(triangles),
            ray_seconds: ray / scenes * log2(triangles),
        })
    }

    /// Step 6: the number of rays with equal times once the grid is built; infinite if the grid's rays are faster by more than
    /// ε. `grid_ray_seconds` is t_G.
    pub fn critical_rays(&self, grid_ray_seconds: f64, epsilon: f64) -> f64 {
        let gain = grid_ray_seconds * (1.0 + epsilon) - self.ray_seconds;
        if gain > 0.0 {
            self.build_seconds / gain
        } else {
            f64::INFINITY
        }
    }
}

/// Steps 5 to 8 for `rays` rays. `grid_ray_seconds` is t_G, of a sample.
pub fn decide(
    grid_ray_seconds: f64,
    hierarchy: &Hierarchy,
    rays: f64,
    epsilon: f64,
) -> PaperDecision {
    if hierarchy.ray_seconds >= grid_ray_seconds {
        return PaperDecision {
            step: Step::GridIsFaster,
            critical_rays: f64::INFINITY,
        };
    }
    let critical_rays = hierarchy.critical_rays(grid_ray_seconds, epsilon);
    let step = if rays <= critical_rays {
        Step::FewRays
    } else {
        Step::ManyRays
    };
    PaperDecision {
        step,
        critical_rays,
    }
}

/// The rule of Havran et al.: a grid if cells have similar numbers of references, for any number of rays.
pub fn is_regular(standard_deviation: f64) -> bool {
    standard_deviation <= REGULAR_SIGMA
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_follow_the_equations() {
        // Two scenes that cost 3 ns and 5 ns for each N log₂ N, and 20 ns and 40 ns a ray for each log₂ N.
        let times =
            |n: u64, build: f64, ray: f64| Times::new(build * n as f64 * log2(n), ray * log2(n));
        let scenes = [
            (1 << 10, times(1 << 10, 3e-9, 2e-8)),
            (1 << 16, times(1 << 16, 5e-9, 4e-8)),
        ];
        let measured = || scenes.iter().map(|(n, times)| (*n, times));
        let hierarchy = Hierarchy::estimate(measured(), 1 << 20).expect("two scenes");
        let expected = 4e-9 * f64::from(1 << 20) * 20.0;
        assert!(
            (hierarchy.build_seconds / expected - 1.0).abs() < 1e-12,
            "{hierarchy:?}"
        );
        assert!(
            (hierarchy.ray_seconds / 6e-7 - 1.0).abs() < 1e-12,
            "{hierarchy:?}"
        );
        assert_eq!(Hierarchy::estimate([], 9), None, "of nothing");
        let one = Hierarchy::estimate(measured(), 1).expect("two scenes");
        assert!(one.build_seconds > 0.0 && one.ray_seconds > 0.0, "{one:?}");
    }

    /// Rows of the paper's table 1 for random rays, in ms and µs: T_H, T_G, t_G, t_H and R_C, which is the break-even of
    /// totals. (Those for path-traced rays do not follow from the times beside them.)
    #[test]
    fn the_table_of_the_paper_follows() {
        let rows = [
            ("bunny", 1639.0, 35.0, 33.1, 10.8, 69_587.0),
            ("a10", 29_921.0, 403.0, 25.0, 5.9, 1_544_378.0),
            ("conference", 4428.0, 97.0, 19.4, 7.1, 348_928.0),
            ("sockets-high", 45_842.0, 730.0, 41.0, 11.0, 1_516_267.0),
        ];
        for (name, build, grid_build, grid_ray, ray, printed) in rows {
            let grid = Times::new(grid_build * 1e-3, grid_ray * 1e-6);
            let tree = Times::new(build * 1e-3, ray * 1e-6);
            let total = crate::times::break_even(&grid, &tree).expect("the tree is faster");
            // Times are printed with two digits.
            assert!(
                (total / printed - 1.0).abs() < 0.04,
                "{name}: {total} {printed}"
            );
            let hierarchy = Hierarchy {
                build_seconds: tree.build_seconds,
                ray_seconds: tree.ray_seconds,
            };
            let critical = hierarchy.critical_rays(grid.ray_seconds, 0.0);
            assert!(critical > total, "{name}: the grid is built already");
        }
    }

    #[test]
    fn few_rays_keep_the_grid_and_many_do_not() {
        let hierarchy = Hierarchy {
            build_seconds: 0.1,
            ray_seconds: 1e-6,
        };
        let at = |rays: f64| decide(3e-6, &hierarchy, rays, EPSILON);
        let critical = at(1.0).critical_rays;
        assert!((critical - 0.1 / 2.03e-6).abs() < 1e-6, "{critical}");
        assert_eq!(at(0.99 * critical).step, Step::FewRays, "step 7");
        assert_eq!(at(1.01 * critical).step, Step::ManyRays, "step 8");
        assert!(
            at(10.0).keeps_grid() && !at(1e6).keeps_grid(),
            "which is kept"
        );
        let slower = decide(1e-6, &hierarchy, 1e12, EPSILON);
        assert_eq!(slower.step, Step::GridIsFaster, "step 5 decides");
        assert!(
            slower.keeps_grid() && slower.critical_rays.is_infinite(),
            "{slower:?}"
        );
    }

    #[test]
    fn even_cells_are_regular() {
        assert!(
            is_regular(0.0) && is_regular(2.0) && !is_regular(2.01),
            "up to 2"
        );
    }
}
