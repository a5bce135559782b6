//! Table 4.1 of *kd-tree merging* with pictures: the time of frames and of their pictures, by merging and by rebuilding, and of
//! the same renderer through Embree.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::ensure;
use kd::{BuildOptions, MergeMethod, Ray, Strategy};
use kd_render::{PartHit, RenderOptions, Rendering, Stage, Tracer, render};
use kd_scene::{AffOptions, SceneDescription, load_aff, toy_room};
use serde_json::{Value, json};

use super::PaperArgs;
use super::frame::{self, Frame};
use crate::environment::Environment;
use crate::measure::{Pairs, seconds, timed_in_pairs};
use crate::names::RIVAL;
use crate::peers;
use crate::plots::{Axis, BarPlot};
use crate::session::Session;
use crate::structure::{Manner, Structure};
use crate::view::View;
use crate::{run_folder, text};

/// Rows of the table: one for every second second of the kitchen's twenty.
const ROWS: usize = 10;

/// The allowed share of pixels that differ where rays are answered in f32: at edges that are seen in mirrors of mirrors.
const MOST_OTHERS: f64 = 0.02;

/// Names in cells.
const MERGED: &str = "scene/merge/picture";
const REBUILT: &str = "scene/rebuild/picture";
const PICTURE: &str = "picture";
/// The rays of a picture alone, of all threads together.
const TRACING: &str = "tracing";

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let (name, scene) = scene(arguments)?;
    let span = scene.span.expect("a scene that moves");
    let triangles: usize = scene.parts.iter().map(|part| part.mesh.len()).sum();
    println!("{name}: {triangles} triangles, {} frames", span.frames);
    let rows = (1..=ROWS).filter(|row| arguments.rows.is_empty() || arguments.rows.contains(row));
    let environment = Environment::detect();
    let mut bench = Bench::new(&scene, arguments)?;
    let (mut frames, mut problems) = (Vec::new(), Vec::new());
    for row in rows {
        let number = (2 * row * (span.frames - 1) + ROWS) / (2 * ROWS);
        let label = (2 * row).to_string();
        eprintln!("{name}, {label}");
        let mut session = Session::new(&environment, &label, triangles, arguments.samples);
        bench.measure(&mut session, number, arguments.peers)?;
        problems.extend(session.problems);
        frames.push(Frame {
            scene: name.clone(),
            label,
            number,
            cells: session.cells,
        });
    }
    ensure!(!frames.is_empty(), "no such row");
    let (columns, views): (&[&str], &[&str]) = if arguments.peers {
        let columns = &["rendered-columns", "rendered-peers-columns"];
        (columns, &["rendered", "rendered-peers"])
    } else {
        (&["rendered-columns"], &["rendered"])
    };
    let paper = ["update", "picture", "rebuild", "picture"];
    println!("{}", frame::times(&frames, columns, paper, seed)?);
    println!(
        "{}",
        View::named(views, ("", ""))?.of(&frame::cells(&frames))
    );
    println!(
        "{} threads, medians of {} pairs; {}x{} pixels, 1 light, 2 bounces, textures",
        bench.threads, arguments.samples, bench.options.width, bench.options.height
    );
    if let Some(every) = arguments.share {
        println!("{}", bench.share(every.max(1))?);
    }
    let lines: anyhow::Result<Vec<Value>> = frames.iter().map(|frame| frame.line()).collect();
    run_folder::write_all([arguments.json.clone()], run_folder::json_lines(&lines?)?)?;
    run_folder::write_all([arguments.plot.clone()], plot(&frames)?)?;
    if let Some(path) = &arguments.picture {
        bench.picture(path)?;
        println!("wrote {}", path.display());
    }
    Ok(text::report_problems(&problems))
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
            threads: rayon::current_num_threads(),
        })
    }

    fn measure(
        &mut self,
        session: &mut Session<'_>,
        frame: usize,
        with_embree: bool,
    ) -> anyhow::Result<()> {
        let updates = timed_in_pairs(
            session.repeats,
            || update(self.scene, &mut self.rebuilt, frame),
            || update(self.scene, &mut self.merged, frame),
        )?;
        session.add_build(MERGED, REBUILT, &updates);
        let options = &self.options;
        let expected = picture(&self.merged, &self.merged.tracer(), options);
        if picture(&self.rebuilt, &self.rebuilt.tracer(), options) != expected {
            let problem = format!("frame {frame}: the picture of a rebuild differs");
            session.problems.push(problem);
        }
        let tracing = AtomicU64::new(0);
        let pictures = timed_in_pairs(
            session.repeats,
            || picture_seconds(&self.rebuilt, &self.rebuilt.tracer(), options),
            || {
                let frame = self.merged.tracer();
                let tracer = Timed::new(&frame, &tracing);
                picture_seconds(&self.merged, &tracer, options)
            },
        )?;
        let rays = usize::try_from(expected.rays.total())?;
        session.add_rays(MERGED, PICTURE, REBUILT, &pictures, rays);
        let mean = tracing.seconds() / session.repeats.pairs as f64;
        session.add_rays(MERGED, TRACING, "", &Pairs::alone(vec![mean]), rays);
        if with_embree {
            self.embree(session, &expected, frame)?;
        }
        Ok(())
    }

    /// The same renderer with rays through Embree, one at a time.
    fn embree(
        &self,
        session: &mut Session<'_>,
        expected: &Rendering,
        frame: usize,
    ) -> anyhow::Result<()> {
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
        let (stage, options) = (&self.merged, &self.options);
        let found = picture(stage, &embree, options).picture;
        let pairs = found.pixels.iter().zip(&expected.picture.pixels);
        let others = pairs.filter(|(a, b)| a.distance(**b) > 0.06).count();
        let (theirs, ours) = (AtomicU64::new(0), AtomicU64::new(0));
        let pictures = timed_in_pairs(
            session.repeats,
            || picture_seconds(stage, &Timed::new(&embree, &theirs), options),
            || picture_seconds(stage, &Timed::new(&stage.tracer(), &ours), options),
        )?;
        let (rival, rays) = (RIVAL.to_string(), usize::try_from(expected.rays.total())?);
        session.add_rays(MERGED, PICTURE, &rival, &pictures, rays);
        let tracing = Pairs {
            own: vec![ours.seconds()],
            baseline: vec![theirs.seconds()],
        };
        session.add_rays(MERGED, TRACING, &rival, &tracing, rays);
        let share = others as f64 / found.pixels.len() as f64;
        if share > MOST_OTHERS {
            let percent = 100.0 * share;
            let problem = format!("frame {frame}: {percent:.1} % of Embree's pixels differ");
            session.problems.push(problem);
        }
        let mut cell = session.blank(&rival, PICTURE, 1, "");
        cell.exact.disagreement_ppm = Some(1e6 * share);
        session.add(cell);
        Ok(())
    }

    /// The share of every `every`th frame whose picture is finished earlier by merging than by rebuilding.
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
            "merging finishes the picture earlier in {sooner} of {all} frames, {percent:.1} % (the paper: 99 %)"
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

