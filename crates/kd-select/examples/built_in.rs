//! Turns a calibration file on standard input into the source of the built-in calibration on standard output:
//!
//! ```text
//! cargo run -p kd-select --features json --example built_in < FILE > new.rs && mv new.rs crates/kd-select/src/built_in.rs
//! ```
#![allow(clippy::print_stdout, reason = "a program")]

use std::error::Error;
use std::fmt::Write as _;
use std::io::Read as _;

use kd_select::{Calibration, Features, Times};

fn main() -> Result<(), Box<dyn Error>> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let calibration = Calibration::read_foreign(&text)?;
    print!("{}", source_of(&calibration)?);
    Ok(())
}

const HEAD: &str = "\
//! The calibration that comes with the library, as Rust data.
//!
//! Generated from a calibration file by `examples/built_in.rs`; not to be changed by hand.

use crate::calibration::Features;
use crate::calibration::RayScheme::{self, Path, Random};
use crate::times::Structure::{self, Balanced, Best, Fast, Grid, Lazy, Objects};
use crate::times::{Opening, Times};

/// A measured scene.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) rays: RayScheme,
    pub(crate) features: Features,
    pub(crate) times: &'static [(Structure, Times)],
}

const fn features(
    triangles: u64,
    refs_per_triangle: f64,
    sigma: f64,
    sparseness: f64,
    hit_share: f64,
) -> Features {
    Features {
        triangles,
        refs_per_triangle,
        sigma,
        sparseness,
        hit_share,
    }
}

/// The build, a ray, and the opening cost with its number of rays.
const fn lazy(build_seconds: f64, ray_seconds: f64, seconds: f64, rays: f64) -> Times {
    Times {
        build_seconds,
        ray_seconds,
        opening: Some(Opening { seconds, rays }),
    }
}

";

/// The source of `src/built_in.rs`.
pub(crate) fn source_of(calibration: &Calibration) -> Result<String, std::fmt::Error> {
    let Calibration {
        version,
        machine,
        threads,
        date,
        commit,
        scenes,
        ..
    } = calibration;
    let mut text = HEAD.to_owned();
    writeln!(text, "pub(crate) const VERSION: &str = {version:?};")?;
    writeln!(text, "pub(crate) const CPU: &str = {:?};", machine.cpu)?;
    writeln!(text, "pub(crate) const LEVEL: &str = {:?};", machine.level)?;
    writeln!(text, "pub(crate) const THREADS: usize = {threads};")?;
    writeln!(text, "pub(crate) const DATE: &str = {date:?};")?;
    writeln!(text, "pub(crate) const COMMIT: &str = {commit:?};\n")?;
    writeln!(text, "#[rustfmt::skip]")?;
    writeln!(text, "pub(crate) const SCENES: &[Scene] = &[")?;
    for scene in scenes {
        let Features {
            triangles,
            refs_per_triangle,
            sigma,
            sparseness,
            hit_share,
        } = scene.features;
        writeln!(
            text,
            "    Scene {{\n        name: {:?},\n        rays: {:?},\n        \
             features: features({triangles}, {refs_per_triangle:?}, {sigma:?}, {sparseness:?}, {hit_share:?}),\n        \
             times: &[",
            scene.scene, scene.rays
        )?;
        for (structure, times) in &scene.times {
            let Times {
                build_seconds,
                ray_seconds,
                opening,
            } = times;
            match opening {
                None => writeln!(
                    text,
                    "            ({structure:?}, Times::new({build_seconds:?}, {ray_seconds:?})),"
                )?,
                Some(opening) => writeln!(
                    text,
                    "            ({structure:?}, lazy({build_seconds:?}, {ray_seconds:?}, {:?}, {:?})),",
                    opening.seconds, opening.rays
                )?,
            }
        }
        writeln!(text, "        ],\n    }},")?;
    }
    writeln!(text, "];")?;
    Ok(text)
}
