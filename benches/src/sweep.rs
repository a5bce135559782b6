//! A run: every variant on every scene with every kind of ray.

use std::convert::Infallible;
use std::time::Duration;

use clap::ValueEnum as _;
use indicatif::{ProgressBar, ProgressStyle};
use kd::Ray;

use crate::check::{Answers, BruteForce, as_source};
use crate::cli::{BenchArgs, UsageError, name_of, names_of};
use crate::environment::Environment;
use crate::measure::{self, Pairs, Repeats};
use crate::memory::peak_bytes_during;
use crate::rays::{self, RayKind, RaySource};
use crate::record::{self, Exact, Record, Steps, Timed};
use crate::run_folder::{self, RunFolder};
use crate::scenes::{self, Scene, SceneSource};
use crate::structure::{BASELINE, BuilderName, Shape, Structure, StructureName, Variant};
use crate::{picture, report, terminal};

/// How much of everything.
#[derive(Clone, Copy, Debug)]
struct Effort {
    repeats: Repeats,
    /// Pixels along the side of the primary image, and of the pictures.
    side: u32,
    picture_side: u32,
    ray_limit: usize,
    /// Ray-triangle tests to spend on checking each kind of ray on each scene, whatever else is in the run, so that
    /// a cell is the same in any run.
    brute_force_tests: usize,
}

const FULL: Effort = Effort {
    repeats: Repeats {
        pairs: 3,
        until: Duration::from_secs(2),
    },
    side: 1024,
    picture_side: 400,
    ray_limit: 1 << 16,
    brute_force_tests: 10_000_000,
};
const SMOKE: Effort = Effort {
    repeats: Repeats {
        pairs: 1,
        until: Duration::MAX,
    },
    side: 128,
    picture_side: 96,
    ray_limit: 1 << 12,
    brute_force_tests: 1_000_000,
};

/// Runs the whole, prints and writes what comes out; false if an answer was wrong or a scene could not be measured.
pub(crate) fn run(arguments: &BenchArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        let message = format!(
            "--peers: no rival libraries are built in; there is {}",
            names_of::<StructureName>()
        );
        return Err(UsageError(message).into());
    }
    let sources = scenes::choose(arguments)?;
    let plan = Plan::new(arguments);
    if arguments.scenes.is_none() {
        println!("only generated scenes; `--scenes DIR` or KD_SCENES=DIR adds mesh files");
    }
    let environment = Environment::detect();
    let folder = RunFolder::create(arguments.out.as_deref(), &environment.rev)?;
    let mut sweep = Sweep {
        progress: progress_bar(sources.len() * plan.variants.len() * plan.kinds.len()),
        environment,
        folder,
        plan,
        records: Vec::new(),
        skipped: Vec::new(),
        problems: Vec::new(),
    };
    for source in &sources {
        if let Err(why) = sweep.measure_scene(source) {
            sweep.problems.push(format!("{}: {why:#}", source.name));
        }
        // After each scene, so that an interrupted run keeps what is done.
        run_folder::write(&sweep.folder.records(), record::to_lines(&sweep.records)?)?;
    }
    sweep.progress.finish_and_clear();
    sweep.conclude(arguments)
}

fn progress_bar(cells: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(cells as u64).with_style(style)
}

/// What to measure.
struct Plan {
    variants: Vec<Variant>,
    kinds: Vec<RayKind>,
    threads: usize,
    /// Answers of each kind to compare with brute force, whatever it takes.
    least_checked: usize,
    effort: Effort,
}

impl Plan {
    fn new(arguments: &BenchArgs) -> Self {
        let mut effort = if arguments.smoke { SMOKE } else { FULL };
        if let Some(pairs) = arguments.samples {
            // Asked for by number, they are all taken, however long it takes.
            effort.repeats = Repeats {
                pairs,
                until: Duration::MAX,
            };
        }
        effort.ray_limit = arguments.ray_limit.unwrap_or(effort.ray_limit);
        let usual = [
            BuilderName::Median,
            BuilderName::Exact,
            BuilderName::Balanced,
        ];
        let builders = match (arguments.builder.as_slice(), arguments.smoke) {
            ([], true) => BuilderName::value_variants(),
            ([], false) => usual.as_slice(),
            (chosen, _) => chosen,
        };
        let mut variants: Vec<Variant> = Vec::new();
        for &structure in &arguments.structure {
            for &builder in builders {
                for &layout in &arguments.layout {
                    variants.push(Variant {
                        structure,
                        builder,
                        layout,
                    });
                }
            }
        }
        let kinds = if arguments.rays.is_empty() {
            RayKind::value_variants()
        } else {
            &arguments.rays
        };
        Self {
            variants: without_repeats(&variants),
            kinds: without_repeats(kinds),
            threads: arguments.threads,
            least_checked: arguments.check,
            effort,
        }
    }
}

fn without_repeats<T: Copy + PartialEq>(values: &[T]) -> Vec<T> {
    let mut once: Vec<T> = Vec::new();
    for value in values {
        if !once.contains(value) {
            once.push(*value);
        }
    }
    once
}

