//! Measured scenes, the machine that measured them, and the file that keeps both.

use std::collections::BTreeMap;

use kd_grid::GridStats;
#[cfg(feature = "json")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::built_in;
use crate::machine::Machine;
use crate::times::{Structure, Times};

/// The distribution of the rays that a scene was measured with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(rename_all = "lowercase"))]
pub enum RayScheme {
    /// Through two random points of the scene's bounding sphere.
    #[default]
    Random,
    /// Those of a path tracer: from a camera, to lights, and scattered from surfaces.
    Path,
}

/// The features of a scene that estimates use: statistics of its grid, and the hits of a sample of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct Features {
    /// Number of triangles.
    pub triangles: u64,
    /// References per triangle.
    pub refs_per_triangle: f64,
    /// The standard deviation of references per cell.
    pub sigma: f64,
    /// The share of empty cells.
    pub sparseness: f64,
    /// The share of sampled rays that hit something.
    pub hit_share: f64,
}

impl Features {
    /// From the statistics of a grid and the share of sampled rays that hit something.
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

/// A scene of a calibration: its features, and the times of structures over it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct MeasuredScene {
    /// Name of the scene.
    pub scene: String,
    /// Distribution of its rays.
    pub rays: RayScheme,
    /// Its features.
    pub features: Features,
    /// The times of each measured structure; the grid is one of them.
    pub times: BTreeMap<Structure, Times>,
}

/// The times of structures over a set of scenes on one machine: the basis of decisions.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct Calibration {
    /// Format of the file: [`FORMAT`](Self::FORMAT).
    pub format: u32,
    /// Version of this crate.
    pub version: String,
    /// The machine that measured.
    pub machine: Machine,
    /// Number of threads that built.
    pub threads: usize,
    /// Date, as `2026-11-28`.
    pub date: String,
    /// The measured commit.
    pub commit: String,
    /// The measured scenes.
    pub scenes: Vec<MeasuredScene>,
}

/// Why a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The text is no calibration.
    #[error("not a calibration: {0}")]
    Malformed(String),
    /// The file has another format.
    #[error("its format is {found}, and this version reads {expected}: calibrate again")]
    Format {
        /// Format of the file.
        found: u32,
        /// Format that this version reads.
        expected: u32,
    },
    /// The file is of another version of the library, whose structures have other costs.
    #[error("it was measured with version {found}, and this is {expected}: calibrate again")]
    Version {
        /// Version of the file.
        found: String,
        /// This version.
        expected: String,
    },
    /// The file is of another machine.
    #[error("it was measured on another machine ({found}), and this is {here}: calibrate again")]
    OtherMachine {
        /// Machine of the file.
        found: Machine,
        /// This machine.
        here: Machine,
    },
    /// A scene has impossible figures.
    #[error("scene `{scene}`: {what}")]
    Scene {
        /// Name of the scene.
        scene: String,
        /// The problem.
        what: String,
    },
    /// The calibration has no scene.
    #[error("it has no scene")]
    Empty,
}

impl Calibration {
    /// The format of files that this version reads and writes.
    pub const FORMAT: u32 = 1;

    /// Scenes measured on this machine with this version; `date` is like `2026-11-28`.
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

    /// The calibration that comes with the library. It was measured on another machine, so that only ratios between structures
    /// hold here. Decisions use it unless a machine has a calibration of its own.
    pub fn built_in() -> Self {
        let measured = |scene: &built_in::Scene| MeasuredScene {
            scene: scene.name.into(),
            rays: scene.rays,
            features: scene.features,
            times: scene.times.iter().copied().collect(),
        };
        Self {
            format: Self::FORMAT,
            version: built_in::VERSION.into(),
            machine: Machine {
                cpu: built_in::CPU.into(),
                level: built_in::LEVEL.into(),
            },
            threads: built_in::THREADS,
            date: built_in::DATE.into(),
            commit: built_in::COMMIT.into(),
            scenes: built_in::SCENES.iter().map(measured).collect(),
        }
    }

