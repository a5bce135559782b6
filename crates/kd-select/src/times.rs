//! What structures cost.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Structure {
    /// A uniform grid.
    Grid,
    /// A bounding volume hierarchy of objects, laid out wide.
    Bvh,
    /// A kd-tree of the preset `fast`.
    Fast,
    /// A kd-tree of the preset `balanced`.
    Balanced,
    /// A kd-tree of the preset `best`.
    Best,
    /// A kd-tree that is built where rays go.
    Lazy,
}

impl Structure {
    /// All of them, those that are soonest there first.
    pub const ALL: [Self; 6] = [
        Self::Grid,
        Self::Lazy,
        Self::Bvh,
        Self::Fast,
        Self::Balanced,
        Self::Best,
    ];

    /// As calibration files have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Bvh => "bvh",
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Best => "best",
            Self::Lazy => "lazy",
        }
    }
}

impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.name().fmt(f)
    }
}

/// What a structure costs over a scene, measured or estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Times {
    /// Until the first ray can be asked, in seconds.
    pub build_seconds: f64,
    /// Of a ray, in seconds.
    pub ray_seconds: f64,
    /// What rays pay besides, in a structure that is built where they go.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub opening: Option<Opening>,
}

/// The cost of building where rays go: after `r` rays it is `seconds · (1 − exp(−r / rays))`, ever less for each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opening {
    /// After any number of rays, in seconds.
    pub seconds: f64,
    /// The number of rays after which 63 % of it are paid.
    pub rays: f64,
}

impl Times {
    /// Of what is built before rays are asked.
    pub const fn new(build_seconds: f64, ray_seconds: f64) -> Self {
        Self {
            build_seconds,
            ray_seconds,
            opening: None,
        }
    }

    /// The seconds that building it and so many rays take.
    pub fn total(&self, rays: f64) -> f64 {
        let opening = self.opening.map_or(0.0, |opening| opening.after(rays));
        self.build_seconds + opening + rays * self.ray_seconds
    }

    /// Whether all of it is finite, building and rays take time, and opening takes none that is negative.
    pub fn are_sound(&self) -> bool {
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        let opening = self.opening.is_none_or(|opening| {
            opening.seconds.is_finite() && opening.seconds >= 0.0 && is_positive(opening.rays)
        });
        is_positive(self.build_seconds) && is_positive(self.ray_seconds) && opening
    }
}

impl Opening {
    /// The seconds that are paid after so many rays.
    pub fn after(&self, rays: f64) -> f64 {
        -self.seconds * (-rays / self.rays).exp_m1()
    }
}

/// The number of rays for which both take as long, if there is one: (T_H − T_G) / (t_G − t_H), with the times of building and
/// of a ray of the one that is there sooner and of the other. Both are built before rays are asked.
///
/// `None` where the one that is there sooner is also as fast for rays, or faster: then it is always better.
pub fn break_even(sooner: &Times, later: &Times) -> Option<f64> {
    let gain = sooner.ray_seconds - later.ray_seconds;
    (gain > 0.0).then(|| ((later.build_seconds - sooner.build_seconds) / gain).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_are_equal_at_the_break_even() {
        let (grid, tree) = (Times::new(0.01, 2e-6), Times::new(0.1, 5e-7));
        let rays = break_even(&grid, &tree).expect("the tree is faster");
        assert!((rays - 60_000.0).abs() < 1e-6, "{rays}");
        assert!(
            (grid.total(rays) - tree.total(rays)).abs() < 1e-12,
            "at {rays}"
        );
        assert!(
            grid.total(0.5 * rays) < tree.total(0.5 * rays),
            "fewer rays"
        );
        assert!(grid.total(2.0 * rays) > tree.total(2.0 * rays), "more rays");
        assert_eq!(break_even(&tree, &grid), None, "built later and slower");
        let better = Times::new(0.001, 1e-6);
        assert_eq!(break_even(&grid, &better), Some(0.0), "sooner and faster");
    }

    #[test]
    fn opening_is_paid_once() {
        let opening = Opening {
            seconds: 2.0,
            rays: 100.0,
        };
        let lazy = Times {
            opening: Some(opening),
            ..Times::new(1.0, 1e-6)
        };
        assert_eq!(lazy.total(0.0), 1.0, "nobody asked");
        let after = |rays: f64| opening.after(rays) / opening.seconds;
        assert!((after(100.0) - 0.632).abs() < 1e-3, "most of it");
        assert!((after(1e9) - 1.0).abs() < 1e-12, "all of it");
        assert!((lazy.total(1e6) - 4.0).abs() < 1e-9, "{}", lazy.total(1e6));
    }

    #[test]
    fn times_that_cannot_be_are_not_sound() {
        let good = Times::new(1.0, 1.0);
        assert!(good.are_sound(), "plain");
        for (build, ray) in [
            (0.0, 1.0),
            (1.0, -1.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
        ] {
            assert!(!Times::new(build, ray).are_sound(), "{build} {ray}");
        }
        for (seconds, rays, is_sound) in [(0.0, 1.0, true), (-1.0, 1.0, false), (1.0, 0.0, false)] {
            let opening = Some(Opening { seconds, rays });
            assert_eq!(
                Times { opening, ..good }.are_sound(),
                is_sound,
                "{opening:?}"
            );
        }
    }
}
