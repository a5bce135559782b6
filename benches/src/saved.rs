//! Trees in files: how long they take to save, to load and to open, and the memory that it takes.
#![allow(
    unsafe_code,
    reason = "`open` is unsafe: the files of this command do not change while they are open"
)]

use std::fs::File;
use std::hint::black_box;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use kd::{BuildOptions, KdTree, Mesh, Ray};
use serde::Serialize;

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::measure::{Repeats, in_pairs};
use crate::memory::peak_of_all_threads_during;
use crate::record::{median, median_ratio};
use crate::{run_folder, text};

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct SavedArgs {
    /// Millions of triangles of the generated terrain
    #[arg(long, value_name = "N", default_value_t = 10.0)]
    millions: f64,

    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    samples: usize,

    /// Where the file is written, and removed again [default: the folder of temporary files]
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,

    /// Only build, and print the peak of memory
    #[arg(long)]
    only_build: bool,

    /// A small terrain: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write the row to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What was measured. Times are in milliseconds.
#[derive(Debug, Default, Serialize)]
struct Row {
    rev: String,
    cpu: String,
    triangles: usize,
    build_ms: f64,
    /// Bytes at most that were allocated during the build, with the mesh. Some of them are never touched.
    build_peak_bytes: usize,
    /// Bytes at most that were resident until the end of the build.
    build_resident_bytes: Option<u64>,
    file_bytes: u64,
    /// Bytes at most during a save, above those of the tree.
    save_peak_bytes: usize,
    save_ms: Vec<f64>,
    /// To write as many bytes before each save, and to force them to the disk as a save does.
    write_ms: Vec<f64>,
    load_ms: Vec<f64>,
    /// To read as many bytes before each load.
    read_ms: Vec<f64>,
    open_verified_ms: Vec<f64>,
    /// From `open` to the first hit, before each open that verifies.
    first_ray_ms: Vec<f64>,
    /// Bytes of the file that are resident in this process after rays.
    resident: Vec<Resident>,
}

#[derive(Debug, Serialize)]
struct Resident {
    rays: usize,
    bytes: u64,
}

/// The most milliseconds until the first ray.
const FIRST_RAY_GOAL_MS: f64 = 50.0;
/// The most bytes of a build of fifty million triangles.
const BUILD_GOAL_BYTES: f64 = 12.0 * GIB;
const GIB: f64 = (1_u64 << 30) as f64;

/// Measures, prints and writes; false if a goal is missed.
pub(crate) fn run(arguments: &SavedArgs) -> anyhow::Result<bool> {
    let environment = Environment::detect();
    let millions = if arguments.smoke {
        0.002
    } else {
        arguments.millions
    };
    let (built, build_peak_bytes) = peak_of_all_threads_during(|| {
        let mesh = terrain(millions * 1e6);
        let start = std::time::Instant::now();
        let tree = KdTree::build(mesh, &BuildOptions::balanced());
        tree.map(|tree| (tree, start.elapsed().as_secs_f64() * 1e3))
    });
    let (tree, build_ms) = built?;
    let mut row = Row {
        rev: environment.rev,
        cpu: environment.cpu,
        triangles: tree.mesh().len(),
        build_ms,
        build_peak_bytes,
        build_resident_bytes: status_bytes("VmHWM:"),
        ..Row::default()
    };
    if !arguments.only_build {
        let folder = match &arguments.folder {
            Some(folder) => tempfile::tempdir_in(folder),
            None => tempfile::tempdir(),
        };
        let folder = folder.context("a folder of temporary files")?;
        row.measure(tree, &folder.path().join("terrain.kd"), arguments.samples)?;
    }
    println!("{}", row.table());
    if let Some(path) = &arguments.json {
        run_folder::write_all([Some(path.clone())], run_folder::json_lines([&row])?)?;
    }
    Ok(text::report_problems(&row.problems()))
}

/// A square of waves with hills, of about this number of triangles.
fn terrain(triangles: f64) -> Mesh {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few thousand"
    )]
    let side = (triangles / 2.0).sqrt().round() as u32;
    let place = |row: u32, column: u32| {
        let [x, y] = [row, column].map(|at| at as f32 / side as f32);
        let waves = 0.01 * (90.0 * x).sin() * (70.0 * y).cos();
        [x, y, waves + 0.1 * (9.0 * x * y).sin()]
    };
    let rows = (0..=side).flat_map(|row| (0..=side).map(move |column| place(row, column)));
    let squares = (0..side).flat_map(|row| {
        (0..side).flat_map(move |column| {
            let corner = row * (side + 1) + column;
            let next = corner + side + 1;
            [[corner, next, next + 1], [corner, next + 1, corner + 1]]
        })
    });
    Mesh::new(rows.collect(), squares.collect()).expect("finite, and all vertices are there")
}

