//! Estimated times of structures that are not built: the paper's two equations extended by features of the grid.
//!
//! The paper estimates T_H and t_H from the number of triangles alone, with errors of 25 to 30 %, and names further statistics of
//! the scene as future work. Here ln (T_H / T_G) and ln (t_H / t_G) are linear functions of the grid's statistics and measured
//! times, which depend on the sizes of triangles and on the rays. As only ratios matter, a calibration of another machine is
//! useful too. A calibration of this machine is better: it distinguishes a slow mesh from a slow machine.

use crate::calibration::{Calibration, Features, MeasuredScene, RayScheme};
use crate::linear::{Linear, Row};
use crate::machine::Machine;
use crate::paper::{Hierarchy, log2};
use crate::times::{Opening, Structure, Times};

/// Penalty on weights, in rows. (0.1 to 6 give the same decisions, by a throw-away program over the scenes of
/// `cargo xtask paper grid-table`, 2026-11-28.)
const PENALTY: f64 = 1.0;

/// Estimates the times of each structure from the features of a grid.
#[derive(Clone, Debug)]
pub struct Estimator {
    models: Vec<Model>,
    /// Whether the calibration is of this machine.
    is_same_machine: bool,
    /// Times by the number of triangles alone, the grid first.
    by_size: Vec<(Structure, Law)>,
    /// The number of rays per triangle up to which the grid was best on half of the scenes.
    usual_rays_each: f64,
}

/// Equations 7 and 8 of the paper for one structure: seconds of the build per N log₂ N, and of a ray per log₂ N.
#[derive(Clone, Copy, Debug)]
struct Law {
    build: f64,
    ray: f64,
}

/// The model of one structure.
#[derive(Clone, Debug)]
struct Model {
    structure: Structure,
    /// ln (T_H / T_G).
    build: Linear,
    /// ln (t_H / t_G).
    ray: Linear,
    opening: Option<OpeningModel>,
}

#[derive(Clone, Debug)]
struct OpeningModel {
    /// ln (seconds / T_G).
    seconds: Linear,
    /// ln (rays / triangles).
    rays: Linear,
}

/// The inputs of the models. The grid's build time per triangle is an input only on the machine of the calibration; elsewhere it is
/// constant, and has no effect.
fn row(features: &Features, grid: &Times, is_same_machine: bool) -> Row {
    let per_triangle = grid.build_seconds / features.triangles.max(1) as f64;
    [
        log2(features.triangles),
        features.refs_per_triangle.max(1.0).ln(),
        features.sigma.ln_1p(),
        features.sparseness,
        features.hit_share,
        (grid.ray_seconds / per_triangle).ln(),
        if is_same_machine {
            per_triangle.ln()
        } else {
            0.0
        },
    ]
}

impl Estimator {
    /// Fits the scenes of a calibration with rays of one distribution, or all scenes if none has such rays. Detects whether the
    /// calibration is of this machine.
    pub fn of(calibration: &Calibration, scheme: RayScheme) -> Self {
        let is_same_machine = calibration.machine == Machine::here();
        if calibration.of_scheme(scheme).next().is_none() {
            return Self::fit(&calibration.scenes, is_same_machine);
        }
        Self::fit(calibration.of_scheme(scheme), is_same_machine)
    }

