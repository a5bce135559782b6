//! A measured frame of *kd-tree merging*, and the paper's table of ten.
//!
//! `frames.toml` declares the columns of tables of frames and the fields of their records.

use std::collections::BTreeMap;

use anyhow::{Context as _, ensure};
use serde_json::{Map, Value};

use crate::record::{self, Record};
use crate::{text, view};

/// The paper's Table 4.1: frame, and milliseconds of the copy of the static tree, the dynamic tree, the merge, the rays; of the
/// rebuild, its rays.
const SEED: [(usize, [f64; 6]); 10] = [
    (2, [32.0, 80.0, 178.0, 7394.0, 1198.0, 7165.0]),
    (4, [32.0, 78.0, 185.0, 6529.0, 1174.0, 6357.0]),
    (6, [32.0, 110.0, 201.0, 8624.0, 1234.0, 8716.0]),
    (8, [33.0, 110.0, 219.0, 7400.0, 1214.0, 7285.0]),
    (10, [36.0, 104.0, 200.0, 10747.0, 1213.0, 10503.0]),
    (12, [37.0, 114.0, 333.0, 10591.0, 1216.0, 10467.0]),
    (14, [42.0, 109.0, 436.0, 7220.0, 1219.0, 6767.0]),
    (16, [48.0, 111.0, 473.0, 11918.0, 1288.0, 12143.0]),
    (18, [47.0, 108.0, 378.0, 13958.0, 1286.0, 13184.0]),
    (20, [52.0, 112.0, 420.0, 8687.0, 1287.0, 8743.0]),
];

/// The cells of a frame.
#[derive(Debug)]
pub(super) struct Frame {
    /// The name of the animation.
    pub(super) scene: String,
    pub(super) label: String,
    pub(super) number: usize,
    pub(super) cells: Vec<Record>,
}

impl Frame {
    /// The value of an expression of cells.
    pub(super) fn value(&self, expression: &str) -> anyhow::Result<f64> {
        view::value(&self.cells, expression).with_context(|| self.label.clone())
    }

    /// Adds the name of the library whose rays it measures, if any, to a line of its record.
    pub(super) fn add_library(&self, line: &mut Map<String, Value>) {
        if let Some(library) = record::library(&self.cells) {
            line.insert("library".into(), library.into());
        }
    }

    /// The fields of a list of `frames.toml` that have cells, after replacements of words.
    pub(super) fn fields(
        &self,
        list: &str,
        replace: &[(&str, &str)],
    ) -> anyhow::Result<Map<String, Value>> {
        let mut fields = Map::new();
        for parts in declared(list)? {
            let mut expression = parts[1].clone();
            for (from, to) in replace {
                expression = expression.replace(from, to);
            }
            if let Ok(value) = self.value(&expression) {
                fields.insert(parts[0].clone(), value.into());
            }
        }
        Ok(fields)
    }

    /// The row of the paper's table, if the paper has the scene.
    pub(super) fn seed(&self) -> Option<(usize, [f64; 6])> {
        let found = SEED.iter().find(|(row, _)| row.to_string() == self.label);
        found.filter(|_| self.scene == "bart_kitchen").copied()
    }
}

/// The items of a list of `frames.toml`, in their parts.
fn declared(list: &str) -> anyhow::Result<Vec<Vec<String>>> {
    let lists: BTreeMap<String, Vec<String>> = toml::from_str(include_str!("../../frames.toml"))?;
    let items = lists
        .get(list)
        .with_context(|| format!("frames.toml: no list {list}"))?;
    let items = items.iter().flat_map(|item| view::expanded(item));
    let parts = |item: String| item.split('|').map(|part| part.trim().to_owned()).collect();
    Ok(items.map(parts).collect())
}

/// A table of milliseconds: the columns of lists of `frames.toml`, and those of the paper if it has a frame.
pub(super) fn times<const N: usize>(
    frames: &[Frame],
    lists: &[&str],
    names: [&str; N],
    seed: fn(&Frame) -> Option<[f64; N]>,
) -> anyhow::Result<String> {
    let columns: Vec<Vec<Vec<String>>> = lists
        .iter()
        .map(|list| declared(list))
        .collect::<Result<_, _>>()?;
    let columns = columns.concat();
    ensure!(
        columns.iter().all(|parts| parts.len() == 3),
        "title | value | decimals"
    );
    let mut head = vec!["row".to_owned(), "frame".to_owned()];
    head.extend(columns.iter().map(|parts| parts[0].clone()));
    if frames.iter().any(|frame| frame.seed().is_some()) {
        head.extend(names.map(|name| format!("paper {name}")));
    }
    let mut table = text::empty_table(head);
    for frame in frames {
        let mut cells = vec![frame.label.clone(), frame.number.to_string()];
        for parts in &columns {
            let decimals = parts[2].parse()?;
            cells.push(format!("{:.*}", decimals, frame.value(&parts[1])?));
        }
        cells.extend(
            seed(frame)
                .into_iter()
                .flatten()
                .map(|ms| format!("{ms:.0}")),
        );
        table.add_row(cells);
    }
    text::align_right(&mut table, 1);
    Ok(format!("milliseconds\n{table}"))
}

/// The cells of all frames.
pub(super) fn cells(frames: &[Frame]) -> Vec<Record> {
    let cells = frames.iter().flat_map(|frame| &frame.cells);
    cells.cloned().collect()
}
