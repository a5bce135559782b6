//! `results`: `docs/results.md`, the figures of all recorded runs, each with its command and its record, and the table of results
//! in `README.md`, which is an excerpt of it.
//!
//! A record of any command is a file of JSON lines. `results.toml` declares the views of each: which lines form a row, and which
//! fields form the columns.

use std::fmt::Write as _;
use std::fs;
use std::iter;

use anyhow::{Context as _, bail, ensure};
use clap::Args;
use serde::Deserialize;
use serde_json::Value;

use crate::record::{median, median_ratio};
use crate::run_folder::{self, workspace_root};
use crate::view::{Mean, mean, number};

const VIEWS: &str = include_str!("../results.toml");

/// The lines of `README.md` around its table.
const MARKS: [&str; 2] = [
    "<!-- results: `cargo xtask results` writes this table -->\n",
    "<!-- end of results -->\n",
];

/// What to do with the document.
#[derive(Args, Debug)]
pub(crate) struct ResultsArgs {
    /// Write nothing; fail if docs/results.md or the table in README.md differs from the records
    #[arg(long)]
    check: bool,
}

#[derive(Debug, Deserialize)]
struct Views {
    readme: Excerpt,
    section: Vec<Section>,
}

/// Some rows of the first table of a section.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Excerpt {
    section: String,
    /// The first cells of these rows.
    rows: Vec<String>,
}

/// A recorded run.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Section {
    title: String,
    file: String,
    command: String,
    note: String,
    table: Vec<Table>,
}

/// A view of the lines of a record.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    /// The field of the lines in a record that is a single object.
    lines: Option<String>,
    rows: Vec<String>,
    names: Vec<String>,
    /// A condition for all lines.
    only: Option<String>,
    columns: Vec<String>,
    /// Whether the values of the field `scenes` follow as columns.
    #[serde(default)]
    scenes: bool,
}

/// Writes or checks both documents; false if one differs.
pub(crate) fn run(arguments: &ResultsArgs) -> anyhow::Result<bool> {
    let mut are_current = true;
    for (path, wanted) in documents()? {
        let path = workspace_root().join(path);
        if !arguments.check {
            run_folder::write_all([Some(path)], wanted)?;
        } else if fs::read_to_string(&path)? != wanted {
            eprintln!("{}: run `cargo xtask results`", path.display());
            are_current = false;
        }
    }
    Ok(are_current)
}

