//! Table 4.1 of *kd-tree merging* with pictures: what frames take to make and to render, by merging and by building anew, and by
//! the same renderer through Embree.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::ensure;
use kd::{BuildOptions, MergeMethod, Ray, Strategy};
use kd_render::{PartHit, RenderOptions, Rendering, Stage, Tracer, render};
use kd_scene::{AffOptions, SceneDescription, load_aff, toy_room};
use serde_json::{Value, json};

use super::PaperArgs;
use super::merge_table::SEED;
use crate::goals::{Goal, Row, Table, geometric_mean, maximum, minimum};
use crate::measure::{self, Repeats};
use crate::peers;
use crate::plots::StackedBars;
use crate::record::{median, median_ratio};
use crate::run_folder;
use crate::structure::{RIVAL, Structure};
use crate::terminal;

/// Rows of the table: seconds of the kitchen's twenty.
const ROWS: usize = 10;

/// Pictures differ in at most this share of their pixels where rays are answered in f32: at edges, seen in mirrors of mirrors.
const MOST_OTHERS: f64 = 0.02;

/// What was measured in a frame, in milliseconds.
#[derive(Clone, Debug)]
struct FrameFigures {
    row: String,
    frame: usize,
    /// Making the frame, and its picture.
    merged: [f64; 2],
    rebuilt: [f64; 2],
    /// What of the picture by merging is tracing, of both threads together.
    tracing: f64,
    rays: u64,
    embree: Option<EmbreeFigures>,
}

#[derive(Clone, Copy, Debug)]
struct EmbreeFigures {
    picture_ms: f64,
    /// Its picture over ours, and its tracing over ours.
    pictures: f64,
    tracing: f64,
    /// Share of pixels that are others.
    others: f64,
}

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let (name, scene) = scene(arguments)?;
    let span = scene.span.expect("a scene that moves");
    let triangles: usize = scene.parts.iter().map(|part| part.mesh.len()).sum();
    println!("{name}: {triangles} triangles, {} frames", span.frames);
    let rows = (1..=ROWS).filter(|row| arguments.rows.is_empty() || arguments.rows.contains(row));
    let mut bench = Bench::new(&scene, arguments)?;
    let mut figures = Vec::new();
    let mut problems = Vec::new();
    for row in rows {
        let frame = (2 * row * (span.frames - 1) + ROWS) / (2 * ROWS);
        eprintln!("{name}, {}", 2 * row);
        figures.push(bench.measure(2 * row, frame, arguments.peers, &mut problems)?);
    }
    ensure!(!figures.is_empty(), "there is no such row");
    let is_of_seed = name == "bart_kitchen";
    println!("{}", times(&figures, is_of_seed));
    println!("{}", ratios(&figures));
    println!(
        "{} threads, medians of {} pairs; {}x{} pixels, 1 light, 2 bounces, textures",
        bench.threads, arguments.samples, bench.options.width, bench.options.height
    );
    if let Some(every) = arguments.share {
        println!("{}", bench.share(every.max(1))?);
    }
    if let Some(path) = &arguments.json {
        run_folder::write(path, to_lines(&name, &figures, is_of_seed)?)?;
        println!("wrote {}", path.display());
    }
    if let Some(path) = &arguments.plot {
        run_folder::write(path, plot(&figures)?)?;
        println!("wrote {}", path.display());
    }
    if let Some(path) = &arguments.picture {
        bench.picture(path)?;
        println!("wrote {}", path.display());
    }
    Ok(terminal::tell_problems(&problems))
}

fn scene(arguments: &PaperArgs) -> anyhow::Result<(String, SceneDescription)> {
    let folder = arguments.scenes.as_ref().filter(|_| !arguments.smoke);
    let Some(folder) = folder else {
        let size = if arguments.smoke { 1 } else { 8 };
        if !arguments.smoke {
            eprintln!(
                "without --scenes or KD_SCENES: the project's own room in place of BART kitchen"
            );
        }
        return Ok((format!("room:{size}"), toy_room(size)?));
    };
    let file = folder.join("bart_kitchen/aff/kitchen.aff");
    Ok((
        "bart_kitchen".to_owned(),
        load_aff(file, &AffOptions::default())?,
    ))
}

struct Bench<'a> {
    scene: &'a SceneDescription,
    merged: Stage,
    rebuilt: Stage,
    options: RenderOptions,
    repeats: Repeats,
    threads: usize,
}

