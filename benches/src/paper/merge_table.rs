//! Table 4.1 of *kd-tree merging* (Eleftheriades 2010): frames by merging moving parts into static ones and by rebuilding; the
//! time of both, and of rays through both.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use anyhow::ensure;
use kd::grid::{GridOptions, UniformGrid};
use kd::select::Structure as Kind;
use kd::{Accel, BuildOptions, KdTree, LazyTree, MergeMethod, Mesh, PartId, Scene, Strategy};
use kd_trace::WideTree;
use serde_json::{Map, Value, json};

use super::PaperArgs;
use super::frame::{self, Frame};
use super::mirrors::{Mirrors, OfFrame, Together, disagreement_ppm};
use crate::animation::Animation;
use crate::check::Answers;
use crate::environment::Environment;
use crate::measure::{Pairs, Repeats, seconds, timed_in_pairs};
use crate::names::{BuilderName, LayoutName, Variant};
use crate::peers::{self, FOLLOWING, OfRival};
use crate::plots::{Axis, XyPlot};
use crate::record::Record;
use crate::run_folder::json_lines;
use crate::session::Session;
use crate::structure::{Queried, Shape, Structure};
use crate::view::{self, View, minimum};
use crate::{run_folder, text};

/// Ways to make a frame.
const WAYS: [(&str, Strategy); 8] = [
    ("merge", Strategy::Merge(MergeMethod::Guided)),
    ("auto", Strategy::Auto),
    ("refit", Strategy::Refit),
    ("instances", Strategy::Instances),
    ("dual", Strategy::Dual),
    (
        "partition trees",
        Strategy::Merge(MergeMethod::PartitionTrees),
    ),
    ("BSP merge", Strategy::Merge(MergeMethod::BspMerge)),
    ("insertion", Strategy::Merge(MergeMethod::Insertion)),
];
const MERGE: &str = WAYS[0].0;
const AUTO: &str = WAYS[1].0;
/// Rebuilds of everything, on one thread.
const REBUILDS: [BuilderName; 3] = [BuilderName::Best, BuilderName::Balanced, BuilderName::Fast];

fn options(builder: BuilderName) -> BuildOptions {
    let options = builder.options().expect("a preset");
    options.with_threads(1)
}

/// Subjects of cells.
fn way(name: &str) -> String {
    format!("scene/{name}/frame")
}

fn rebuilt(builder: BuilderName) -> String {
    Variant::kd(builder, LayoutName::Wide).to_string()
}

fn best() -> String {
    rebuilt(BuilderName::Best)
}

fn embree(following: &str) -> String {
    format!("embree/{following}/moving")
}

const GRID: &str = "grid/exact/own";
const LAZY: &str = "kd/best/lazy";
const COPY: &str = "kd/best/copy";
/// The trees of the moving parts: a share of an update by merging.
const OBJECTS: &str = "bvh/objects/wide";
const RAYS: &str = "mirrors";
const BATCHES: &str = "mirrors-batch";

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let environment = Environment::detect();
    let (mut lines, mut problems, mut measured) = (String::new(), Vec::new(), Vec::new());
    for animation in animations(arguments)? {
        let moving: usize = animation.groups.iter().map(|mesh| mesh.len()).sum();
        println!(
            "{}: {} static triangles, {moving} in {} moving parts",
            animation.name,
            animation.fixed.len(),
            animation.groups.len()
        );
        let mut frames = Vec::new();
        for (number, (label, frame)) in (1..).zip(&animation.rows) {
            if !arguments.rows.is_empty() && !arguments.rows.contains(&number) {
                continue;
            }
            eprintln!("{}, {label}", animation.name);
            let mut bench = Bench::new(&animation, *frame, arguments)?;
            let triangles = bench.whole.len();
            let mut session = Session::new(&environment, label, triangles, arguments.samples);
            bench.measure(&mut session, arguments.peers)?;
            let frame = Frame {
                scene: animation.name.clone(),
                label: label.clone(),
                number: *frame,
                cells: session.cells.clone(),
            };
            lines += &frame.to_lines()?;
            frames.push(frame);
            problems.extend(session.problems);
        }
        ensure!(!frames.is_empty(), "no such row");
        let paper = ["copy", "dynamic", "merge", "trace", "rebuild", "trace"];
        let seed = |frame: &Frame| frame.seed().map(|(_, ms)| ms);
        println!(
            "{}",
            frame::times(&frames, &["merge-table-columns"], paper, seed)?
        );
        let all = frame::cells(&frames);
        let views: &[&str] = if arguments.peers {
            &["merge-table", "merge-table-peers"]
        } else {
            &["merge-table"]
        };
        println!("{}", View::named(views, ("", ""))?.of(&all));
        measured.push((animation.name, frames));
    }
    run_folder::write_all([arguments.plot.clone()], plot(&measured)?)?;
    println!(
        "one thread, medians of {} pairs; an update lasts from the first transform to the first ray; a trace is 800x600 rays of a \
         picture and two reflections, each with a ray to the light, one ray at a time unless it says batches",
        arguments.samples
    );
    run_folder::write_all([arguments.json.clone()], lines)?;
    Ok(text::report_problems(&problems))
}