/// The path and the text of each document.
fn documents() -> anyhow::Result<[(&'static str, String); 2]> {
    let views: Views = toml::from_str(VIEWS)?;
    let readme = fs::read_to_string(workspace_root().join("README.md"))?;
    let table = views.excerpt().context("results.toml, readme")?;
    Ok([
        ("docs/results.md", views.document()?),
        ("README.md", with_table(&readme, &table)?),
    ])
}

/// A text with another table between its [`MARKS`].
fn with_table(text: &str, table: &str) -> anyhow::Result<String> {
    let (before, rest) = text.split_once(MARKS[0]).context("the mark of a table")?;
    let (_, after) = rest.split_once(MARKS[1]).context("the end of a table")?;
    Ok([before, MARKS[0], table, MARKS[1], after].concat())
}

impl Views {
    fn document(&self) -> anyhow::Result<String> {
        let mut text = String::from(
            "# Results\n\n`cargo xtask results` makes this file from [benches/records](../benches/records): do not edit it. Times are \
             those of a shared two-core machine and vary by a tenth and more from run to run; ratios of pairs vary by some hundredths. \
             `DIR` is a folder of meshes or animations that are not part of this repository.\n",
        );
        for section in &self.section {
            let written = section.write(&mut text);
            written.with_context(|| format!("results.toml, {}", section.title))?;
        }
        Ok(text)
    }

    /// The table of `README.md`, with its command.
    fn excerpt(&self) -> anyhow::Result<String> {
        let Excerpt { section, rows } = &self.readme;
        let mut sections = self.section.iter();
        let section = sections.find(|one| one.title == *section);
        let section = section.context("there is no such section")?;
        let values = section.values()?;
        let table = section.table.first().context("a table")?;
        let table = table.markdown(table.lines(&values)?)?;
        let mut lines = table.lines();
        let head = lines.by_ref().take(2);
        let mut text: String = head.map(|line| format!("{line}\n")).collect();
        for row in rows {
            let start = format!("| {row} |");
            let line = table.lines().find(|line| line.starts_with(&start));
            let line = line.with_context(|| format!("there is no row `{row}`"))?;
            writeln!(text, "{line}")?;
        }
        let (note, command, file) = (&section.note, &section.command, &section.file);
        let date = section.date()?;
        writeln!(
            text,
            "\n{note}\n(`{command}`, {date}, [the record](benches/records/{file}))"
        )?;
        Ok(text)
    }
}

impl Section {
    /// The lines of the record.
    fn values(&self) -> anyhow::Result<Vec<Value>> {
        let path = workspace_root().join("benches/records").join(&self.file);
        let record = fs::read_to_string(path)?;
        let values = serde_json::Deserializer::from_str(&record).into_iter();
        Ok(values.collect::<Result<_, _>>()?)
    }

    fn date(&self) -> anyhow::Result<&str> {
        self.file.get(..10).context("files start with a date")
    }

    fn write(&self, text: &mut String) -> anyhow::Result<()> {
        let values = self.values()?;
        let (title, note, command, file) = (&self.title, &self.note, &self.command, &self.file);
        let date = self.date()?;
        self.check_library(&values)?;
        writeln!(
            text,
            "\n## {title}\n\n{note}\n(`{command}`, {date}, [the record](../benches/records/{file}))"
        )?;
        for table in &self.table {
            *text += "\n";
            *text += &table.markdown(table.lines(&values)?)?;
        }
        Ok(())
    }
}

impl Section {
    /// A library of which a record says the version must be in the note or over a column with that version.
    fn check_library(&self, values: &[Value]) -> anyhow::Result<()> {
        let names = self.table.iter().flat_map(|table| &table.names);
        let texts: Vec<&String> = iter::once(&self.note).chain(names).collect();
        for library in values.iter().filter_map(|line| line["library"].as_str()) {
            let without_patch = library.rsplit_once('.').map_or(library, |parts| parts.0);
            let is_named = texts.iter().any(|text| text.contains(without_patch));
            ensure!(is_named, "the record is of {library}, which no text names");
        }
        Ok(())
    }
}

impl Table {
    /// The lines of a record that it is a view of.
    fn lines<'a>(&self, values: &'a [Value]) -> anyhow::Result<&'a [Value]> {
        match &self.lines {
            Some(field) => {
                let first = values.first().context("an object")?;
                Ok(at(first, field).as_array().context("a list")?)
            }
            None => Ok(values),
        }
    }

    fn markdown(&self, lines: &[Value]) -> anyhow::Result<String> {
        let mut rows: Vec<(Vec<String>, Vec<&Value>)> = Vec::new();
        for line in lines {
            if self.only.as_deref().is_none_or(|only| holds(line, only)) {
                let words: Vec<String> = self.rows.iter().map(|row| text(at(line, row))).collect();
                match rows.iter_mut().find(|(known, _)| *known == words) {
                    Some((_, lines)) => lines.push(line),
                    None => rows.push((words, vec![line])),
                }
            }
        }
        let (_, first) = rows.first().context("no line for a table")?;
        let scenes = first[0]["scenes"].as_object().filter(|_| self.scenes);
        let scenes: Vec<String> = scenes
            .into_iter()
            .flatten()
            .map(|scene| scene.0.clone())
            .collect();
        let columns = self.columns.iter().map(|column| Column::parse(column));
        let columns = columns.collect::<anyhow::Result<Vec<_>>>()?;
        let numbers = columns.iter().map(|column| column.title.to_owned());
        let numbers: Vec<String> = numbers.chain(scenes.iter().cloned()).collect();
        let rule = self
            .names
            .iter()
            .map(|_| "---")
            .chain(numbers.iter().map(|_| "--:"));
        let mut table = row(self.names.iter().chain(&numbers)) + &row(rule);
        for (words, lines) in &rows {
            let figures = columns.iter().map(|column| column.figure(lines));
            let figures = figures.collect::<anyhow::Result<Vec<_>>>()?;
            let of_scene = |scene: &String| number(lines[0]["scenes"][scene].as_f64());
            let of_scenes: Vec<String> = scenes.iter().map(of_scene).collect();
            table += &row(words.iter().chain(&figures).chain(&of_scenes));
        }
        Ok(table)
    }
}

