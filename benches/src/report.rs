//! The report of a run: one HTML page without network access or scripts.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Context as _;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::names::REFERENCE;
use crate::picture::HeatScale;
use crate::plots::{self, Axis, BarPlot, XyPlot};
use crate::record::{self, Record, Row};
use crate::run_folder::{self, RunFolder};
use crate::summary::{self, EXACT, Figure, Group, Section};

const STYLE: &str = include_str!("report.css");

/// Reads a run and writes its report.
pub(crate) fn rewrite(run: &Path) -> anyhow::Result<bool> {
    let folder = RunFolder::open(run)?;
    write(&folder, &record::read(run)?)?;
    println!("{}", folder.report().display());
    Ok(true)
}

/// Writes the report of a run into its folder.
pub(crate) fn write(folder: &RunFolder, records: &[Record]) -> anyhow::Result<()> {
    let page = page(folder, records)?;
    run_folder::write(&folder.report(), page.into_string())
}

/// The rows of the sections.
struct Run<'a> {
    rows: Vec<Row<'a>>,
    scenes: Vec<&'a str>,
    /// Structure, builder and layout.
    variants: Vec<String>,
    kinds: Vec<&'a str>,
}

impl<'a> Run<'a> {
    fn new(records: &'a [Record]) -> Self {
        let rows = record::rows(records);
        let variants: Vec<String> = record::distinct(rows.iter().map(|row| row.variant.as_str()))
            .into_iter()
            .map(String::from)
            .collect();
        Self {
            scenes: record::distinct(records.iter().map(|r| r.scene.as_str())),
            variants,
            kinds: record::distinct(records.iter().map(|r| r.rays.as_str())),
            rows,
        }
    }

    fn row(&self, scene: &str, variant: &str) -> Option<&Row<'a>> {
        self.rows
            .iter()
            .find(|row| row.scene == scene && row.variant == variant)
    }

    /// For each scene, a bar of each variant.
    fn by_scene(&self, value: impl Fn(&Row<'a>) -> Option<f64>) -> Vec<Vec<Vec<f64>>> {
        let bar = |scene: &str, variant: &String| {
            let row = self.row(scene, variant);
            vec![row.and_then(&value).unwrap_or(f64::NAN)]
        };
        let bars = |scene: &&str| self.variants.iter().map(|v| bar(scene, v)).collect();
        self.scenes.iter().map(bars).collect()
    }
}

fn page(folder: &RunFolder, records: &[Record]) -> anyhow::Result<Markup> {
    let run = Run::new(records);
    let name = folder.name();
    Ok(html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "kd bench " (name) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { "kd bench" }
                    p.run { (name) }
                    @if let Some(first) = records.first() { (environment(first)) }
                    (verdict(records))
                }
                @if !records.is_empty() {
                    @for table in &summary::sections(records) { (section(&run, table)) }
                    (quality(&run)?)
                    (bars(&run)?)
                    @for scene in &run.scenes { (scene_section(folder, scene)?) }
                }
            }
        }
    })
}

fn environment(record: &Record) -> Markup {
    html! {
        dl {
            div { dt { "commit" } dd { (record.rev) } }
            div { dt { "CPU" } dd { (record.cpu) } }
            div { dt { "rustc" } dd { (record.rustc) } }
            div { dt { "SIMD" } dd { (record.simd) } }
            div { dt { "threads" } dd { (record.threads) } }
            div { dt { "repeats" } dd { (record.timed.trace_ns_per_ray.len()) } }
            div { dt { "baseline" } dd { (record.baseline) } }
            @if !record.library.is_empty() { div { dt { "library" } dd { (record.library) } } }
        }
    }
}

/// Whether the answers are right, before any time.
fn verdict(records: &[Record]) -> Markup {
    let wrong: Vec<&Record> = records.iter().filter(|r| r.is_wrong()).collect();
    let checked: usize = records
        .iter()
        .map(|record| record.exact.brute_force_rays)
        .sum();
    let rays: usize = records.iter().map(|record| record.exact.rays).sum();
    let rivals = if records.iter().any(Record::is_of_rival) {
        ", rivals' up to 100 in a million,"
    } else {
        ""
    };
    if wrong.is_empty() {
        return html! {
            p.verdict.good {
                "All " (grouped(rays)) " answers agree with the reference's" (rivals) " and "
                (grouped(checked)) " of them were compared with a test of every triangle."
            }
        };
    }
    html! {
        div.verdict.bad {
            p { "Wrong answers. Times of these cells mean nothing." }
            ul {
                @for record in wrong {
                    li {
                        (record.cell()) ": " (record.exact.mismatches) " of " (record.exact.rays)
                        " differ from the reference, " (record.exact.brute_force_mismatches) " of "
                        (record.exact.brute_force_rays) " from a test of every triangle"
                    }
                }
            }
        }
    }
}

