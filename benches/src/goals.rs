//! Tables of figures with the goal of each beside it.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::json;

use crate::terminal;

/// What a row should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Goal {
    AtMost(f64),
    AtLeast(f64),
    /// To compare with only.
    None,
}

/// One figure of every scene and of all of them.
#[derive(Debug)]
pub(crate) struct Row {
    name: String,
    goal: Goal,
    /// By scene; none where the row does not ask about it.
    values: Vec<Option<f64>>,
    /// Of all scenes that have one; none if no scene has.
    value: Option<f64>,
}

/// Rows over the same scenes.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) scenes: Vec<String>,
    pub(crate) rows: Vec<Row>,
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

impl Row {
    /// `of_all` makes one value of those of the scenes that have one.
    pub(crate) fn new(
        name: impl Into<String>,
        goal: Goal,
        values: Vec<Option<f64>>,
        of_all: fn(&[f64]) -> f64,
    ) -> Self {
        let known: Vec<f64> = values.iter().copied().flatten().collect();
        Self {
            name: name.into(),
            goal,
            value: (!known.is_empty()).then(|| of_all(&known)),
            values,
        }
    }

    /// Unknown without a value.
    pub(crate) fn is_met(&self) -> Option<bool> {
        self.value.map(|value| self.goal.is_met_by(value))
    }

    fn cells(&self) -> Vec<String> {
        let met = match (self.goal, self.is_met()) {
            (Goal::None, _) | (_, None) => "–",
            (_, Some(true)) => "yes",
            (_, Some(false)) => "NO",
        };
        let mut cells = vec![
            self.name.clone(),
            number(self.value),
            self.goal.to_string(),
            met.into(),
        ];
        cells.extend(self.values.iter().copied().map(number));
        cells
    }
}

impl Table {
    /// One JSON object for each row.
    pub(crate) fn to_lines(&self) -> anyhow::Result<String> {
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
                "met": row.is_met(),
                "scenes": by_scene.collect::<BTreeMap<String, Option<f64>>>(),
            });
            lines += &serde_json::to_string(&line)?;
            lines.push('\n');
        }
        Ok(lines)
    }

    /// The row of a name, for tests here and in other modules.
    #[cfg(test)]
    pub(crate) fn row(&self, name: &str) -> &Row {
        let found = self.rows.iter().find(|row| row.name == name);
        found.unwrap_or_else(|| panic!("{name} in\n{self}"))
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let titles = ["", "all", "goal", "met"].map(String::from);
        let head = titles.into_iter().chain(self.scenes.iter().cloned());
        let mut table = terminal::empty_table(head.collect());
        for row in &self.rows {
            table.add_row(row.cells());
        }
        terminal::align_right(&mut table, 1);
        table.fmt(f)
    }
}

/// Ratios with three decimals, what is larger with one, a dash for what is not known.
fn number(value: Option<f64>) -> String {
    match value {
        Some(value) if value < 10.0 => format!("{value:.3}"),
        Some(value) => format!("{value:.1}"),
        None => "–".into(),
    }
}

pub(crate) fn geometric_mean(values: &[f64]) -> f64 {
    let logarithms: f64 = values.iter().map(|value| value.ln()).sum();
    (logarithms / values.len() as f64).exp()
}

pub(crate) fn arithmetic_mean(values: &[f64]) -> f64 {
    sum(values) / values.len() as f64
}

pub(crate) fn sum(values: &[f64]) -> f64 {
    values.iter().sum()
}

pub(crate) fn minimum(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

pub(crate) fn maximum(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
impl Row {
    /// The value of all scenes, where there must be one.
    pub(crate) fn of_all(&self) -> f64 {
        self.value.unwrap_or_else(|| panic!("a value in {self:?}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let row =
            |goal, values: [Option<f64>; 2], of_all| Row::new("speed", goal, values.into(), of_all);
        Table {
            scenes: vec!["a".into(), "b".into()],
            rows: vec![
                row(Goal::AtLeast(1.5), [Some(1.0), Some(4.0)], geometric_mean),
                row(Goal::AtLeast(1.5), [Some(1.0), Some(4.0)], minimum),
                row(Goal::AtMost(20.0), [Some(1.0), Some(40.0)], arithmetic_mean),
                row(Goal::None, [Some(1.0), Some(40.0)], sum),
                row(Goal::AtLeast(2.0), [None, Some(12.0)], geometric_mean),
                row(Goal::AtMost(0.0), [None, None], geometric_mean),
            ],
        }
    }

    #[test]
    fn one_value_of_all_scenes_meets_the_goal_or_not() {
        let table = table();
        let values: Vec<Option<f64>> = table.rows.iter().map(|row| row.value).collect();
        let expected = [2.0, 1.0, 20.5, 41.0, 12.0].map(Some);
        assert_eq!(values[1..5], expected[1..], "{table}");
        assert!((table.rows[0].of_all() - 2.0).abs() < 1e-12, "{table}");
        assert_eq!(values[5], None, "no scene has a value\n{table}");
        let met = table.rows.iter().map(Row::is_met);
        let expected = [
            Some(true),
            Some(false),
            Some(false),
            Some(true),
            Some(true),
            None,
        ];
        assert_eq!(met.collect::<Vec<_>>(), expected, "{table}");
    }

    #[test]
    fn what_is_not_known_is_a_dash_and_null() {
        let table = table();
        let text = table.to_string();
        let words = |row: usize| {
            let line = text
                .lines()
                .nth(row + 2)
                .expect("after the head and its line");
            line.split_whitespace().collect::<Vec<_>>()
        };
        assert_eq!(
            words(0),
            ["speed", "2.000", "≥", "1.5", "yes", "1.000", "4.000"],
            "{text}"
        );
        assert_eq!(words(1)[4], "NO", "{text}");
        assert_eq!(
            words(3),
            ["speed", "41.0", "–", "–", "1.000", "40.0"],
            "{text}"
        );
        assert_eq!(words(5), ["speed", "–", "≤", "0", "–", "–", "–"], "{text}");
        let lines = table.to_lines().expect("plain data");
        let lines: Vec<&str> = lines.lines().collect();
        for (line, parts) in [
            (lines[1], ["\"met\":false", "\"sense\":\"at least\""]),
            (lines[3], ["\"met\":true", "\"sense\":null"]),
            (
                lines[4],
                ["\"met\":true", "\"scenes\":{\"a\":null,\"b\":12.0}"],
            ),
            (lines[5], ["\"met\":null", "\"value\":null"]),
        ] {
            assert!(
                parts.iter().all(|part| line.contains(part)),
                "{parts:?} in {line}"
            );
        }
    }
}