    /// Fits scenes measured on one machine, this one or another, with one distribution of rays. A structure that no scene has is
    /// not estimated.
    pub fn fit<'a>(
        scenes: impl IntoIterator<Item = &'a MeasuredScene>,
        is_same_machine: bool,
    ) -> Self {
        let scenes: Vec<&MeasuredScene> = scenes.into_iter().collect();
        let others = Structure::ALL.into_iter().filter(|s| *s != Structure::Grid);
        let models = others.filter_map(|structure| Model::fit(structure, &scenes, is_same_machine));
        let law = |structure: &Structure| Some((*structure, Law::of(*structure, &scenes)?));
        Self {
            models: models.collect(),
            is_same_machine,
            by_size: Structure::ALL.iter().filter_map(law).collect(),
            usual_rays_each: usual_rays_each(&scenes),
        }
    }

    /// The times of each structure over a scene with these features and times of its grid; the grid first, unchanged.
    pub fn estimate(&self, features: &Features, grid: &Times) -> Vec<(Structure, Times)> {
        let row = row(features, grid, self.is_same_machine);
        let others = self.models.iter().map(|model| {
            let opening = model.opening.as_ref().map(|opening| Opening {
                seconds: grid.build_seconds * opening.seconds.at(&row).exp(),
                rays: features.triangles as f64 * opening.rays.at(&row).exp(),
            });
            let times = Times {
                build_seconds: grid.build_seconds * model.build.at(&row).exp(),
                ray_seconds: grid.ray_seconds * model.ray.at(&row).exp(),
                opening,
            };
            (model.structure, times)
        });
        std::iter::once((Structure::Grid, *grid))
            .chain(others)
            .collect()
    }

    /// The times of each structure by the number of triangles alone (the paper's equations 7 and 8), without the grid and the lazy
    /// tree.
    pub fn by_size(&self, triangles: u64) -> Vec<(Structure, Times)> {
        let are_built =
            |structure: Structure| !matches!(structure, Structure::Grid | Structure::Lazy);
        let built = self
            .by_size
            .iter()
            .filter(|(structure, _)| are_built(*structure));
        built
            .map(|(structure, law)| (*structure, law.at(triangles)))
            .collect()
    }

    /// The times of a grid by the number of triangles alone; a nanosecond each if no grid was measured.
    pub fn grid_by_size(&self, triangles: u64) -> Times {
        let grid = self
            .by_size
            .iter()
            .find(|(structure, _)| *structure == Structure::Grid);
        grid.map_or(Times::new(1e-9, 1e-9), |(_, law)| law.at(triangles))
    }

    /// Whether a trial of a grid pays for `rays` rays: the rays per triangle are at most the number up to which the grid was best
    /// on half of the measured scenes. A trial costs the build of the grid, which is lost if another structure is chosen.
    pub fn may_be_few(&self, triangles: u64, rays: f64) -> bool {
        rays <= self.usual_rays_each * triangles as f64
    }
}

impl Law {
    fn of(structure: Structure, scenes: &[&MeasuredScene]) -> Option<Self> {
        let measured = scenes.iter().filter_map(|scene| {
            let times = scene.times_of(structure)?;
            Some((scene.features.triangles, times))
        });
        // Two triangles have N log₂ N = 2 and log₂ N = 1: twice the factor of the build, and the factor of a ray.
        let unit = Hierarchy::estimate(measured, 2)?;
        Some(Self {
            build: unit.build_seconds / 2.0,
            ray: unit.ray_seconds,
        })
    }

    fn at(self, triangles: u64) -> Times {
        let levels = log2(triangles);
        Times::new(self.build * triangles as f64 * levels, self.ray * levels)
    }
}

/// The median, over scenes, of the number of rays per triangle up to which the grid was best; 0 without scenes.
fn usual_rays_each(scenes: &[&MeasuredScene]) -> f64 {
    let mut each: Vec<f64> = scenes.iter().filter_map(|scene| rays_each(scene)).collect();
    each.sort_by(f64::total_cmp);
    each.get(each.len() / 2).copied().unwrap_or(0.0)
}

/// The number of rays per triangle up to which the grid was best among structures that are built before rays are traced; infinite
/// if it always is.
fn rays_each(scene: &MeasuredScene) -> Option<f64> {
    let grid = scene.times_of(Structure::Grid)?;
    let built = scene
        .times
        .iter()
        .filter(|(structure, times)| **structure != Structure::Grid && times.opening.is_none());
    let ends = built.filter_map(|(_, times)| crate::times::break_even(grid, times));
    let end = ends.fold(f64::INFINITY, f64::min);
    Some(end / scene.features.triangles as f64)
}

