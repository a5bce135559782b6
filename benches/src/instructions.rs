//! Instructions per ray: equal in every run of the same program, independent of the load of the machine.
//!
//! valgrind runs this program for each kind of ray and each way to trace it, over one generated scene, and counts the
//! instructions inside one function.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use anyhow::Context as _;
use clap::{Args, ValueEnum as _};
use kd::{BuildOptions, KdTree};
use serde_json::json;

use crate::arguments::name_of;
use crate::check::Answers;
use crate::environment::Environment;
use crate::names::{BuilderName, LayoutName, Variant};
use crate::rays::RayKind;
use crate::record::Record;
use crate::run_folder;
use crate::scenes;
use crate::session::{Session, rays_name};
use crate::structure::{Manner, Structure as _};
use crate::text;
use crate::workload::{self, Amount, Workload};

/// The traced scene: rooms and clutter, small and large triangles.
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
    if let (Some(kind), Some(layout)) = (arguments.inside, arguments.layout) {
        let (tree, workload) = prepare(kind, layout)?;
        let mut answers = Answers::none(kind, workload.rays.len());
        rays_that_are_counted(&tree, arguments.by, &workload, &mut answers);
        black_box(answers);
        return Ok(true);
    }
    let environment = Environment::detect();
    let mut session = Session::new(&environment, SCENE, 0, 1);
    let kinds = RayKind::value_variants();
    let head = ["instructions per ray".to_owned()].into_iter();
    let mut table = text::empty_table(head.chain(kinds.iter().map(name_of)));
    let mut lines = String::new();
    for (layout, by) in WAYS {
        let mut row = vec![format!("{}, {}", layout.name(), name_of(&by))];
        for kind in kinds {
            let (_, workload) = prepare(*kind, layout)?;
            let subject = Variant::kd(BuilderName::Balanced, layout).to_string();
            let mut cell = session.blank(&subject, &rays_name(*kind, by), 1, "");
            let instructions = count(*kind, (layout, by))?;
            let per_ray = instructions as f64 / workload.rays.len() as f64;
            cell.exact.rays = workload.rays.len();
            cell.exact.instructions = Some(instructions);
            row.push(format!("{per_ray:.1}"));
            lines += &line(session.add(cell), name_of(kind), name_of(&by), per_ray)?;
        }
        table.add_row(row);
    }
    text::align_right(&mut table, 1);
    println!("{table}");
    run_folder::write_all([arguments.json.clone()], lines)?;
    Ok(true)
}

fn line(cell: &Record, rays: String, by: String, per_ray: f64) -> anyhow::Result<String> {
    let line = json!({
        "scene": cell.scene,
        "layout": cell.layout,
        "by": by,
        "rays": rays,
        "instructions_per_ray": per_ray,
        "rev": cell.rev,
        "rustc": cell.rustc,
    });
    Ok(serde_json::to_string(&line)? + "\n")
}

fn prepare(kind: RayKind, layout: LayoutName) -> anyhow::Result<(KdTree, Workload)> {
    let sources = scenes::choose_from(None, &[SCENE.to_owned()], true)?;
    let scene = sources.first().context("the scene exists")?.load()?;
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

/// The instructions of all rays.
fn count(kind: RayKind, (layout, by): Way) -> anyhow::Result<u64> {
    let out = std::env::temp_dir().join(format!("kd-instructions-{}", std::process::id()));
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--toggle-collect=*rays_that_are_counted*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args(["instructions", "--inside", &name_of(&kind), "--layout", layout.name(), "--by", &name_of(&by)])
        .status()
        .context("valgrind counts instructions; on Debian and Ubuntu, `apt-get install valgrind` installs it")?;
    anyhow::ensure!(status.success(), "valgrind: {status}");
    let counted = total(&out);
    std::fs::remove_file(&out).ok();
    counted
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