struct Sweep {
    plan: Plan,
    environment: Environment,
    folder: RunFolder,
    progress: ProgressBar,
    records: Vec<Record>,
    skipped: Vec<String>,
    problems: Vec<String>,
}

/// The rays of one kind on one scene, with the answers they must get.
struct Workload {
    kind: RayKind,
    rays: Vec<Ray>,
    expected: Answers,
    brute_force: BruteForce,
}

impl Sweep {
    fn say(&self, what: &str) {
        self.progress.set_message(what.to_owned());
        self.progress.tick();
    }

    fn measure_scene(&mut self, source: &SceneSource) -> anyhow::Result<()> {
        let name = &source.name;
        self.say(&format!("{name}: loading"));
        let scene = source.load()?;
        self.say(&format!(
            "{name}: building the baseline, making rays, checking them"
        ));
        let baseline = BASELINE.build(&scene.mesh, self.plan.threads)?;
        let workloads = self.workloads(&scene, &*baseline);
        for variant in self.plan.variants.clone() {
            self.measure_variant(name, &scene, variant, &*baseline, &workloads)?;
        }
        self.say(&format!("{name}: pictures"));
        self.illustrate(name, &scene, &*baseline)
    }

    fn workloads(&self, scene: &Scene, baseline: &dyn Structure) -> Vec<Workload> {
        // Nothing is timed here, so all cores may work.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let answered = |kind: RayKind, rays: &[Ray]| {
            let mut answers = Answers::none(kind, rays.len());
            measure::trace(baseline, rays, &mut answers, cores);
            answers
        };
        let primary = rays::primary(&scene.camera, self.plan.effort.side);
        let points = match answered(RayKind::Primary, &primary) {
            Answers::Closest(hits) => rays::surface_points(&scene.mesh, &primary, &hits),
            Answers::Any(_) => Vec::new(),
        };
        let source = RaySource {
            mesh: &scene.mesh,
            light: scene.light,
            primary: &primary,
            points: &points,
            limit: self.plan.effort.ray_limit,
        };
        let workload = |kind: &RayKind| {
            let (kind, rays) = (*kind, source.rays(*kind));
            let expected = answered(kind, &rays);
            let tests = self.plan.effort.brute_force_tests;
            let brute_force =
                BruteForce::sample(&scene.mesh, kind, &rays, tests, self.plan.least_checked);
            Workload {
                kind,
                rays,
                expected,
                brute_force,
            }
        };
        self.plan.kinds.iter().map(workload).collect()
    }

    fn measure_variant(
        &mut self,
        name: &str,
        scene: &Scene,
        variant: Variant,
        baseline: &dyn Structure,
        workloads: &[Workload],
    ) -> anyhow::Result<()> {
        let (triangles, most) = (scene.mesh.len(), variant.builder.most_triangles());
        if triangles > most {
            let builder = name_of(&variant.builder);
            self.skipped.push(format!(
                "{name}: `{builder}` takes too long above {most} triangles, here are {triangles}"
            ));
            self.progress.inc(workloads.len() as u64);
            return Ok(());
        }
        self.say(&format!("{name}: {variant}, building"));
        let threads = self.plan.threads;
        let build = |variant: Variant| variant.build(&scene.mesh, threads);
        let builds = measure::in_pairs(
            self.plan.effort.repeats,
            || build(BASELINE),
            || build(variant),
        )?;
        // On one thread, so that the peak does not depend on which threads happen to work at the same time.
        let (bare, peak_build_bytes) = peak_bytes_during(|| variant.build_bare(&scene.mesh));
        drop(bare?);
        let structure = build(variant)?;
        if let Some(flaw) = structure.flaw() {
            self.problems.push(format!("{name} {variant}: {flaw}"));
        }
        let shape = structure.shape();
        for workload in workloads {
            let kind = name_of(&workload.kind);
            self.say(&format!("{name}: {variant}, {kind}"));
            let mut answers = Answers::none(workload.kind, workload.rays.len());
            let traces = self.time_rays(workload, &*structure, baseline, &mut answers);
            let (mismatches, brute_force_mismatches) =
                self.check(name, variant, workload, &answers);
            let record = Record {
                schema: record::SCHEMA,
                rev: self.environment.rev.clone(),
                cpu: self.environment.cpu.clone(),
                rustc: self.environment.rustc.clone(),
                threads,
                simd: self.environment.simd.clone(),
                scene: name.to_owned(),
                triangles,
                structure: name_of(&variant.structure),
                builder: name_of(&variant.builder),
                layout: name_of(&variant.layout),
                rays: kind,
                baseline: BASELINE.to_string(),
                exact: Exact {
                    peak_build_bytes,
                    rays: workload.rays.len(),
                    hits: answers.hits(),
                    hit_hash: answers.hash(),
                    mismatches,
                    brute_force_rays: workload.brute_force.rays.len(),
                    brute_force_mismatches,
                    steps: steps_of(&*structure, workload),
                    ..exact_of(&shape)
                },
                timed: timed_of(&builds, &traces, workload.rays.len()),
            };
            self.records.push(record);
            self.progress.inc(1);
        }
        Ok(())
    }

    fn time_rays(
        &self,
        workload: &Workload,
        structure: &dyn Structure,
        baseline: &dyn Structure,
        answers: &mut Answers,
    ) -> Pairs {
        let (rays, threads) = (&workload.rays, self.plan.threads);
        let mut others = Answers::none(workload.kind, rays.len());
        let traced = |structure, answers: &mut Answers| {
            measure::trace(structure, rays, answers, threads);
            Ok::<(), Infallible>(())
        };
        let Ok(pairs) = measure::in_pairs(
            self.plan.effort.repeats,
            || traced(baseline, &mut others),
            || traced(structure, answers),
        );
        pairs
    }

    /// How many answers differ from the baseline's, and from those of brute force; the first of each is told.
    fn check(
        &mut self,
        scene: &str,
        variant: Variant,
        workload: &Workload,
        answers: &Answers,
    ) -> (usize, usize) {
        let kind = name_of(&workload.kind);
        let from_baseline = answers.differences(&workload.expected);
        let from_brute_force = workload.brute_force.differences(answers);
        let both = [
            ("the baseline", &from_baseline),
            ("a test of every triangle", &from_brute_force),
        ];
        for (what, differences) in both {
            if let Some(first) = differences.first() {
                let ray = as_source(&workload.rays[*first]);
                let count = differences.len();
                self.problems.push(format!(
                    "{scene} {variant} {kind}: {count} rays differ from {what}, first {ray}"
                ));
            }
        }
        (from_baseline.len(), from_brute_force.len())
    }

    fn illustrate(
        &self,
        name: &str,
        scene: &Scene,
        baseline: &dyn Structure,
    ) -> anyhow::Result<()> {
        let (folder, side) = (&self.folder, self.plan.effort.picture_side);
        run_folder::write(&folder.statistics(name), baseline.shape().text)?;
        run_folder::write(
            &folder.picture(name, "shaded"),
            picture::shaded(scene, baseline, side)?,
        )?;
        if let Some((heat, scale)) = picture::heat(scene, baseline, side)? {
            run_folder::write(&folder.picture(name, "heat"), heat)?;
            run_folder::write(&folder.heat_scale(name), serde_json::to_vec(&scale)?)?;
        }
        Ok(())
    }

    fn conclude(self, arguments: &BenchArgs) -> anyhow::Result<bool> {
        report::write(&self.folder, &self.records)?;
        let latest = self.folder.publish_as_latest()?;
        if let Some(path) = &arguments.json {
            run_folder::write(path, record::to_lines(&self.records)?)?;
        }
        println!("{}", terminal::table(&self.records));
        println!(
            "× is the speed relative to {BASELINE}, the median of pairs of runs; above 1 is faster"
        );
        for skipped in &self.skipped {
            println!("skipped: {skipped}");
        }
        let rays: usize = self.records.iter().map(|record| record.exact.rays).sum();
        let checked: usize = self
            .records
            .iter()
            .map(|record| record.exact.brute_force_rays)
            .sum();
        println!(
            "checked: every tree for parts of triangles it misses; {rays} answers against the baseline's, {checked} of them \
             against a test of every triangle"
        );
        for problem in &self.problems {
            eprintln!("FAILED: {problem}");
        }
        let extra = arguments.json.iter().map(|path| path.display().to_string());
        let written = [self.folder.records(), self.folder.report(), latest]
            .map(|path| path.display().to_string());
        for path in written.into_iter().chain(extra) {
            println!("wrote {path}");
        }
        Ok(self.problems.is_empty())
    }
}

/// The steps of all rays, for closest hits where the structure counts them.
fn steps_of(structure: &dyn Structure, workload: &Workload) -> Option<Steps> {
    if workload.kind.is_any_hit() {
        return None;
    }
    let mut sum = Steps::default();
    for ray in &workload.rays {
        sum += structure.counted(ray)?.1;
    }
    Some(sum)
}

fn exact_of(shape: &Shape) -> Exact {
    Exact {
        nodes: shape.nodes,
        leaves: shape.leaves,
        empty_leaves: shape.empty_leaves,
        refs: shape.refs,
        depth: shape.depth,
        sah_cost_15_20: shape.sah_cost_15_20,
        sah_cost_own: shape.sah_cost_own,
        bytes_total: shape.bytes_total,
        ..Exact::default()
    }
}

fn timed_of(builds: &Pairs, traces: &Pairs, rays: usize) -> Timed {
    let (build_ms, baseline_build_ms) = builds.scaled(1e3);
    let (trace_ns_per_ray, baseline_ns_per_ray) = traces.scaled(1e9 / rays.max(1) as f64);
    Timed {
        build_ms,
        trace_ns_per_ray,
        baseline_build_ms,
        baseline_ns_per_ray,
    }
}
