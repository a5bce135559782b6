//! A run: every variant on every scene with every kind of ray.

use std::time::Duration;

use clap::ValueEnum as _;
use indicatif::{ProgressBar, ProgressStyle};

use crate::check::{Answers, as_source};
use crate::cli::{BenchArgs, name_of};
use crate::environment::Environment;
use crate::measure::{self, Pairs, Repeats};
use crate::rays::RayKind;
use crate::record::{self, Exact, Record, Steps, Timed};
use crate::run_folder::{self, RunFolder};
use crate::scenes::{self, Scene, SceneSource};
use crate::structure::{REFERENCE, RIVAL, Shape, Structure, Variant};
use crate::variants::without_repeats;
use crate::workload::{self, Amount, Workload};
use crate::{native, peers, picture, report, terminal, variants};

/// How much of everything.
#[derive(Clone, Copy, Debug)]
struct Effort {
    repeats: Repeats,
    rays: Amount,
    /// Pixels along the side of pictures.
    picture_side: u32,
}

const FULL: Effort = Effort {
    repeats: Repeats {
        pairs: 3,
        until: Duration::from_secs(2),
    },
    rays: Amount::FULL,
    picture_side: 400,
};
const SMOKE: Effort = Effort {
    repeats: Repeats {
        pairs: 1,
        until: Duration::MAX,
    },
    rays: Amount {
        side: 128,
        ray_limit: 1 << 12,
        brute_force_tests: 1_000_000,
        least_checked: 0,
    },
    picture_side: 96,
};

/// Runs the whole, prints and writes what comes out; false if an answer was wrong or a scene could not be measured.
pub(crate) fn run(arguments: &BenchArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let sources = scenes::choose(arguments)?;
    let plan = Plan::new(arguments)?;
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
    if let Some(program) = &arguments.native_build {
        println!("Rust rivals once more, in {}", program.display());
        let own = native::measure(program, arguments, &sweep.folder)?;
        native::keep_better(&mut sweep.records, own);
    }
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
    /// What runs before every timed repeat.
    baseline: Variant,
    kinds: Vec<RayKind>,
    threads: usize,
    effort: Effort,
}

