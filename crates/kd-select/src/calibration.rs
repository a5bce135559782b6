//! What was measured, on which machine, and the file that keeps it.

use std::collections::BTreeMap;

use kd_grid::GridStats;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::machine::Machine;
use crate::times::{Structure, Times};

/// How rays were made that a scene was measured with.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum RayScheme {
    /// Through two random points of the scene's bounding sphere.
    #[default]
    Random,
    /// Those of a path tracer: from a camera, to lights, and scattered from surfaces.
    Path,
}

/// What a grid tells of a scene, and a sample of rays through it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Features {
    /// Triangles.
    pub triangles: u64,
    /// References per triangle.
    pub refs_per_triangle: f64,
    /// The standard deviation of references per cell.
    pub sigma: f64,
    /// The part of cells that is empty.
    pub sparseness: f64,
    /// The part of the sampled rays that hits something.
    pub hit_share: f64,
}

impl Features {
    /// Of a grid's statistics and the part of a sample of rays that hits something.
    pub fn new(stats: &GridStats, hit_share: f64) -> Self {
        Self {
            triangles: stats.triangles as u64,
            refs_per_triangle: stats.refs_per_triangle(),
            sigma: stats.standard_deviation(),
            sparseness: stats.sparseness(),
            hit_share,
        }
    }
}

/// A scene of a calibration: what it is like, and what structures cost over it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredScene {
    /// What it is called.
    pub scene: String,
    /// How its rays were made.
    pub rays: RayScheme,
    /// What its grid tells.
    pub features: Features,
    /// What each structure costs; the grid is one of them.
    pub times: BTreeMap<Structure, Times>,
}

/// What structures cost over a set of scenes, on one machine: what decisions are made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Of the file: [`FORMAT`](Self::FORMAT).
    pub format: u32,
    /// Of this crate.
    pub version: String,
    /// Where it was measured.
    pub machine: Machine,
    /// How many threads built.
    pub threads: usize,
    /// When, as `2026-11-28`.
    pub date: String,
    /// The commit that was measured.
    pub commit: String,
    /// What was measured.
    pub scenes: Vec<MeasuredScene>,
}

/// Why a calibration is of no use here.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// It is no calibration.
    #[error("not a calibration: {0}")]
    Malformed(String),
    /// It is of another format.
    #[error("its format is {found}, and this version reads {expected}: calibrate again")]
    Format {
        /// What it has.
        found: u32,
        /// What is read.
        expected: u32,
    },
    /// It is of another version of the library, whose structures cost something else.
    #[error("it was measured with version {found}, and this is {expected}: calibrate again")]
    Version {
        /// What it has.
        found: String,
        /// What this is.
        expected: String,
    },
    /// It is of another machine.
    #[error("it was measured on another machine ({found}), and this is {here}: calibrate again")]
    OtherMachine {
        /// Where it was measured.
        found: Machine,
        /// This one.
        here: Machine,
    },
    /// A scene has figures that cannot be.
    #[error("scene `{scene}`: {what}")]
    Scene {
        /// What it is called.
        scene: String,
        /// What is wrong.
        what: String,
    },
    /// There is no scene.
    #[error("it has no scene")]
    Empty,
}

impl Calibration {
    /// Of the file.
    pub const FORMAT: u32 = 1;

    /// What was measured here and now; `date` is like `2026-11-28`.
    pub fn new(threads: usize, date: String, commit: String, scenes: Vec<MeasuredScene>) -> Self {
        Self {
            format: Self::FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            machine: Machine::here(),
            threads,
            date,
            commit,
            scenes,
        }
    }

    /// The calibration that comes with the library: measured elsewhere, so that only ratios between structures mean something
    /// here. It is what decisions are made from until a machine has its own.
    #[allow(clippy::missing_panics_doc, reason = "a test reads it")]
    pub fn built_in() -> Self {
        let calibration = Self::parsed(include_str!("built_in.json"));
        calibration.expect("the one that comes with the library is right")
    }

    /// Reads a file that [`to_json`](Self::to_json) wrote, on this machine, by this version.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`] tells what it is not, or what is wrong in which scene.
    pub fn read(text: &str) -> Result<Self, CalibrationError> {
        let calibration = Self::parsed(text)?;
        let expected = env!("CARGO_PKG_VERSION");
        if calibration.version != expected {
            return Err(CalibrationError::Version {
                found: calibration.version,
                expected: expected.into(),
            });
        }
        let here = Machine::here();
        if calibration.machine != here {
            return Err(CalibrationError::OtherMachine {
                found: calibration.machine,
                here,
            });
        }
        Ok(calibration)
    }

