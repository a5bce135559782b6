//! The costs of the steps of our traversal: the constants of [`CostModel::PACKED`].
//!
//! Trees over the chosen scenes are built for several cost models, so that the numbers of nodes and of blocks on a ray's path
//! vary. Rays of all kinds are timed in groups of neighbors, and the steps of each group are counted. Least squares give the
//! time of each kind of step.
//!
//! Counts do not cover caches, which a tree with more references misses more often. So rays are also traced in trees of models
//! around the fitted one, compared with the tree of the fitted one.

mod fit;
mod neighbors;

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::{Args, ValueEnum as _};
use kd::layout::TraversalCounts;
use kd::{BuildOptions, CostModel, KdTree, Layout, Ray};
use serde::Serialize;

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::rays::RayKind;
use crate::run_folder;
use crate::scenes::{self, Scene, SceneSource};
use crate::workload::{self, Amount, Workload};
use fit::{Equation, Fit, TERMS};
use neighbors::{Comparison, compare};

/// What to measure. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct CalibrateArgs {
    /// Adds the mesh files in this folder to the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Tiny scenes: a check that the command works, in seconds. The constants are meaningless
    #[arg(long)]
    smoke: bool,

    /// Passes over each group, of which the fastest counts
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = at_least_one)]
    samples: usize,

    /// Also write the results to this file, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Neighbors that are timed together, for some tenths of a millisecond.
const GROUP: usize = 1024;
/// Groups of a kind on a scene.
const GROUPS: usize = 12;
/// Pixels along the side of the image that rays are made from.
const SIDE: u32 = 512;
/// Models whose trees are measured for the fit: shallow to deep, with and without a bonus for empty space.
const MODELS: [CostModel; 5] = [
    with(0.02, 0.8),
    with(0.06, 0.8),
    with(0.2, 0.8),
    with(0.6, 0.8),
    with(0.1, 1.0),
];

/// K_T 1, eight lanes.
const fn with(intersect: f32, empty_bonus: f32) -> CostModel {
    CostModel {
        traverse: 1.0,
        intersect,
        lanes: 8,
        empty_bonus,
    }
}

/// A scene with groups of rays of every kind.
struct Grouped {
    scene: Scene,
    groups: Vec<(RayKind, Vec<Vec<Ray>>)>,
}

/// The names of the terms of [`Equation::counts`].
const TERM_NAMES: [&str; TERMS] = ["set-up", "node", "leaf", "block", "decision"];

