//! A run as a table in the terminal.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

use crate::record::{self, Record, Row};

/// A line below the head, and between scenes an empty row.
const STYLE: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// One row for each scene and variant; times with the speed relative to the baseline.
pub(crate) fn table(records: &[Record]) -> String {
    let kinds = record::distinct(records.iter().map(|record| record.rays.as_str()));
    let columns = ["scene", "variant", "build ms", "SAH cost", "refs/tri"];
    let kind_titles = kinds.iter().map(|kind| format!("{kind} ns"));
    let head = columns.into_iter().map(String::from).chain(kind_titles);
    let mut table = empty_table(head.collect());
    let mut scene = None;
    for row in record::rows(records) {
        if scene.is_some_and(|scene| scene != row.scene) {
            table.add_row([""]);
        }
        scene = Some(row.scene);
        table.add_row(cells(&row, &kinds));
    }
    align_right(&mut table, 2);
    table.to_string()
}

/// Says what was wrong; true if nothing was.
pub(crate) fn tell_problems<'a>(problems: impl IntoIterator<Item = &'a String>) -> bool {
    let mut are_none = true;
    for problem in problems {
        eprintln!("FAILED: {problem}");
        are_none = false;
    }
    are_none
}

/// A table with a head and no rows yet.
pub(crate) fn empty_table(head: Vec<String>) -> Table {
    let mut table = Table::new();
    table
        .load_style(STYLE)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(head);
    table
}

/// Aligns numbers, which stand in all columns but the first few.
pub(crate) fn align_right(table: &mut Table, names: usize) {
    for column in table.column_iter_mut().skip(names) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

fn cells(row: &Row<'_>, kinds: &[&str]) -> Vec<String> {
    let build = row.build();
    let known = |text: String| {
        if build.is_of_rival() {
            "–".into()
        } else {
            text
        }
    };
    let mut cells = vec![
        row.scene.to_owned(),
        row.label(),
        with_speed(record::median(&build.timed.build_ms), build.build_speed()),
        known(format!("{:.1}", build.exact.sah_cost_15_20)),
        known(format!("{:.2}", build.refs_per_triangle())),
    ];
    for kind in kinds {
        cells.push(row.cells.get(kind).map_or_else(String::new, |record| {
            let time = record::median(&record.timed.trace_ns_per_ray);
            with_speed(time, record.trace_speed()) + &disagreement(record)
        }));
    }
    cells
}

/// Of a rival that does not agree everywhere, how far.
fn disagreement(record: &Record) -> String {
    match record.exact.disagreement_ppm {
        Some(ppm) if ppm > 0.0 => format!(" {ppm:.0} ppm"),
        _ => String::new(),
    }
}

fn with_speed(time: f64, speed: f64) -> String {
    format!("{} ×{speed:.2}", three_digits(time))
}

/// A time with three digits that count; times need no more, and columns stay narrow.
pub(crate) fn three_digits(value: f64) -> String {
    match value {
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_shows_times_with_speeds() {
        let text = table(&[record::example()]);
        for part in [
            "tetra-3",
            "kd/exact/binary",
            "2.50 ×2.00",
            "71.2",
            "1.25",
            "100 ×0.50",
            "primary ns",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn rivals_show_how_they_disagree_and_how_they_were_built() {
        let mut rival = record::example();
        rival.structure = "obvhs".into();
        rival.rustflags = "-C target-cpu=native".into();
        rival.exact.disagreement_ppm = Some(12.4);
        let text = table(&[rival]);
        for part in ["obvhs/exact/binary (native)", "100 ×0.50 12 ppm", " – "] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(!text.contains("71.2"), "its cost is not known:\n{text}");
    }

    #[test]
    fn numbers_keep_three_digits() {
        let shown = [0.5, 9.994, 9.996, 99.94, 99.96, 12_345.6].map(three_digits);
        assert_eq!(
            shown,
            ["0.50", "9.99", "10.0", "99.9", "100", "12346"],
            "rounded once"
        );
    }
}
