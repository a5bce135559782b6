//! Rivals written in Rust, measured in a second build of this program, for this processor.
//!
//! A rival may be faster where the compiler may use every instruction of the processor, as its users can allow. Ours detects
//! them at run time, so it is measured in the default build only.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use anyhow::Context as _;

use super::{BenchArgs, variants};
use crate::arguments::name_of;
use crate::names::{StructureName, Variant};
use crate::record::{self, Record};
use crate::run_folder::RunFolder;

/// Runs the other program over the same scenes and rays. There, too, Embree runs before every repeat.
pub(crate) fn measure(
    program: &Path,
    arguments: &BenchArgs,
    folder: &RunFolder,
) -> anyhow::Result<Vec<Record>> {
    let structures = to_measure(&variants::choose(arguments)?);
    if structures.is_empty() {
        return Ok(Vec::new());
    }
    let (records, scratch) = (folder.native_records(), folder.scratch());
    let status = Command::new(program)
        .args(call(arguments, &structures))
        .arg("--json")
        .arg(&records)
        .arg("--out")
        .arg(&scratch)
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
    Ok(of_rivals(record::read(&records)?))
}

/// The structures of a run that have rivals written in Rust among their variants.
fn to_measure(variants: &[Variant]) -> Vec<StructureName> {
    let rivals = variants.iter().filter(|variant| variant.is_rival());
    let mut structures: Vec<StructureName> = rivals.map(|variant| variant.structure).collect();
    structures.retain(|structure| structure.is_rust_rival());
    structures
}

/// Without structures of ours that share the name of a rival and are measured with it.
fn of_rivals(mut records: Vec<Record>) -> Vec<Record> {
    records.retain(Record::is_of_rival);
    records
}

/// The arguments of this run, for those structures alone.
fn call(arguments: &BenchArgs, structures: &[StructureName]) -> Vec<OsString> {
    let mut call: Vec<OsString> = vec!["bench".into(), "--peers".into()];
    let mut add = |flag: &str, value: OsString| call.extend([flag.into(), value]);
    if let Some(scenes) = &arguments.scenes {
        add("--scenes", scenes.into());
    }
    for scene in &arguments.scene {
        add("--scene", scene.into());
    }
    for structure in structures {
        add("--structure", name_of(structure).into());
    }
    for builder in &arguments.builder {
        add("--builder", name_of(builder).into());
    }
    for kind in &arguments.rays {
        add("--rays", name_of(kind).into());
    }
    add("--threads", arguments.threads.to_string().into());
    if let Some(samples) = arguments.samples {
        add("--samples", samples.to_string().into());
    }
    if let Some(limit) = arguments.ray_limit {
        add("--ray-limit", limit.to_string().into());
    }
    if arguments.smoke {
        call.push("--smoke".into());
    }
    call
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
    use crate::sweep::parsed;

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
    fn our_hierarchies_are_no_rivals() {
        let to_measure = |arguments: &str| {
            let call = format!("--peers --structure {arguments}");
            let arguments = parsed(call.split(' '));
            to_measure(&variants::choose(&arguments).expect("some"))
        };
        let none: [StructureName; 0] = [];
        assert_eq!(to_measure("bvh --builder binned"), none, "of ours only");
        let rivals = to_measure("bvh --builder binned,default");
        assert_eq!(rivals, [StructureName::Bvh], "the crate");

        // The other build makes rows of both. Ours was faster there.
        let record = |builder: &str, flags: &str, nanoseconds: f64| {
            let mut record = record::example();
            record.structure = "bvh".into();
            record.builder = builder.into();
            record.rustflags = flags.into();
            record.timed.baseline_ns_per_ray = vec![100.0];
            record.timed.trace_ns_per_ray = vec![nanoseconds];
            record.exact.disagreement_ppm = (builder == "default").then_some(0.5);
            record
        };
        let both = |flags: &str, nanoseconds: f64| {
            let builders = ["binned", "default", "sweep"];
            builders.map(|builder| record(builder, flags, nanoseconds))
        };
        let mut records = both("", 50.0);
        keep_better(&mut records, of_rivals(both("native", 20.0).to_vec()));
        let kept = records.map(|record| (record.builder, record.rustflags));
        let kept = kept
            .each_ref()
            .map(|(builder, flags)| (builder.as_str(), flags.as_str()));
        assert_eq!(
            kept,
            [("binned", ""), ("default", "native"), ("sweep", "")],
            "only the crate is replaced"
        );
    }

    #[test]
    fn the_other_program_gets_the_same_arguments() {
        let ours =
            "--peers --scenes dir --scene a,b --builder medium --threads 2 --samples 5 --smoke";
        let arguments = parsed(ours.split(' '));
        let call = call(&arguments, &[StructureName::Obvhs]);
        assert_eq!(call[0], "bench", "the command");
        let theirs = parsed(call.into_iter().skip(1));
        assert_eq!(theirs.structure, [StructureName::Obvhs], "only the rival");
        assert_eq!(
            (
                theirs.scene,
                theirs.builder,
                theirs.threads,
                theirs.samples,
                theirs.smoke
            ),
            (arguments.scene, arguments.builder, 2, Some(5), true),
            "the rest is the same"
        );
    }
}