/// A ray straight down on the terrain, another one for each number.
fn ray(number: usize) -> Ray {
    let place = |step: f64| {
        let place = (0.5 + step * number as f64).fract();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
        let place = place as f32;
        place
    };
    // Steps of an even spread (Roberts).
    let at = [place(0.754_877_666), place(0.569_840_291), 1.0];
    Ray::new(at, [0.0, 0.0, -1.0])
}

fn open(path: &Path) -> anyhow::Result<KdTree> {
    // SAFETY: this command saved the file, and changes it only after the tree is dropped.
    Ok(unsafe { KdTree::open(path) }?)
}

impl Row {
    fn measure(&mut self, tree: KdTree, path: &Path, samples: usize) -> anyhow::Result<()> {
        let (saved, peak) = peak_of_all_threads_during(|| tree.save(path));
        saved?;
        self.save_peak_bytes = peak;
        self.file_bytes = std::fs::metadata(path)?.len();
        let expected: Vec<_> = (0..1000)
            .map(|number| tree.intersect(&ray(number)))
            .collect();
        let repeats = Repeats::all(samples);

        let bytes = std::fs::read(path)?;
        let other = path.with_extension("bytes");
        let write = || -> anyhow::Result<()> {
            let mut file = File::create(&other)?;
            file.write_all(&bytes)?;
            Ok(file.sync_all()?)
        };
        let saves = in_pairs(repeats, write, || Ok(tree.save(path)?))?;
        (self.save_ms, self.write_ms) = saves.scaled(1e3);
        std::fs::remove_file(&other)?;
        drop(bytes);
        drop(tree);

        let read = || -> anyhow::Result<()> {
            black_box(std::fs::read(path)?);
            Ok(())
        };
        let load = || -> anyhow::Result<()> {
            black_box(KdTree::load(path)?);
            Ok(())
        };
        (self.load_ms, self.read_ms) = in_pairs(repeats, read, load)?.scaled(1e3);

        let first_ray = || -> anyhow::Result<KdTree> {
            let tree = open(path)?;
            black_box(tree.intersect(&ray(0)));
            Ok(tree)
        };
        let verified = || -> anyhow::Result<KdTree> {
            // SAFETY: nothing changes the file.
            Ok(unsafe { KdTree::open_verified(path) }?)
        };
        let opens = in_pairs(repeats, first_ray, verified)?;
        (self.open_verified_ms, self.first_ray_ms) = opens.scaled(1e3);

        let resident_file_bytes = || status_bytes("RssFile:");
        let before = resident_file_bytes().unwrap_or(0);
        let opened = open(path)?;
        let mut traced = 0;
        for rays in [0, 1, 10, 100, 1000] {
            for (number, expected) in (traced..).zip(&expected[traced..rays]) {
                let hit = opened.intersect(&ray(number));
                anyhow::ensure!(hit == *expected, "ray {number}: {hit:?}");
            }
            traced = rays;
            if let Some(bytes) = resident_file_bytes() {
                let bytes = bytes.saturating_sub(before);
                self.resident.push(Resident { rays, bytes });
            }
        }
        Ok(())
    }

