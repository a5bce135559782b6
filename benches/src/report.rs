//! A run as one HTML page that needs nothing else: no network, no scripts.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Context as _;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::picture::HeatScale;
use crate::plots::{self, BarPlot, ScatterPlot};
use crate::record::{self, Record, Row};
use crate::run_folder::{self, RunFolder};
use crate::structure::REFERENCE;
use crate::terminal::three_digits;

const STYLE: &str = include_str!("report.css");

/// Reads a run and writes its report again.
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

/// What the sections are made from.
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

    /// The value of each variant for each scene, for a plot.
    fn by_scene(&self, value: impl Fn(&Row<'a>) -> Option<f64>) -> Vec<Vec<f64>> {
        let of = |scene: &&str| {
            let values = self.variants.iter().map(|variant| {
                self.row(scene, variant)
                    .and_then(&value)
                    .unwrap_or(f64::NAN)
            });
            values.collect()
        };
        self.scenes.iter().map(of).collect()
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
                    (summary(&run))
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
        }
    }
}

/// Whether the answers were right, before any time.
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
                span { span.swatch style=(format!("background:{}", hex(index))) {} (variant) }
            }
        }
    }
}

fn hex(variant: usize) -> String {
    let plotters::style::RGBColor(r, g, b) = plots::color(variant);
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn summary(run: &Run<'_>) -> Markup {
    html! {
        section {
            h2 { "Summary" }
            p.note {
                "Median time of each cell, and in small print how many times as fast as the baseline it is: the median \
                 over pairs of runs on the same rays, taken one right after the other. Above ×1 is faster. The \
                 baseline's own row shows how much noise there is."
            }
            div.wide {
                table {
                    thead {
                        tr {
                            th { "scene" } th { "variant" }
                            th.number { "build ms" } th.number { "SAH cost" } th.number { "refs / triangle" }
                            th.number { "MB" } th.number { "peak MB" }
                            @for kind in &run.kinds { th.number { (kind) " ns" } }
                        }
                    }
                    @for scene in &run.scenes { (summary_of_scene(run, scene)) }
                }
            }
        }
    }
}

fn summary_of_scene(run: &Run<'_>, scene: &str) -> Markup {
    let rows: Vec<(usize, &Row<'_>)> = run
        .variants
        .iter()
        .enumerate()
        .filter_map(|(index, variant)| Some((index, run.row(scene, variant)?)))
        .collect();
    html! {
        tbody {
            @for (place, (index, row)) in rows.iter().enumerate() {
                @let build = row.build();
                tr {
                    @if place == 0 {
                        th scope="rowgroup" rowspan=(rows.len()) {
                            a href=(format!("#{scene}")) { (scene) }
                            small { (grouped(build.triangles)) " triangles" }
                        }
                    }
                    td.variant { span.swatch style=(format!("background:{}", hex(*index))) {} (row.label()) }
                    (timed(record::median(&build.timed.build_ms), build.build_speed()))
                    @if build.is_of_rival() {
                        td.number { "–" } td.number { "–" }
                    } @else {
                        td.number { (format!("{:.1}", build.exact.sah_cost_15_20)) }
                        td.number { (format!("{:.2}", build.refs_per_triangle())) }
                    }
                    td.number { (megabytes(build.exact.bytes_total)) }
                    td.number { (megabytes(build.exact.peak_build_bytes)) }
                    @for kind in &run.kinds {
                        @if let Some(cell) = row.cells.get(kind) {
                            (timed(record::median(&cell.timed.trace_ns_per_ray), cell.trace_speed()))
                        } @else {
                            td.number { "–" }
                        }
                    }
                }
            }
        }
    }
}

/// A time with its speed; a clear difference is coloured.
fn timed(time: f64, speed: f64) -> Markup {
    let class = match speed {
        s if s >= 1.1 => "faster",
        s if s <= 0.9 => "slower",
        _ => "even",
    };
    html! { td.number { (three_digits(time)) " " small class=(class) { "×" (format!("{speed:.2}")) } } }
}

fn megabytes(bytes: usize) -> String {
    format!("{:.2}", bytes as f64 / 1e6)
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

/// Whether the cost that builders minimise tells what rays take.
fn quality(run: &Run<'_>) -> anyhow::Result<Markup> {
    let mut plots = Vec::new();
    for kind in run
        .kinds
        .iter()
        .filter(|kind| ["random", "diffuse"].contains(*kind))
    {
        let mut points = Vec::new();
        for row in &run.rows {
            let variant = run
                .variants
                .iter()
                .position(|variant| *variant == row.variant);
            if let (Some(variant), Some(cell)) = (variant, row.cells.get(kind)) {
                let time = record::median(&cell.timed.trace_ns_per_ray);
                let is_reference = row.variant == REFERENCE.to_string();
                points.push((
                    variant,
                    cell.exact.sah_cost_15_20,
                    time,
                    if is_reference { row.scene } else { "" },
                ));
            }
        }
        let y_axis = format!("{kind}: ns per ray");
        plots.push(
            ScatterPlot {
                x_axis: "SAH cost (15:20)",
                y_axis: &y_axis,
                points,
            }
            .to_svg()?,
        );
    }
    Ok(html! {
        @if !plots.is_empty() {
            section {
                h2 { "SAH cost against time" }
                p.note {
                    "The surface area heuristic predicts what a random ray costs in the tree's own nodes. Wide ones divide \
                     small cells anew, so that their times depend less on it. A point is a scene and a variant; the name \
                     stands at the reference's, " (REFERENCE) "."
                }
                (legend(run))
                div.pair { @for plot in &plots { figure { (PreEscaped(plot)) } } }
            }
        }
    })
}

fn bars(run: &Run<'_>) -> anyhow::Result<Markup> {
    let mut plots = Vec::new();
    let build = |row: &Row<'_>| Some(record::median(&row.build().timed.build_ms));
    plots.push(("Build".to_owned(), "ms", run.by_scene(build)));
    for kind in &run.kinds {
        let trace =
            |row: &Row<'_>| Some(record::median(&row.cells.get(kind)?.timed.trace_ns_per_ray));
        plots.push((format!("Rays: {kind}"), "ns per ray", run.by_scene(trace)));
    }
    let mut figures = Vec::new();
    for (title, axis, values) in plots {
        figures.push((
            title,
            BarPlot {
                axis,
                groups: run.scenes.clone(),
                values,
            }
            .to_svg()?,
        ));
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
                    figure { img src=(picture) alt={ "The scene " (scene) }; figcaption { "as the camera sees it" } }
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

/// The colours of the heat picture, as CSS.
fn ramp() -> String {
    let mut css = String::from("background:linear-gradient(to right");
    for step in 0..=16 {
        let [r, g, b] = kd_render::heat_color(f64::from(step) / 16.0);
        // Writing to a string cannot fail.
        let _ = write!(css, ",rgb({r} {g} {b})");
    }
    css + ")"
}

/// A PNG as an address that holds the picture itself.
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
            "×0.50",
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
