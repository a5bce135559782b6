//! The rows of the table, with their goals.

use super::figures::{Figures, PRESETS, RIVALS};
use crate::cli::name_of;
use crate::goals::{Goal, Row, Table, geometric_mean, sum};

const FAST: usize = 0;
const BALANCED: usize = 1;
const BEST: usize = 2;

/// All rows.
pub(super) fn of(measured: &[Figures]) -> Table {
    let mut rows = Vec::new();
    let mut add = |name: String, goal, value: &dyn Fn(&Figures) -> f64| {
        let values = measured.iter().map(|f| Some(value(f))).collect();
        rows.push(Row::new(name, goal, values, geometric_mean));
    };
    for (preset, most) in [(BEST, 0.8), (BALANCED, 0.5), (FAST, 1.25)] {
        let (ours, rival) = (PRESETS[preset], name_of(&RIVALS[preset]));
        let name = format!("build time, {ours} / Embree {rival}");
        add(name, Goal::AtMost(most), &|f| f.over_embree[preset]);
    }
    for preset in [BEST, BALANCED, FAST] {
        let name = format!("speed-up on two threads, {}", PRESETS[preset]);
        add(name, Goal::AtLeast(1.85), &|f| f.speed_up[preset]);
    }
    let name = "on two threads, best / best below a median";
    add(name.into(), Goal::None, &|f| f.nested_over_median_top);
    let name = "SAH cost, best below a median / best";
    add(name.into(), Goal::None, &|f| f.median_top_cost);
    for (preset, most) in [(BALANCED, 1.02), (FAST, 1.08)] {
        let name = format!("trace time, {} / best", PRESETS[preset]);
        add(name, Goal::AtMost(most), &|f| f.trace_over_best[preset]);
    }
    for (preset, most) in [(BALANCED, 1.01), (FAST, 1.10)] {
        let name = format!("SAH cost by the model of best, {} / best", PRESETS[preset]);
        add(name, Goal::AtMost(most), &|f| f.cost_over_best[preset]);
    }
    for (preset, most) in [(BALANCED, 100.0), (BEST, 250.0)] {
        let name = format!("peak bytes per triangle, {}", PRESETS[preset]);
        add(name, Goal::AtMost(most), &|f| f.peak_bytes[preset][0]);
    }
    for preset in [BALANCED, BEST] {
        let name = format!("peak bytes on two threads / on one, {}", PRESETS[preset]);
        let grown = |f: &Figures| f.peak_bytes[preset][1] / f.peak_bytes[preset][0];
        add(name, Goal::AtMost(1.2), &grown);
    }
    rows.push(different_trees(measured));
    Table {
        scenes: measured.iter().map(|scene| scene.scene.clone()).collect(),
        rows,
    }
}

/// How many presets on how many scenes give another tree on another number of threads.
fn different_trees(measured: &[Figures]) -> Row {
    let counts = measured.iter().map(|f| Some(f.different_trees as f64));
    let name = "trees that differ on two or three threads";
    Row::new(name, Goal::AtMost(0.0), counts.collect(), sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(scene: &str, factor: f64) -> Figures {
        Figures {
            scene: scene.into(),
            over_embree: [1.0, 0.5, 0.8].map(|ratio| ratio * factor),
            speed_up: [1.9; 3],
            trace_over_best: [1.0; 3],
            cost_over_best: [1.2, 1.0, 1.0],
            nested_over_median_top: 0.9,
            median_top_cost: 1.1,
            peak_bytes: [[90.0, 99.0]; 3],
            different_trees: 0,
            problems: Vec::new(),
        }
    }

    #[test]
    fn rows_are_means_over_scenes_with_goals() {
        let table = of(&[figures("a", 0.5), figures("b", 2.0)]);
        let best = table.row("build time, best / Embree high");
        assert!(
            (best.of_all() - 0.8).abs() < 1e-12,
            "of 0.4 and 1.6: {best:?}"
        );
        let cost = table.row("SAH cost by the model of best, fast / best");
        assert_eq!(cost.is_met(), Some(false), "1.2 is above 1.1: {cost:?}");
        let text = table.to_string();
        for part in ["≤ 0.8", "≥ 1.85", "yes", "NO", "90.0", "1.100"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        let lines = table.to_lines().expect("plain data");
        assert_eq!(lines.lines().count(), table.rows.len(), "one each");
        assert!(
            lines.contains("\"met\":false") && lines.contains("\"scenes\":{\"a\":"),
            "{lines}"
        );
    }

    #[test]
    fn one_tree_that_differs_is_too_many() {
        let mut scene = figures("a", 1.0);
        scene.different_trees = 1;
        let row = different_trees(&[figures("b", 1.0), scene]);
        assert_eq!(row.is_met(), Some(false), "{row:?}");
    }
}