impl<'a> Bench<'a> {
    fn new(scene: &'a SceneDescription, arguments: &PaperArgs) -> anyhow::Result<Self> {
        let best = BuildOptions::best();
        let stage = |strategy| Stage::new(scene.clone(), best.clone(), strategy);
        let merged = stage(Strategy::Merge(MergeMethod::Guided))?;
        for warning in merged.warnings() {
            eprintln!("warning: {warning}");
        }
        let [width, height] = if arguments.smoke {
            [80, 60]
        } else {
            [800, 600]
        };
        Ok(Self {
            scene,
            merged,
            rebuilt: stage(Strategy::Rebuild(best.clone()))?,
            options: RenderOptions {
                width,
                height,
                lights: 1,
                ..RenderOptions::default()
            },
            repeats: Repeats {
                pairs: arguments.samples,
                until: Duration::MAX,
            },
            threads: rayon::current_num_threads(),
        })
    }

    fn measure(
        &mut self,
        row: usize,
        frame: usize,
        with_embree: bool,
        problems: &mut Vec<String>,
    ) -> anyhow::Result<FrameFigures> {
        let updates = measure::timed_in_pairs(
            self.repeats,
            || update(self.scene, &mut self.rebuilt, frame),
            || update(self.scene, &mut self.merged, frame),
        )?;
        let options = &self.options;
        let expected = picture(&self.merged, &self.merged.tracer(), options);
        if picture(&self.rebuilt, &self.rebuilt.tracer(), options) != expected {
            problems.push(format!("frame {frame}: another picture by building anew"));
        }
        let tracing = AtomicU64::new(0);
        let pictures = measure::timed_in_pairs(
            self.repeats,
            || picture_seconds(&self.rebuilt, &self.rebuilt.tracer(), options),
            || {
                let frame = self.merged.tracer();
                let tracer = Timed::new(&frame, &tracing);
                picture_seconds(&self.merged, &tracer, options)
            },
        )?;
        let times = self.repeats.pairs as f64;
        let ms = |seconds: &[f64]| 1e3 * median(seconds);
        let embree = if with_embree {
            let embree = self.embree(&expected)?;
            if embree.others > MOST_OTHERS {
                let share = 100.0 * embree.others;
                problems.push(format!(
                    "frame {frame}: {share:.1} % of Embree's pixels are others"
                ));
            }
            Some(embree)
        } else {
            None
        };
        Ok(FrameFigures {
            row: row.to_string(),
            frame,
            merged: [ms(&updates.own), ms(&pictures.own)],
            rebuilt: [ms(&updates.baseline), ms(&pictures.baseline)],
            tracing: 1e-6 * tracing.load(Ordering::Relaxed) as f64 / times,
            rays: expected.rays.total(),
            embree,
        })
    }

    /// The same renderer, whose rays go through Embree one by one.
    fn embree(&self, expected: &Rendering) -> anyhow::Result<EmbreeFigures> {
        let mesh = self.scene.mesh_at(self.merged.time())?;
        let mut next = 0;
        let starts = self.scene.parts.iter().map(|part| {
            let start = next;
            next += part.mesh.len();
            start
        });
        let embree = OfStructure {
            starts: starts.collect(),
            structure: RIVAL.build(&Arc::new(mesh), self.threads)?.structure,
        };
        let stage = &self.merged;
        let found = picture(stage, &embree, &self.options).picture;
        let pairs = found.pixels.iter().zip(&expected.picture.pixels);
        let others = pairs.filter(|(a, b)| a.distance(**b) > 0.06).count();
        let (theirs, ours) = (AtomicU64::new(0), AtomicU64::new(0));
        let pictures = measure::timed_in_pairs(
            self.repeats,
            || picture_seconds(stage, &Timed::new(&embree, &theirs), &self.options),
            || picture_seconds(stage, &Timed::new(&stage.tracer(), &ours), &self.options),
        )?;
        Ok(EmbreeFigures {
            picture_ms: 1e3 * median(&pictures.baseline),
            pictures: median_ratio(&pictures.baseline, &pictures.own),
            tracing: theirs.into_inner() as f64 / ours.into_inner() as f64,
            others: others as f64 / found.pixels.len() as f64,
        })
    }

