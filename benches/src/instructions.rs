//! Instructions per ray, counted and not timed: the same on every run of the same program, however busy the machine is.
//!
//! valgrind runs this program once more for each kind of ray and layout, over one generated scene, and counts what happens
//! inside one function.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context as _;
use clap::{Args, ValueEnum as _};
use serde_json::json;

use crate::check::Answers;
use crate::cli::name_of;
use crate::environment::Environment;
use crate::rays::RayKind;
use crate::run_folder;
use crate::scenes;
use crate::structure::{BuilderName, LayoutName, Structure, StructureName, Variant};
use crate::terminal;
use crate::workload::{self, Amount, Workload};

/// The scene that is traced: rooms and clutter, small and large triangles.
const SCENE: &str = "gears";
const LAYOUTS: [LayoutName; 2] = [LayoutName::Wide, LayoutName::Binary];

/// How many rays of a kind: more make no difference, and valgrind takes fifty times as long as the machine.
const AMOUNT: Amount = Amount {
    side: 64,
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
}

/// Counts and prints, or is what is counted.
pub(crate) fn run(arguments: &InstructionsArgs) -> anyhow::Result<bool> {
    if let (Some(kind), Some(layout)) = (arguments.inside, arguments.layout) {
        let (structure, workload) = prepare(kind, layout)?;
        let mut answers = Answers::none(kind, workload.rays.len());
        rays_that_are_counted(&*structure, &workload, &mut answers);
        black_box(answers);
        return Ok(true);
    }
    let Environment { rev, rustc, .. } = Environment::detect();
    let mut lines = String::new();
    let mut head = vec!["instructions per ray".to_owned()];
    head.extend(RayKind::value_variants().iter().map(name_of));
    let mut table = terminal::empty_table(head);
    for layout in LAYOUTS {
        let mut row = vec![layout.name()];
        for kind in RayKind::value_variants() {
            let (_, workload) = prepare(*kind, layout)?;
            let per_ray = count(*kind, layout)? as f64 / workload.rays.len() as f64;
            row.push(format!("{per_ray:.1}"));
            let line = json!({
                "scene": SCENE,
                "layout": layout.name(),
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

fn prepare(kind: RayKind, layout: LayoutName) -> anyhow::Result<(Box<dyn Structure>, Workload)> {
    let sources = scenes::choose_from(None, &[SCENE.to_owned()], true)?;
    let scene = sources.first().context("a scene was asked for")?.load()?;
    let variant = Variant {
        structure: StructureName::Kd,
        builder: BuilderName::Balanced,
        layout,
    };
    let structure = variant.build(&scene.mesh, 1)?.structure;
    let mut workloads = workload::all(&scene, &[kind], AMOUNT, &*structure);
    let workload = workloads.pop().context("one kind was asked for")?;
    Ok((structure, workload))
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
fn count(kind: RayKind, layout: LayoutName) -> anyhow::Result<u64> {
    let out = std::env::temp_dir().join(format!("kd-instructions-{}", std::process::id()));
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--toggle-collect=*rays_that_are_counted*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args(["instructions", "--inside", &name_of(&kind), "--layout", &layout.name()])
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
