//! Table 4.1 of *kd-tree merging* (Eleftheriades 2010): frames made by merging what moves into what stands still, and by
//! building everything anew; what both take, and what rays take through both.

mod table;

use std::convert::Infallible;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::ensure;
use kd::grid::{GridOptions, UniformGrid};
use kd::select::Structure;
use kd::{Accel, BuildOptions, KdTree, LazyTree, MergeMethod, Mesh, PartId, Scene, Strategy};
use kd_trace::WideTree;

use super::PaperArgs;
use super::mirrors::Mirrors;
use super::traced::{Answers, Traced};
use crate::animation::Animation;
use crate::measure::{self, Repeats};
use crate::peers;
use crate::record::{median, median_ratio};
use crate::run_folder;
use crate::terminal;

/// Frame, and milliseconds for copying the static tree, the dynamic tree, merging, tracing; building anew, tracing that.
pub(super) const SEED: [(usize, [f64; 6]); 10] = [
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

/// Ways to make a frame of what has moved.
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
const MERGE: usize = 0;
const AUTO: usize = 1;
/// The methods of the paper.
const OF_PAPER: std::ops::Range<usize> = 5..8;

/// Ways to build everything anew.
fn builders() -> [(&'static str, BuildOptions); 3] {
    let builders = [
        ("best", BuildOptions::best()),
        ("balanced", BuildOptions::balanced()),
        ("fast", BuildOptions::fast()),
    ];
    builders.map(|(name, options)| (name, options.with_threads(1)))
}
const BEST: usize = 0;
const FAST: usize = 2;

/// What was measured in a frame.
#[derive(Debug)]
struct FrameFigures {
    label: String,
    frame: usize,
    /// The tree of what moves alone, in milliseconds: a part of an update by merging.
    dynamic_ms: f64,
    rebuild_ms: [f64; 3],
    rebuild_trace_ms: f64,
    /// The tree of everything, asked in batches.
    rebuild_batch_ms: f64,
    ways: Vec<WayFigures>,
    /// A copy of the kd-tree of what stands still, in milliseconds, with which every frame of the paper's methods begins, and
    /// none of ours.
    still_copy_ms: f64,
    embree: Vec<EmbreeFigures>,
    /// Building a tree where rays go and tracing them, over building all of it by `best` and tracing.
    lazy: f64,
    grid: GridFigures,
}

/// Of a uniform grid over everything, built anew.
#[derive(Clone, Copy, Debug)]
struct GridFigures {
    build_ms: f64,
    /// Over an update of our own choice.
    updates: f64,
    /// Rays, over the tree of everything, by `best`.
    trace: f64,
}

#[derive(Clone, Copy, Debug)]
struct WayFigures {
    update_ms: f64,
    /// Times that an update goes into building everything anew.
    rebuilds: [f64; 3],
    trace_ms: f64,
    /// Over the tree of everything, by `best`.
    trace: f64,
    batch_ms: f64,
}

/// Of one way in which Embree follows.
#[derive(Clone, Copy, Debug)]
struct EmbreeFigures {
    update_ms: f64,
    /// Our updates, by merging and by our own choice, over its.
    our_updates: [f64; 2],
    trace_ms: f64,
    packets_ms: f64,
}

pub(super) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let mut lines = String::new();
    let mut problems = Vec::new();
    let mut measured = Vec::new();
    for animation in animations(arguments)? {
        let moving: usize = animation.groups.iter().map(|mesh| mesh.len()).sum();
        println!(
            "{}: {} triangles that stand still, {moving} in {} parts that move",
            animation.name,
            animation.fixed.len(),
            animation.groups.len()
        );
        let figures = measure_all(&animation, arguments, &mut problems)?;
        let is_of_seed = animation.name == "bart_kitchen";
        println!("{}", table::times(&figures, is_of_seed));
        println!("{}", table::ratios(&figures));
        lines += &table::to_lines(&animation, &figures, is_of_seed)?;
        measured.push((animation.name, figures));
    }
    if let Some(path) = &arguments.plot {
        run_folder::write(path, table::plot(&measured)?)?;
        println!("wrote {}", path.display());
    }
    println!(
        "one thread, medians of {} pairs; an update is from the first transform to the first ray; a trace is 800x600 rays of a \
         picture and two reflections, each with a ray to the light, one by one unless it says batches",
        arguments.samples
    );
    if let Some(path) = &arguments.json {
        run_folder::write(path, lines)?;
        println!("wrote {}", path.display());
    }
    Ok(terminal::tell_problems(&problems))
}

fn animations(arguments: &PaperArgs) -> anyhow::Result<Vec<Animation>> {
    if arguments.smoke {
        return Ok(vec![Animation::generated(1, 0.05)?]);
    }
    let Some(folder) = &arguments.scenes else {
        eprintln!("without --scenes or KD_SCENES: generated rooms in place of BART kitchen");
        let shares = [0.001, 0.01, 0.1];
        return shares
            .map(|share| Animation::generated(6, share))
            .into_iter()
            .collect();
    };
    let kitchen = ["bart_kitchen".to_owned()];
    let names = if arguments.scene.is_empty() {
        kitchen.as_slice()
    } else {
        arguments.scene.as_slice()
    };
    names
        .iter()
        .map(|name| Animation::load(&folder.join(name)))
        .collect()
}

fn measure_all(
    animation: &Animation,
    arguments: &PaperArgs,
    problems: &mut Vec<String>,
) -> anyhow::Result<Vec<FrameFigures>> {
    let mut figures = Vec::new();
    for (number, (label, frame)) in (1..).zip(&animation.rows) {
        if !arguments.rows.is_empty() && !arguments.rows.contains(&number) {
            continue;
        }
        eprintln!("{}, {label}", animation.name);
        let mut bench = Bench::new(animation, *frame, arguments)?;
        figures.push(bench.measure(label, problems)?);
    }
    ensure!(!figures.is_empty(), "there is no such row");
    Ok(figures)
}

/// A frame to measure.
struct Bench<'a> {
    animation: &'a Animation,
    frame: usize,
    repeats: Repeats,
    with_embree: bool,
    whole: Arc<Mesh>,
    best: KdTree,
    rays: Mirrors,
    scenes: Vec<(Scene, Vec<PartId>)>,
}

