//! What is measured on one scene.

use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum as _;
use kd::tree::Tree;
use kd::{BuildOptions, KdTree, Mesh};

use crate::check::Answers;
use crate::cli::name_of;
use crate::measure::{Repeats, timed_in_pairs};
use crate::memory::peak_of_all_threads_during;
use crate::rays::RayKind;
use crate::record::median_ratio;
use crate::scenes::{Scene, SceneSource};
use crate::structure::{BuilderName, LayoutName, StructureName, Variant};
use crate::workload::{self, Amount, Workload};

/// The presets, in the order of all arrays below.
pub(super) const PRESETS: [&str; 3] = ["fast", "balanced", "best"];
const BEST: usize = 2;

fn options() -> [BuildOptions; 3] {
    [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
    ]
}

fn median_top() -> BuildOptions {
    BuildOptions::best().with_median_levels(1)
}

/// The build of Embree that each preset is compared with.
pub(super) const RIVALS: [BuilderName; 3] =
    [BuilderName::Medium, BuilderName::High, BuilderName::High];

/// How to measure.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    repeats: Repeats,
    whole: bool,
    rays: Amount,
}

impl Settings {
    pub(super) fn new(samples: usize, whole: bool, smoke: bool) -> Self {
        let rays = Amount {
            brute_force_tests: 0,
            ..Amount::FULL
        };
        Self {
            repeats: Repeats {
                pairs: samples,
                until: Duration::MAX,
            },
            whole,
            rays: if smoke {
                Amount {
                    side: 64,
                    ray_limit: 1 << 10,
                    ..rays
                }
            } else {
                rays
            },
        }
    }

    /// The same with no pair after so long.
    pub(super) fn until(&self, limit: Duration) -> Self {
        let mut settings = self.clone();
        settings.repeats.until = limit;
        settings
    }

    /// Build times of presets over those of Embree on the same mesh, on one thread.
    pub(super) fn over_embree(
        &self,
        mesh: &Arc<Mesh>,
        rivals: [BuilderName; 3],
    ) -> anyhow::Result<[f64; 3]> {
        let mut ratios = [0.0; 3];
        for ((ratio, options), rival) in ratios.iter_mut().zip(options()).zip(rivals) {
            let rival = Variant {
                structure: StructureName::Embree,
                builder: rival,
                layout: LayoutName::Own,
            };
            let pairs = timed_in_pairs(
                self.repeats,
                || Ok(rival.build(mesh, 1)?.seconds),
                || self.seconds(mesh, &options, 1),
            )?;
            *ratio = median_ratio(&pairs.own, &pairs.baseline);
        }
        Ok(ratios)
    }

    /// How many times as fast presets build on two threads.
    fn speed_ups(&self, mesh: &Arc<Mesh>) -> anyhow::Result<[f64; 3]> {
        let mut ratios = [0.0; 3];
        for (ratio, options) in ratios.iter_mut().zip(options()) {
            let pairs = timed_in_pairs(
                self.repeats,
                || self.seconds(mesh, &options, 1),
                || self.seconds(mesh, &options, 2),
            )?;
            *ratio = median_ratio(&pairs.baseline, &pairs.own);
        }
        Ok(ratios)
    }

    /// Time on two threads of a build that works on all of a large cell at once, over that of one that gives each
    /// thread its half below a median (Shi 2011 §3.1.3).
    fn nested_over_median_top(&self, mesh: &Arc<Mesh>) -> anyhow::Result<f64> {
        let (nested, median_top) = (BuildOptions::best(), median_top());
        let pairs = timed_in_pairs(
            self.repeats,
            || self.seconds(mesh, &median_top, 2),
            || self.seconds(mesh, &nested, 2),
        )?;
        Ok(median_ratio(&pairs.own, &pairs.baseline))
    }

    fn seconds(
        &self,
        mesh: &Arc<Mesh>,
        options: &BuildOptions,
        threads: usize,
    ) -> anyhow::Result<f64> {
        let options = options.clone().with_threads(threads);
        let start = Instant::now();
        if self.whole {
            let ready = KdTree::build(Arc::clone(mesh), &options)?;
            return Ok(seconds_and_drop(start, ready));
        }
        let tree = kd::custom::build(&**mesh, &options)?;
        Ok(seconds_and_drop(start, tree))
    }
}

/// The seconds since `start`, taken before what was made goes.
fn seconds_and_drop<T>(start: Instant, made: T) -> f64 {
    let seconds = start.elapsed().as_secs_f64();
    drop(made);
    seconds
}

