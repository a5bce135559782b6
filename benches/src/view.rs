//! Views of cells: tables of figures by scene, with the goal of each row.
//!
//! `views.toml` declares the rows: which value of which cells, how the values of a scene and then those of all scenes become one,
//! and the goal.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum as _;
use serde_json::json;

use crate::names::Variant;
use crate::rays::RayKind;
use crate::record::{self, Record, median};
use crate::run_folder::json_lines;
use crate::structure::Manner;
use crate::text;

/// The range that a row should reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Goal {
    AtMost(f64),
    AtLeast(f64),
    /// For comparison only.
    None,
}

/// A value of a cell.
type Value = fn(&Record) -> f64;

/// Values by name.
const VALUES: [(&str, Value); 16] = [
    ("speed", Record::trace_speed),
    ("time", Record::trace_ratio),
    ("build speed", Record::build_speed),
    ("build time", Record::build_ratio),
    ("ms", Record::build_ms),
    ("over ms", |cell| median(&cell.timed.baseline_build_ms)),
    ("picture ms", |cell| {
        picture_ms(cell, &cell.timed.trace_ns_per_ray)
    }),
    ("over picture ms", |cell| {
        picture_ms(cell, &cell.timed.baseline_ns_per_ray)
    }),
    ("Mray/s", |cell| 1e3 / cell.ns_per_ray()),
    ("cost", |cell| cell.exact.sah_cost_own),
    ("peak", |cell| cell.exact.peak_build_bytes as f64),
    ("peak per triangle", |cell| {
        per_triangle(cell, cell.exact.peak_build_bytes)
    }),
    ("bytes per triangle", |cell| {
        per_triangle(cell, cell.exact.bytes_total)
    }),
    ("differ", |cell| cell.exact.mismatches as f64),
    ("percent", |cell| 1e2 * share(cell)),
    ("share", share),
];

/// The share of answers that differ.
fn share(cell: &Record) -> f64 {
    1e-6 * cell.exact.disagreement_ppm.unwrap_or(0.0)
}

/// Milliseconds of all rays.
fn picture_ms(cell: &Record, nanoseconds: &[f64]) -> f64 {
    1e-6 * median(nanoseconds) * cell.exact.rays as f64
}

fn per_triangle(cell: &Record, count: usize) -> f64 {
    count as f64 / cell.triangles.max(1) as f64
}

/// One value of several.
pub(crate) type Mean = fn(&[f64]) -> f64;

/// Means by name.
pub(crate) fn mean(name: &str) -> anyhow::Result<Mean> {
    Ok(match name {
        "geo" => geometric_mean,
        "mean" => arithmetic_mean,
        "median" => median,
        "sum" => |values| values.iter().sum(),
        "min" => minimum,
        "max" => maximum,
        _ => bail!("no mean is called `{name}`"),
    })
}

/// A value of the cells of a scene.
#[derive(Debug)]
struct Term {
    value: Value,
    subject: String,
    rays: String,
    over: String,
    threads: usize,
}

impl Term {
    fn parse(text: &str) -> anyhow::Result<Self> {
        let (name, cell) = text.split_once(':').context("VALUE: CELL")?;
        let value = VALUES.iter().find(|(known, _)| *known == name.trim());
        let (_, value) = value.with_context(|| format!("no value is called `{name}`"))?;
        let mut parts = cell.split(';').map(str::trim);
        let mut next = || parts.next().unwrap_or_default().to_owned();
        let (subject, rays, over, threads) = (next(), next(), next(), next());
        let threads = if threads.is_empty() {
            1
        } else {
            threads.parse()?
        };
        Ok(Self {
            value: *value,
            subject,
            rays,
            over,
            threads,
        })
    }

    fn takes(&self, cell: &Record) -> bool {
        let is_of_rays = match self.rays.as_str() {
            "*" => RayKind::from_str(&cell.rays, false).is_ok(),
            rays => cell.rays == rays,
        };
        let variant = cell.variant();
        let is_of_subject = match self.subject.split_once('*') {
            Some((start, end)) => variant.starts_with(start) && variant.ends_with(end),
            None => variant == self.subject,
        };
        let is_like = cell.baseline == self.over && cell.threads == self.threads;
        is_like && is_of_rays && is_of_subject
    }
}

/// What a term is about, if that is a timed comparison of two variants.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) struct Comparison {
    pub(crate) own: (Variant, usize),
    pub(crate) over: (Variant, usize),
    /// Kinds of rays and the way to trace them; none for builds.
    pub(crate) rays: Option<(Vec<RayKind>, Manner)>,
}