fn animations(arguments: &PaperArgs) -> anyhow::Result<Vec<Animation>> {
    if arguments.smoke {
        return Ok(vec![Animation::generated(1, 0.05)?]);
    }
    let Some(folder) = &arguments.scenes else {
        eprintln!("without --scenes or KD_SCENES: generated rooms in place of BART kitchen");
        let shares = [0.001, 0.01, 0.1].into_iter();
        return shares.map(|share| Animation::generated(6, share)).collect();
    };
    let kitchen = ["bart_kitchen".to_owned()];
    let names = if arguments.scene.is_empty() {
        kitchen.as_slice()
    } else {
        arguments.scene.as_slice()
    };
    let load = |name: &String| Animation::load(&folder.join(name));
    names.iter().map(load).collect()
}

/// A frame to measure.
struct Bench<'a> {
    animation: &'a Animation,
    frame: usize,
    whole: Arc<Mesh>,
    best: KdTree,
    rays: Mirrors,
    expected: Vec<Answers>,
    scenes: Vec<(Scene, Vec<PartId>)>,
}

impl<'a> Bench<'a> {
    fn new(animation: &'a Animation, frame: usize, arguments: &PaperArgs) -> anyhow::Result<Self> {
        let whole = Arc::new(animation.whole(frame)?);
        let best = KdTree::build(Arc::clone(&whole), &options(BuilderName::Best))?;
        let limit = if arguments.smoke {
            2000
        } else {
            arguments.ray_limit
        };
        let rays = Mirrors::new(&best, animation.camera(frame), animation.light, limit);
        let mut scenes = Vec::new();
        for (_, strategy) in WAYS {
            let (mut scene, parts) = animation.scene(options(BuilderName::Best), strategy)?;
            scene.set_ray_budget(rays.of_whole_picture() as u64);
            animation.set(&mut scene, &parts, animation.before(frame))?;
            scene.commit()?;
            scenes.push((scene, parts));
        }
        Ok(Self {
            animation,
            frame,
            expected: rays.answers(&best),
            whole,
            best,
            rays,
            scenes,
        })
    }

    fn measure(&mut self, session: &mut Session<'_>, with_embree: bool) -> anyhow::Result<()> {
        for (number, (name, _)) in WAYS.into_iter().enumerate() {
            // Only merging is compared with all builders, the other ways with the best one.
            let rebuilds = if name == MERGE {
                &REBUILDS[..]
            } else {
                &REBUILDS[..1]
            };
            for builder in rebuilds {
                let whole = Arc::clone(&self.whole);
                let pairs = timed_in_pairs(
                    session.repeats,
                    || build_seconds(&whole, *builder),
                    || self.update(number),
                )?;
                session.add_build(&way(name), &rebuilt(*builder), &pairs);
            }
            let frame = self.scenes[number].0.snapshot();
            let traced = OfFrame::new(&frame);
            self.check(session, name, &traced);
            self.trace(
                session,
                &way(name),
                &traced,
                [Together::None, Together::All],
            );
        }
        self.objects(session)?;
        parts_of_updates(session)?;
        self.lazy(session)?;
        self.grid(session)?;
        self.copy(session)?;
        if with_embree {
            self.embree(session)?;
        }
        Ok(())
    }

