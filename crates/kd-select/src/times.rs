//! Structures and their times.

use std::fmt;

#[cfg(feature = "json")]
use serde::{Deserialize, Serialize};

/// A structure that can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Structure {
    /// A uniform grid.
    Grid,
    /// Wide nodes of objects: triangles divided by their centers, without a kd-tree. Older files call it `bvh`.
    #[cfg_attr(feature = "json", serde(alias = "bvh"))]
    Objects,
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
    /// All structures, in the usual order of their build times.
    pub const ALL: [Self; 6] = [
        Self::Grid,
        Self::Lazy,
        Self::Objects,
        Self::Fast,
        Self::Balanced,
        Self::Best,
    ];

    /// The name in calibration files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Objects => "objects",
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

/// The times of a structure over a scene, measured or estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct Times {
    /// Time until the first ray can be traced, in seconds.
    pub build_seconds: f64,
    /// Time of a ray, in seconds.
    pub ray_seconds: f64,
    /// The additional cost of rays in a structure that is built where they go.
    #[cfg_attr(
        feature = "json",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub opening: Option<Opening>,
}

/// The cost of building where rays go: `seconds · (1 − exp(−r / rays))` after `r` rays, so that each ray pays less than the last.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct Opening {
    /// The limit for many rays, in seconds.
    pub seconds: f64,
    /// The number of rays that pay 63 % of it.
    pub rays: f64,
}

impl Times {
    /// Times of a structure that is built before rays are traced.
    pub const fn new(build_seconds: f64, ray_seconds: f64) -> Self {
        Self {
            build_seconds,
            ray_seconds,
            opening: None,
        }
    }

    /// The time of the build and of `rays` rays, in seconds.
    pub fn total(&self, rays: f64) -> f64 {
        let opening = self.opening.map_or(0.0, |opening| opening.after(rays));
        self.build_seconds + opening + rays * self.ray_seconds
    }

    /// Whether all times are finite, those of build and rays are positive, and that of opening is not negative.
    pub fn are_sound(&self) -> bool {
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        let opening = self.opening.is_none_or(|opening| {
            opening.seconds.is_finite() && opening.seconds >= 0.0 && is_positive(opening.rays)
        });
        is_positive(self.build_seconds) && is_positive(self.ray_seconds) && opening
    }
}

impl Opening {
    /// The cost of the first `rays` rays, in seconds.
    pub fn after(&self, rays: f64) -> f64 {
        -self.seconds * (-rays / self.rays).exp_m1()
    }
}

/// The number of rays with equal totals, if it exists: (T_H − T_G) / (t_G − t_H), with build times T and ray times t of the structure
/// that is built faster (G) and of the other one (H). Both are built before rays are traced.
///
/// `None` if the rays of the structure that is built faster are no slower: it is always better.
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
        assert_eq!(
            break_even(&tree, &grid),
            None,
            "slower to build and to trace"
        );
        let better = Times::new(0.001, 1e-6);
        assert_eq!(
            break_even(&grid, &better),
            Some(0.0),
            "faster to build and to trace"
        );
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
        assert_eq!(lazy.total(0.0), 1.0, "no rays");
        let after = |rays: f64| opening.after(rays) / opening.seconds;
        assert!((after(100.0) - 0.632).abs() < 1e-3, "most of it");
        assert!((after(1e9) - 1.0).abs() < 1e-12, "all of it");
        assert!((lazy.total(1e6) - 4.0).abs() < 1e-9, "{}", lazy.total(1e6));
    }

    #[test]
    fn impossible_times_are_not_sound() {
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