fn row(cells: impl Iterator<Item = impl AsRef<str>>) -> String {
    let mut line = String::from("|");
    for cell in cells {
        line = line + " " + cell.as_ref() + " |";
    }
    line + "\n"
}

/// A field, by its path with dots. A number is a place in a list.
fn at<'a>(line: &'a Value, path: &str) -> &'a Value {
    path.split('.')
        .fold(line, |value, name| match name.parse::<usize>() {
            Ok(place) if value.is_array() => &value[place],
            _ => &value[name],
        })
}

/// A text, or a number with at most three decimals.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            ((1e3 * number).round() / 1e3).to_string()
        }
        other => other.to_string(),
    }
}

/// Whether a line has a text in a field: `FIELD=TEXT`.
fn holds(line: &Value, condition: &str) -> bool {
    let (field, wanted) = condition.split_once('=').unwrap_or((condition, ""));
    at(line, field) == wanted
}

/// The samples of a field: one number, or all of a list or an object.
fn samples(line: &Value, path: &str) -> Vec<f64> {
    match at(line, path) {
        Value::Array(values) => values.iter().filter_map(Value::as_f64).collect(),
        Value::Object(values) => values.values().filter_map(Value::as_f64).collect(),
        value => value.as_f64().into_iter().collect(),
    }
}

/// A column of a table.
struct Column<'a> {
    title: &'a str,
    only: Option<&'a str>,
    value: &'a str,
    decimals: usize,
    of: Mean,
}

impl<'a> Column<'a> {
    fn parse(text: &'a str) -> anyhow::Result<Self> {
        let parts: Vec<&str> = text.split('|').map(str::trim).collect();
        let (title, value, decimals, of) = match parts[..] {
            [title, value, decimals] => (title, value, decimals, "geo"),
            [title, value, decimals, of] => (title, value, decimals, of),
            _ => bail!("`{text}`: title | value | decimals"),
        };
        let condition = value
            .strip_prefix('[')
            .and_then(|rest| rest.split_once(']'));
        let (only, value) =
            condition.map_or((None, value), |(only, value)| (Some(only), value.trim()));
        let of = mean(of)?;
        let decimals = decimals.parse()?;
        Ok(Self {
            title,
            only,
            value,
            decimals,
            of,
        })
    }

    /// The figure of the lines of a row; a dash if none has the value.
    fn figure(&self, lines: &[&Value]) -> anyhow::Result<String> {
        if self.value == "goal" {
            return Ok(goal(lines[0]));
        }
        let lines = lines
            .iter()
            .filter(|line| self.only.is_none_or(|only| holds(line, only)));
        let values: Vec<f64> = lines.flat_map(|line| values(line, self.value)).collect();
        ensure!(
            values.iter().all(|value| value.is_finite()),
            "{}: {values:?}",
            self.title
        );
        if values.is_empty() {
            return Ok("–".into());
        }
        Ok(format!("{:.*}", self.decimals, (self.of)(&values)))
    }
}