impl Term {
    /// `None` if the cell is not such a comparison.
    fn comparison(&self) -> Option<Comparison> {
        let (over, over_threads) = match self.over.split_once(" on ") {
            Some((over, threads)) => (over, threads.parse().ok()?),
            None => (self.over.as_str(), self.threads),
        };
        let rays = match self.rays.as_str() {
            "" => None,
            "*" => Some((RayKind::value_variants().to_vec(), Manner::Single)),
            rays => {
                let (kind, by) = rays.split_once('-').unwrap_or((rays, "single"));
                let kind = RayKind::from_str(kind, false).ok()?;
                Some((vec![kind], Manner::from_str(by, false).ok()?))
            }
        };
        Some(Comparison {
            own: (Variant::parse(&self.subject)?, self.threads),
            over: (Variant::parse(over)?, over_threads),
            rays,
        })
    }
}

/// A quotient of sums of terms; the denominator may be missing.
#[derive(Debug)]
pub(crate) struct Expression(Vec<Vec<Term>>);

impl Expression {
    pub(crate) fn parse(text: &str) -> anyhow::Result<Self> {
        let sum = |text: &str| text.split(" + ").map(Term::parse).collect();
        let parts: anyhow::Result<Vec<Vec<Term>>> = text.split(" / ").map(sum).collect();
        parts.map(Self).with_context(|| format!("`{text}`"))
    }

    /// The value of cells of one scene; `None` if one was not measured. `of` joins the cells of a term.
    pub(crate) fn of(&self, cells: &[&Record], of: Mean) -> Option<f64> {
        let term = |term: &Term| {
            let taken = cells.iter().filter(|cell| term.takes(cell));
            let values: Vec<f64> = taken.map(|cell| (term.value)(cell)).collect();
            (!values.is_empty()).then(|| of(&values))
        };
        let mut sums = self
            .0
            .iter()
            .map(|terms| terms.iter().map(term).sum::<Option<f64>>());
        let first = sums.next()??;
        sums.try_fold(first, |value, sum| Some(value / sum?))
    }
}

/// The value of an expression over cells of one scene.
pub(crate) fn value(cells: &[Record], expression: &str) -> anyhow::Result<f64> {
    let cells: Vec<&Record> = cells.iter().collect();
    let found = Expression::parse(expression)?.of(&cells, median);
    found.with_context(|| format!("no cell for `{expression}`"))
}

#[derive(Debug)]
struct Line {
    name: String,
    value: Expression,
    goal: Goal,
    in_scene: Mean,
    of_scenes: Mean,
}

impl Line {
    fn parse(text: &str) -> anyhow::Result<Self> {
        let mut parts = text.split('|').map(str::trim);
        let mut next = || parts.next().unwrap_or_default();
        let (name, value, goal, means) = (next(), next(), next(), next());
        let goal = match goal.split_once(' ') {
            Some(("<=", most)) => Goal::AtMost(most.parse()?),
            Some((">=", least)) => Goal::AtLeast(least.parse()?),
            _ => Goal::None,
        };
        let (in_scene, of_scenes) = match means.split_once(' ') {
            Some((in_scene, of_scenes)) => (mean(in_scene)?, mean(of_scenes)?),
            None if means == "worst" => (mean("geo")?, goal.worst()),
            None if means.is_empty() => (mean("geo")?, mean("geo")?),
            None => (mean(means)?, mean(means)?),
        };
        Ok(Self {
            name: name.to_owned(),
            value: Expression::parse(value)?,
            goal,
            in_scene,
            of_scenes,
        })
    }
}

/// The declaration of a table.
#[derive(Debug)]
pub(crate) struct View(Vec<Line>);

impl View {
    /// The rows of these names in `views.toml`, one list after the other, after a replacement of words.
    pub(crate) fn named(names: &[&str], replace: (&str, &str)) -> anyhow::Result<Self> {
        let views: BTreeMap<String, Vec<String>> = toml::from_str(include_str!("../views.toml"))?;
        let mut lines = Vec::new();
        for row in names.iter().filter_map(|name| views.get(*name)).flatten() {
            for row in expanded(&row.replace(replace.0, replace.1)) {
                let line = Line::parse(&row);
                lines.push(line.with_context(|| format!("views.toml: {row}"))?);
            }
        }
        ensure!(!lines.is_empty(), "views.toml: no view is called {names:?}");
        Ok(Self(lines))
    }

