//! How fast files are read: each format over reading the bytes, OBJ over `tobj`, and the memory that it takes.

mod generated;

use std::hint::black_box;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::measure::{Pairs, Repeats, in_pairs};
use crate::memory::bytes_during;
use crate::record::{median, median_ratio};
use crate::{run_folder, text};
use generated::Sheet;

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct FilesArgs {
    /// Size of each file, about, in millions of bytes
    #[arg(long, value_name = "MB", default_value_t = 200)]
    size: u64,

    /// Only these kinds of files
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    kind: Vec<Kind>,

    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    samples: usize,

    /// Where the files are written, and removed again [default: the folder of temporary files]
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,

    /// Files of a million bytes: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A kind of files, by format and content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// PLY, little endian
    PlyBinary,
    /// PLY, as text
    PlyText,
    /// STL, binary
    StlBinary,
    /// STL, as text
    StlText,
    /// OBJ of positions and triangles
    Obj,
    /// OBJ with normals and texture coordinates
    ObjFull,
    /// OFF
    Off,
}

impl Kind {
    fn extension(self) -> &'static str {
        match self {
            Self::PlyBinary | Self::PlyText => "ply",
            Self::StlBinary | Self::StlText => "stl",
            Self::Obj | Self::ObjFull => "obj",
            Self::Off => "off",
        }
    }

    /// The most times that reading may take longer than reading the bytes.
    fn goal(self) -> Option<f64> {
        matches!(self, Self::PlyBinary | Self::StlBinary).then_some(4.0)
    }
}

/// A row of the table.
#[derive(Debug, Serialize)]
struct Row {
    rev: String,
    cpu: String,
    kind: String,
    bytes: u64,
    triangles: usize,
    /// Milliseconds to read the file as a mesh, and the bytes alone before each.
    read_ms: Vec<f64>,
    bytes_ms: Vec<f64>,
    /// Milliseconds to read the file as a mesh, and by `tobj` before each.
    obj_ms: Vec<f64>,
    tobj_ms: Vec<f64>,
    /// Bytes at most while the file is read, over those that the mesh keeps.
    peak_over_kept: f64,
}

/// Measures, prints and writes; false if a goal is missed.
pub(crate) fn run(arguments: &FilesArgs) -> anyhow::Result<bool> {
    let environment = Environment::detect();
    let folder = match &arguments.folder {
        Some(folder) => tempfile::tempdir_in(folder),
        None => tempfile::tempdir(),
    };
    let folder = folder.context("a folder of temporary files")?;
    let size = if arguments.smoke { 1 } else { arguments.size };
    let mut rows = Vec::new();
    let mut problems = Vec::new();
    for kind in Kind::value_variants() {
        if !arguments.kind.is_empty() && !arguments.kind.contains(kind) {
            continue;
        }
        let path = folder.path().join(format!("sheet.{}", kind.extension()));
        let sheet = Sheet::of_size(size * 1_000_000, *kind);
        sheet
            .write(&path, *kind)
            .with_context(|| format!("cannot write {}", path.display()))?;
        let row = measure(&path, *kind, arguments.samples, &environment)?;
        anyhow::ensure!(
            row.triangles == sheet.triangles(),
            "{kind:?}: {} triangles",
            row.triangles
        );
        std::fs::remove_file(&path)?;
        // A small file is read in no time.
        if !arguments.smoke {
            problems.extend(row.problems(*kind));
        }
        rows.push(row);
    }
    println!("{}", table(&rows));
    println!(
        "times are medians of {}, in pairs; OBJ is read by tobj 4 without its materials",
        arguments.samples
    );
    if let Some(path) = &arguments.json {
        run_folder::write_all([Some(path.clone())], run_folder::json_lines(&rows)?)?;
    }
    Ok(text::report_problems(&problems))
}