impl<'a> Bench<'a> {
    fn new(animation: &'a Animation, frame: usize, arguments: &PaperArgs) -> anyhow::Result<Self> {
        let whole = Arc::new(animation.whole(frame)?);
        let best = KdTree::build(Arc::clone(&whole), &builders()[BEST].1)?;
        let limit = if arguments.smoke {
            2000
        } else {
            arguments.ray_limit
        };
        let rays = Mirrors::new(&best, animation.camera(frame), animation.light, limit);
        let mut scenes = Vec::new();
        for (_, strategy) in WAYS {
            let mut scene = Scene::new(builders()[BEST].1.clone());
            scene.set_strategy(strategy);
            scene.set_ray_budget(rays.of_whole_picture());
            scene.add_static(Arc::clone(&animation.fixed))?;
            let groups = animation.groups.iter();
            let parts = groups.map(|mesh| scene.add_dynamic(Arc::clone(mesh)));
            let parts = parts.collect::<Result<Vec<_>, _>>()?;
            animation.set(&mut scene, &parts, animation.before(frame))?;
            scene.commit()?;
            scenes.push((scene, parts));
        }
        let repeats = Repeats {
            pairs: arguments.samples,
            until: Duration::MAX,
        };
        Ok(Self {
            animation,
            frame,
            repeats,
            with_embree: arguments.peers,
            whole,
            best,
            rays,
            scenes,
        })
    }

