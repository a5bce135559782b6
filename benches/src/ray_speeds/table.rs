//! The rows of the table, with their goals.

use super::figures::{ByKind, COHERENT, Figures, INCOHERENT, KINDS};
use crate::cli::name_of;
use crate::goals::{Goal, Row, Table, arithmetic_mean, geometric_mean, minimum};
use crate::structure::FIRST;

/// All rows.
pub(super) fn of(measured: &[Figures]) -> Table {
    let mut table = Table {
        scenes: measured.iter().map(|scene| scene.scene.clone()).collect(),
        rows: Vec::new(),
    };
    let rows = &mut table.rows;
    let medium = "single rays / Embree medium";
    rows.extend(by_kind(measured, medium, |f| &f.over_medium));
    rows.extend(mean_and_worst(measured, medium, [1.3, 0.9], |f| {
        &f.over_medium
    }));
    let robust = "single rays / Embree robust";
    rows.extend(mean_and_worst(measured, robust, [1.5, 1.0], |f| {
        &f.over_robust
    }));
    rows.extend(batches(measured));
    let single = "batches / single rays";
    rows.extend(by_kind(measured, single, |f| &f.batches_over_single));
    let obvhs = "single rays / obvhs";
    rows.extend(mean_and_worst(measured, obvhs, [2.0, 2.0], |f| {
        &f.over_obvhs
    }));
    rows.extend(first_hits(measured));
    let threads = "two threads / one thread";
    rows.extend(by_kind(measured, threads, |f| &f.two_threads));
    rows.push(mean(measured, threads, 1.9, |f| &f.two_threads));
    let bytes = measured.iter().map(|f| Some(f.bytes_per_triangle));
    let (name, most) = ("bytes per triangle", Goal::AtMost(110.0));
    rows.push(Row::new(name, most, bytes.collect(), arithmetic_mean));
    table
}

/// A row without a goal for each kind of rays.
fn by_kind<'a>(
    measured: &'a [Figures],
    name: &'a str,
    speeds: fn(&Figures) -> &ByKind,
) -> impl Iterator<Item = Row> + 'a {
    KINDS.iter().enumerate().map(move |(place, kind)| {
        let values = measured.iter().map(|f| Some(speeds(f)[place]));
        let name = format!("{name}, {}", name_of(kind));
        Row::new(name, Goal::None, values.collect(), geometric_mean)
    })
}

/// The row of the mean over the kinds.
fn mean(measured: &[Figures], name: &str, least: f64, speeds: fn(&Figures) -> &ByKind) -> Row {
    let values = measured.iter().map(|f| Some(geometric_mean(speeds(f))));
    let name = format!("{name}, all kinds");
    Row::new(name, Goal::AtLeast(least), values.collect(), geometric_mean)
}

/// That row, and one of the kind that is slowest on each scene, of all scenes the slowest.
fn mean_and_worst(
    measured: &[Figures],
    name: &str,
    [mean_goal, worst_goal]: [f64; 2],
    speeds: fn(&Figures) -> &ByKind,
) -> [Row; 2] {
    let values = measured.iter().map(|f| Some(minimum(speeds(f))));
    let worst = Row::new(
        format!("{name}, worst kind"),
        Goal::AtLeast(worst_goal),
        values.collect(),
        minimum,
    );
    [mean(measured, name, mean_goal, speeds), worst]
}

fn batches(measured: &[Figures]) -> Vec<Row> {
    let mut rows = Vec::new();
    for (place, (kind, least)) in COHERENT.iter().zip([2.5, 1.7]).enumerate() {
        let values = measured.iter().map(|f| Some(f.batches_over_packets[place]));
        let name = format!("{} batch / Embree packets of 8", name_of(kind));
        rows.push(Row::new(
            name,
            Goal::AtLeast(least),
            values.collect(),
            geometric_mean,
        ));
    }
    for (place, kind) in COHERENT.iter().enumerate() {
        let values = measured.iter().map(|f| Some(f.packets_over_packets[place]));
        let name = format!("{} packets / Embree packets of 8", name_of(kind));
        rows.push(Row::new(name, Goal::None, values.collect(), geometric_mean));
    }
    for (place, kind) in INCOHERENT.iter().enumerate() {
        let values = measured
            .iter()
            .map(|f| f.batches_over_medium.map(|speeds| speeds[place]));
        let name = format!("{} batch / Embree medium", name_of(kind));
        rows.push(Row::new(
            name,
            Goal::AtLeast(1.6),
            values.collect(),
            geometric_mean,
        ));
    }
    rows
}