    /// In how many frames of all, by steps, merging gives the picture sooner than building anew.
    fn share(&mut self, every: usize) -> anyhow::Result<String> {
        let span = self.scene.span.expect("it moves");
        let (mut sooner, mut all) = (0, 0);
        for frame in (0..span.frames).step_by(every) {
            let totals =
                [&mut self.rebuilt, &mut self.merged].map(|stage| -> anyhow::Result<f64> {
                    let start = Instant::now();
                    stage.show(span.time_of(frame))?;
                    picture(stage, &stage.tracer(), &self.options);
                    Ok(start.elapsed().as_secs_f64())
                });
            let [rebuilt, merged] = totals;
            sooner += usize::from(merged? < rebuilt?);
            all += 1;
        }
        let percent = 100.0 * f64::from(u32::try_from(sooner)?) / f64::from(u32::try_from(all)?);
        Ok(format!(
            "merging gives the picture sooner in {sooner} of {all} frames, {percent:.1} % (the paper: 99 %)"
        ))
    }

    /// Figure 4.2: frame 10, 6 lights, 2 bounces.
    fn picture(&mut self, path: &Path) -> anyhow::Result<()> {
        let span = self.scene.span.expect("it moves");
        self.merged.show(span.time_of((span.frames - 1) / 2))?;
        let options = RenderOptions {
            lights: 6,
            subpixels: 2,
            ..self.options.clone()
        };
        let tracer = self.merged.tracer();
        Ok(picture(&self.merged, &tracer, &options)
            .picture
            .save(path)?)
    }
}

/// From the frame before to this one, in seconds.
fn update(scene: &SceneDescription, stage: &mut Stage, frame: usize) -> anyhow::Result<f64> {
    let span = scene.span.expect("it moves");
    let before = if frame == 0 { 1 } else { frame - 1 };
    stage.show(span.time_of(before))?;
    let start = Instant::now();
    stage.show(span.time_of(frame))?;
    Ok(start.elapsed().as_secs_f64())
}

fn picture(stage: &Stage, tracer: &impl Tracer, options: &RenderOptions) -> Rendering {
    render(stage, tracer, &stage.camera(), options, &|_| {})
}

fn picture_seconds(
    stage: &Stage,
    tracer: &impl Tracer,
    options: &RenderOptions,
) -> anyhow::Result<f64> {
    let start = Instant::now();
    std::hint::black_box(picture(stage, tracer, options));
    Ok(start.elapsed().as_secs_f64())
}

/// What the time is taken of that goes into answers, of all threads together.
struct Timed<'a, T> {
    tracer: &'a T,
    nanoseconds: &'a AtomicU64,
}

impl<'a, T> Timed<'a, T> {
    fn new(tracer: &'a T, nanoseconds: &'a AtomicU64) -> Self {
        Self {
            tracer,
            nanoseconds,
        }
    }

    fn time(&self, work: impl FnOnce(&T)) {
        let start = Instant::now();
        work(self.tracer);
        let nanoseconds = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds.fetch_add(nanoseconds, Ordering::Relaxed);
    }
}

impl<T: Tracer> Tracer for Timed<'_, T> {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        self.time(|tracer| tracer.intersect(rays, hits));
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.time(|tracer| tracer.occluded(rays, occluded));
    }
}

/// A structure over the triangles of all parts.
struct OfStructure {
    structure: Box<dyn Structure>,
    /// The first triangle of each part.
    starts: Vec<usize>,
}

impl Tracer for OfStructure {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        let mut found = vec![None; rays.len()];
        self.structure.closest(rays, &mut found);
        for (hit, found) in hits.iter_mut().zip(found) {
            *hit = found.map(|mut hit| {
                let triangle = hit.triangle as usize;
                let part = self.starts.partition_point(|start| *start <= triangle) - 1;
                let start = u32::try_from(self.starts[part]).expect("as few as the triangle is");
                hit.triangle -= start;
                PartHit { part, hit }
            });
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.structure.any(rays, occluded);
    }
}

/// The paper's figures of a row: building by copy, dynamic tree and merge, rendering; building anew, rendering that.
fn seed(row: &str) -> Option<[f64; 4]> {
    let found = SEED.iter().find(|(number, _)| number.to_string() == row);
    found.map(|(_, [copy, dynamic, merge, trace, rebuild, rebuilt])| {
        [copy + dynamic + merge, *trace, *rebuild, *rebuilt]
    })
}

