//! Table 1 and Figures 1 and 2 of *When It Makes Sense to Use Uniform Grids for Ray Tracing* (Hapala, Karlík and Havran 2011):
//! times of a grid and of a kd-tree over many scenes, the quality of estimates of the kd-tree that is not built, and of decisions
//! from these estimates.

mod decisions;
mod estimates;
mod measure;
mod rays;
mod scenes;
mod seed;
mod table;

use anyhow::ensure;
use kd_select::{Calibration, RayScheme};

use super::PaperArgs;
use crate::environment::Environment;
use crate::{run_folder, text};

use decisions::Decisions;
use estimates::Estimates;
use measure::{Measured, Settings};

/// The two kinds of rays, the halves of the paper's table.
const SCHEMES: [RayScheme; 2] = [RayScheme::Random, RayScheme::Path];

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    let sources = scenes::choose(arguments)?;
    let settings = Settings::new(arguments);
    let (mut measured, mut problems) = (Vec::new(), Vec::new());
    for source in &sources {
        eprintln!("{}", source.name);
        measured.extend(measure::measure(source, &settings, &mut problems)?);
    }
    ensure!(!measured.is_empty(), "no scene has triangles");
    println!("{}", table::of(&measured));
    println!("{}", table::averages(&measured));
    let estimates = SCHEMES.map(|scheme| Estimates::of(&measured, scheme, settings.combinations));
    for (scheme, estimates) in SCHEMES.into_iter().zip(&estimates) {
        println!("{}", estimates.summary(scheme));
    }
    let decisions = SCHEMES.map(|scheme| Decisions::of(&measured, scheme));
    println!("{}", decisions::table(&decisions));
    for (scheme, decisions) in SCHEMES.into_iter().zip(&decisions) {
        println!("{}", decisions.worst(scheme));
    }
    println!(
        "one thread, medians of {} runs in turns, one ray at a time; every answer equals the kd-tree's",
        arguments.samples
    );
    run_folder::write_all([arguments.json.clone()], table::to_lines(&measured)?)?;
    run_folder::write_all([arguments.plot.clone()], estimates::to_svg(&estimates)?)?;
    if let Some(path) = &arguments.calibration {
        let scenes = measured.iter().map(|measured| measured.scene.clone());
        let date = run_folder::today();
        let calibration = Calibration::new(1, date, Environment::detect().rev, scenes.collect());
        run_folder::write(path, calibration.to_json())?;
        println!("wrote {}", path.display());
    }
    Ok(text::report_problems(&problems))
}

/// The measurements with rays of one scheme.
fn of_scheme(measured: &[Measured], scheme: RayScheme) -> Vec<&Measured> {
    let of_scheme = measured
        .iter()
        .filter(|measured| measured.scene.rays == scheme);
    of_scheme.collect()
}

/// A number of rays, or a dash.
fn rays_text(rays: Option<f64>) -> String {
    rays.map_or_else(|| "–".into(), |rays| format!("{rays:.0}"))
}
