//! The rows of the table, with their goals.

use std::fmt;

use serde_json::json;

use super::figures::{Figures, PRESETS, RIVALS};
use crate::cli::name_of;
use crate::terminal;

/// What a row should be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    AtMost(f64),
    AtLeast(f64),
    /// To compare with only.
    None,
}

#[derive(Debug)]
struct Row {
    name: String,
    goal: Goal,
    /// By scene.
    values: Vec<f64>,
    /// Of all scenes.
    value: f64,
}

/// All rows.
#[derive(Debug)]
pub(super) struct Table {
    scenes: Vec<String>,
    rows: Vec<Row>,
}

const FAST: usize = 0;
const BALANCED: usize = 1;
const BEST: usize = 2;

impl Table {
    pub(super) fn of(measured: &[Figures]) -> Self {
        let mut table = Self {
            scenes: measured.iter().map(|scene| scene.scene.clone()).collect(),
            rows: Vec::new(),
        };
        let mut add = |name: String, goal, value: &dyn Fn(&Figures) -> f64| {
            let values: Vec<f64> = measured.iter().map(value).collect();
            table.rows.push(Row {
                name,
                goal,
                value: geometric_mean(&values),
                values,
            });
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
        table.rows.push(different_trees(measured));
        table
    }

    /// One JSON object for each row.
    pub(super) fn to_lines(&self) -> anyhow::Result<String> {
        let mut lines = String::new();
        for row in &self.rows {
            let by_scene = self.scenes.iter().cloned().zip(row.values.iter().copied());
            let (sense, goal) = match row.goal {
                Goal::AtMost(goal) => (Some("at most"), Some(goal)),
                Goal::AtLeast(goal) => (Some("at least"), Some(goal)),
                Goal::None => (None, None),
            };
            let line = json!({
                "row": row.name,
                "value": row.value,
                "goal": goal,
                "sense": sense,
                "met": row.goal.is_met_by(row.value),
                "scenes": by_scene.collect::<std::collections::BTreeMap<String, f64>>(),
            });
            lines += &serde_json::to_string(&line)?;
            lines.push('\n');
        }
        Ok(lines)
    }
}

/// How many presets on how many scenes give another tree on another number of threads.
fn different_trees(measured: &[Figures]) -> Row {
    let values: Vec<f64> = measured.iter().map(|f| f.different_trees as f64).collect();
    Row {
        name: "trees that differ on two or three threads".into(),
        goal: Goal::AtMost(0.0),
        value: values.iter().sum(),
        values,
    }
}

pub(super) fn geometric_mean(values: &[f64]) -> f64 {
    let logarithms: f64 = values.iter().map(|value| value.ln()).sum();
    (logarithms / values.len() as f64).exp()
}

impl Goal {
    fn is_met_by(self, value: f64) -> bool {
        match self {
            Self::AtMost(goal) => value <= goal,
            Self::AtLeast(goal) => value >= goal,
            Self::None => true,
        }
    }
}

impl fmt::Display for Goal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(goal) => write!(f, "≤ {goal}"),
            Self::AtLeast(goal) => write!(f, "≥ {goal}"),
            Self::None => write!(f, "–"),
        }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let titles = ["", "all", "goal", "met"].map(String::from);
        let head = titles.into_iter().chain(self.scenes.iter().cloned());
        let mut table = terminal::empty_table(head.collect());
        for row in &self.rows {
            let met = match (row.goal, row.goal.is_met_by(row.value)) {
                (Goal::None, _) => "–",
                (_, true) => "yes",
                (_, false) => "NO",
            };
            let mut cells = vec![
                row.name.clone(),
                number(row.value),
                row.goal.to_string(),
                met.into(),
            ];
            cells.extend(row.values.iter().copied().map(number));
            table.add_row(cells);
        }
        terminal::align_right(&mut table, 1);
        table.fmt(f)
    }
}

/// Ratios with three decimals, what is larger with one.
fn number(value: f64) -> String {
    if value < 10.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.1}")
    }
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
        let table = Table::of(&[figures("a", 0.5), figures("b", 2.0)]);
        let row = |name: &str| {
            let found = table.rows.iter().find(|row| row.name == name);
            found.unwrap_or_else(|| panic!("{name} in {table}"))
        };
        let best = row("build time, best / Embree high");
        assert!((best.value - 0.8).abs() < 1e-12, "of 0.4 and 1.6: {best:?}");
        let cost = row("SAH cost by the model of best, fast / best");
        assert!(
            !cost.goal.is_met_by(cost.value),
            "1.2 is above 1.1: {cost:?}"
        );
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
        assert!(!row.goal.is_met_by(row.value), "{row:?}");
    }
}