fn measure(
    path: &Path,
    kind: Kind,
    samples: usize,
    environment: &Environment,
) -> anyhow::Result<Row> {
    let (mesh, taken) = bytes_during(|| kd::load_mesh(path));
    let triangles = mesh?.len();
    let repeats = Repeats::all(samples);
    let ours = || -> anyhow::Result<()> {
        black_box(kd::load_mesh(path)?);
        Ok(())
    };
    let bytes = || -> anyhow::Result<()> {
        black_box(std::fs::read(path)?);
        Ok(())
    };
    let over_bytes = in_pairs(repeats, bytes, ours)?;
    let over_tobj = if kind.extension() == "obj" {
        let theirs = || -> anyhow::Result<()> {
            let (models, _) = tobj::load_obj(path, &tobj::LoadOptions::default())?;
            black_box(models);
            Ok(())
        };
        in_pairs(repeats, theirs, ours)?
    } else {
        Pairs::default()
    };
    let (read_ms, bytes_ms) = over_bytes.scaled(1e3);
    let (obj_ms, tobj_ms) = over_tobj.scaled(1e3);
    Ok(Row {
        rev: environment.rev.clone(),
        cpu: environment.cpu.clone(),
        kind: crate::arguments::name_of(&kind),
        bytes: std::fs::metadata(path)?.len(),
        triangles,
        read_ms,
        bytes_ms,
        obj_ms,
        tobj_ms,
        peak_over_kept: taken.peak as f64 / taken.kept.max(1) as f64,
    })
}

impl Row {
    fn over_bytes(&self) -> f64 {
        median_ratio(&self.read_ms, &self.bytes_ms)
    }

    fn over_tobj(&self) -> Option<f64> {
        (!self.obj_ms.is_empty()).then(|| median_ratio(&self.obj_ms, &self.tobj_ms))
    }

    /// The goals that are missed.
    fn problems(&self, kind: Kind) -> Vec<String> {
        let mut problems = Vec::new();
        let over_bytes = self.over_bytes();
        if kind.goal().is_some_and(|goal| over_bytes > goal) {
            problems.push(format!(
                "{}: {over_bytes:.2} times as long as its bytes",
                self.kind
            ));
        }
        if let Some(over_tobj) = self.over_tobj().filter(|ratio| *ratio > 1.0) {
            problems.push(format!(
                "{}: {over_tobj:.2} times as long as tobj",
                self.kind
            ));
        }
        if self.peak_over_kept > 2.0 {
            let peak = self.peak_over_kept;
            problems.push(format!(
                "{}: {peak:.2} times the memory that it keeps",
                self.kind
            ));
        }
        problems
    }
}

fn table(rows: &[Row]) -> String {
    let head = [
        "file",
        "MB",
        "triangles",
        "ms",
        "/ its bytes",
        "/ tobj",
        "peak / kept",
    ];
    let mut table = text::empty_table(head);
    for row in rows {
        table.add_row([
            row.kind.clone(),
            format!("{:.0}", row.bytes as f64 * 1e-6),
            row.triangles.to_string(),
            format!("{:.0}", median(&row.read_ms)),
            format!("{:.2}", row.over_bytes()),
            row.over_tobj()
                .map_or_else(String::new, |ratio| format!("{ratio:.2}")),
            format!("{:.2}", row.peak_over_kept),
        ]);
    }
    text::align_right(&mut table, 1);
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        for kind in Kind::value_variants() {
            let sheet = Sheet::of_size(20_000, *kind);
            let path = folder.path().join(format!("a.{}", kind.extension()));
            sheet.write(&path, *kind).expect("written");
            let bytes = std::fs::metadata(&path).expect("there").len();
            assert!(
                (10_000..40_000).contains(&bytes),
                "{kind:?} has {bytes} bytes"
            );
            let mesh = kd::load_mesh(&path).expect("read");
            assert_eq!(mesh.len(), sheet.triangles(), "{kind:?}");
            let area: f32 = (0..)
                .take(mesh.len())
                .map(|i| mesh.normal(i).length())
                .sum();
            assert!(area > 0.0 && area.is_finite(), "{kind:?}: {area}");
        }
    }
}
