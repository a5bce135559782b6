//! `bench`: every variant on every scene with every kind of ray.

mod native;
mod variants;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum as _};
use indicatif::{ProgressBar, ProgressStyle};

use crate::arguments::{at_least_one, name_of};
use crate::environment::Environment;
use crate::measure::{Repeats, timed_in_pairs};
use crate::names::{BuilderName, LayoutName, REFERENCE, RIVAL, StructureName, Variant};
use crate::rays::RayKind;
use crate::record::{Exact, Record, Steps};
use crate::report;
use crate::run_folder::{self, RunFolder};
use crate::scenes::{self, Scene, SceneSource};
use crate::session::Session;
use crate::structure::{Manner, Structure};
use crate::workload::{self, Amount, Traced, Workload};
use crate::{ours, peers, picture, text};

use variants::without_repeats;

/// What to measure. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Adds the mesh files in this folder to the generated scenes; it may hold scenes.toml with cameras and lights
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Structures to build [default: kd; all but tinybvh with --peers; all of ours with --smoke]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    structure: Vec<StructureName>,

    /// Builders, for structures that have them [default for kd: median,binned,exact,fast,balanced,best;
    /// fast,balanced,best with --peers; all with --smoke; all of any other structure]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    builder: Vec<BuilderName>,

    /// Layouts of nodes [default: binary for builders of kd-trees, to compare the trees that they build; wide for the
    /// presets fast, balanced and best and for hierarchies]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    layout: Vec<LayoutName>,

    /// Kinds of rays to trace [default: all]
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    rays: Vec<RayKind>,

    /// Threads that build and trace
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    threads: usize,

    /// Timed repeats, each after one of the baseline [default: 3, fewer if they take seconds; 1 with --smoke]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    samples: Option<usize>,

    /// Of each kind but primary, keep about this many rays, in whole runs of 64 neighbors; 0 keeps all
    /// [default: 65536; 4096 with --smoke]
    #[arg(long, value_name = "N")]
    ray_limit: Option<usize>,

    /// Of each kind, compare at least N answers with a test of every triangle; 20000 make 10⁵ for a scene
    #[arg(long, value_name = "N", default_value_t = 16)]
    check: usize,

    /// Also measure rival libraries; the baseline is then Embree's medium build instead of our balanced one. Embree is the
    /// library file that `KD_EMBREE` names, or else Embree 3 if it is installed, or else Embree 4
    #[arg(long)]
    peers: bool,

    /// This program built for this processor: rivals in Rust run there too, and the faster cells are kept
    /// [`cargo xtask bench --peers` builds one]
    #[arg(long, value_name = "PROGRAM", requires = "peers")]
    native_build: Option<PathBuf>,

    /// This is that program: measure only rivals in Rust
    #[arg(long, hide = true)]
    in_native_build: bool,

    /// Tiny scenes, few rays, one repeat, every builder: a check that the command works, in seconds
    #[arg(long)]
    smoke: bool,

    /// Also write the records to this file
    #[arg(long, value_name = "FILE", overrides_with = "json")]
    json: Option<PathBuf>,

    /// Where the folder of the run goes [default: target/bench of the workspace]
    #[arg(long, value_name = "DIR", overrides_with = "out")]
    out: Option<PathBuf>,
}

/// The amount of work.
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
    repeats: Repeats::all(1),
    rays: Amount {
        side: 128,
        ray_limit: 1 << 12,
        brute_force_tests: 1_000_000,
        least_checked: 0,
    },
    picture_side: 96,
};

/// Measures everything, prints and writes; false if an answer is wrong or a scene cannot be measured.
pub(crate) fn run(arguments: &BenchArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let scene = &arguments.scene;
    let sources = scenes::choose_from(arguments.scenes.as_deref(), scene, arguments.smoke)?;
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
        // After each scene, so that an interrupted run keeps its records.
        run_folder::write(
            &sweep.folder.records(),
            run_folder::json_lines(&sweep.records)?,
        )?;
    }
    sweep.progress.finish_and_clear();
    if let Some(program) = &arguments.native_build
        && !arguments.in_native_build
    {
        println!("Rust rivals again, in {}", program.display());
        if sweep.plan.variants.iter().any(native::measures) {
            let own = native::measure(program, &sweep.folder)?;
            native::keep_better(&mut sweep.records, own);
        }
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
    /// Runs before every timed repeat.
    baseline: Variant,
    kinds: Vec<RayKind>,
    threads: usize,
    effort: Effort,
}