/// What was measured on one scene; arrays are by preset.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) scene: String,
    /// Build times on one thread, over those of the [`RIVALS`].
    pub(super) over_embree: [f64; 3],
    pub(super) speed_up: [f64; 3],
    /// Time of rays over that of `best`, the geometric mean over their kinds.
    pub(super) trace_over_best: [f64; 3],
    /// SAH cost under the model of `best`, over that of `best`.
    pub(super) cost_over_best: [f64; 3],
    /// On two threads, the time of `best` over that of the same below a median, and the cost of that over `best`'s.
    pub(super) nested_over_median_top: f64,
    pub(super) median_top_cost: f64,
    /// The most that a build has allocated at a time above the mesh until the tree is there, by triangle; on one thread
    /// and on two.
    pub(super) peak_bytes: [[f64; 2]; 3],
    /// Presets that give another tree on more threads.
    pub(super) different_trees: usize,
    pub(super) problems: Vec<String>,
}

impl Figures {
    pub(super) fn measure(source: &SceneSource, settings: &Settings) -> anyhow::Result<Self> {
        let scene = source.load()?;
        let mut problems = Vec::new();
        let mut trees = Vec::new();
        let (mut peak_bytes, mut different_trees) = ([[0.0; 2]; 3], 0);
        for (preset, options) in options().iter().enumerate() {
            let build =
                |threads| kd::custom::build(&*scene.mesh, &options.clone().with_threads(threads));
            let (tree, alone) = peak_of_all_threads_during(|| build(1));
            let (on_two, together) = peak_of_all_threads_during(|| build(2));
            let (tree, on_two) = (tree?, on_two?);
            let triangles = scene.mesh.len().max(1) as f64;
            peak_bytes[preset] = [alone, together].map(|bytes| bytes as f64 / triangles);
            if !are_equal(&tree, &on_two) || !are_equal(&tree, &build(3)?) {
                different_trees += 1;
                let (name, preset) = (&source.name, PRESETS[preset]);
                problems.push(format!("{name}: the number of threads shows in {preset}"));
            }
            trees.push(tree);
        }
        let model = *trees[BEST].cost();
        let median_top = kd::custom::build(&*scene.mesh, &median_top())?.sah_cost(&model);
        let costs: Vec<f64> = trees.iter().map(|tree| tree.sah_cost(&model)).collect();
        drop(trees);
        Ok(Self {
            over_embree: settings.over_embree(&scene.mesh, RIVALS)?,
            speed_up: settings.speed_ups(&scene.mesh)?,
            trace_over_best: trace_over_best(&scene, &source.name, settings, &mut problems)?,
            nested_over_median_top: settings.nested_over_median_top(&scene.mesh)?,
            median_top_cost: median_top / costs[BEST],
            cost_over_best: std::array::from_fn(|preset| costs[preset] / costs[BEST]),
            peak_bytes,
            different_trees,
            problems,
            scene: source.name.clone(),
        })
    }
}

fn are_equal(a: &Tree, b: &Tree) -> bool {
    a.nodes() == b.nodes() && a.refs() == b.refs()
}

fn trace_over_best(
    scene: &Scene,
    name: &str,
    settings: &Settings,
    problems: &mut Vec<String>,
) -> anyhow::Result<[f64; 3]> {
    let mut trees = Vec::new();
    for options in options() {
        trees.push(KdTree::build(Arc::clone(&scene.mesh), &options)?);
    }
    let best = &trees[BEST];
    let workloads = workload::all(scene, RayKind::value_variants(), settings.rays, best);
    let mut ratios = [1.0; 3];
    for (preset, tree) in trees.iter().enumerate().take(BEST) {
        let mut logarithms = 0.0;
        for workload in &workloads {
            let Workload { kind, rays, .. } = workload;
            let mut answers = Answers::none(*kind, rays.len());
            let pairs = workload.time(settings.repeats, 1, best, tree, &mut answers);
            logarithms += median_ratio(&pairs.own, &pairs.baseline).ln();
            let wrong = answers.differences(&workload.expected).len();
            if wrong > 0 {
                let (preset, kind) = (PRESETS[preset], name_of(kind));
                problems.push(format!(
                    "{name}: {wrong} {kind} rays of {preset} differ from those of best"
                ));
            }
        }
        ratios[preset] = (logarithms / workloads.len() as f64).exp();
    }
    Ok(ratios)
}
