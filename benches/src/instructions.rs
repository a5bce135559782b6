//! Instructions per ray: equal in every run of the same program, independent of the load of the machine. Those of batches vary a
//! little, since a batch chooses its ways by measured times.
//!
//! valgrind runs this program for each scene, each kind of ray and each way to trace it, and counts the instructions inside one
//! function.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use anyhow::Context as _;
use clap::{Args, ValueEnum as _};
use kd::{BuildOptions, KdTree};
use serde::{Deserialize, Serialize};

use crate::arguments::name_of;
use crate::check::Answers;
use crate::environment::Environment;
use crate::names::LayoutName;
use crate::rays::RayKind;
use crate::run_folder;
use crate::scenes::{self, SceneSource};
use crate::structure::{Manner, Structure as _};
use crate::text;
use crate::workload::{self, Amount, Workload};

/// The scene without `--scene`: rooms and clutter, small and large triangles.
const SCENE: &str = "gears";

/// A layout, and the way to trace rays.
type Way = (LayoutName, Manner);

const WAYS: [Way; 4] = [
    (LayoutName::Wide, Manner::Single),
    (LayoutName::Wide, Manner::Packets),
    (LayoutName::Wide, Manner::Batch),
    (LayoutName::Binary, Manner::Single),
];

/// The rays of a kind: a picture of usual size, since batches depend on the distance of neighbors, and no more, since valgrind
/// is fifty times slower than the machine.
const AMOUNT: Amount = Amount {
    side: 512,
    ray_limit: 1 << 12,
    brute_force_tests: 0,
    least_checked: 0,
};

/// What to count.
#[derive(Args, Debug)]
pub(crate) struct InstructionsArgs {
    /// Count in these scenes, in their smallest form; `gears` by default
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = SCENE)]
    scene: Vec<String>,

    /// A folder of mesh files that `--scene` may name
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Also print the ratio of each count over that of an earlier run, which `--json` wrote to this file
    #[arg(long, value_name = "FILE")]
    over: Option<PathBuf>,

    /// Also write the counts to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Trace rays of this kind and exit, for valgrind
    #[arg(long, value_name = "KIND", hide = true, requires = "layout")]
    inside: Option<RayKind>,

    /// The layout
    #[arg(long, value_name = "NAME", hide = true)]
    layout: Option<LayoutName>,

    /// The way to trace
    #[arg(long, value_name = "MANNER", hide = true, default_value = "single")]
    by: Manner,
}

/// Counts and prints, or traces the rays that are counted.
pub(crate) fn run(arguments: &InstructionsArgs) -> anyhow::Result<bool> {
    let folder = arguments.scenes.as_deref();
    let sources = scenes::choose_from(folder, &arguments.scene, true)?;
    if let (Some(kind), Some(layout)) = (arguments.inside, arguments.layout) {
        let source = sources.first().context("a scene was requested")?;
        let (tree, workload) = prepare(source, kind, layout)?;
        let mut answers = Answers::none(kind, workload.rays.len());
        rays_that_are_counted(&tree, arguments.by, &workload, &mut answers);
        black_box(answers);
        return Ok(true);
    }
    let earlier = match &arguments.over {
        Some(path) => Count::read(path)?,
        None => Vec::new(),
    };
    let environment = Environment::detect();
    let kinds = RayKind::value_variants();
    let mut counts = Vec::new();
    for source in &sources {
        let head = [format!("{}: instructions per ray", source.name)];
        let mut table = text::empty_table(head.into_iter().chain(kinds.iter().map(name_of)));
        for way in WAYS {
            let of_kind = |kind: &RayKind| {
                let instructions_per_ray = count(source, folder, *kind, way)?;
                Ok(Count::new(
                    &environment,
                    source,
                    *kind,
                    way,
                    instructions_per_ray,
                ))
            };
            let row: Vec<Count> = kinds.iter().map(of_kind).collect::<anyhow::Result<_>>()?;
            let name = format!("{}, {}", way.0.name(), name_of(&way.1));
            table.add_row(
                [name]
                    .into_iter()
                    .chain(row.iter().map(|count| count.text(&earlier))),
            );
            counts.extend(row);
        }
        text::align_right(&mut table, 1);
        println!("{table}");
    }
    run_folder::write_all([arguments.json.clone()], run_folder::json_lines(&counts)?)?;
    Ok(true)
}

