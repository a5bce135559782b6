//! The time until the first ray, and the rays that follow, by our presets over Embree's builds; on hostile meshes over a sphere of as
//! many triangles; and frames of many parts.

mod hostile;
mod parts;

use std::sync::Arc;

use clap::Args;
use kd::glam::Vec3;
use kd::{Aabb, KdTree, Ray};

use crate::builds::{PRESETS, growth};
use crate::environment::Environment;
use crate::names::{LayoutName, Variant};
use crate::record::Record;
use crate::scene_table::{SceneTable, SceneTableArgs};
use crate::scenes::Scene;
use crate::session::Session;
use crate::view::View;
use crate::workload::Amount;
use crate::{peers, run_folder};

/// Two threads are compared with one from this number of triangles on.
const TWO_THREADS_FROM: usize = 50_000;

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct FirstRayArgs {
    #[command(flatten)]
    table: SceneTableArgs,

    /// Also build generated meshes from 10 000 triangles up to this number, and plot our times over Embree's
    #[arg(long, value_name = "TRIANGLES", num_args = 0..=1, require_equals = true, default_missing_value = "4200000")]
    growth: Option<u64>,
}

/// Measures, prints and writes; false if an answer is wrong.
pub(crate) fn run(arguments: &FirstRayArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let (samples, is_smoke) = (arguments.table.samples, arguments.table.smoke);
    let command = SceneTable {
        usual: None,
        with_rooms: true,
        view: View::named(&["first-ray"], ("", ""))?,
        file: "first-ray.jsonl",
        note: "and their geometric mean; ours and its baseline run in turns",
        rays: if is_smoke {
            (64, 1 << 10)
        } else {
            (Amount::FULL.side, Amount::FULL.ray_limit)
        },
        leaves_out: |scene, comparison| {
            comparison.own.1 == 2 && scene.mesh.len() < TWO_THREADS_FROM
        },
    };
    let others = |environment: &Environment| {
        let mut cells = hostile::measure(environment, samples, is_smoke)?;
        cells.extend(parts::measure(environment, samples, is_smoke)?);
        Ok(cells)
    };
    arguments
        .table
        .run_with(&command, note_bytes, others, |folder, _: &[Record]| {
            let Some(most) = arguments.growth else {
                return Ok(String::new());
            };
            let growth = growth::measure(most, samples, LayoutName::Wide)?;
            println!("\n{growth}");
            let plot = folder.file("growth.svg");
            run_folder::write_all([Some(plot)], growth.to_svg()?)?;
            growth.to_lines()
        })
}

/// The sizes of what rays traverse.
fn note_bytes(session: &mut Session<'_>, scene: &Scene) -> anyhow::Result<()> {
    for preset in PRESETS {
        let options = preset.options().expect("a preset").with_threads(1);
        let tree = KdTree::build(Arc::clone(&scene.mesh), &options)?;
        let subject = Variant::kd(preset, LayoutName::Wide).to_string();
        let mut cell = session.blank(&subject, "", 1, "");
        cell.exact.bytes_total = tree.stats().bytes_kept();
        session.add(cell);
    }
    Ok(())
}

/// Rays between points in a box.
fn rays_through(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut point = || {
        let at = Vec3::new(rng.f32(), rng.f32(), rng.f32());
        bounds.min + at * (bounds.max - bounds.min)
    };
    let mut ray = || {
        let (from, to) = (point(), point());
        Ray::new(from, to - from)
    };
    (0..count).map(|_| ray()).collect()
}