    fn table(&self) -> String {
        let mut table = text::empty_table(["", "", "over"]);
        let mib = |bytes: f64| format!("{:.1} MiB", bytes / (1 << 20) as f64);
        let ms = |times: &[f64]| format!("{:.3} ms", median(times));
        let mut add = |name: String, value: String, over: String| {
            table.add_row([name, value, over]);
        };
        add(
            "triangles".into(),
            self.triangles.to_string(),
            String::new(),
        );
        add(
            "build".into(),
            format!("{:.0} ms", self.build_ms),
            String::new(),
        );
        add(
            "most allocated by the build".into(),
            mib(self.build_peak_bytes as f64),
            format!(
                "{:.0} bytes a triangle",
                self.build_peak_bytes as f64 / self.triangles as f64
            ),
        );
        if let Some(bytes) = self.build_resident_bytes {
            add(
                "most resident until it ends".into(),
                mib(bytes as f64),
                format!(
                    "{:.0} bytes a triangle",
                    bytes as f64 / self.triangles as f64
                ),
            );
        }
        if self.file_bytes > 0 {
            let over = |own: &[f64], other: &[f64], what: &str| {
                format!("{:.2} x {what}", median_ratio(own, other))
            };
            add(
                "file".into(),
                mib(self.file_bytes as f64),
                format!(
                    "{:.1} bytes a triangle",
                    self.file_bytes as f64 / self.triangles as f64
                ),
            );
            add(
                "save".into(),
                ms(&self.save_ms),
                over(&self.save_ms, &self.write_ms, "writing the bytes"),
            );
            add(
                "most memory of a save".into(),
                mib(self.save_peak_bytes as f64),
                String::new(),
            );
            add(
                "load".into(),
                ms(&self.load_ms),
                over(&self.load_ms, &self.read_ms, "reading the bytes"),
            );
            add(
                "open and verify".into(),
                ms(&self.open_verified_ms),
                format!(
                    "{:.3} of load",
                    median(&self.open_verified_ms) / median(&self.load_ms)
                ),
            );
            add(
                "open and the first ray".into(),
                ms(&self.first_ray_ms),
                over(
                    &self.first_ray_ms,
                    &self.open_verified_ms,
                    "open and verify",
                ),
            );
        }
        for resident in &self.resident {
            add(
                format!("resident after {} rays", resident.rays),
                mib(resident.bytes as f64),
                format!(
                    "{:.4} of the file",
                    resident.bytes as f64 / self.file_bytes as f64
                ),
            );
        }
        text::align_right(&mut table, 1);
        table.to_string()
    }

    /// The goals that are missed.
    fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        let first = median_or_zero(&self.first_ray_ms);
        if first > FIRST_RAY_GOAL_MS {
            problems.push(format!("the first ray takes {first:.1} ms"));
        }
        let peak = self.build_resident_bytes.unwrap_or(0);
        let per_triangle = peak as f64 / self.triangles as f64;
        if self.triangles > 1_000_000 && per_triangle * 50e6 > BUILD_GOAL_BYTES {
            let gib = per_triangle * 50e6 / GIB;
            problems.push(format!("50 million triangles would need {gib:.1} GiB"));
        }
        problems
    }
}

fn median_or_zero(times: &[f64]) -> f64 {
    if times.is_empty() { 0.0 } else { median(times) }
}

/// A number of bytes of this process; `None` where the system does not say.
fn status_bytes(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(name))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_terrain_can_be_measured() {
        let mesh = terrain(5000.0);
        assert_eq!(mesh.len(), 5000);
        let tree = KdTree::build(mesh, &BuildOptions::balanced()).expect("valid");
        let hits = (0..100).filter(|number| tree.occluded(&ray(*number)));
        assert_eq!(hits.count(), 100, "rays meet the terrain");
        let folder = tempfile::tempdir().expect("a folder");
        let mut row = Row {
            triangles: 5000,
            ..Row::default()
        };
        let path = folder.path().join("a.kd");
        row.measure(tree, &path, 1).expect("saved and opened");
        assert!(row.file_bytes > 5000 * 60, "{row:?}");
        assert_eq!(row.problems(), Vec::<String>::new());
    }
}
