//! The summary of a run of `bench`, for the terminal and for the report: one table of builders, one of what users get.

use crate::record::{Record, Row, distinct, rows};

/// A table: a row for each variant on each scene.
#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) title: &'static str,
    pub(crate) note: String,
    /// Titles of the columns after scene and variant.
    pub(crate) head: Vec<String>,
    pub(crate) groups: Vec<Group>,
}

/// The rows of a scene.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    pub(crate) lines: Vec<Line>,
}

#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) variant: String,
    /// The variant, with a mark if it was compiled for this processor.
    pub(crate) label: String,
    pub(crate) cells: Vec<Figure>,
}

/// A figure of a row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figure {
    pub(crate) text: String,
    /// The speed over the baseline's.
    pub(crate) speed: Option<f64>,
    /// Further figures of the cell.
    pub(crate) more: Option<String>,
}

/// The variant whose speed is 1 among builders, where it was measured.
pub(crate) const EXACT: &str = "kd/exact/binary";

/// The tables of a run that have rows.
pub(crate) fn sections(records: &[Record]) -> Vec<Section> {
    let kinds = distinct(records.iter().map(|record| record.rays.as_str()));
    let (builders, others): (Vec<Row<'_>>, Vec<Row<'_>>) =
        rows(records).into_iter().partition(is_of_builder);
    let baseline = records.first().map_or("", |record| &record.baseline);
    let titles = ["build ms", "SAH cost", "refs/tri", "MB", "peak MB"];
    let head = titles.into_iter().map(String::from);
    let head: Vec<String> = head
        .chain(kinds.iter().map(|kind| format!("{kind} ns")))
        .collect();
    let (has_exact, over) = if builders.iter().any(|row| row.variant == EXACT) {
        (true, EXACT)
    } else {
        (false, baseline)
    };
    let sections = [
        Section {
            title: "Builders: the trees that they build",
            note: format!(
                "Rays go through the tree's own 8-byte nodes (layout binary). SAH cost at K_T 15, K_I 20; below the time of \
                 a kind of ray: nodes and triangle tests per ray. × is the speed over {over}."
            ),
            head: head.clone(),
            groups: groups(&builders, &kinds, has_exact),
        },
        Section {
            title: "Presets and structures: what users get",
            note: format!(
                "Rays go through the layout that a user gets: wide nodes for kd-trees. The SAH cost is that of the tree behind \
                 them. × is the speed over {baseline}."
            ),
            head,
            groups: groups(&others, &kinds, false),
        },
    ];
    let with_rows = sections.into_iter();
    with_rows
        .filter(|section| !section.groups.is_empty())
        .collect()
}

/// Whether a row shows a tree as its builder built it.
pub(crate) fn is_of_builder(row: &Row<'_>) -> bool {
    let build = row.build();
    build.structure == "kd" && build.layout == "binary"
}

fn groups(rows: &[Row<'_>], kinds: &[&str], over_exact: bool) -> Vec<Group> {
    let scenes = distinct(rows.iter().map(|row| row.scene));
    let group = |scene: &str| {
        let of_scene: Vec<&Row<'_>> = rows.iter().filter(|row| row.scene == scene).collect();
        let exact = of_scene
            .iter()
            .find(|row| over_exact && row.variant == EXACT);
        let lines = of_scene.iter().map(|row| Line {
            variant: row.variant.clone(),
            label: row.label(),
            cells: cells(row, kinds, exact.copied()),
        });
        Group {
            scene: scene.to_owned(),
            triangles: of_scene[0].build().triangles,
            lines: lines.collect(),
        }
    };
    scenes.into_iter().map(group).collect()
}

/// The figures of a row, with speeds over those of `exact` if it was measured.
fn cells(row: &Row<'_>, kinds: &[&str], exact: Option<&Row<'_>>) -> Vec<Figure> {
    let build = row.build();
    let plain = |text: String| Figure {
        text,
        ..Figure::default()
    };
    let known = |text: String| {
        let is_unknown = build.is_of_rival();
        plain(if is_unknown { "–".into() } else { text })
    };
    let build_speed = build.build_speed() / exact.map_or(1.0, |row| row.build().build_speed());
    let mut figures = vec![
        Figure {
            text: three_digits(build.build_ms()),
            speed: Some(build_speed),
            more: None,
        },
        known(format!("{:.1}", build.exact.sah_cost_15_20)),
        known(format!("{:.2}", build.refs_per_triangle())),
        plain(megabytes(build.exact.bytes_total)),
        plain(megabytes(build.exact.peak_build_bytes)),
    ];
    for kind in kinds {
        let Some(cell) = row.cells.get(kind) else {
            figures.push(plain("–".into()));
            continue;
        };
        let of_exact = exact.and_then(|row| row.cells.get(kind));
        let speed = cell.trace_speed() / of_exact.map_or(1.0, |exact| exact.trace_speed());
        let steps = cell.steps_per_ray().filter(|_| is_of_builder(row));
        let steps = steps.map(|[nodes, tests]| format!("{nodes:.1} n {tests:.1} t"));
        let ppm = cell.exact.disagreement_ppm.filter(|ppm| *ppm > 0.0);
        figures.push(Figure {
            text: three_digits(cell.ns_per_ray()),
            speed: Some(speed),
            more: ppm.map(|ppm| format!("{ppm:.0} ppm")).or(steps),
        });
    }
    figures
}

/// A time with three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    match value {
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

fn megabytes(bytes: usize) -> String {
    format!("{:.2}", bytes as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::example;

    #[test]
    fn numbers_keep_three_digits() {
        let shown = [0.5, 9.994, 9.996, 99.94, 99.96, 12_345.6].map(three_digits);
        assert_eq!(
            shown,
            ["0.50", "9.99", "10.0", "99.9", "100", "12346"],
            "rounded once"
        );
    }

    #[test]
    fn builders_are_compared_with_exact_through_their_trees() {
        let mut median = example();
        median.builder = "median".into();
        median.timed.trace_ns_per_ray = vec![200.0, 420.0, 180.0];
        let mut preset = example();
        (preset.builder, preset.layout) = ("best".into(), "wide".into());
        let records = [example(), median, preset];
        let [builders, users] = &sections(&records)[..] else {
            panic!("two tables");
        };
        assert!(
            builders.note.ends_with("over kd/exact/binary."),
            "{builders:?}"
        );
        let lines = &builders.groups[0].lines;
        let speeds = [0, 1].map(|line: usize| lines[line].cells[5].speed);
        assert_eq!(speeds, [Some(1.0), Some(0.5)], "{lines:?}");
        let steps = lines[0].cells[5].more.as_deref();
        assert_eq!(steps, Some("0.0 n 0.0 t"), "of 9 and 7 steps of 4096 rays");
        let users = &users.groups[0].lines;
        assert_eq!(users[0].label, "kd/best/wide", "{users:?}");
        assert_eq!(
            users[0].cells[5].speed,
            Some(0.5),
            "over the baseline of the record"
        );
    }
}
