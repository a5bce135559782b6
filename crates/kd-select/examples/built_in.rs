//! Turns a calibration file on standard input into the source of the built-in calibration on standard output:
//!
//! ```text
//! cargo run -p kd-select --features json --example built_in < FILE > new.rs && mv new.rs crates/kd-select/src/built_in/data.rs
//! ```
#![allow(clippy::print_stdout, reason = "a program")]

use std::error::Error;
use std::fmt::Write as _;
use std::io::Read as _;

use kd_select::{Calibration, Features, Opening, Times};

fn main() -> Result<(), Box<dyn Error>> {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text)?;
    let calibration = Calibration::read_foreign(&text)?;
    print!("{}", source_of(&calibration)?);
    Ok(())
}

const HEAD: &str = "\
//! The measured scenes.
//!
//! Generated from a calibration file by `examples/built_in.rs`; not to be changed by hand.

use super::{Scene, features, lazy};
use crate::calibration::RayScheme::{Path, Random};
use crate::times::Structure::{Balanced, Best, Fast, Grid, Lazy, Objects};
use crate::times::Times;

";

/// The source of `src/built_in/data.rs`.
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
        let times = scene.times.iter().map(|(structure, times)| {
            let Times {
                build_seconds: build,
                ray_seconds: ray,
                opening,
            } = times;
            match opening {
                None => format!("({structure:?}, Times::new({build:?}, {ray:?}))"),
                Some(Opening { seconds, rays }) => {
                    format!("({structure:?}, lazy({build:?}, {ray:?}, {seconds:?}, {rays:?}))")
                }
            }
        });
        writeln!(
            text,
            "    Scene {{ name: {:?}, rays: {:?}, \
             features: features({triangles}, {refs_per_triangle:?}, {sigma:?}, {sparseness:?}, {hit_share:?}), \
             times: &[{}] }},",
            scene.scene,
            scene.rays,
            times.collect::<Vec<_>>().join(", ")
        )?;
    }
    writeln!(text, "];")?;
    Ok(text)
}