    /// Whatever machine and version it is of.
    fn parsed(text: &str) -> Result<Self, CalibrationError> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
        }
        let malformed = |why: serde_json::Error| CalibrationError::Malformed(why.to_string());
        // The format first: another one may have other fields.
        let Format { format } = serde_json::from_str(text).map_err(malformed)?;
        if format != Self::FORMAT {
            return Err(CalibrationError::Format {
                found: format,
                expected: Self::FORMAT,
            });
        }
        let calibration: Self = serde_json::from_str(text).map_err(malformed)?;
        calibration.check()?;
        Ok(calibration)
    }

    /// Whether every scene has statistics and times that can be, and there is one.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Scene`] names the first one that has not; [`CalibrationError::Empty`].
    pub fn check(&self) -> Result<(), CalibrationError> {
        if self.scenes.is_empty() {
            return Err(CalibrationError::Empty);
        }
        for MeasuredScene {
            scene,
            features,
            times,
            ..
        } in &self.scenes
        {
            let refuse = |what: String| {
                let scene = scene.clone();
                Err(CalibrationError::Scene { scene, what })
            };
            let Features {
                triangles,
                refs_per_triangle,
                sigma,
                sparseness,
                hit_share,
            } = *features;
            if triangles == 0 || !(refs_per_triangle >= 1.0 && refs_per_triangle.is_finite()) {
                return refuse("it has no triangles, or they are in no cell".into());
            }
            let are_shares = (0.0..1.0).contains(&sparseness) && (0.0..=1.0).contains(&hit_share);
            if !(sigma >= 0.0 && sigma.is_finite() && are_shares) {
                return refuse("its statistics are no statistics".into());
            }
            if !times.contains_key(&Structure::Grid) {
                return refuse("the grid was not measured".into());
            }
            if times
                .get(&Structure::Lazy)
                .is_some_and(|lazy| lazy.opening.is_none())
            {
                return refuse("what rays open of a lazy tree was not measured".into());
            }
            if let Some((structure, times)) = times.iter().find(|(_, times)| !times.are_sound()) {
                return refuse(format!("times of {structure} that cannot be: {times:?}"));
            }
        }
        Ok(())
    }

    /// As a file.
    #[allow(clippy::missing_panics_doc, reason = "names and numbers")]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("nothing that JSON has not");
        text.push('\n');
        text
    }

    /// The scenes whose rays were made in one way.
    pub fn of_scheme(&self, rays: RayScheme) -> impl Iterator<Item = &MeasuredScene> {
        self.scenes.iter().filter(move |scene| scene.rays == rays)
    }
}

impl MeasuredScene {
    /// What a structure costs, if it was measured.
    pub fn times_of(&self, structure: Structure) -> Option<&Times> {
        self.times.get(&structure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Calibration {
        let scene = MeasuredScene {
            scene: "bunny".into(),
            rays: RayScheme::Path,
            features: Features {
                triangles: 69_451,
                refs_per_triangle: 2.6,
                sigma: 4.8,
                sparseness: 0.9,
                hit_share: 0.4,
            },
            times: BTreeMap::from([
                (Structure::Grid, Times::new(0.004, 1e-6)),
                (Structure::Fast, Times::new(0.04, 3e-7)),
            ]),
        };
        Calibration::new(1, "2026-11-28".into(), "0123abcd".into(), vec![scene])
    }

    #[test]
    fn files_come_back() {
        let calibration = example();
        assert_eq!(
            Calibration::read(&calibration.to_json()),
            Ok(calibration),
            "as it was"
        );
    }

    #[test]
    fn the_built_in_one_is_right() {
        let calibration = Calibration::built_in();
        for rays in [RayScheme::Random, RayScheme::Path] {
            assert!(
                calibration.of_scheme(rays).count() >= 28,
                "{rays:?}: as many as the paper"
            );
        }
    }

    type Change<'a> = &'a dyn Fn(&mut Calibration);

    #[test]
    fn foreign_files_are_refused_with_a_reason() {
        let refused = |change: Change<'_>| {
            let mut calibration = example();
            change(&mut calibration);
            Calibration::read(&calibration.to_json())
                .expect_err("refused")
                .to_string()
        };
        let (negative, unopened) = (Times::new(-1.0, 1.0), Times::new(1.0, 1.0));
        let rows: [(Change<'_>, &str); 10] = [
            (
                &|c| c.format = 7,
                "its format is 7, and this version reads 1: calibrate again",
            ),
            (
                &|c| c.version = "0.0.3".into(),
                "it was measured with version 0.0.3",
            ),
            (
                &|c| c.machine.cpu = "Abacus 9".into(),
                "it was measured on another machine (Abacus 9",
            ),
            (&|c| c.scenes.clear(), "it has no scene"),
            (
                &|c| c.scenes[0].features.triangles = 0,
                "scene `bunny`: it has no triangles",
            ),
            (
                &|c| c.scenes[0].features.refs_per_triangle = 0.5,
                "scene `bunny`: it has no triangles",
            ),
            (
                &|c| c.scenes[0].features.sparseness = 1.5,
                "scene `bunny`: its statistics are no",
            ),
            (
                &|c| c.scenes[0].times.retain(|of, _| *of != Structure::Grid),
                "the grid was not measured",
            ),
            (
                &|c| c.scenes[0].times.extend([(Structure::Lazy, unopened)]),
                "scene `bunny`: what rays open",
            ),
            (
                &|c| c.scenes[0].times.extend([(Structure::Best, negative)]),
                "scene `bunny`: times of best that cannot be",
            ),
        ];
        for (change, message) in rows {
            let refused = refused(change);
            assert!(refused.contains(message), "{message}: {refused}");
        }
        for text in ["", "{}", "[1, 2]", "{\"format\": 1}", "{\"format\": -1}"] {
            let refused = Calibration::read(text).expect_err(text).to_string();
            assert!(
                refused.starts_with("not a calibration: "),
                "{text}: {refused}"
            );
        }
    }
}