    /// The timed comparisons that the rows need, each once.
    pub(crate) fn comparisons(&self) -> Vec<Comparison> {
        let terms = self.0.iter().flat_map(|line| line.value.0.iter().flatten());
        let mut comparisons: Vec<Comparison> = Vec::new();
        for mut comparison in terms.filter_map(Term::comparison) {
            // Kinds that another row already has.
            for known in &comparisons {
                let is_like = (known.own, known.over) == (comparison.own, comparison.over);
                if let (true, Some((kinds, by)), Some((more, way))) =
                    (is_like, &known.rays, &mut comparison.rays)
                    && *by == *way
                {
                    more.retain(|kind| !kinds.contains(kind));
                }
            }
            let is_empty = comparison
                .rays
                .as_ref()
                .is_some_and(|(kinds, _)| kinds.is_empty());
            if !is_empty && !comparisons.contains(&comparison) {
                comparisons.push(comparison);
            }
        }
        comparisons
    }

    /// The table of cells, a column for each scene in order of appearance.
    pub(crate) fn of(&self, cells: &[Record]) -> Table {
        let scenes = record::distinct(cells.iter().map(|cell| cell.scene.as_str()));
        let of_scene = |scene: &&str| -> Vec<&Record> {
            cells.iter().filter(|cell| cell.scene == *scene).collect()
        };
        let by_scene: Vec<Vec<&Record>> = scenes.iter().map(of_scene).collect();
        let row = |line: &Line| {
            let values = by_scene
                .iter()
                .map(|cells| line.value.of(cells, line.in_scene));
            Row::new(&line.name, line.goal, values.collect(), line.of_scenes)
        };
        Table {
            library: record::library(cells).unwrap_or_default().to_owned(),
            scenes: scenes.into_iter().map(String::from).collect(),
            rows: self.0.iter().map(row).collect(),
        }
    }
}

/// A row for each word of `{a,b}`, which takes the places of `{}`; the row itself without such a list.
pub(crate) fn expanded(row: &str) -> Vec<String> {
    let list = row.split_once('{').and_then(|(start, rest)| {
        let (words, end) = rest.split_once('}')?;
        Some((start, words, end))
    });
    let Some((start, words, end)) = list else {
        return vec![row.to_owned()];
    };
    let with = |word: &str| format!("{start}{word}{}", end.replace("{}", word));
    words.split(',').map(with).collect()
}

/// One figure by scene and of all scenes.
#[derive(Debug)]
pub(crate) struct Row {
    name: String,
    goal: Goal,
    /// By scene; `None` where it was not measured.
    values: Vec<Option<f64>>,
    /// Of all scenes with a value; `None` without any.
    value: Option<f64>,
}

/// Rows over the same scenes.
#[derive(Debug)]
pub(crate) struct Table {
    /// The library that a part of the cells are of, with its version; empty without one.
    pub(crate) library: String,
    pub(crate) scenes: Vec<String>,
    pub(crate) rows: Vec<Row>,
}

impl Goal {
    /// The value furthest from the goal; the geometric mean without a goal.
    pub(crate) fn worst(self) -> Mean {
        match self {
            Self::AtMost(_) => maximum,
            Self::AtLeast(_) => minimum,
            Self::None => geometric_mean,
        }
    }

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
    /// `of_all` forms one value of those of all scenes.
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

    /// The scene whose value is furthest from the goal, and the value; `None` without a goal or a value.
    fn worst<'a>(&self, scenes: &'a [String]) -> Option<(&'a str, f64)> {
        let known = scenes.iter().zip(&self.values);
        let known = known.filter_map(|(scene, value)| Some((scene.as_str(), (*value)?)));
        let by_value = |a: &(&str, f64), b: &(&str, f64)| a.1.total_cmp(&b.1);
        match self.goal {
            Goal::AtMost(_) => known.max_by(by_value),
            Goal::AtLeast(_) => known.min_by(by_value),
            Goal::None => None,
        }
    }

    /// `None` without a value.
    pub(crate) fn is_met(&self) -> Option<bool> {
        self.value.map(|value| self.goal.is_met_by(value))
    }

    fn cells(&self, scenes: &[String]) -> Vec<String> {
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
            self.worst(scenes).map_or("–".into(), |(scene, value)| {
                format!("{} {scene}", number(Some(value)))
            }),
        ];
        cells.extend(self.values.iter().copied().map(number));
        cells
    }
}

