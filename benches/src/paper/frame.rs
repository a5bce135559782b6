//! A measured frame of *kd-tree merging*, and the paper's table of ten.

use anyhow::Context as _;

use crate::record::Record;
use crate::view;

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

    pub(super) fn values<const N: usize>(
        &self,
        expressions: [&str; N],
    ) -> anyhow::Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, expression) in values.iter_mut().zip(expressions) {
            *value = self.value(expression)?;
        }
        Ok(values)
    }

    /// The row of the paper's table, if the paper has the scene.
    pub(super) fn seed(&self) -> Option<(usize, [f64; 6])> {
        let found = SEED.iter().find(|(row, _)| row.to_string() == self.label);
        found.filter(|_| self.scene == "bart_kitchen").copied()
    }
}

/// The cells of all frames.
pub(super) fn cells(frames: &[Frame]) -> Vec<Record> {
    let cells = frames.iter().flat_map(|frame| &frame.cells);
    cells.cloned().collect()
}
