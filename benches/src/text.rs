//! Tables in the terminal.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

use crate::record::{self, Record};
use crate::summary::{self, Figure};

/// A line below the head; an empty row between scenes.
const STYLE: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The tables of a run of `bench`: a row for each scene and variant, times with their speed over the baseline.
pub(crate) fn summary(records: &[Record]) -> String {
    let mut text = record::library(records).map_or_else(String::new, |name| format!("{name}\n"));
    for section in summary::sections(records) {
        let head = ["scene", "variant"].into_iter().map(String::from);
        let mut table = empty_table(head.chain(section.head));
        for (number, group) in section.groups.iter().enumerate() {
            if number > 0 {
                table.add_row([""]);
            }
            for line in &group.lines {
                let names = [group.scene.clone(), line.label.clone()].into_iter();
                table.add_row(names.chain(line.cells.iter().map(cell)));
            }
        }
        align_right(&mut table, 2);
        let (title, note) = (section.title, section.note);
        text += &format!("{title}\n{table}\n{note}\n");
    }
    text.truncate(text.trim_end().len());
    text
}

fn cell(figure: &Figure) -> String {
    let speed = figure.speed.map(|speed| format!("×{speed:.2}"));
    let parts = [Some(figure.text.clone()), speed, figure.more.clone()];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    parts.join(" ")
}

/// Prints problems to the error output; true if there are none.
pub(crate) fn report_problems<'a>(problems: impl IntoIterator<Item = &'a String>) -> bool {
    let mut are_none = true;
    for problem in problems {
        eprintln!("FAILED: {problem}");
        are_none = false;
    }
    are_none
}

/// A table without rows.
pub(crate) fn empty_table<T: Into<String>>(head: impl IntoIterator<Item = T>) -> Table {
    let mut table = Table::new();
    let head: Vec<String> = head.into_iter().map(Into::into).collect();
    table
        .load_style(STYLE)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(head);
    table
}

/// Aligns numbers to the right, in all columns but the first `names`.
pub(crate) fn align_right(table: &mut Table, names: usize) {
    for column in table.column_iter_mut().skip(names) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::example;

    #[test]
    fn the_table_shows_times_with_speeds() {
        let mut preset = example();
        (preset.builder, preset.layout) = ("best".into(), "wide".into());
        let text = summary(&[preset]);
        for part in [
            "tetra-3",
            "kd/best/wide",
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
    fn rivals_show_their_disagreement_and_their_build() {
        let mut rival = example();
        rival.structure = "obvhs".into();
        rival.rustflags = "-C target-cpu=native".into();
        rival.exact.disagreement_ppm = Some(12.4);
        let text = summary(&[rival]);
        for part in ["obvhs/exact/binary (native)", "100 ×0.50 12 ppm", " – "] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(!text.contains("71.2"), "its cost is unknown:\n{text}");
    }
}