impl Table {
    /// One JSON object for each row.
    pub(crate) fn to_lines(&self) -> anyhow::Result<String> {
        json_lines(self.rows.iter().map(|row| {
            let by_scene = self.scenes.iter().cloned().zip(row.values.iter().copied());
            let (sense, goal) = match row.goal {
                Goal::AtMost(goal) => (Some("at most"), Some(goal)),
                Goal::AtLeast(goal) => (Some("at least"), Some(goal)),
                Goal::None => (None, None),
            };
            let mut line = json!({
                "row": row.name,
                "value": row.value,
                "goal": goal,
                "sense": sense,
                "met": row.is_met(),
                "worst": row.worst(&self.scenes).map(|(scene, value)| json!({ "scene": scene, "value": value })),
                "scenes": by_scene.collect::<BTreeMap<String, Option<f64>>>(),
            });
            if !self.library.is_empty() {
                line["library"] = self.library.as_str().into();
            }
            line
        }))
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
        let titles = [&*self.library, "all", "goal", "met", "worst"].into_iter();
        let mut table = text::empty_table(titles.chain(self.scenes.iter().map(String::as_str)));
        for row in &self.rows {
            table.add_row(row.cells(&self.scenes));
        }
        text::align_right(&mut table, 1);
        table.fmt(f)
    }
}

/// Three decimals below 10, one above, a dash for an unknown value.
pub(crate) fn number(value: Option<f64>) -> String {
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
    values.iter().sum::<f64>() / values.len() as f64
}