fn legend(run: &Run<'_>) -> Markup {
    html! {
        p.legend {
            @for (index, variant) in run.variants.iter().enumerate() {
                span { (colored(index)) (variant) }
            }
        }
    }
}

fn swatch(run: &Run<'_>, variant: &str) -> Markup {
    let index = run.variants.iter().position(|other| other == variant);
    colored(index.unwrap_or(0))
}

fn colored(variant: usize) -> Markup {
    html! { span.swatch style=(format!("background:{}", hex(variant))) {} }
}

fn hex(variant: usize) -> String {
    let plotters::style::RGBColor(r, g, b) = plots::color(variant);
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn section(run: &Run<'_>, section: &Section) -> Markup {
    html! {
        section {
            h2 { (section.title) }
            p.note {
                (section.note) " Times are medians, speeds medians over pairs of runs on the same rays, one right after the other; \
                 above ×1 is faster. The baseline's own row shows the noise."
            }
            div.wide {
                table.summary {
                    thead {
                        tr {
                            th { "scene" } th { "variant" }
                            @for title in &section.head { th.number { (title) } }
                        }
                    }
                    @for group in &section.groups { (group_rows(run, group)) }
                }
            }
        }
    }
}

fn group_rows(run: &Run<'_>, group: &Group) -> Markup {
    html! {
        tbody {
            @for (place, line) in group.lines.iter().enumerate() {
                tr {
                    @if place == 0 {
                        th scope="rowgroup" rowspan=(group.lines.len()) {
                            a href=(format!("#{}", group.scene)) { (group.scene) }
                            small { (grouped(group.triangles)) " triangles" }
                        }
                    }
                    td.variant { (swatch(run, &line.variant)) (line.label) }
                    @for figure in &line.cells { (figure_cell(figure)) }
                }
            }
        }
    }
}

/// A figure with its speed below it; a clear difference is colored.
fn figure_cell(figure: &Figure) -> Markup {
    let class = |speed: f64| match speed {
        s if s >= 1.1 => "faster",
        s if s <= 0.9 => "slower",
        _ => "even",
    };
    html! {
        td.number {
            (figure.text)
            @if let Some(speed) = figure.speed { " " small class=(class(speed)) { "×" (format!("{speed:.2}")) } }
            @if let Some(more) = &figure.more { " " small { (more) } }
        }
    }
}

/// A whole number with its digits in groups of three.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Whether the cost that builders minimise predicts the time of rays.
///
/// Of a run with builders, only their rows: wide nodes divide small cells again, so that their times depend less on the cost.
fn quality<'a>(run: &Run<'a>) -> anyhow::Result<Markup> {
    let of_builders = run.rows.iter().filter(|row| summary::is_of_builder(row));
    let of_builders: Vec<&Row<'a>> = of_builders.collect();
    let (rows, named) = if of_builders.is_empty() {
        (run.rows.iter().collect(), REFERENCE.to_string())
    } else {
        let first = of_builders[0].variant.as_str();
        let has_exact = of_builders.iter().any(|row| row.variant == EXACT);
        let named = if has_exact { EXACT } else { first };
        (of_builders, named.to_owned())
    };
    let kinds = ["random", "diffuse"].into_iter();
    let mut plots = Vec::new();
    for kind in kinds.filter(|kind| run.kinds.contains(kind)) {
        let point = |row: &&Row<'a>| {
            let variant = run.variants.iter().position(|other| *other == row.variant);
            let cell = row.cells.get(kind)?;
            let name = if row.variant == named { row.scene } else { "" };
            Some((variant?, cell.exact.sah_cost_15_20, cell.ns_per_ray(), name))
        };
        let plot = XyPlot {
            x_axis: "SAH cost (15:20)",
            y_axis: &format!("{kind}: ns per ray"),
            scale: Axis::Logarithmic,
            lines: Vec::new(),
            points: rows.iter().filter_map(point).collect(),
        };
        plots.push(plot.to_svg()?);
    }
    Ok(html! {
        @if !plots.is_empty() {
            section {
                h2 { "SAH cost against time" }
                p.note {
                    "The surface area heuristic predicts the cost of a random ray in the tree's own nodes. A point is a scene and \
                     a variant; names are at those of " (named) "."
                }
                (legend(run))
                div.pair { @for plot in &plots { figure { (PreEscaped(plot)) } } }
            }
        }
    })
}