    fn check(&self, session: &mut Session<'_>, name: &str, structure: &dyn Structure) {
        let found = self.rays.answers(structure);
        if disagreement_ppm(&self.expected, &found, false) > 0.0 {
            let problem = format!("{}, {name}: hits differ from a rebuild's", session.scene);
            session.problems.push(problem);
        }
    }

    /// Cells of rays one at a time and together, each pass after one through the tree of everything.
    fn trace(
        &self,
        session: &mut Session<'_>,
        subject: &str,
        structure: &dyn Structure,
        together: [Together; 2],
    ) {
        for (rays, together) in [RAYS, BATCHES].into_iter().zip(together) {
            let of_best = match together {
                Together::None => Together::None,
                _ => Together::All,
            };
            let pairs = self.trace_pairs(session.repeats, structure, [of_best, together]);
            let count = self.rays.len();
            let cell = session.add_rays(subject, rays, &best(), &pairs, count);
            cell.exact.rays = self.rays.of_whole_picture();
        }
    }

    fn trace_pairs(
        &self,
        repeats: Repeats,
        structure: &dyn Structure,
        [of_best, together]: [Together; 2],
    ) -> Pairs {
        let Ok(pairs) = timed_in_pairs(
            repeats,
            || Ok::<_, std::convert::Infallible>(self.rays.seconds(&self.best, of_best)),
            || Ok(self.rays.seconds(structure, together)),
        );
        pairs
    }

    /// Seconds of the update from the frame before to this one.
    fn update(&mut self, number: usize) -> anyhow::Result<f64> {
        let (scene, parts) = &mut self.scenes[number];
        let before = self.animation.before(self.frame);
        self.animation.set(scene, parts, before)?;
        scene.commit()?;
        let start = Instant::now();
        self.animation.set(scene, parts, self.frame)?;
        black_box(scene.commit()?);
        Ok(start.elapsed().as_secs_f64())
    }

    /// The share of an update by merging that builds the moving parts.
    fn objects(&mut self, session: &mut Session<'_>) -> anyhow::Result<()> {
        let moved = self.animation.moved(self.frame)?;
        let build = || {
            seconds(|| {
                for mesh in &moved {
                    black_box(WideTree::from_objects(mesh));
                }
                anyhow::Ok(())
            })
        };
        let repeats = Repeats::all(4 * session.repeats.pairs + 1);
        let pairs = timed_in_pairs(repeats, || self.update(0), build)?;
        session.add_build(OBJECTS, &way(MERGE), &pairs);
        Ok(())
    }

    /// A lazy tree, from nothing to the last ray, over build and rays of the best one. (Of the rays that are traced here, not of
    /// the whole picture.)
    fn lazy(&self, session: &mut Session<'_>) -> anyhow::Result<()> {
        let pairs = timed_in_pairs(
            session.repeats,
            || {
                let build = build_seconds(&self.whole, BuilderName::Best)?;
                anyhow::Ok(build + self.rays.seconds(&self.best, Together::None))
            },
            || {
                let start = Instant::now();
                let options = options(BuilderName::Best);
                let tree = LazyTree::new(Arc::clone(&self.whole), &options)?;
                let build = start.elapsed().as_secs_f64();
                let tree = Queried::new(&tree, |_| Shape::default());
                Ok(build + self.rays.seconds(&tree, Together::None))
            },
        )?;
        session.add_build(LAZY, &best(), &pairs);
        Ok(())
    }