pub(crate) fn minimum(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

pub(crate) fn maximum(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// A cell whose times are `time` over a baseline of 1, for tests here and in other modules.
#[cfg(test)]
pub(crate) fn cell(scene: &str, subject: &str, rays: &str, over: &str, time: f64) -> Record {
    let mut cell = record::example();
    let names: Vec<&str> = subject.split('/').collect();
    (cell.structure, cell.builder) = (names[0].into(), names[1].into());
    (cell.layout, cell.scene) = (names[2].into(), scene.into());
    (cell.rays, cell.baseline) = (rays.into(), over.into());
    (cell.timed.build_ms, cell.timed.baseline_build_ms) = (vec![time], vec![1.0]);
    (cell.timed.trace_ns_per_ray, cell.timed.baseline_ns_per_ray) = (vec![time], vec![1.0]);
    cell
}

/// The table of a view, in which these rows have the value and meet their goal or not, for tests here and in other modules.
#[cfg(test)]
pub(crate) fn table_with(view: &str, cells: &[Record], rows: &[(&str, f64, bool)]) -> Table {
    let view = View::named(&[view], ("LAYOUT", "tree")).expect("valid");
    let table = view.of(cells);
    for (name, value, is_met) in rows {
        let row = table.row(name);
        assert!((row.of_all() - value).abs() < 1e-9, "{value}: {row:?}");
        assert_eq!(row.is_met(), Some(*is_met), "{row:?}");
    }
    table
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
            library: "Embree 4.4.0".into(),
            scenes: vec!["a".into(), "b".into()],
            rows: vec![
                row(Goal::AtLeast(1.5), [Some(1.0), Some(4.0)], geometric_mean),
                row(Goal::AtLeast(1.5), [Some(1.0), Some(4.0)], minimum),
                row(Goal::AtMost(20.0), [Some(1.0), Some(40.0)], arithmetic_mean),
                row(Goal::None, [Some(1.0), Some(40.0)], maximum),
                row(Goal::AtLeast(2.0), [None, Some(12.0)], geometric_mean),
                row(Goal::AtMost(0.0), [None, None], geometric_mean),
            ],
        }
    }

    #[test]
    fn one_value_of_all_scenes_meets_the_goal_or_not() {
        let table = table();
        let values: Vec<Option<f64>> = table.rows.iter().map(|row| row.value).collect();
        let expected = [2.0, 1.0, 20.5, 40.0, 12.0].map(Some);
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
    fn unknown_values_are_dashes_and_null() {
        let table = table();
        let text = table.to_string();
        assert!(text.contains("Embree 4.4.0"), "in the head\n{text}");
        let words = |row: usize| {
            let line = text
                .lines()
                .nth(row + 2)
                .expect("after the head and its line");
            line.split_whitespace().collect::<Vec<_>>()
        };
        assert_eq!(
            words(0),
            [
                "speed", "2.000", "≥", "1.5", "yes", "1.000", "a", "1.000", "4.000"
            ],
            "{text}"
        );
        assert_eq!(words(1)[4], "NO", "{text}");
        assert_eq!(
            words(3),
            ["speed", "40.0", "–", "–", "–", "1.000", "40.0"],
            "{text}"
        );
        assert_eq!(words(2)[5..7], ["40.0", "b"], "{text}");
        assert_eq!(
            words(5),
            ["speed", "–", "≤", "0", "–", "–", "–", "–"],
            "{text}"
        );
        let lines = table.to_lines().expect("plain data");
        let lines: Vec<&str> = lines.lines().collect();
        for (line, parts) in [
            (lines[1], ["\"met\":false", "\"sense\":\"at least\""]),
            (lines[3], ["\"met\":true", "\"sense\":null"]),
            (
                lines[4],
                ["\"met\":true", "\"scenes\":{\"a\":null,\"b\":12.0}"],
            ),
            (lines[0], ["\"scene\":\"a\"", "\"value\":1.0"]),
            (lines[5], ["\"met\":null", "\"worst\":null"]),
        ] {
            assert!(
                parts.iter().all(|part| line.contains(part)),
                "{parts:?} in {line}"
            );
        }
    }

    #[test]
    fn expressions_take_the_cells_of_a_scene() {
        let cells = [
            cell("a", "kd/fast/wide", "primary", "kd/best/wide", 2.0),
            cell("a", "kd/fast/wide", "ao", "kd/best/wide", 8.0),
            cell("a", "kd/fast/wide", "ao-batch", "kd/best/wide", 99.0),
            cell("a", "kd/fast/wide", "", "kd/best/wide", 3.0),
            cell("a", "kd/best/copy", "", "", 1.0),
        ];
        let all: Vec<&Record> = cells.iter().collect();
        for (expression, expected) in [
            ("time: kd/fast/wide; *; kd/best/wide", Some(4.0)),
            ("speed: kd/fast/wide; primary; kd/best/wide", Some(0.5)),
            (
                "ms: kd/fast/wide;; kd/best/wide + ms: kd/best/copy",
                Some(4.0),
            ),
            (
                "ms: kd/fast/wide;; kd/best/wide / ms: kd/best/copy",
                Some(3.0),
            ),
            ("ms: kd/fast/wide;; kd/best/wide; 2", None),
            ("ms: kd/*/copy", Some(1.0)),
        ] {
            let parsed = Expression::parse(expression).expect(expression);
            let found = parsed.of(&all, geometric_mean);
            let found = found.map(|value| (1e6 * value).round() / 1e6);
            assert_eq!(found, expected, "{expression}");
        }
        for wrong in ["ms", "minutes: kd/fast/wide", "ms: a;; b; two"] {
            assert!(Expression::parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(
            expanded("{a,b} x | {}y"),
            ["a x | ay", "b x | by"],
            "a row each"
        );
    }

    #[test]
    fn comparisons_are_those_of_the_rows_each_once() {
        let view = View::named(&["rays"], ("", "")).expect("valid");
        let all = view.comparisons();
        let count = |over: &str, by: Manner| -> usize {
            let of = all.iter().filter(|one| one.over.0.to_string() == over);
            let rays = of.filter_map(|one| one.rays.as_ref());
            let rays = rays.filter(|(_, way)| *way == by);
            rays.map(|(kinds, _)| kinds.len()).sum()
        };
        assert_eq!(count("embree/medium/own", Manner::Single), 5, "{all:?}");
        assert_eq!(count("embree8/medium/own", Manner::Packets), 2, "{all:?}");
        assert_eq!(count("kd/balanced/wide", Manner::Single), 5, "two threads");
        let builds = View::named(&["builds"], ("LAYOUT", "tree")).expect("valid");
        let builds = builds.comparisons();
        let of_builds = builds.iter().filter(|one| one.rays.is_none());
        assert_eq!(of_builds.count(), 3 + 3 + 1, "{builds:?}");
    }

    /// Each view is parsed, and each of its rows has another name.
    #[test]
    fn all_views_are_valid() {
        let views: BTreeMap<String, Vec<String>> =
            toml::from_str(include_str!("../views.toml")).expect("TOML");
        for name in views.keys() {
            let view = View::named(&[name], ("", "")).expect(name);
            let names: Vec<&str> = view.0.iter().map(|line| line.name.as_str()).collect();
            assert_eq!(record::distinct(names.iter().copied()), names, "{name}");
        }
        assert!(View::named(&["views"], ("", "")).is_err(), "unknown");
    }
}
