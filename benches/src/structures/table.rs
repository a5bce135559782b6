//! The rows of the table, with their goals.

use super::figures::{ALL, BOXES, Figures, GRID, HIERARCHIES};
use crate::goals::{Goal, Row, Table, geometric_mean};
use crate::structure::Variant;

/// All rows.
pub(super) fn of(measured: &[Figures]) -> Table {
    let mut rows = Vec::new();
    let mut add = |name: String, goal, value: &dyn Fn(&Figures) -> f64| {
        let values = measured.iter().map(|f| Some(value(f))).collect();
        rows.push(Row::new(name, goal, values, geometric_mean));
    };
    for (number, grid) in [GRID, BOXES].into_iter().enumerate() {
        let name = format!("build time, {} / Embree low", name(grid));
        add(name, Goal::AtMost(0.5), &|f| f.grids_over_low[number]);
    }
    let speed_up = format!("speed-up on two threads, {}", name(GRID));
    add(speed_up, Goal::AtLeast(1.8), &|f| f.grid_two_threads);
    for (number, hierarchy) in HIERARCHIES.into_iter().enumerate() {
        let name = format!("speed of rays, {} / obvhs", name(hierarchy));
        add(name, Goal::AtLeast(0.9), &|f| f.over_obvhs[number]);
    }
    for (number, structure) in ALL.into_iter().enumerate() {
        let name = name(structure);
        let build = format!("build time, {name} / balanced");
        add(build, Goal::None, &|f| f.builds[number]);
        let speed = format!("speed of rays, {name} / balanced");
        add(speed, Goal::None, &|f| f.speeds[number]);
    }
    Table {
        scenes: measured.iter().map(|scene| scene.scene.clone()).collect(),
        rows,
    }
}

/// Without the layout, where there is only one.
fn name(variant: Variant) -> String {
    let name = variant.to_string();
    name.strip_suffix("/own")
        .map_or(name.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_their_goals() {
        let figures = |scene: &str, factor: f64| Figures {
            scene: scene.into(),
            grids_over_low: [0.6 * factor, 0.4 * factor],
            grid_two_threads: 1.9,
            over_obvhs: [2.0, 2.0, 0.5],
            builds: [0.1; ALL.len()],
            speeds: [0.3; ALL.len()],
            problems: Vec::new(),
        };
        let table = of(&[figures("a", 0.5), figures("b", 2.0)]);
        let met = |name: &str| table.row(name).is_met();
        assert_eq!(
            met("build time, grid/exact / Embree low"),
            Some(false),
            "{table}"
        );
        assert_eq!(
            met("build time, grid/boxes / Embree low"),
            Some(true),
            "{table}"
        );
        assert_eq!(
            met("speed-up on two threads, grid/exact"),
            Some(true),
            "{table}"
        );
        assert_eq!(
            met("speed of rays, bvh/objects/wide / obvhs"),
            Some(false),
            "{table}"
        );
        let of_all = table.row("speed of rays, bsp/polygon / balanced").of_all();
        assert!((of_all - 0.3).abs() < 1e-12, "{table}");
    }
}
