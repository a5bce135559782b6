//! Instructions per ray, counted and not timed: the same on every run of the same program, however busy the machine is.
//!
//! valgrind runs this program once more for each kind of ray and each way to trace it, over one generated scene, and counts
//! what happens inside one function.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use anyhow::Context as _;
use clap::{Args, ValueEnum as _};
use kd::{BuildOptions, KdTree};
use serde_json::json;

use crate::check::Answers;
use crate::cli::name_of;
use crate::environment::Environment;
use crate::rays::RayKind;
use crate::run_folder;
use crate::scenes;
use crate::structure::{Asked, LayoutName, Manner, Structure};
use crate::terminal;
use crate::workload::{self, Amount, Workload};

/// The scene that is traced: rooms and clutter, small and large triangles.
const SCENE: &str = "gears";

/// A way to trace rays.
#[derive(Clone, Copy, Debug)]
struct Way {
    layout: LayoutName,
    /// One by one if nothing is said.
    by: Option<Manner>,
}

const WAYS: [Way; 4] = [
    Way {
        layout: LayoutName::Wide,
        by: None,
    },
    Way {
        layout: LayoutName::Wide,
        by: Some(Manner::Packets),
    },
    Way {
        layout: LayoutName::Wide,
        by: Some(Manner::Batch),
    },
    Way {
        layout: LayoutName::Binary,
        by: None,
    },
];

impl Way {
    fn name(self) -> String {
        let (layout, by) = (self.layout.name(), self.by_name());
        format!("{layout}, {by}")
    }

    fn by_name(self) -> String {
        self.by.map_or_else(|| "single".into(), |by| name_of(&by))
    }
}

/// How many rays of a kind: a picture of usual size, since batches live from how near to each other rays are, and no more,
/// since valgrind takes fifty times as long as the machine.
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

    /// Trace rays of this kind and end: what runs inside valgrind
    #[arg(long, value_name = "KIND", hide = true, requires = "layout")]
    inside: Option<RayKind>,

    /// In this layout
    #[arg(long, value_name = "NAME", hide = true)]
    layout: Option<LayoutName>,

    /// Put together so
    #[arg(long, value_name = "MANNER", hide = true)]
    by: Option<Manner>,
}

/// Counts and prints, or is what is counted.
pub(crate) fn run(arguments: &InstructionsArgs) -> anyhow::Result<bool> {
    if let (Some(kind), Some(layout)) = (arguments.inside, arguments.layout) {
        let way = Way {
            layout,
            by: arguments.by,
        };
        let (tree, workload) = prepare(kind, way)?;
        let mut answers = Answers::none(kind, workload.rays.len());
        let asked = way.by.map(|by| Asked { tree: &tree, by });
        let structure: &dyn Structure = match &asked {
            Some(asked) => asked,
            None => &tree,
        };
        rays_that_are_counted(structure, &workload, &mut answers);
        black_box(answers);
        return Ok(true);
    }
    let Environment { rev, rustc, .. } = Environment::detect();
    let mut lines = String::new();
    let mut head = vec!["instructions per ray".to_owned()];
    head.extend(RayKind::value_variants().iter().map(name_of));
    let mut table = terminal::empty_table(head);
    for way in WAYS {
        let mut row = vec![way.name()];
        for kind in RayKind::value_variants() {
            let (_, workload) = prepare(*kind, way)?;
            let per_ray = count(*kind, way)? as f64 / workload.rays.len() as f64;
            row.push(format!("{per_ray:.1}"));
            let line = json!({
                "scene": SCENE,
                "layout": way.layout.name(),
                "by": way.by_name(),
                "rays": name_of(kind),
                "instructions_per_ray": per_ray,
                "rev": rev,
                "rustc": rustc,
            });
            lines += &serde_json::to_string(&line)?;
            lines.push('\n');
        }
        table.add_row(row);
    }
    terminal::align_right(&mut table, 1);
    println!("{table}");
    if let Some(path) = &arguments.json {
        run_folder::write(path, lines)?;
        println!("wrote {}", path.display());
    }
    Ok(true)
}

fn prepare(kind: RayKind, way: Way) -> anyhow::Result<(KdTree, Workload)> {
    let sources = scenes::choose_from(None, &[SCENE.to_owned()], true)?;
    let scene = sources.first().context("a scene was asked for")?.load()?;
    let options = BuildOptions::balanced()
        .with_threads(1)
        .with_layout(way.layout.layout());
    let tree = KdTree::build(Arc::clone(&scene.mesh), &options)?;
    let mut workloads = workload::all(&scene, &[kind], AMOUNT, &tree);
    let workload = workloads.pop().context("one kind was asked for")?;
    Ok((tree, workload))
}

/// What valgrind counts. Its name is how it is found.
#[inline(never)]
fn rays_that_are_counted(structure: &dyn Structure, workload: &Workload, answers: &mut Answers) {
    match answers {
        Answers::Closest(hits) => structure.closest(&workload.rays, hits),
        Answers::Any(hits) => structure.any(&workload.rays, hits),
    }
}

/// The instructions of all rays.
fn count(kind: RayKind, way: Way) -> anyhow::Result<u64> {
    let by = way.by.map(|by| ["--by".to_owned(), name_of(&by)]);
    let out = std::env::temp_dir().join(format!("kd-instructions-{}", std::process::id()));
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--toggle-collect=*rays_that_are_counted*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args(["instructions", "--inside", &name_of(&kind), "--layout", &way.layout.name()])
        .args(by.into_iter().flatten())
        .status()
        .context("valgrind counts instructions; on Debian and Ubuntu, `apt-get install valgrind` installs it")?;
    anyhow::ensure!(status.success(), "valgrind: {status}");
    let counted = total(&out);
    std::fs::remove_file(&out).ok();
    counted
}

/// The sum that callgrind writes at the end of its file.
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
        assert_eq!(total(&file).expect("there is one"), 1234);
        std::fs::write(&file, "events: Ir\n").expect("written");
        assert!(total(&file).is_err(), "none");
    }
}