    fn measure(&mut self, label: &str, problems: &mut Vec<String>) -> anyhow::Result<FrameFigures> {
        let scale = 1e3 * self.rays.scale;
        let expected = Traced::Tree(&self.best).answers(&self.rays);
        let mut rebuild_ms = [0.0; 3];
        let (mut rebuild_trace_ms, mut rebuild_batch_ms) = (vec![], vec![]);
        let mut ways = Vec::new();
        for (way, (name, _)) in WAYS.into_iter().enumerate() {
            let mut update_ms = f64::NAN;
            let mut rebuilds = [f64::NAN; 3];
            for (place, (_, options)) in builders().iter().enumerate() {
                // What stands beside merging is told for all builders, other ways for the best one.
                if way != MERGE && place != BEST {
                    continue;
                }
                let whole = Arc::clone(&self.whole);
                let pairs = measure::timed_in_pairs(
                    self.repeats,
                    || build_seconds(&whole, options),
                    || self.update(way),
                )?;
                rebuilds[place] = median_ratio(&pairs.baseline, &pairs.own);
                if way == MERGE {
                    rebuild_ms[place] = 1e3 * median(&pairs.baseline);
                }
                update_ms = 1e3 * median(&pairs.own);
            }
            let frame = self.scenes[way].0.snapshot();
            let traced = Traced::Frame(&frame);
            if traced.answers(&self.rays) != expected {
                problems.push(format!("{label}, {name}: other hits than by building anew"));
            }
            let pairs = self.trace_pairs(&traced, false);
            rebuild_trace_ms.push(scale * median(&pairs.baseline));
            let batched = self.trace_pairs(&traced, true);
            rebuild_batch_ms.push(scale * median(&batched.baseline));
            ways.push(WayFigures {
                update_ms,
                rebuilds,
                trace_ms: scale * median(&pairs.own),
                trace: median_ratio(&pairs.own, &pairs.baseline),
                batch_ms: scale * median(&batched.own),
            });
        }
        Ok(FrameFigures {
            label: label.to_owned(),
            frame: self.frame,
            dynamic_ms: self.dynamic_part()? * ways[MERGE].update_ms,
            lazy: self.lazy()?,
            grid: self.grid(&expected, label, problems)?,
            rebuild_ms,
            rebuild_trace_ms: median(&rebuild_trace_ms),
            rebuild_batch_ms: median(&rebuild_batch_ms),
            ways,
            still_copy_ms: self.still_copy_ms()?,
            embree: if self.with_embree {
                self.embree(&expected, label, problems)?
            } else {
                vec![]
            },
        })
    }

    /// Traces the tree of everything and something else in turn.
    fn trace_pairs(&self, traced: &Traced<'_>, in_batches: bool) -> measure::Pairs {
        let best = Traced::Tree(&self.best);
        let Ok(pairs) = measure::timed_in_pairs(
            self.repeats,
            || Ok::<_, Infallible>(best.seconds(&self.rays, in_batches)),
            || Ok(traced.seconds(&self.rays, in_batches)),
        );
        pairs
    }

    /// From the frame before to this one, in seconds.
    fn update(&mut self, way: usize) -> anyhow::Result<f64> {
        let (scene, parts) = &mut self.scenes[way];
        self.animation
            .set(scene, parts, self.animation.before(self.frame))?;
        scene.commit()?;
        let start = Instant::now();
        self.animation.set(scene, parts, self.frame)?;
        black_box(scene.commit()?);
        Ok(start.elapsed().as_secs_f64())
    }

    /// A tree that is built where rays go, from nothing to the last ray, over the best one. (As many rays as are traced here,
    /// not all of a picture.)
    fn lazy(&self) -> anyhow::Result<f64> {
        let options = &builders()[BEST].1;
        let pairs = measure::timed_in_pairs(
            self.repeats,
            || -> anyhow::Result<f64> {
                let build = build_seconds(&self.whole, options)?;
                Ok(build + Traced::Tree(&self.best).seconds(&self.rays, false))
            },
            || {
                let start = Instant::now();
                let tree = LazyTree::new(Arc::clone(&self.whole), options)?;
                let build = start.elapsed().as_secs_f64();
                Ok(build + Traced::Lazy(&tree).seconds(&self.rays, false))
            },
        )?;
        Ok(median_ratio(&pairs.own, &pairs.baseline))
    }

    /// A grid over everything, which is there sooner than any tree.
    fn grid(
        &mut self,
        expected: &[Answers],
        label: &str,
        problems: &mut Vec<String>,
    ) -> anyhow::Result<GridFigures> {
        let whole = Arc::clone(&self.whole);
        let options = GridOptions::new().with_threads(1);
        let build = || {
            let start = Instant::now();
            let grid = UniformGrid::build(Arc::clone(&whole), &options)?;
            let seconds = start.elapsed().as_secs_f64();
            drop(grid);
            Ok(seconds)
        };
        let builds = measure::timed_in_pairs(self.repeats, || self.update(AUTO), build)?;
        let accel = Accel::with(Arc::clone(&whole), Structure::Grid)?;
        let traced = Traced::Accel(&accel);
        if traced.answers(&self.rays) != expected {
            problems.push(format!("{label}, grid: other hits than by building anew"));
        }
        let traces = self.trace_pairs(&traced, false);
        Ok(GridFigures {
            build_ms: 1e3 * median(&builds.own),
            updates: median_ratio(&builds.own, &builds.baseline),
            trace: median_ratio(&traces.own, &traces.baseline),
        })
    }