/// The values of a line: those of a field, or one that is made of several.
fn values(line: &Value, value: &str) -> Vec<f64> {
    if let Some(field) = value.strip_prefix("median ") {
        return vec![median(&samples(line, field))];
    }
    if let Some((above, below)) = value
        .strip_prefix("pairs ")
        .and_then(|two| two.split_once(' '))
    {
        let (above, below) = (samples(line, above), samples(line, below));
        // Where nothing was measured, there is no value.
        let ratio = (!below.is_empty()).then(|| median_ratio(&above, &below));
        return ratio.into_iter().collect();
    }
    if let Some((above, below)) = value.split_once(" / ") {
        let pairs = values(line, above).into_iter().zip(values(line, below));
        return pairs.map(|(above, below)| above / below).collect();
    }
    if let Some((first, rest)) = value.split_once(" + ") {
        let pairs = values(line, first).into_iter().zip(values(line, rest));
        return pairs.map(|(first, rest)| first + rest).collect();
    }
    samples(line, value)
}

/// The goal of a row of a view, and whether it is missed.
fn goal(line: &Value) -> String {
    let sign = match line["sense"].as_str() {
        Some("at most") => '≤',
        Some("at least") => '≥',
        _ => return "–".into(),
    };
    let missed = if line["met"] == false { ", missed" } else { "" };
    format!("{sign} {}{missed}", text(&line["goal"]))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_text_names_the_version_of_the_library() {
        let section = |note: &str| Section {
            title: String::new(),
            file: String::new(),
            command: String::new(),
            note: note.into(),
            table: Vec::new(),
        };
        let lines = [json!({"library": "Embree 4.4.0"}), json!({"row": "a"})];
        assert!(
            section("The rival is Embree 4.4.")
                .check_library(&lines)
                .is_ok()
        );
        assert!(
            section("The rival is Embree 3.13.")
                .check_library(&lines)
                .is_err()
        );
        assert!(
            section("").check_library(&lines[1..]).is_ok(),
            "it has none"
        );
    }

    #[test]
    fn lines_become_rows_and_missing_values_dashes() {
        let lines = [
            json!({"who": "a", "ms": 1.0, "deep": {"er": 3}}),
            json!({"who": "b", "ms": 5.0, "more": 1.0}),
            json!({"who": "a", "ms": 4.0}),
        ];
        let table = |columns: &[&str]| Table {
            lines: None,
            rows: vec!["who".into()],
            names: vec!["name".into()],
            only: None,
            columns: columns.iter().map(|&column| column.into()).collect(),
            scenes: false,
        };
        let columns = [
            "ms | ms | 1",
            "deep | [who=a] deep.er | 0",
            "both | ms + more | 0 | max",
        ];
        let text = table(&columns).markdown(&lines).expect("lines");
        let expected = "| name | ms | deep | both |\n| --- | --: | --: | --: |\n\
                        | a | 2.0 | 3 | – |\n| b | 5.0 | – | 6 |\n";
        assert_eq!(text, expected);
        for wrong in ["ms", "ms | ms | x", "ms | ms | 1 | most"] {
            assert!(table(&[wrong]).markdown(&lines).is_err(), "{wrong}");
        }
        assert!(table(&columns).markdown(&[]).is_err(), "no line");
    }

    #[test]
    fn a_table_is_replaced_between_its_marks() {
        let text = format!("a\n{}old\n{}b\n", MARKS[0], MARKS[1]);
        let expected = format!("a\n{}new\n{}b\n", MARKS[0], MARKS[1]);
        assert_eq!(with_table(&text, "new\n").expect("marks"), expected);
        for wrong in ["", MARKS[0], MARKS[1]] {
            assert!(with_table(wrong, "new\n").is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_documents_are_current() {
        for (path, wanted) in documents().expect("readable records") {
            let present = fs::read_to_string(workspace_root().join(path)).expect("committed");
            assert!(present == wanted, "{path}: run `cargo xtask results`");
        }
    }
}
