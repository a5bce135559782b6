//! What an update takes where what stands still grows, and what moves has nothing to do with it.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use kd::{BuildOptions, MergeMethod, Scene, Strategy};
use serde_json::json;

use super::PaperArgs;
use crate::animation::Animation;
use crate::record::median;
use crate::run_folder;
use crate::terminal;

/// Sizes of generated rooms: 124 thousand triangles, 1 and 10 million.
const SIZES: [u32; 3] = [6, 12, 26];
/// About as many as move in BART kitchen.
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
    let mut table = terminal::empty_table(
        ["still", "moving", "merge ms", "auto ms"]
            .map(String::from)
            .into(),
    );
    let mut lines = String::new();
    for size in sizes {
        let animation = Animation::with_object(*size, |_| MOVING)?;
        let (still, moving) = (animation.fixed.len(), animation.groups[0].len());
        let mut updates = Vec::new();
        for (_, strategy) in WAYS {
            let mut scene = Scene::new(BuildOptions::fast().with_threads(1));
            scene.set_strategy(strategy);
            scene.add_static(Arc::clone(&animation.fixed))?;
            let parts = [scene.add_dynamic(Arc::clone(&animation.groups[0]))?];
            let mut update = || -> anyhow::Result<f64> {
                let start = Instant::now();
                animation.set(&mut scene, &parts, 0)?;
                black_box(scene.commit()?);
                Ok(1e3 * start.elapsed().as_secs_f64())
            };
            // The first one builds what stands still.
            update()?;
            let times = (0..4 * arguments.samples + 1).map(|_| update());
            updates.push(median(&times.collect::<Result<Vec<_>, _>>()?));
        }
        let cells = [still.to_string(), moving.to_string()].into_iter();
        table.add_row(cells.chain(updates.iter().map(|ms| format!("{ms:.3}"))));
        let line = json!({
            "table": "merge-table", "row": "growth", "still": still, "moving": moving,
            "merge_ms": updates[0], "auto_ms": updates[1],
        });
        lines += &serde_json::to_string(&line)?;
        lines.push('\n');
    }
    terminal::align_right(&mut table, 0);
    println!("{table}");
    println!(
        "one thread, medians of {} updates",
        4 * arguments.samples + 1
    );
    if let Some(path) = &arguments.json {
        run_folder::write(path, lines)?;
        println!("wrote {}", path.display());
    }
    Ok(true)
}