/// Seconds of the update from the frame before to this one.
fn update(scene: &SceneDescription, stage: &mut Stage, frame: usize) -> anyhow::Result<f64> {
    let span = scene.span.expect("it moves");
    let before = if frame == 0 { 1 } else { frame - 1 };
    stage.show(span.time_of(before))?;
    seconds(|| Ok(stage.show(span.time_of(frame))?))
}

fn picture(stage: &Stage, tracer: &impl Tracer, options: &RenderOptions) -> Rendering {
    render(stage, tracer, &stage.camera(), options, &|_| {})
}

fn picture_seconds(
    stage: &Stage,
    tracer: &impl Tracer,
    options: &RenderOptions,
) -> anyhow::Result<f64> {
    seconds(|| Ok(picture(stage, tracer, options)))
}

/// A tracer whose time is added up, of all threads together.
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
        self.structure.closest(Manner::Single, rays, &mut found);
        for (hit, found) in hits.iter_mut().zip(found) {
            *hit = found.map(|mut hit| {
                let triangle = hit.triangle as usize;
                let part = self.starts.partition_point(|start| *start <= triangle) - 1;
                let start = u32::try_from(self.starts[part]).expect("no more than the triangle");
                hit.triangle -= start;
                // No scene of the papers has instances.
                let instance = 0;
                PartHit {
                    part,
                    instance,
                    hit,
                }
            });
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.structure.any(Manner::Single, rays, occluded);
    }
}

/// The seconds of a sum of nanoseconds.
trait Seconds {
    fn seconds(&self) -> f64;
}

impl Seconds for AtomicU64 {
    fn seconds(&self) -> f64 {
        1e-9 * self.load(Ordering::Relaxed) as f64
    }
}

/// The paper's figures of a row: copy, dynamic tree and merge together, the picture; the rebuild, its picture.
fn seed(frame: &Frame) -> Option<[f64; 4]> {
    let (_, [copy, dynamic, merge, trace, rebuild, rebuilt]) = frame.seed()?;
    Some([copy + dynamic + merge, trace, rebuild, rebuilt])
}

impl Frame {
    fn line(&self) -> anyhow::Result<Value> {
        let seed = seed(self).map_or(Value::Null, |[update, picture, rebuild, rebuilt]| {
            json!({
                "update_ms": update, "picture_ms": picture,
                "rebuild_ms": rebuild, "rebuild_picture_ms": rebuilt,
            })
        });
        let embree = self.fields("rendered-peers-fields", &[])?;
        let picture = self.cells.iter().find(|cell| cell.rays == PICTURE);
        let mut line = self.fields("rendered-fields", &[])?;
        line.extend([
            ("table".into(), "merge-table-rendered".into()),
            ("scene".into(), self.scene.as_str().into()),
            ("row".into(), self.label.as_str().into()),
            ("frame".into(), self.number.into()),
            (
                "rays".into(),
                picture.map_or(0, |cell| cell.exact.rays).into(),
            ),
            (
                "embree".into(),
                if embree.is_empty() {
                    Value::Null
                } else {
                    embree.into()
                },
            ),
            ("seed".into(), seed),
        ]);
        self.add_library(&mut line);
        Ok(line.into())
    }
}

/// Figure 4.1: updating and rendering stacked, by rebuilding and by merging.
fn plot(frames: &[Frame]) -> anyhow::Result<String> {
    const PICTURES: &str = "picture ms: scene/merge/picture; picture; scene/rebuild/picture";
    let value = |frame: &Frame| -> anyhow::Result<Vec<Vec<f64>>> {
        let parts = |over: &str| -> anyhow::Result<Vec<f64>> {
            let update = format!("{over}ms: {MERGED};; {REBUILT}");
            Ok(vec![
                frame.value(&update)?,
                frame.value(&format!("{over}{PICTURES}"))?,
            ])
        };
        Ok(vec![parts("over ")?, parts("")?])
    };
    let bars = BarPlot {
        axis: "milliseconds",
        scale: Axis::Linear,
        groups: frames.iter().map(|frame| frame.label.as_str()).collect(),
        legend: vec![
            ["rebuilt, updating", "rebuilt, picture"],
            ["merged, updating", "merged, picture"],
        ],
        values: frames.iter().map(value).collect::<anyhow::Result<_>>()?,
    };
    bars.to_svg()
}
