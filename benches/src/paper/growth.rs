//! The time of an update as the static scene grows, with the moving object apart from it.

use std::hint::black_box;
use std::time::Instant;

use kd::{BuildOptions, MergeMethod, Strategy};
use serde_json::json;

use super::PaperArgs;
use crate::animation::Animation;
use crate::environment::Environment;
use crate::measure::Pairs;
use crate::session::Session;
use crate::{run_folder, text};

/// Sizes of generated rooms: 124 thousand triangles, 1 and 10 million.
const SIZES: [u32; 3] = [6, 12, 26];
/// About the number of moving triangles in BART kitchen.
const MOVING: f64 = 7000.0;
const WAYS: [(&str, Strategy); 2] = [
    ("merge", Strategy::Merge(MergeMethod::Guided)),
    ("auto", Strategy::Auto),
];

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    let sizes = if arguments.smoke {
        &[1, 2]
    } else {
        SIZES.as_slice()
    };
    let environment = Environment::detect();
    let updates = 4 * arguments.samples + 1;
    let mut table = text::empty_table(["static", "moving", "merge ms", "auto ms"]);
    let mut lines = Vec::new();
    for size in sizes {
        let animation = Animation::with_object(*size, |_| MOVING)?;
        let (fixed, moving) = (animation.fixed.len(), animation.groups[0].len());
        let mut session = Session::new(&environment, &animation.name, fixed + moving, updates);
        for (name, strategy) in WAYS {
            let options = BuildOptions::fast().with_threads(1);
            let (mut scene, parts) = animation.scene(options, strategy)?;
            let mut update = || -> anyhow::Result<f64> {
                let start = Instant::now();
                animation.set(&mut scene, &parts, 0)?;
                black_box(scene.commit()?);
                Ok(start.elapsed().as_secs_f64())
            };
            // The first one builds the static tree.
            update()?;
            let own: Result<Vec<f64>, _> = (0..updates).map(|_| update()).collect();
            session.add_build(&format!("scene/{name}/frame"), "", &Pairs::alone(own?));
        }
        let ms: Vec<f64> = session.cells.iter().map(|cell| cell.build_ms()).collect();
        let counts = [fixed.to_string(), moving.to_string()].into_iter();
        table.add_row(counts.chain(ms.iter().map(|ms| format!("{ms:.3}"))));
        lines.push(json!({
            "table": "merge-table", "row": "growth", "still": fixed, "moving": moving,
            "merge_ms": ms[0], "auto_ms": ms[1],
        }));
    }
    text::align_right(&mut table, 0);
    println!("{table}\none thread, medians of {updates} updates");
    run_folder::write_all([arguments.json.clone()], run_folder::json_lines(lines)?)?;
    Ok(true)
}
