//! Rivals written in Rust, measured in a second build of this program, for this processor.
//!
//! A rival may be faster where the compiler may use every instruction of the processor, as its users can allow. Ours detects
//! them at run time, so it is measured in the default build only.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context as _;

use crate::names::Variant;
use crate::record::{self, Record};
use crate::run_folder::RunFolder;

/// Whether a variant is measured in the second build: the rivals written in Rust.
pub(crate) fn measures(variant: &Variant) -> bool {
    variant.is_rival() && variant.structure.is_rust_rival()
}

/// Runs the other program with the arguments of this one. There, too, Embree runs before every repeat.
pub(crate) fn measure(program: &Path, folder: &RunFolder) -> anyhow::Result<Vec<Record>> {
    let (records, scratch) = (folder.native_records(), folder.scratch());
    let status = Command::new(program)
        .args(call(std::env::args_os().skip(1), [&records, &scratch]))
        .stdout(std::process::Stdio::null())
        .status()
        .with_context(|| format!("cannot start {}", program.display()))?;
    std::fs::remove_dir_all(&scratch).ok();
    // Wrong answers end it with 1, and are in the records.
    anyhow::ensure!(
        matches!(status.code(), Some(0 | 1)) && records.exists(),
        "{}: {status}",
        program.display()
    );
    record::read(&records)
}

/// The arguments of this run, for the rivals written in Rust alone; the last file and folder count.
fn call(
    own: impl Iterator<Item = OsString>,
    [records, out]: [&PathBuf; 2],
) -> impl Iterator<Item = OsString> {
    let more = ["--in-native-build".into(), "--json".into(), records.into()];
    own.chain(more).chain(["--out".into(), out.into()])
}

/// Replaces each row of `records`, which is a variant on a scene, by that of `native` if its rays are faster there, by
/// the geometric mean over their kinds.
pub(crate) fn keep_better(records: &mut [Record], native: Vec<Record>) {
    let speeds = |of: &[Record], like: &Record| {
        let row = of.iter().filter(|record| is_same_row(record, like));
        row.map(|record| record.trace_speed().ln()).sum::<f64>()
    };
    let is_better = |like: &&Record| speeds(&native, like) > speeds(records, like);
    let better: Vec<Record> = native.iter().filter(is_better).cloned().collect();
    for faster in better {
        let known = records
            .iter_mut()
            .find(|record| record.cell() == faster.cell());
        if let Some(record) = known {
            *record = faster;
        }
    }
}

fn is_same_row(a: &Record, b: &Record) -> bool {
    a.scene == b.scene && a.variant() == b.variant()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::{parsed, variants};

    #[test]
    fn rows_are_replaced_whole() {
        let record = |builder: &str, rays: &str, flags: &str, nanoseconds: f64| {
            let mut record = record::example();
            record.builder = builder.into();
            record.rays = rays.into();
            record.rustflags = flags.into();
            record.timed.baseline_ns_per_ray = vec![100.0];
            record.timed.trace_ns_per_ray = vec![nanoseconds];
            record
        };
        let mut records = vec![
            record("medium", "primary", "", 50.0),
            record("medium", "ao", "", 50.0),
            record("slow", "primary", "", 50.0),
        ];
        let native = vec![
            record("medium", "primary", "native", 60.0),
            record("medium", "ao", "native", 20.0),
            record("slow", "primary", "native", 51.0),
        ];
        keep_better(&mut records, native);
        let kept: Vec<&str> = records
            .iter()
            .map(|record| record.rustflags.as_str())
            .collect();
        assert_eq!(
            kept,
            ["native", "native", ""],
            "medium gains, slow does not"
        );
    }

    /// Our hierarchies and the crate bvh share a name.
    #[test]
    fn the_other_program_measures_the_rivals_of_the_same_run() {
        let measured = |arguments: &str| {
            let own = arguments.split(' ').map(OsString::from);
            let files = ["native.jsonl", "scratch"].map(PathBuf::from);
            let theirs = parsed(call(own, files.each_ref()));
            assert_eq!((theirs.json, theirs.out), files.map(Some).into(), "its own");
            let variants = variants::choose(&parsed(arguments.split(' '))).expect("some");
            let measured = variants.iter().filter(|variant| measures(variant));
            let names: Vec<String> = measured.map(ToString::to_string).collect();
            assert_eq!(theirs.samples, Some(5), "the rest is the same");
            names.join(" ")
        };
        let ours = "--peers --json a --out b --samples 5 --native-build c --structure";
        let only = |structures: &str| measured(&format!("{ours} {structures}"));
        assert_eq!(only("bvh,embree --builder binned,low"), "", "none in Rust");
        assert_eq!(
            only("bvh --builder binned,default"),
            "bvh/default/own",
            "the crate"
        );
    }
}