/// One line of the file that `--json` names.
#[derive(Debug, Deserialize, Serialize)]
struct Count {
    scene: String,
    layout: String,
    by: String,
    rays: String,
    instructions_per_ray: f64,
    rev: String,
    rustc: String,
}

impl Count {
    fn new(
        environment: &Environment,
        source: &SceneSource,
        kind: RayKind,
        (layout, by): Way,
        instructions_per_ray: f64,
    ) -> Self {
        Self {
            scene: source.family().to_owned(),
            layout: layout.name().to_owned(),
            by: name_of(&by),
            rays: name_of(&kind),
            instructions_per_ray,
            rev: environment.rev.clone(),
            rustc: environment.rustc.clone(),
        }
    }

    fn read(file: &Path) -> anyhow::Result<Vec<Self>> {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let counts = text.lines().map(serde_json::from_str);
        let counts: Result<_, _> = counts.collect();
        counts.with_context(|| file.display().to_string())
    }

    /// The cell of the table, with the ratio over an earlier count of the same rays.
    fn text(&self, earlier: &[Self]) -> String {
        let names =
            |count: &Self| [&count.scene, &count.layout, &count.by, &count.rays].map(String::clone);
        let now = self.instructions_per_ray;
        match earlier.iter().find(|count| names(count) == names(self)) {
            Some(before) => format!("{now:.1} ({:.3})", now / before.instructions_per_ray),
            None => format!("{now:.1}"),
        }
    }
}

fn prepare(
    source: &SceneSource,
    kind: RayKind,
    layout: LayoutName,
) -> anyhow::Result<(KdTree, Workload)> {
    let scene = source.load()?;
    let options = BuildOptions::balanced()
        .with_threads(1)
        .with_layout(layout.layout());
    let tree = KdTree::build(Arc::clone(&scene.mesh), &options)?;
    let mut workloads = workload::all(&scene, &[kind], AMOUNT, &tree);
    let workload = workloads.pop().context("one kind was requested")?;
    Ok((tree, workload))
}

/// The function that valgrind counts, found by its name.
#[inline(never)]
fn rays_that_are_counted(tree: &KdTree, by: Manner, workload: &Workload, answers: &mut Answers) {
    match answers {
        Answers::Closest(hits) => tree.closest(by, &workload.rays, hits),
        Answers::Any(hits) => tree.any(by, &workload.rays, hits),
    }
}

/// Instructions per ray.
fn count(
    source: &SceneSource,
    folder: Option<&Path>,
    kind: RayKind,
    (layout, by): Way,
) -> anyhow::Result<f64> {
    let (_, workload) = prepare(source, kind, layout)?;
    let out = std::env::temp_dir().join(format!("kd-instructions-{}", std::process::id()));
    let mut command = Command::new("valgrind");
    command
        .args([
            "--tool=callgrind",
            "--quiet",
            "--toggle-collect=*rays_that_are_counted*",
        ])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args([
            "instructions",
            "--scene",
            &source.name,
            "--inside",
            &name_of(&kind),
        ])
        .args(["--layout", layout.name(), "--by", &name_of(&by)]);
    if let Some(folder) = folder {
        command.arg("--scenes").arg(folder);
    }
    let status = command.status().context(
        "valgrind counts instructions; on Debian and Ubuntu, `apt-get install valgrind` installs it",
    )?;
    anyhow::ensure!(status.success(), "valgrind: {status}");
    let counted = total(&out);
    std::fs::remove_file(&out).ok();
    Ok(counted? as f64 / workload.rays.len() as f64)
}

/// The sum at the end of callgrind's file.
fn total(file: &Path) -> anyhow::Result<u64> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let mut sums = text
        .lines()
        .filter_map(|line| line.strip_prefix("totals: "));
    let sum = sums.next_back().context("callgrind wrote no totals")?;
    Ok(sum.trim().parse()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("counts");
        std::fs::write(&file, "events: Ir\nfn=(1) main\n3 400\ntotals: 1234\n").expect("written");
        assert_eq!(total(&file).expect("totals"), 1234);
        std::fs::write(&file, "events: Ir\n").expect("written");
        assert!(total(&file).is_err(), "none");
    }
}
