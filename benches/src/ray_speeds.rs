//! The speed of rays through our default tree, over rivals and over our other ways to trace, with goals.

mod first_hits;

use std::sync::Arc;

use clap::Args;
use kd::{BuildOptions, Hit, KdTree};
use kd_rivals::{FIRST, Restarting};
use kd_trace::RayQuery;

use crate::arguments::name_of;
use crate::measure::Pairs;
use crate::names::{REFERENCE, RIVAL};
use crate::peers;
use crate::rays::RayKind;
use crate::record::Record;
use crate::scene_table::{SceneTable, SceneTableArgs};
use crate::scenes::Scene;
use crate::session::Session;
use crate::structure::Manner;
use crate::view::View;
use crate::workload::Amount;

use first_hits::Distances;

/// The number of triangles from which incoherent batches are compared with single rays: they should pay where a tree exceeds the
/// caches.
const LARGE: usize = 200_000;

/// The rays of the first hits, and their baselines.
const FIRST_HITS: &str = "random-first";
const FILTER: &str = "embree/medium/filter";
const RESTARTING: &str = "kd/balanced/restarting";

/// What to trace.
#[derive(Args, Debug)]
pub(crate) struct RaysArgs {
    #[command(flatten)]
    table: SceneTableArgs,

    /// Of each kind but primary, keep about this many rays, in whole runs of 64 neighbors; 0 keeps all
    /// [default: 65536; 1024 with --smoke]
    #[arg(long, value_name = "N")]
    ray_limit: Option<usize>,
}

/// Measures, prints and writes; false if an answer of ours depends on the way to trace.
pub(crate) fn run(arguments: &RaysArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let (side, usual_limit) = if arguments.table.smoke {
        (64, 1 << 10)
    } else {
        (Amount::FULL.side, Amount::FULL.ray_limit)
    };
    let command = SceneTable {
        usual: None,
        with_rooms: true,
        view: View::named(&["rays"], ("", ""))?,
        file: "rays.jsonl",
        note: "of speeds of rays; ours and its baseline run in turns",
        rays: (side, arguments.ray_limit.unwrap_or(usual_limit)),
        leaves_out: |scene, comparison| {
            let is_batch = matches!(comparison.rays, Some((_, Manner::Batch)));
            is_batch && comparison.over.0 == RIVAL && scene.mesh.len() < LARGE
        },
    };
    arguments.table.run(&command, measure, |_, cells| {
        println!("{}", disagreements(cells));
        Ok(String::new())
    })
}

/// The cells that are no comparisons of variants: first hits and the size of the tree.
fn measure(session: &mut Session<'_>, scene: &Scene) -> anyhow::Result<()> {
    // A camera that sees nothing of the mesh leaves nothing to measure.
    for workload in session.workloads.iter().filter(|w| w.rays.is_empty()) {
        let (scene, kind) = (&session.scene, name_of(&workload.kind));
        session.problems.push(format!("{scene}: no {kind} rays"));
    }
    let mesh = &scene.mesh;
    let options = BuildOptions::default().with_threads(1);
    let tree = KdTree::build(Arc::clone(mesh), &options)?;
    first_over_filter(session, &tree, &*peers::filtered(mesh, 1)?);
    first_over_restarting(session, &tree);
    let mut cell = session.blank(&REFERENCE.to_string(), "", 1, "");
    cell.exact.bytes_total = tree.stats().bytes_kept();
    session.add(cell);
    Ok(())
}

/// The speed, and the rays in a million whose first hits the rival finds differently.
fn first_over_filter(session: &mut Session<'_>, tree: &KdTree, filter: &dyn RayQuery<Hit = Hit>) {
    let (pairs, [ours, theirs]) = first_hits_over(session, tree, filter);
    let different = count_unless(first_hits::agree, &ours, &theirs) as f64;
    session.add_rays(
        &REFERENCE.to_string(),
        FIRST_HITS,
        FILTER,
        &pairs,
        ours.len(),
    );
    let mut cell = session.blank(FILTER, FIRST_HITS, 1, "");
    cell.exact.rays = ours.len();
    cell.exact.disagreement_ppm = Some(different / ours.len().max(1) as f64 * 1e6);
    session.add(cell);
}

fn first_over_restarting(session: &mut Session<'_>, tree: &KdTree) {
    let (pairs, [ours, restarted]) = first_hits_over(session, tree, &Restarting(tree));
    let wrong = count_unless(first_hits::are_those_of_restarted, &ours, &restarted);
    if wrong > 0 {
        let scene = &session.scene;
        let problem = format!(
            "{scene}: the first hits of {wrong} random rays differ from those of restarted rays"
        );
        session.problems.push(problem);
    }
    session.add_rays(
        &REFERENCE.to_string(),
        FIRST_HITS,
        RESTARTING,
        &pairs,
        ours.len(),
    );
}