fn bars(run: &Run<'_>) -> anyhow::Result<Markup> {
    let mut plots = Vec::new();
    let build = |row: &Row<'_>| Some(row.build().build_ms());
    plots.push(("Build".to_owned(), "ms", run.by_scene(build)));
    for kind in &run.kinds {
        let trace = |row: &Row<'_>| Some(row.cells.get(kind)?.ns_per_ray());
        plots.push((format!("Rays: {kind}"), "ns per ray", run.by_scene(trace)));
    }
    let mut figures = Vec::new();
    for (title, axis, values) in plots {
        let plot = BarPlot {
            axis,
            scale: Axis::Logarithmic,
            groups: run.scenes.clone(),
            legend: Vec::new(),
            values,
        };
        figures.push((title, plot.to_svg()?));
    }
    Ok(html! {
        section {
            h2 { "Times by scene" }
            p.note { "Shorter is better. The axes are logarithmic." }
            (legend(run))
            @for (title, plot) in &figures {
                figure { figcaption { (title) } (PreEscaped(plot)) }
            }
        }
    })
}

fn scene_section(folder: &RunFolder, scene: &str) -> anyhow::Result<Markup> {
    let shaded = picture(&folder.picture(scene, "shaded"))?;
    let heat = picture(&folder.picture(scene, "heat"))?;
    let scale: Option<HeatScale> = read_if_there(&folder.heat_scale(scene))?
        .map(|bytes| serde_json::from_slice(&bytes))
        .transpose()?;
    let statistics = read_if_there(&folder.statistics(scene))?
        .map(String::from_utf8)
        .transpose()?;
    Ok(html! {
        section id=(scene) {
            h2 { (scene) }
            div.scene {
                @if let Some(picture) = shaded {
                    figure { img src=(picture) alt={ "The scene " (scene) }; figcaption { "from the camera" } }
                }
                @if let (Some(picture), Some(scale)) = (heat, scale) {
                    figure {
                        img src=(picture) alt={ "Traversal cost of " (scene) };
                        figcaption {
                            "steps of each primary ray (nodes, leaves, triangles), mean "
                            (format!("{:.1}", scale.mean))
                            span.scale { "0" span.ramp style=(ramp()) {} "≥ " (scale.brightest) }
                        }
                    }
                }
                @if let Some(text) = statistics {
                    figure.statistics { pre { (text.trim_end()) } figcaption { (REFERENCE) } }
                }
            }
        }
    })
}

/// The colors of the heat picture, as CSS.
fn ramp() -> String {
    let mut css = String::from("background:linear-gradient(to right");
    for step in 0..=16 {
        let [r, g, b] = kd_render::heat_color(f64::from(step) / 16.0);
        // Writing to a string cannot fail.
        let _ = write!(css, ",rgb({r} {g} {b})");
    }
    css + ")"
}

/// A PNG as an address that contains the picture.
fn picture(path: &Path) -> anyhow::Result<Option<String>> {
    let bytes = read_if_there(path)?;
    Ok(bytes.map(|bytes| format!("data:image/png;base64,{}", BASE64.encode(bytes))))
}

fn read_if_there(path: &Path) -> anyhow::Result<Option<Vec<u8>>> {
    if !path.exists() {
        return Ok(None);
    }
    fs::read(path)
        .map(Some)
        .with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page_of(records: &[Record]) -> String {
        let out = tempfile::tempdir().expect("a folder");
        let folder = RunFolder::create(Some(out.path()), "rev").expect("made");
        run_folder::write(&folder.statistics("tetra-3"), "nodes 101 < 102\n").expect("written");
        write(&folder, records).expect("written");
        fs::read_to_string(folder.report()).expect("there")
    }

    #[test]
    fn the_page_stands_alone() {
        let page = page_of(&[record::example()]);
        for part in [
            "kd/exact/binary",
            "some CPU",
            "×1.00",
            "nodes 101 &lt; 102",
            "<svg",
            "id=\"tetra-3\"",
        ] {
            assert!(page.contains(part), "{part} is missing");
        }
        for outside in ["<script", "src=\"http", "href=\"http", "<link", "@import"] {
            assert!(!page.contains(outside), "{outside} needs something else");
        }
    }

    #[test]
    fn wrong_answers_come_before_any_time() {
        let mut record = record::example();
        record.exact.mismatches = 3;
        let page = page_of(&[record]);
        let (verdict, table) = (page.find("Wrong answers"), page.find("<table"));
        assert!(verdict.is_some() && verdict < table, "at the top");
        assert!(
            page_of(&[]).contains("kd bench"),
            "a run without cells is a page too"
        );
    }

    #[test]
    fn long_numbers_are_grouped() {
        let shown = [7, 1234, 1_234_567].map(grouped);
        assert_eq!(
            shown,
            ["7", "1\u{202f}234", "1\u{202f}234\u{202f}567"],
            "in threes"
        );
    }
}