impl Plan {
    fn new(arguments: &BenchArgs) -> anyhow::Result<Self> {
        let mut effort = if arguments.smoke { SMOKE } else { FULL };
        if let Some(pairs) = arguments.samples {
            // An explicit number has no time limit.
            effort.repeats = Repeats::all(pairs);
        }
        effort.rays.ray_limit = arguments.ray_limit.unwrap_or(effort.rays.ray_limit);
        effort.rays.least_checked = arguments.check;
        let kinds = if arguments.rays.is_empty() {
            RayKind::value_variants()
        } else {
            &arguments.rays
        };
        let mut variants = variants::choose(arguments)?;
        variants.retain(|variant| !arguments.in_native_build || native::measures(variant));
        Ok(Self {
            variants,
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
        let (scene, description) = source.load_described()?;
        self.say(&format!("{name}: baseline, rays and their checks"));
        let (plan, environment) = (&self.plan, self.environment.clone());
        let build = |variant: Variant| variant.build(&scene.mesh, plan.threads);
        let reference = build(REFERENCE)?.structure;
        let rival = if plan.baseline == REFERENCE {
            None
        } else {
            Some(build(plan.baseline)?.structure)
        };
        let baseline = rival.as_ref().unwrap_or(&reference);
        let mut session = Session::new(&environment, name, scene.mesh.len(), 1);
        session.repeats = plan.effort.repeats;
        session.workloads = workload::all(&scene, &plan.kinds, plan.effort.rays, &*reference);
        for variant in plan.variants.clone() {
            self.measure_variant(&mut session, &scene, variant, &**baseline)?;
        }
        self.records.append(&mut session.cells);
        self.problems.append(&mut session.problems);
        self.say(&format!("{name}: pictures"));
        let (folder, side) = (&self.folder, self.plan.effort.picture_side);
        run_folder::write(&folder.statistics(name), reference.shape().text)?;
        let shaded = picture::shaded(description, side)?;
        run_folder::write(&folder.picture(name, "shaded"), shaded)?;
        let (heat, scale) = picture::heat(&scene, side)?;
        run_folder::write(&folder.picture(name, "heat"), heat)?;
        run_folder::write(&folder.heat_scale(name), serde_json::to_vec(&scale)?)
    }

    fn measure_variant(
        &mut self,
        session: &mut Session<'_>,
        scene: &Scene,
        variant: Variant,
        baseline: &dyn Structure,
    ) -> anyhow::Result<()> {
        let (name, triangles) = (session.scene.clone(), scene.mesh.len());
        let most = variant.builder.most_triangles();
        if triangles > most {
            let builder = name_of(&variant.builder);
            self.skipped.push(format!(
                "{name}: `{builder}` takes too long above {most} triangles; the scene has {triangles}"
            ));
            self.progress.inc(session.workloads.len() as u64);
            return Ok(());
        }
        self.say(&format!("{name}: {variant}, building"));
        let (threads, over) = (self.plan.threads, self.plan.baseline);
        let builds = timed_in_pairs(
            session.repeats,
            || over.build_seconds(&scene.mesh, threads),
            || variant.build_seconds(&scene.mesh, threads),
        )?;
        // On one thread, so that the peak does not depend on which threads work at the same time.
        let built = variant.build(&scene.mesh, 1)?;
        let of_tree = ours::peak_bytes_of_tree(variant, &scene.mesh)?;
        let structure = built.structure;
        if let Some(flaw) = structure.flaw() {
            self.problems.push(format!("{name} {variant}: {flaw}"));
        }
        let shape = structure.shape();
        let measured = session.cells.len();
        for kind in &self.plan.kinds {
            self.say(&format!("{name}: {variant}, {}", name_of(kind)));
            let steps = steps_of(&*structure, session.workload(*kind));
            let traced = |structure| Traced {
                structure,
                by: Manner::Single,
                threads,
            };
            let cell = session.trace(
                *kind,
                (variant, traced(&*structure)),
                (over, traced(baseline)),
            );
            (cell.timed.build_ms, cell.timed.baseline_build_ms) = builds.scaled(1e3);
            cell.exact = Exact {
                nodes: shape.nodes,
                leaves: shape.leaves,
                empty_leaves: shape.empty_leaves,
                refs: shape.refs,
                depth: shape.depth,
                sah_cost_15_20: shape.sah_cost_15_20,
                sah_cost_own: shape.sah_cost_own,
                bytes_total: shape.bytes_total,
                peak_build_bytes: of_tree.unwrap_or(built.peak_bytes),
                steps,
                ..cell.exact.clone()
            };
            self.progress.inc(1);
        }
        let line = line_of(&session.cells[measured..]);
        self.progress.suspend(|| eprintln!("{line}"));
        Ok(())
    }

    fn conclude(self, arguments: &BenchArgs) -> anyhow::Result<bool> {
        let lines = run_folder::json_lines(&self.records)?;
        run_folder::write(&self.folder.records(), &lines)?;
        report::write(&self.folder, &self.records)?;
        let latest = self.folder.publish_as_latest()?;
        println!("{}", text::summary(&self.records));
        if self.records.iter().any(Record::is_of_rival) {
            println!(
                "ppm: a rival's answers that differ from ours, in a million; (native): times of a build for this processor, where \
                 a rival is faster in one"
            );
        }
        for skipped in &self.skipped {
            println!("skipped: {skipped}");
        }
        let sum = |count: fn(&Exact) -> usize| -> usize {
            self.records.iter().map(|record| count(&record.exact)).sum()
        };
        println!(
            "checked: every tree for missing parts of triangles; {} answers against the reference's, {} of them against a test of \
             every triangle",
            sum(|exact| exact.rays),
            sum(|exact| exact.brute_force_rays)
        );
        run_folder::write_all([arguments.json.clone()], lines)?;
        for path in [self.folder.records(), self.folder.report(), latest] {
            println!("wrote {}", path.display());
        }
        Ok(text::report_problems(&self.problems))
    }
}

/// The times of one variant in a scene, before the tables of all of them.
fn line_of(cells: &[Record]) -> String {
    let Some(first) = cells.first() else {
        return String::new();
    };
    let times = cells
        .iter()
        .map(|cell| format!("{} {:.0}", cell.rays, cell.ns_per_ray()));
    format!(
        "{} {}: built in {:.1} ms; ns per ray: {}",
        first.scene,
        first.variant(),
        first.build_ms(),
        times.collect::<Vec<_>>().join(", ")
    )
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

/// The arguments of a command line, for tests.
#[cfg(test)]
fn parsed<T: Into<std::ffi::OsString> + Clone>(
    arguments: impl IntoIterator<Item = T>,
) -> BenchArgs {
    use clap::FromArgMatches as _;

    let command = BenchArgs::augment_args(clap::Command::new("bench").no_binary_name(true));
    let matches = command.try_get_matches_from(arguments).expect("valid");
    BenchArgs::from_arg_matches(&matches).expect("valid")
}
