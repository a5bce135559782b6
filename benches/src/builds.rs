//! What builds of kd-trees cost and what the trees are worth, over Embree's builds and over our preset `best`, with goals.

pub(crate) mod growth;

use clap::Args;
use kd::tree::Tree;

use crate::arguments::name_of;
use crate::memory::peak_of_all_threads_during;
use crate::names::{BuilderName, LayoutName, StructureName, Variant};
use crate::scene_table::{SceneTable, SceneTableArgs};
use crate::scenes::Scene;
use crate::session::Session;
use crate::view::View;
use crate::workload::Amount;
use crate::{peers, run_folder};

/// The scenes of the goals, in a folder of meshes.
const SCENES: [&str; 6] = [
    "bunny",
    "sponza_dabrovic",
    "sibenik",
    "monastery",
    "dragon_res2",
    "munich",
];

use BuilderName::{Balanced, Best, Fast, MedianTop};

pub(crate) const PRESETS: [BuilderName; 3] = [Fast, Balanced, Best];

/// What to build.
#[derive(Args, Debug)]
pub(crate) struct BuildsArgs {
    #[command(flatten)]
    table: SceneTableArgs,

    /// Also build generated meshes from 10 000 triangles up to this number, and plot our times over Embree's
    #[arg(long, value_name = "TRIANGLES", num_args = 0..=1, require_equals = true, default_missing_value = "4200000")]
    growth: Option<u64>,
}

/// Measures, prints and writes; false if an answer is wrong or a tree depends on the number of threads.
pub(crate) fn run(arguments: &BuildsArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let command = SceneTable {
        usual: Some(&SCENES),
        with_rooms: false,
        view: View::named(&["builds"], ("", ""))?,
        file: "builds.jsonl",
        note: "and their geometric mean; ours and its baseline run in turns",
        rays: if arguments.table.smoke {
            (64, 1 << 10)
        } else {
            (Amount::FULL.side, Amount::FULL.ray_limit)
        },
        leaves_out: |_, _| false,
    };
    arguments.table.run(&command, note_trees, |folder, _| {
        let Some(most) = arguments.growth else {
            return Ok(String::new());
        };
        let growth = growth::measure(most, arguments.table.samples, LayoutName::Tree)?;
        println!("\n{growth}");
        let plot = folder.file("growth.svg");
        run_folder::write_all([Some(plot)], growth.to_svg()?)?;
        growth.to_lines()
    })
}

/// Embree's build on one thread.
pub(crate) const fn embree(builder: BuilderName) -> Variant {
    Variant::own(StructureName::Embree, builder)
}

/// The trees that do not depend on threads, under the cost model of `best`.
fn tree_of(builder: BuilderName) -> Variant {
    Variant::kd(builder, LayoutName::Tree)
}

/// Builds each preset on one, two and three threads: SAH costs, peaks of memory, and trees that differ.
fn note_trees(session: &mut Session<'_>, scene: &Scene) -> anyhow::Result<()> {
    let build = |builder: BuilderName, threads| {
        let options = builder.options().expect("a builder of kd-trees");
        kd::custom::build(&*scene.mesh, &options.with_threads(threads))
    };
    let mut trees = Vec::new();
    for preset in PRESETS {
        let (tree, alone) = peak_of_all_threads_during(|| build(preset, 1));
        let (on_two, together) = peak_of_all_threads_during(|| build(preset, 2));
        let (tree, on_two) = (tree?, on_two?);
        let differs = !are_equal(&tree, &on_two) || !are_equal(&tree, &build(preset, 3)?);
        if differs {
            let (scene, preset) = (&session.scene, name_of(&preset));
            let problem = format!("{scene}: the tree of {preset} depends on the number of threads");
            session.problems.push(problem);
        }
        let mut cell = session.blank(&tree_of(preset).to_string(), "", 2, "");
        cell.exact.peak_build_bytes = together;
        session.add(cell);
        trees.push((preset, tree, alone, differs));
    }
    let model = *trees[2].1.cost();
    trees.push((MedianTop, build(MedianTop, 1)?, 0, false));
    for (builder, tree, peak, differs) in trees {
        let mut cell = session.blank(&tree_of(builder).to_string(), "", 1, "");
        cell.exact.sah_cost_own = tree.sah_cost(&model);
        cell.exact.peak_build_bytes = peak;
        cell.exact.mismatches = usize::from(differs);
        session.add(cell);
    }
    Ok(())
}

fn are_equal(a: &Tree, b: &Tree) -> bool {
    a.nodes() == b.nodes() && a.refs() == b.refs()
}

#[cfg(test)]
mod tests {
    use crate::view::{cell, table_with};

    #[test]
    fn rows_are_means_over_scenes_with_goals() {
        let mut cells = Vec::new();
        for (scene, factor) in [("a", 0.5), ("b", 2.0)] {
            let time = 0.8 * factor;
            cells.push(cell(scene, "kd/best/tree", "", "embree/high/own", time));
            for (builder, cost, differ) in
                [("best", 1.0, 0), ("fast", 1.2, 0), ("balanced", 1.0, 1)]
            {
                let mut tree = cell(scene, &format!("kd/{builder}/tree"), "", "", 1.0);
                tree.triangles = 100;
                tree.exact.sah_cost_own = cost;
                tree.exact.mismatches = if scene == "b" { differ } else { 0 };
                cells.push(tree);
            }
        }
        let rows = [
            ("build time, best / Embree high", 0.8, true),
            ("SAH cost by the model of best, fast / best", 1.2, false),
            ("trees that differ on two or three threads", 1.0, false),
            ("peak bytes per triangle, balanced", 90.0, true),
        ];
        let table = table_with("builds", &cells, &rows);
        let lines = table.to_lines().expect("plain data");
        assert_eq!(lines.lines().count(), table.rows.len(), "one each");
    }
}