fn times(figures: &[FrameFigures], is_of_seed: bool) -> String {
    let mut head: Vec<String> = [
        "row", "frame", "update", "picture", "`best`", "picture", "Mray/s",
    ]
    .map(String::from)
    .into();
    if figures.iter().any(|f| f.embree.is_some()) {
        head.push("Embree's".into());
    }
    if is_of_seed {
        let names = ["update", "picture", "rebuild", "picture"];
        head.extend(names.map(|name| format!("paper {name}")));
    }
    let mut table = terminal::empty_table(head);
    for f in figures {
        let mut cells = vec![f.row.clone(), f.frame.to_string()];
        cells.push(format!("{:.2}", f.merged[0]));
        cells.extend([f.merged[1], f.rebuilt[0], f.rebuilt[1]].map(|ms| format!("{ms:.0}")));
        cells.push(format!("{:.2}", f.rays as f64 / f.merged[1] * 1e-3));
        cells.extend(f.embree.map(|embree| format!("{:.0}", embree.picture_ms)));
        if is_of_seed && let Some(ms) = seed(&f.row) {
            cells.extend(ms.map(|ms| format!("{ms:.0}")));
        }
        table.add_row(cells);
    }
    terminal::align_right(&mut table, 1);
    format!("milliseconds\n{table}")
}

fn ratios(figures: &[FrameFigures]) -> Table {
    let mut rows = Vec::new();
    let mut row = |name: &str, goal: Goal, value: &dyn Fn(&FrameFigures) -> Option<f64>| {
        let of_all = match goal {
            Goal::AtMost(_) => maximum,
            Goal::AtLeast(_) => minimum,
            Goal::None => geometric_mean,
        };
        let values = figures.iter().map(value).collect();
        rows.push(Row::new(name, goal, values, of_all));
    };
    let total = |[update, picture]: [f64; 2]| update + picture;
    row(
        "building anew and its picture / merging and its picture",
        Goal::None,
        &|f| Some(total(f.rebuilt) / total(f.merged)),
    );
    row("picture by merging / by building anew", Goal::None, &|f| {
        Some(f.merged[1] / f.rebuilt[1])
    });
    row("tracing, of both threads together, ms", Goal::None, &|f| {
        Some(f.tracing)
    });
    if figures.iter().any(|f| f.embree.is_some()) {
        row("picture through Embree / ours", Goal::AtLeast(1.5), &|f| {
            Some(f.embree?.pictures)
        });
        row("tracing by Embree / ours", Goal::AtLeast(2.0), &|f| {
            Some(f.embree?.tracing)
        });
        row(
            "pixels that are others through Embree, %",
            Goal::None,
            &|f| Some(100.0 * f.embree?.others),
        );
    }
    Table {
        scenes: figures.iter().map(|f| f.row.clone()).collect(),
        rows,
    }
}

fn to_lines(name: &str, figures: &[FrameFigures], is_of_seed: bool) -> anyhow::Result<String> {
    let mut lines = String::new();
    for f in figures {
        let seed = seed(&f.row).filter(|_| is_of_seed);
        let seed = seed.map_or(Value::Null, |[update, picture, rebuild, rebuilt]| {
            json!({
                "update_ms": update, "picture_ms": picture,
                "rebuild_ms": rebuild, "rebuild_picture_ms": rebuilt,
            })
        });
        let embree = f.embree.map_or(Value::Null, |embree| {
            json!({
                "picture_ms": embree.picture_ms, "picture_over_ours": embree.pictures,
                "tracing_over_ours": embree.tracing, "other_pixels": embree.others,
            })
        });
        let line = json!({
            "table": "merge-table-rendered", "scene": name, "row": f.row, "frame": f.frame,
            "update_ms": f.merged[0], "picture_ms": f.merged[1], "rays": f.rays,
            "tracing_ms": f.tracing, "rebuild_ms": f.rebuilt[0],
            "rebuild_picture_ms": f.rebuilt[1], "embree": embree, "seed": seed,
        });
        lines += &serde_json::to_string(&line)?;
        lines.push('\n');
    }
    Ok(lines)
}

/// Figure 4.1: building and rendering, one over the other, by building anew and by merging.
fn plot(figures: &[FrameFigures]) -> anyhow::Result<String> {
    let bars = StackedBars {
        axis: "milliseconds",
        parts: ["updating", "picture"],
        names: ["built anew", "merged"],
        groups: figures.iter().map(|f| f.row.clone()).collect(),
        values: figures.iter().map(|f| [f.rebuilt, f.merged]).collect(),
    };
    bars.to_svg()
}