impl Model {
    fn fit(structure: Structure, scenes: &[&MeasuredScene], is_same_machine: bool) -> Option<Self> {
        let (mut rows, mut builds, mut rays) = (Vec::new(), Vec::new(), Vec::new());
        let (mut opening_seconds, mut opening_rays) = (Vec::new(), Vec::new());
        for scene in scenes {
            let (grid, times) = (scene.times_of(Structure::Grid)?, scene.times_of(structure));
            let Some(times) = times else {
                continue;
            };
            rows.push(row(&scene.features, grid, is_same_machine));
            builds.push((times.build_seconds / grid.build_seconds).ln());
            rays.push((times.ray_seconds / grid.ray_seconds).ln());
            if let Some(opening) = times.opening {
                // The logarithm needs a positive number: at least a nanosecond.
                let seconds = opening.seconds.max(1e-9);
                opening_seconds.push((seconds / grid.build_seconds).ln());
                opening_rays.push((opening.rays / scene.features.triangles as f64).ln());
            }
        }
        let opening = if opening_rays.len() == rows.len() {
            Some(OpeningModel {
                seconds: Linear::fit(&rows, &opening_seconds, PENALTY)?,
                rays: Linear::fit(&rows, &opening_rays, PENALTY)?,
            })
        } else {
            None
        };
        Some(Self {
            structure,
            build: Linear::fit(&rows, &builds, PENALTY)?,
            ray: Linear::fit(&rows, &rays, PENALTY)?,
            opening,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Scenes whose tree build times grow with the size of their triangles.
    fn scenes() -> Vec<MeasuredScene> {
        let scene = |i: u32| {
            let features = Features {
                triangles: 1000 << (i % 8),
                refs_per_triangle: 1.5 + 0.5 * f64::from(i % 5),
                sigma: 3.0 + f64::from(i * 7 % 11),
                sparseness: 0.5 + 0.04 * f64::from(i % 10),
                hit_share: 0.1 * f64::from(i * 3 % 8),
            };
            let per_triangle = 1e-8 * (1.0 + 0.1 * f64::from(i * 5 % 7));
            let grid = Times::new(
                per_triangle * features.triangles as f64,
                1e-6 * f64::from(1 + i % 3),
            );
            let times = BTreeMap::from([
                (Structure::Grid, grid),
                (Structure::Fast, tree(&features, &grid)),
            ]);
            MeasuredScene {
                scene: format!("{i}"),
                rays: RayScheme::Random,
                features,
                times,
            }
        };
        (0..40).map(scene).collect()
    }

    fn tree(features: &Features, grid: &Times) -> Times {
        let build = 8.0 * features.refs_per_triangle.powf(0.7);
        Times::new(
            build * grid.build_seconds,
            grid.ray_seconds * (-0.3 * features.sigma.ln_1p()).exp(),
        )
    }

    #[test]
    fn scenes_that_follow_a_law_are_estimated_by_it() {
        let scenes = scenes();
        for left_out in 0..scenes.len() {
            let others = scenes.iter().enumerate().filter(|(i, _)| *i != left_out);
            let estimator = Estimator::fit(others.map(|(_, scene)| scene), left_out % 2 == 0);
            let MeasuredScene {
                features, times, ..
            } = &scenes[left_out];
            let estimates = estimator.estimate(features, &times[&Structure::Grid]);
            assert_eq!(
                estimates[0],
                (Structure::Grid, times[&Structure::Grid]),
                "as it is"
            );
            let (structure, estimate) = estimates[1];
            let truth = times[&Structure::Fast];
            assert_eq!(
                (structure, estimates.len()),
                (Structure::Fast, 2),
                "what was measured"
            );
            let off = |a: f64, b: f64| (a / b - 1.0).abs();
            assert!(
                off(estimate.build_seconds, truth.build_seconds) < 0.1,
                "{estimate:?} {truth:?}"
            );
            assert!(
                off(estimate.ray_seconds, truth.ray_seconds) < 0.1,
                "{estimate:?} {truth:?}"
            );
        }
    }

    /// On a machine that takes twice as long for everything, all estimates double.
    #[test]
    fn the_speed_of_the_machine_does_not_matter() {
        let scenes = scenes();
        let estimator = Estimator::fit(&scenes, false);
        let grid = scenes[5].times[&Structure::Grid];
        let slow = Times::new(2.0 * grid.build_seconds, 2.0 * grid.ray_seconds);
        let [here, there] =
            [grid, slow].map(|grid| estimator.estimate(&scenes[5].features, &grid)[1].1);
        assert!(
            (there.build_seconds / here.build_seconds - 2.0).abs() < 1e-9,
            "{here:?} {there:?}"
        );
        assert!(
            (there.ray_seconds / here.ray_seconds - 2.0).abs() < 1e-9,
            "{here:?} {there:?}"
        );
    }

    /// Meshes whose triangles slow down the grid alone: the model can use that only on the measured machine.
    #[test]
    fn a_slow_mesh_is_distinguished_from_a_slow_machine() {
        let mut scenes = scenes();
        for scene in &mut scenes {
            let features = scene.features;
            let tree = Times::new(1e-7 * features.triangles as f64, 1e-7);
            scene.times.insert(Structure::Fast, tree);
        }
        let error = |is_same_machine: bool| {
            let estimator = Estimator::fit(&scenes, is_same_machine);
            let errors = scenes.iter().map(|scene| {
                let grid = scene.times[&Structure::Grid];
                let estimate = estimator.estimate(&scene.features, &grid)[1].1;
                (estimate.build_seconds / scene.times[&Structure::Fast].build_seconds)
                    .ln()
                    .abs()
            });
            errors.fold(0.0, f64::max)
        };
        assert!(error(true) < 0.05, "{}", error(true));
        assert!(error(false) > 0.1, "{}", error(false));
    }

    #[test]
    fn opening_costs_are_estimated() {
        let mut scenes = scenes();
        for scene in &mut scenes {
            let grid = scene.times[&Structure::Grid];
            let opening = Some(Opening {
                seconds: 5.0 * grid.build_seconds,
                rays: 0.25 * scene.features.triangles as f64,
            });
            let lazy = Times {
                opening,
                ..Times::new(grid.build_seconds, grid.ray_seconds)
            };
            scene.times.insert(Structure::Lazy, lazy);
        }
        let estimator = Estimator::fit(&scenes, true);
        let MeasuredScene {
            features, times, ..
        } = &scenes[9];
        let estimates = estimator.estimate(features, &times[&Structure::Grid]);
        let lazy = estimates
            .iter()
            .find(|(structure, _)| *structure == Structure::Lazy);
        let opening = lazy.expect("measured").1.opening.expect("it opens");
        let truth = times[&Structure::Lazy].opening.expect("it opens");
        assert!(
            (opening.seconds / truth.seconds - 1.0).abs() < 1e-6,
            "{opening:?}"
        );
        assert!(
            (opening.rays / truth.rays - 1.0).abs() < 1e-6,
            "{opening:?}"
        );
    }

    #[test]
    fn by_size_is_what_the_equations_say() {
        let scenes = scenes();
        let estimator = Estimator::fit(&scenes, true);
        let measured = scenes
            .iter()
            .map(|s| (s.features.triangles, &s.times[&Structure::Fast]));
        let expected = Hierarchy::estimate(measured, 5000).expect("scenes");
        let [(structure, times)] = estimator.by_size(5000)[..] else {
            panic!("one structure beside the grid");
        };
        assert_eq!(structure, Structure::Fast, "the other one");
        let off = |a: f64, b: f64| (a / b - 1.0).abs();
        assert!(
            off(times.build_seconds, expected.build_seconds) < 1e-9,
            "{times:?}"
        );
        assert!(
            off(times.ray_seconds, expected.ray_seconds) < 1e-9,
            "{times:?}"
        );
        assert!(estimator.grid_by_size(5000).are_sound(), "of the grid");
    }

    #[test]
    fn many_rays_need_no_trial() {
        let estimator = Estimator::fit(&scenes(), true);
        assert!(estimator.may_be_few(1000, 10.0), "a few");
        assert!(!estimator.may_be_few(1000, 1e9), "more than a grid suits");
        let nothing = Estimator::fit([], true);
        assert!(!nothing.may_be_few(1000, 1.0), "nothing is known");
    }
}