    /// A grid over everything: the fastest rebuild.
    fn grid(&mut self, session: &mut Session<'_>) -> anyhow::Result<()> {
        let whole = Arc::clone(&self.whole);
        let options = GridOptions::new().with_threads(1);
        let build = || seconds(|| Ok(UniformGrid::build(Arc::clone(&whole), &options)?));
        let pairs = timed_in_pairs(session.repeats, || self.update(1), build)?;
        session.add_build(GRID, &way(AUTO), &pairs);
        let accel = Accel::with(Arc::clone(&whole), Kind::Grid)?;
        let traced = Queried::new(&accel, |_| Shape::default());
        self.check(session, "grid", &traced);
        let together = [Together::None; 2];
        let pairs = self.trace_pairs(session.repeats, &traced, together);
        session.add_rays(GRID, RAYS, &best(), &pairs, self.rays.len());
        Ok(())
    }

    /// A copy of the kd-tree of the static parts, with which every frame of the paper's methods begins, and none of ours.
    fn copy(&self, session: &mut Session<'_>) -> anyhow::Result<()> {
        let tree = kd::custom::build(&*self.animation.fixed, &options(BuilderName::Best))?;
        let copies = (0..session.repeats.pairs).map(|_| seconds(|| anyhow::Ok(tree.clone())));
        let copies = Pairs::alone(copies.collect::<Result<_, _>>()?);
        session.add_build(COPY, "", &copies);
        Ok(())
    }

    fn embree(&mut self, session: &mut Session<'_>) -> anyhow::Result<()> {
        let before = self.animation.moved(self.animation.before(self.frame))?;
        let now = self.animation.moved(self.frame)?;
        let [before, now] = [before, now].map(|meshes| Mesh::concatenated(&meshes));
        let (before, now) = (before?, now?);
        for (name, following) in FOLLOWING {
            let mut rival = following.build(&self.animation.fixed, &before)?;
            let mut update = || -> anyhow::Result<f64> {
                rival.update(before.positions())?;
                seconds(|| Ok(rival.update(now.positions())?))
            };
            for number in [0, 1] {
                let repeats = session.repeats;
                let pairs = timed_in_pairs(repeats, &mut update, || self.update(number))?;
                session.add_build(&way(WAYS[number].0), &embree(name), &pairs);
            }
            let traced = OfRival::new(Box::new(rival.structure()));
            let found = self.rays.answers(&traced);
            let ppm = disagreement_ppm(&self.expected, &found, true);
            if ppm > 1000.0 {
                let scene = &session.scene;
                let problem = format!("{scene}, Embree {name}: {ppm:.0} ppm of rays disagree");
                session.problems.push(problem);
            }
            let together = [Together::None, Together::Coherent];
            self.trace(session, &embree(name), &traced, together);
        }
        self.totals(session)
    }

    /// Cells of updates and rays together, over those of the best of Embree's ways.
    fn totals(&self, session: &mut Session<'_>) -> anyhow::Result<()> {
        for (over, rays) in [
            ("embree/best/single", RAYS),
            ("embree/best/packets", BATCHES),
        ] {
            let total =
                |expression: &str| view::value(&session.cells, &expression.replace("RAYS", rays));
            let theirs = FOLLOWING.map(|(way, _)| total(&ITS_TOTAL.replace("WAY", way)));
            let theirs: anyhow::Result<Vec<f64>> = theirs.into_iter().collect();
            let pairs = Pairs {
                own: vec![1e-3 * total(OUR_TOTAL)?],
                baseline: vec![1e-3 * minimum(&theirs?)],
            };
            session.add_build("scene/auto/total", over, &pairs);
        }
        Ok(())
    }
}

/// Milliseconds of an update and of the rays of the picture, by our own choice and by the best of Embree's ways.
const OUR_TOTAL: &str =
    "ms: scene/auto/frame;; kd/best/wide + picture ms: scene/auto/frame; RAYS; kd/best/wide";
const ITS_TOTAL: &str = "over ms: scene/auto/frame;; embree/WAY/moving + picture ms: embree/WAY/moving; RAYS; kd/best/wide";