/// The times and the hits, ours first.
fn first_hits_over(
    session: &Session<'_>,
    tree: &KdTree,
    other: &dyn RayQuery<Hit = Hit>,
) -> (Pairs, [Vec<Distances>; 2]) {
    let rays = &session.workload(RayKind::Random).rays;
    first_hits::time(session.repeats, rays, tree, other)
}

/// The number of rays whose hits do not match.
fn count_unless(
    matches: fn(&Distances, &Distances) -> bool,
    ours: &[Distances],
    others: &[Distances],
) -> usize {
    let pairs = ours.iter().zip(others);
    pairs.filter(|(a, b)| !matches(a, b)).count()
}

/// A line with the disagreements of Embree's filter.
fn disagreements(cells: &[Record]) -> String {
    let by_scene = cells.iter().filter(|cell| cell.variant() == FILTER);
    let by_scene = by_scene.map(|cell| {
        let ppm = cell.exact.disagreement_ppm.unwrap_or(0.0);
        format!("{} {ppm:.0}", cell.scene)
    });
    let by_scene: Vec<String> = by_scene.collect();
    format!(
        "random rays in a million whose first {FIRST} hits Embree finds differently: {}",
        by_scene.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;
    use crate::view::{cell, table_with};

    const OURS: &str = "kd/balanced/wide";

    fn cells(scene: &str, factor: f64, large: bool) -> Vec<Record> {
        let mut cells = Vec::new();
        let mut add = |rays: String, over: &str, speed: f64| {
            cells.push(cell(scene, OURS, &rays, over, 1.0 / speed));
        };
        let kinds = RayKind::value_variants().iter().map(name_of);
        for (kind, speed) in kinds.zip([1.0, 2.0, 2.0, 2.0, 4.0]) {
            add(kind.clone(), "embree/medium/own", speed * factor);
            add(kind.clone(), "embree-robust/medium/own", 1.6);
            add(kind.clone(), "obvhs/medium/own", 1.9 + 0.1 * speed);
            add(format!("{kind}-batch"), OURS, 5.0 - speed);
            add(format!("{kind}-batch"), "embree8/medium/own", 1.5 + speed);
            add(format!("{kind}-packets"), "embree8/medium/own", 1.1);
            if large {
                add(
                    format!("{kind}-batch"),
                    "embree/medium/own",
                    1.3 + 0.1 * speed,
                );
            }
        }
        add(FIRST_HITS.into(), FILTER, 3.0);
        add(FIRST_HITS.into(), RESTARTING, 3.0);
        let mut on_two = cell(scene, OURS, "shadow", "kd/balanced/wide on 1", 0.5);
        on_two.threads = 2;
        let mut size = cell(scene, OURS, "", "", 1.0);
        (size.triangles, size.exact.bytes_total) = (10, if large { 2000 } else { 500 });
        let mut filter = cell(scene, FILTER, FIRST_HITS, "", 1.0);
        filter.exact.disagreement_ppm = Some(12.4);
        cells.extend([on_two, size, filter]);
        cells
    }

    #[test]
    fn kinds_have_rows_with_their_mean_and_worst() {
        let cells = [cells("a", 0.5, false), cells("b", 2.0, true)].concat();
        let rows = [
            ("single rays / Embree medium, random", 4.0, true),
            ("single rays / Embree medium, all kinds", 2.0, true),
            ("single rays / Embree medium, worst kind", 0.5, false),
            ("single rays / Embree medium, worst scene", 1.0, true),
            ("single rays / Embree robust, worst scene", 1.6, true),
            ("single rays / obvhs, worst kind", 2.0, true),
            ("primary batch / Embree packets of 8", 2.5, true),
            ("shadow packets / Embree packets of 8", 1.1, true),
            ("ao batch / Embree medium", 1.5, true),
            ("random batch / Embree medium", 1.7, true),
            ("batches / single rays, shadow", 3.0, true),
            ("first 4 hits / Embree with a filter, random", 3.0, true),
            ("first 4 hits / restarting, random", 3.0, true),
            ("two threads / one thread, shadow", 2.0, true),
            ("bytes per triangle", 125.0, false),
        ];
        let table = table_with("rays", &cells, &rows);
        assert_eq!(table.rows.len(), 8 + 2 + 7 + 5 + 2 + 2 + 6 + 1, "{table}");
        let line = disagreements(&cells);
        assert!(line.ends_with("differently: a 12, b 12"), "{line}");
    }

    #[test]
    fn without_a_large_scene_incoherent_batches_have_no_value() {
        let table = table_with("rays", &cells("a", 1.0, false), &[]);
        let row = table.row("diffuse batch / Embree medium");
        assert_eq!(row.is_met(), None, "{row:?}");
    }
}