impl Plan {
    fn new(arguments: &BenchArgs) -> anyhow::Result<Self> {
        let mut effort = if arguments.smoke { SMOKE } else { FULL };
        if let Some(pairs) = arguments.samples {
            // Asked for by number, they are all taken, however long it takes.
            effort.repeats = Repeats {
                pairs,
                until: Duration::MAX,
            };
        }
        effort.rays.ray_limit = arguments.ray_limit.unwrap_or(effort.rays.ray_limit);
        effort.rays.least_checked = arguments.check;
        let kinds = if arguments.rays.is_empty() {
            RayKind::value_variants()
        } else {
            &arguments.rays
        };
        Ok(Self {
            variants: variants::choose(arguments)?,
            baseline: if arguments.peers { RIVAL } else { REFERENCE },
            kinds: without_repeats(kinds),
            threads: arguments.threads,
            effort,
        })
    }
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
            "{name}: building what to compare with, making rays, checking them"
        ));
        let build = |variant: Variant| variant.build(&scene.mesh, self.plan.threads);
        let reference = build(REFERENCE)?.structure;
        let rival = if self.plan.baseline == REFERENCE {
            None
        } else {
            Some(build(self.plan.baseline)?.structure)
        };
        let baseline = rival.as_ref().unwrap_or(&reference);
        let (kinds, amount) = (&self.plan.kinds, self.plan.effort.rays);
        let workloads = workload::all(&scene, kinds, amount, &*reference);
        for variant in self.plan.variants.clone() {
            self.measure_variant(name, &scene, variant, &**baseline, &workloads)?;
        }
        self.say(&format!("{name}: pictures"));
        self.illustrate(name, &scene, &*reference)
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
        let repeats = self.plan.effort.repeats;
        let build_seconds = |variant: Variant| {
            let built = variant.build(&scene.mesh, threads)?;
            anyhow::Ok(built.seconds)
        };
        let builds = measure::timed_in_pairs(
            repeats,
            || build_seconds(self.plan.baseline),
            || build_seconds(variant),
        )?;
        // On one thread, so that the peak does not depend on which threads happen to work at the same time.
        let built = variant.build(&scene.mesh, 1)?;
        let peak_build_bytes = variant
            .peak_bytes_of_tree(&scene.mesh)?
            .unwrap_or(built.peak_bytes);
        let structure = built.structure;
        if let Some(flaw) = structure.flaw() {
            self.problems.push(format!("{name} {variant}: {flaw}"));
        }
        let shape = structure.shape();
        for workload in workloads {
            let kind = name_of(&workload.kind);
            self.say(&format!("{name}: {variant}, {kind}"));
            let mut answers = Answers::none(workload.kind, workload.rays.len());
            let traces = workload.time(repeats, threads, baseline, &*structure, &mut answers);
            let record = Record {
                schema: record::SCHEMA,
                rev: self.environment.rev.clone(),
                cpu: self.environment.cpu.clone(),
                rustc: self.environment.rustc.clone(),
                rustflags: self.environment.rustflags.clone(),
                threads,
                simd: self.environment.simd.clone(),
                scene: name.to_owned(),
                triangles,
                structure: name_of(&variant.structure),
                builder: name_of(&variant.builder),
                layout: variant.layout.name(),
                rays: kind,
                baseline: self.plan.baseline.to_string(),
                exact: Exact {
                    peak_build_bytes,
                    rays: workload.rays.len(),
                    hits: answers.hits(),
                    hit_hash: answers.hash(),
                    steps: steps_of(&*structure, workload),
                    ..exact_of(&shape)
                },
                timed: timed_of(&builds, &traces, workload.rays.len()),
            };
            let record = self.checked(record, variant, workload, &answers);
            self.records.push(record);
            self.progress.inc(1);
        }
        Ok(())
    }

    /// The record with what is wrong with the answers: how many differ from the reference's, and for ours from those
    /// of brute force. The first of each is told.
    fn checked(
        &mut self,
        mut record: Record,
        variant: Variant,
        workload: &Workload,
        answers: &Answers,
    ) -> Record {
        let mut found = Vec::new();
        if variant.is_rival() {
            let disagreements = workload.expected.disagreements(answers);
            let share = disagreements.len() as f64 / workload.rays.len().max(1) as f64;
            record.exact.mismatches = disagreements.len();
            record.exact.disagreement_ppm = Some(share * 1e6);
            found.push(("ours", disagreements));
        } else {
            let from_reference = answers.differences(&workload.expected);
            let from_brute_force = workload.brute_force.differences(answers);
            record.exact.mismatches = from_reference.len();
            record.exact.brute_force_rays = workload.brute_force.rays.len();
            record.exact.brute_force_mismatches = from_brute_force.len();
            found.push(("the reference", from_reference));
            found.push(("a test of every triangle", from_brute_force));
        }
        if record.is_wrong() {
            let cell = record.cell();
            for (what, differences) in &found {
                if let Some(first) = differences.first() {
                    let (count, ray) = (differences.len(), as_source(&workload.rays[*first]));
                    self.problems.push(format!(
                        "{cell}: {count} rays differ from {what}, first {ray}"
                    ));
                }
            }
        }
        record
    }

    fn illustrate(
        &self,
        name: &str,
        scene: &Scene,
        reference: &dyn Structure,
    ) -> anyhow::Result<()> {
        let (folder, side) = (&self.folder, self.plan.effort.picture_side);
        run_folder::write(&folder.statistics(name), reference.shape().text)?;
        run_folder::write(
            &folder.picture(name, "shaded"),
            picture::shaded(scene, reference, side)?,
        )?;
        if let Some((heat, scale)) = picture::heat(scene, reference, side)? {
            run_folder::write(&folder.picture(name, "heat"), heat)?;
            run_folder::write(&folder.heat_scale(name), serde_json::to_vec(&scale)?)?;
        }
        Ok(())
    }

    fn conclude(self, arguments: &BenchArgs) -> anyhow::Result<bool> {
        run_folder::write(&self.folder.records(), record::to_lines(&self.records)?)?;
        report::write(&self.folder, &self.records)?;
        let latest = self.folder.publish_as_latest()?;
        if let Some(path) = &arguments.json {
            run_folder::write(path, record::to_lines(&self.records)?)?;
        }
        println!("{}", terminal::table(&self.records));
        println!(
            "× is the speed relative to {}, the median of pairs of runs; above 1 is faster",
            self.plan.baseline
        );
        if self.records.iter().any(Record::is_of_rival) {
            println!(
                "ppm are a rival's answers that differ from ours, in a million; (native) are times of a build for this \
                 processor, where a rival is faster in one"
            );
        }
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
            "checked: every tree for parts of triangles it misses; {rays} answers against the reference's, {checked} of them \
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