    fn still_copy_ms(&self) -> anyhow::Result<f64> {
        let tree = kd::custom::build(&*self.animation.fixed, &builders()[BEST].1)?;
        let seconds = (0..self.repeats.pairs).map(|_| {
            let start = Instant::now();
            black_box(tree.clone());
            start.elapsed().as_secs_f64()
        });
        Ok(1e3 * median(&seconds.collect::<Vec<_>>()))
    }

    /// Which part of an update by merging it is to build what moves.
    fn dynamic_part(&mut self) -> anyhow::Result<f64> {
        let moved = self.animation.moved(self.frame)?;
        let build = || {
            let start = Instant::now();
            for mesh in &moved {
                black_box(WideTree::from_objects(mesh));
            }
            Ok(start.elapsed().as_secs_f64())
        };
        let repeats = Repeats {
            pairs: 4 * self.repeats.pairs + 1,
            ..self.repeats
        };
        let pairs = measure::timed_in_pairs(repeats, || self.update(MERGE), build)?;
        Ok(median_ratio(&pairs.own, &pairs.baseline))
    }

    #[cfg(feature = "peers")]
    fn embree(
        &mut self,
        expected: &[Answers],
        label: &str,
        problems: &mut Vec<String>,
    ) -> anyhow::Result<Vec<EmbreeFigures>> {
        use super::traced::disagreement_ppm;
        use crate::peers::EmbreeMoving;

        let scale = 1e3 * self.rays.scale;
        let before = self.animation.moved(self.animation.before(self.frame))?;
        let now = self.animation.moved(self.frame)?;
        let [before, now] = [before, now].map(|meshes| Mesh::concatenated(&meshes));
        let (before, now) = (before?, now?);
        let mut all = Vec::new();
        for (name, following) in EMBREE_NAMES.into_iter().zip(EMBREE) {
            let mut embree = EmbreeMoving::new(&self.animation.fixed, &before, following, 1)?;
            let mut update = || -> anyhow::Result<f64> {
                embree.update(before.positions())?;
                let start = Instant::now();
                embree.update(now.positions())?;
                Ok(start.elapsed().as_secs_f64())
            };
            let mut update_ms = 0.0;
            let mut our_updates = [0.0; 2];
            for (place, way) in [MERGE, AUTO].into_iter().enumerate() {
                let pairs =
                    measure::timed_in_pairs(self.repeats, &mut update, || self.update(way))?;
                update_ms = 1e3 * median(&pairs.baseline);
                our_updates[place] = median_ratio(&pairs.own, &pairs.baseline);
            }
            let traced = Traced::Embree(&embree);
            let found = traced.answers(&self.rays);
            let ppm = disagreement_ppm(expected, &found);
            if ppm > 1000.0 {
                problems.push(format!(
                    "{label}, Embree {name}: {ppm:.0} ppm of rays disagree"
                ));
            }
            let [trace_ms, packets_ms] = [false, true].map(|in_packets| {
                let pairs = self.trace_pairs(&traced, in_packets);
                scale * median(&pairs.own)
            });
            all.push(EmbreeFigures {
                update_ms,
                our_updates,
                trace_ms,
                packets_ms,
            });
        }
        Ok(all)
    }

    #[cfg(not(feature = "peers"))]
    fn embree(
        &mut self,
        _: &[Answers],
        _: &str,
        _: &mut Vec<String>,
    ) -> anyhow::Result<Vec<EmbreeFigures>> {
        anyhow::bail!("no rival libraries are built in")
    }
}

/// Ways in which Embree follows what moves.
#[cfg(feature = "peers")]
const EMBREE: [peers::Following; 3] = [
    peers::Following::Rebuild,
    peers::Following::Medium,
    peers::Following::Refit,
];
const EMBREE_NAMES: [&str; 3] = ["rebuild", "medium", "refit"];
const EMBREE_MEDIUM: usize = 1;
const EMBREE_REFIT: usize = 2;

fn build_seconds(mesh: &Arc<Mesh>, options: &BuildOptions) -> anyhow::Result<f64> {
    let mesh = Arc::clone(mesh);
    let start = Instant::now();
    let tree = KdTree::build(mesh, options)?;
    let seconds = start.elapsed().as_secs_f64();
    drop(tree);
    Ok(seconds)
}