    /// Reads a file that [`to_json`](Self::to_json) wrote, on this machine and with this version.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`]: the text is malformed, of another format, version or machine, or a scene has impossible figures.
    #[cfg(feature = "json")]
    pub fn read(text: &str) -> Result<Self, CalibrationError> {
        let calibration = Self::read_foreign(text)?;
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

    /// [`read`](Self::read), for a calibration of any machine and version. Only ratios between its structures hold here.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`]: the text is malformed or of another format, or a scene has impossible figures.
    #[cfg(feature = "json")]
    pub fn read_foreign(text: &str) -> Result<Self, CalibrationError> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
        }
        let malformed = |why: serde_json::Error| CalibrationError::Malformed(why.to_string());
        // The format first: another format may have other fields.
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

    /// Checks that the calibration has a scene, and that every scene has possible statistics and times.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Scene`] names the first scene that has not; [`CalibrationError::Empty`].
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
                return refuse("it has no triangles, or no references".into());
            }
            let are_shares = (0.0..1.0).contains(&sparseness) && (0.0..=1.0).contains(&hit_share);
            if !(sigma >= 0.0 && sigma.is_finite() && are_shares) {
                return refuse("its statistics are out of range".into());
            }
            if !times.contains_key(&Structure::Grid) {
                return refuse("the grid was not measured".into());
            }
            if times
                .get(&Structure::Lazy)
                .is_some_and(|lazy| lazy.opening.is_none())
            {
                return refuse("the lazy tree has no opening cost".into());
            }
            if let Some((structure, times)) = times.iter().find(|(_, times)| !times.are_sound()) {
                return refuse(format!(
                    "the times of {structure} are out of range: {times:?}"
                ));
            }
        }
        Ok(())
    }

    /// The text of a calibration file.
    #[cfg(feature = "json")]
    #[allow(clippy::missing_panics_doc, reason = "JSON can hold every calibration")]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("names and numbers");
        text.push('\n');
        text
    }

    /// The scenes with rays of one distribution.
    pub fn of_scheme(&self, rays: RayScheme) -> impl Iterator<Item = &MeasuredScene> {
        self.scenes.iter().filter(move |scene| scene.rays == rays)
    }
}

impl MeasuredScene {
    /// The times of a structure, if it was measured.
    pub fn times_of(&self, structure: Structure) -> Option<&Times> {
        self.times.get(&structure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "json")]
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
    #[cfg(feature = "json")]
    fn files_come_back() {
        let calibration = example();
        assert_eq!(
            Calibration::read(&calibration.to_json()),
            Ok(calibration),
            "as it was"
        );
    }

    #[test]
    fn the_built_in_calibration_is_sound() {
        let calibration = Calibration::built_in();
        assert_eq!(calibration.check(), Ok(()), "every scene");
        for rays in [RayScheme::Random, RayScheme::Path] {
            assert!(
                calibration.of_scheme(rays).count() >= 28,
                "{rays:?}: as many as the paper"
            );
        }
    }

    #[cfg(feature = "json")]
    type Change<'a> = &'a dyn Fn(&mut Calibration);

    /// Calibrations from before the rename of the structure `bvh`.
    #[test]
    #[cfg(feature = "json")]
    fn the_old_name_of_wide_nodes_of_objects_is_read() {
        let mut calibration = example();
        let times = &mut calibration.scenes[0].times;
        times.insert(Structure::Objects, Times::new(0.02, 4e-7));
        let text = calibration.to_json();
        assert!(text.contains("\"objects\""), "the new name: {text}");
        let old = text.replace("\"objects\"", "\"bvh\"");
        assert_eq!(Calibration::read(&old), Ok(calibration), "the old name");
    }

    #[test]
    #[cfg(feature = "json")]
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
                "scene `bunny`: its statistics are out of range",
            ),
            (
                &|c| c.scenes[0].times.retain(|of, _| *of != Structure::Grid),
                "the grid was not measured",
            ),
            (
                &|c| c.scenes[0].times.extend([(Structure::Lazy, unopened)]),
                "scene `bunny`: the lazy tree has no opening cost",
            ),
            (
                &|c| c.scenes[0].times.extend([(Structure::Best, negative)]),
                "scene `bunny`: the times of best are out of range",
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