/// A calibration, as in its file.
#[derive(Debug, Serialize)]
struct Calibration {
    schema: u32,
    rev: String,
    cpu: String,
    rustc: String,
    level: &'static str,
    scenes: Vec<String>,
    groups: usize,
    groups_kept: usize,
    /// Nanoseconds of each term.
    ns: Vec<(&'static str, f64)>,
    r_squared: f64,
    median_error: f64,
    ninth_decile_error: f64,
    /// K_I per slot at K_T 1, leaves charged to nodes.
    intersect: f64,
    comparisons: Vec<Comparison>,
}

/// Measures, prints and writes. True unless nothing could be fitted.
pub(crate) fn run(arguments: &CalibrateArgs) -> anyhow::Result<bool> {
    let sources = scenes::choose_from(
        arguments.scenes.as_deref(),
        &arguments.scene,
        arguments.smoke,
    )?;
    let mut workloads = Vec::new();
    let mut equations = Vec::new();
    for source in &sources {
        eprintln!("{}: building and tracing", source.name);
        let workload = Grouped::new(source)?;
        for cost in MODELS {
            let tree = build(&workload.scene, cost)?;
            for (kind, groups) in &workload.groups {
                let group_of = |rays: &Vec<Ray>| equation(&tree, *kind, rays, arguments.samples);
                equations.extend(groups.iter().map(group_of));
            }
        }
        workloads.push(workload);
    }
    let Some(fit) = fit::fit(&equations) else {
        eprintln!("no ray hits anything: nothing to fit");
        return Ok(false);
    };
    let intersect = slot_cost(&fit, &equations);
    if !(intersect.is_finite() && intersect > 0.0) {
        eprintln!("the fit gives nodes or blocks no cost: {fit:?}");
        return Ok(false);
    }
    print_fit(&fit, equations.len(), intersect);
    let comparisons = compare(&workloads, intersect, arguments.samples)?;
    neighbors::print(&comparisons);
    if arguments.json.is_some() {
        let environment = Environment::detect();
        let calibration = Calibration {
            schema: 1,
            rev: environment.rev,
            cpu: environment.cpu,
            rustc: environment.rustc,
            level: kd::layout::Level::detect().name(),
            scenes: sources.iter().map(|source| source.name.clone()).collect(),
            groups: equations.len(),
            groups_kept: fit.kept,
            ns: TERM_NAMES.into_iter().zip(fit.costs).collect(),
            r_squared: fit.r_squared,
            median_error: fit.median_error,
            ninth_decile_error: fit.ninth_decile_error,
            intersect,
            comparisons,
        };
        let mut text = serde_json::to_string_pretty(&calibration)?;
        text.push('\n');
        run_folder::write_all([arguments.json.clone()], text)?;
    }
    Ok(true)
}

/// K_I per slot at K_T 1.
///
/// The model has no cost for a visit to a leaf, which takes longer than a node: its return to the stack is rarely predicted. Each
/// leaf follows nodes, so its cost is added to theirs.
fn slot_cost(fit: &Fit, equations: &[Equation]) -> f64 {
    let sum = |term: usize| -> f64 { equations.iter().map(|e| e.counts[term]).sum() };
    let [_, node, leaf, block, _] = fit.costs;
    block / 8.0 / (node + leaf * sum(2) / sum(1))
}

fn print_fit(fit: &Fit, equations: usize, intersect: f64) {
    println!("ns per step, from {} of {equations} groups:", fit.kept);
    for (name, ns) in TERM_NAMES.iter().zip(fit.costs) {
        println!("  {name:<9} {ns:>7.2}");
    }
    println!(
        "fit: R² {:.3}, off by {:.0} % (median), {:.0} % (ninth decile)",
        fit.r_squared,
        100.0 * fit.median_error,
        100.0 * fit.ninth_decile_error
    );
    println!(
        "cost model: traverse 1, intersect {intersect:.3} per slot, lanes 8 (leaves charged to the nodes above)"
    );
}

impl Grouped {
    fn new(source: &SceneSource) -> anyhow::Result<Self> {
        let scene = source.load()?;
        let tree = build(&scene, CostModel::PACKED)?;
        let amount = Amount {
            side: SIDE,
            ray_limit: 4 * GROUP * GROUPS,
            brute_force_tests: 0,
            least_checked: 0,
        };
        let workloads = workload::all(&scene, RayKind::value_variants(), amount, &tree);
        let groups = workloads.iter().map(|Workload { kind, rays, .. }| {
            let step = (rays.len() / GROUP / GROUPS).max(1);
            let whole = rays.chunks_exact(GROUP).step_by(step).take(GROUPS);
            (*kind, whole.map(<[Ray]>::to_vec).collect())
        });
        let groups = groups.collect();
        Ok(Self { scene, groups })
    }
}

/// The tree under a cost model.
fn build(scene: &Scene, cost: CostModel) -> anyhow::Result<KdTree> {
    // The layout of the steps in the model.
    let options = BuildOptions::best()
        .with_cost(cost)
        .with_layout(Layout::Binary);
    Ok(KdTree::build(Arc::clone(&scene.mesh), &options)?)
}

/// The steps of a group of rays and their least nanoseconds, both per ray.
fn equation(tree: &KdTree, kind: RayKind, rays: &[Ray], samples: usize) -> Equation {
    let mut sums = [0_u64; TERMS];
    for ray in rays {
        let TraversalCounts {
            nodes,
            leaves,
            blocks,
            decisions,
            ..
        } = if kind.is_any_hit() {
            tree.occluded_counted(ray).1
        } else {
            tree.intersect_counted(ray).1
        };
        for (sum, count) in sums.iter_mut().zip([1, nodes, leaves, blocks, decisions]) {
            *sum += u64::from(count);
        }
    }
    let seconds = (0..samples).map(|_| seconds(tree, kind, rays));
    let rays = rays.len() as f64;
    Equation {
        counts: sums.map(|sum| sum as f64 / rays),
        total: 1e9 * seconds.fold(f64::INFINITY, f64::min) / rays,
    }
}

/// Traces rays once, on this thread.
fn seconds(tree: &KdTree, kind: RayKind, rays: &[Ray]) -> f64 {
    let start = Instant::now();
    let hits = if kind.is_any_hit() {
        rays.iter().filter(|ray| tree.occluded(ray)).count()
    } else {
        rays.iter()
            .filter(|ray| tree.intersect(ray).is_some())
            .count()
    };
    black_box(hits);
    start.elapsed().as_secs_f64()
}