fn first_hits(measured: &[Figures]) -> [Row; 2] {
    let row = |other: &str, goal, speed: fn(&Figures) -> f64| {
        let values = measured.iter().map(|f| Some(speed(f)));
        let name = format!("first {FIRST} hits / {other}, random");
        Row::new(name, goal, values.collect(), geometric_mean)
    };
    [
        row("Embree with a filter", Goal::AtLeast(2.0), |f| {
            f.first_over_filter
        }),
        row("restarting", Goal::None, |f| f.first_over_restarting),
    ]
}

/// A line that says how far the hits of Embree's filter are ours.
pub(super) fn disagreements(measured: &[Figures]) -> String {
    let by_scene = measured
        .iter()
        .map(|f| format!("{} {:.0}", f.scene, f.first_disagreement_ppm));
    let by_scene: Vec<String> = by_scene.collect();
    format!(
        "random rays in a million whose first {FIRST} hits Embree sees differently: {}",
        by_scene.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(scene: &str, factor: f64, large: bool) -> Figures {
        Figures {
            scene: scene.into(),
            over_medium: [1.0, 2.0, 2.0, 2.0, 4.0].map(|speed| speed * factor),
            over_robust: [1.6; 5],
            over_obvhs: [2.0, 2.0, 1.9, 2.0, 3.0],
            batches_over_packets: [2.6, 1.6],
            packets_over_packets: [1.2, 1.1],
            batches_over_medium: large.then_some([1.7, 1.7, 1.5]),
            batches_over_single: [4.0, 2.0, 1.0, 1.0, 1.0],
            first_over_filter: 3.0,
            first_over_restarting: 1.5,
            first_disagreement_ppm: 12.4,
            two_threads: [1.9, 1.8, 2.0, 1.9, 2.0],
            bytes_per_triangle: 100.0 * factor,
            problems: Vec::new(),
        }
    }

    #[test]
    fn kinds_have_rows_with_their_mean_and_worst() {
        let table = of(&[figures("a", 0.5, false), figures("b", 2.0, true)]);
        for (name, value, is_met) in [
            ("single rays / Embree medium, random", 4.0, true),
            ("single rays / Embree medium, all kinds", 2.0, true),
            ("single rays / Embree medium, worst kind", 0.5, false),
            ("single rays / Embree robust, worst kind", 1.6, true),
            ("single rays / obvhs, worst kind", 1.9, false),
            ("primary batch / Embree packets of 8", 2.6, true),
            ("shadow batch / Embree packets of 8", 1.6, false),
            ("shadow packets / Embree packets of 8", 1.1, true),
            ("ao batch / Embree medium", 1.7, true),
            ("random batch / Embree medium", 1.5, false),
            ("batches / single rays, shadow", 2.0, true),
            ("first 4 hits / Embree with a filter, random", 3.0, true),
            ("first 4 hits / restarting, random", 1.5, true),
            ("two threads / one thread, shadow", 1.8, true),
            ("bytes per triangle", 125.0, false),
        ] {
            let row = table.row(name);
            assert!((row.of_all() - value).abs() < 1e-9, "{value}: {row:?}");
            assert_eq!(row.is_met(), Some(is_met), "{row:?}");
        }
        assert_eq!(
            table.rows.len(),
            7 + 2 + 2 + 5 + 5 + 2 + 2 + 6 + 1,
            "{table}"
        );
    }

    #[test]
    fn without_a_large_scene_batches_of_rays_that_part_have_no_value() {
        let table = of(&[figures("a", 1.0, false)]);
        let row = table.row("diffuse batch / Embree medium");
        assert_eq!(row.is_met(), None, "{row:?}");
    }

    #[test]
    fn disagreements_are_told_by_scene() {
        let line = disagreements(&[figures("a", 1.0, false), figures("b", 1.0, false)]);
        assert!(line.ends_with("differently: a 12, b 12"), "{line}");
    }
}