/// Whether an update builds the trees of the moving parts.
fn builds_objects(way: &str) -> bool {
    matches!(way, "merge" | "dual")
}

/// Cells of the parts of updates, as the paper divides them: a copy, the moving trees, the merge.
fn parts_of_updates(session: &mut Session<'_>) -> anyhow::Result<()> {
    const OBJECTS: &str = "build time: bvh/objects/wide;; scene/merge/frame";
    const UPDATE: &str = "ms: scene/WAY/frame;; kd/best/wide";
    let update = |cells: &[Record], way: &str| view::value(cells, &UPDATE.replace("WAY", way));
    let objects = view::value(&session.cells, OBJECTS)? * update(&session.cells, MERGE)?;
    for (way, _) in WAYS {
        let dynamic = if builds_objects(way) { objects } else { 0.0 };
        let merge = update(&session.cells, way)? - dynamic;
        for (part, ms) in [("copy", 0.0), ("dynamic", dynamic), ("merge", merge)] {
            let part = format!("scene/{way}/{part}");
            session.add_build(&part, "", &Pairs::alone(vec![1e-3 * ms]));
        }
    }
    Ok(())
}

fn build_seconds(mesh: &Arc<Mesh>, builder: BuilderName) -> anyhow::Result<f64> {
    seconds(|| Ok(KdTree::build(Arc::clone(mesh), &options(builder))?))
}

impl Frame {
    /// One JSON object for each way.
    fn to_lines(&self) -> anyhow::Result<String> {
        let seed = self.seed().map_or(Value::Null, |(frame, ms)| {
            json!({
                "frame": frame, "copy_ms": ms[0], "dynamic_ms": ms[1], "merge_ms": ms[2], "trace_ms": ms[3],
                "rebuild_ms": ms[4], "rebuild_trace_ms": ms[5],
            })
        });
        let line = |(way, _): (&str, Strategy)| -> anyhow::Result<Map<String, Value>> {
            let its = if builds_objects(way) {
                "medium"
            } else {
                "refit"
            };
            let mut ours = self.fields("merge-table-fields", &[("WAY", way), ("ITS", its)])?;
            ours.insert("scene".into(), self.scene.as_str().into());
            ours.insert("frame".into(), self.number.into());
            ours.insert("strategy".into(), way.into());
            let mut line = Map::from_iter([
                ("table".into(), "merge-table".into()),
                ("row".into(), self.label.as_str().into()),
                ("seed".into(), seed.clone()),
                ("ours".into(), ours.into()),
            ]);
            self.add_library(&mut line);
            Ok(line)
        };
        let lines: anyhow::Result<Vec<Map<String, Value>>> = WAYS.into_iter().map(line).collect();
        json_lines(lines?)
    }
}

/// By row: updates in milliseconds, and times of rays over `best` in percent.
fn plot(measured: &[(String, Vec<Frame>)]) -> anyhow::Result<String> {
    let mut lines = Vec::new();
    for (name, frames) in measured {
        for (what, scale, expression) in [
            ("merge, ms", 1.0, "ms: scene/merge/frame;; kd/best/wide"),
            ("auto, ms", 1.0, "ms: scene/auto/frame;; kd/best/wide"),
            (
                "rays, %",
                100.0,
                "time: scene/merge/frame; mirrors; kd/best/wide",
            ),
        ] {
            let values = frames.iter().map(|frame| frame.value(expression));
            let points = (1..).map(f64::from).zip(values);
            let points = points.map(|(row, value)| Ok((row, scale * value?)));
            lines.push((
                format!("{name}: {what}"),
                points.collect::<anyhow::Result<_>>()?,
            ));
        }
    }
    let plot = XyPlot {
        x_axis: "row: from outside to all over it",
        y_axis: "update in ms; rays through the merged tree, % of best",
        scale: Axis::Logarithmic,
        lines,
        points: Vec::new(),
    };
    plot.to_svg()
}
