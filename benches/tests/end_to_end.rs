//! The program as a user starts it: a small run from the command line to the files, twice.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn kd_bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kd-bench"))
        .args(arguments)
        .env_remove("KD_SCENES")
        .output()
        .expect("the program starts")
}

/// Measures two tiny scenes; the records of the run and its output.
fn sweep(out: &Path, json: &str, threads: &str) -> (Vec<serde_json::Value>, String) {
    let json = out.join(json);
    let output = kd_bench(&[
        "bench",
        "--smoke",
        "--scene",
        "tetra,gears-1",
        "--builder",
        "median,naive,balanced",
        "--threads",
        threads,
        "--out",
        out.to_str().expect("plain name"),
        "--json",
        json.to_str().expect("plain name"),
    ]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let complained = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}\n{complained}");
    let text = fs::read_to_string(&json).expect("written");
    let records = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("a record"));
    (records.collect(), printed)
}

#[test]
fn two_runs_agree_on_everything_exact() {
    let out = tempfile::tempdir().expect("a folder");
    let (first, printed) = sweep(out.path(), "first.jsonl", "1");
    let (second, _) = sweep(out.path(), "second.jsonl", "2");
    let expected = 2 * 4 * 5;
    assert_eq!(
        first.len(),
        expected,
        "scenes, builders and the median octree, kinds of rays"
    );
    for (first, second) in first.iter().zip(&second) {
        assert_eq!(
            first["exact"], second["exact"],
            "on one thread and on two: {first}"
        );
        assert_eq!(first["exact"]["mismatches"], 0, "{first}");
        assert_eq!(first["exact"]["brute_force_mismatches"], 0, "{first}");
        assert!(
            first["exact"]["brute_force_rays"].as_u64() > Some(0),
            "{first}"
        );
        assert!(
            first["exact"]["peak_build_bytes"].as_u64() > Some(1000),
            "{first}"
        );
        assert_eq!(
            first["timed"]["build_ms"].as_array().map(Vec::len),
            Some(1),
            "{first}"
        );
    }
    let hits = first
        .iter()
        .filter_map(|record| record["exact"]["hits"].as_u64());
    assert!(hits.sum::<u64>() > 10_000, "rays hit something");
    assert!(printed.contains("only generated scenes"), "{printed}");

    let latest = out.path().join("latest");
    for file in [
        "run.jsonl",
        "report.html",
        "scenes/tetra-4.heat.png",
        "scenes/gears-1.txt",
    ] {
        assert!(latest.join(file).exists(), "{file} is missing");
    }
    let report = fs::read_to_string(latest.join("report.html")).expect("written");
    assert!(
        report.contains("data:image/png") && report.contains("answers agree"),
        "pictures and verdict"
    );
}

#[test]
fn compare_distinguishes_equal_runs_from_changed_ones() {
    let out = tempfile::tempdir().expect("a folder");
    let (_, _) = sweep(out.path(), "first.jsonl", "1");
    let path = |name: &str| out.path().join(name).display().to_string();
    let (first, changed) = (path("first.jsonl"), path("changed.jsonl"));
    let equal = kd_bench(&["compare", &first, &path("latest")]);
    assert_eq!(equal.status.code(), Some(0), "a run equals itself");

    let text = fs::read_to_string(&first).expect("written");
    fs::write(&changed, text.replacen("\"depth\":", "\"depth\":1", 1)).expect("written");
    let different = kd_bench(&["compare", &first, &changed]);
    let printed = String::from_utf8_lossy(&different.stdout);
    assert_eq!(different.status.code(), Some(1), "{printed}");
    assert!(
        printed.contains("exact: 1 differences") && printed.contains("depth"),
        "{printed}"
    );

    let report = kd_bench(&["report", &path("latest")]);
    assert!(report.status.success(), "the report can be written again");
}

#[test]
fn unknown_names_are_refused_with_exit_code_2() {
    for (arguments, said) in [
        (["bench", "--builder", "grown"], "balanced"),
        (["bench", "--scene", "atlantis"], "tetra-7"),
        (["bench", "--scenes", "no/such/folder"], "no/such/folder"),
        (["bench", "--structure", "embree"], "add --peers"),
        #[cfg(not(feature = "peers"))]
        (["bench", "--peers", "--smoke"], "no rival libraries"),
    ] {
        let output = kd_bench(&arguments);
        let complained = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {complained}");
        assert!(complained.contains(said), "{arguments:?}: {complained}");
    }
}

/// The output of a program with rivals; `None` without an installed Embree, which the error must name.
#[cfg(feature = "peers")]
fn with_rivals(arguments: &[&str]) -> Option<String> {
    let output = kd_bench(arguments);
    let complained = String::from_utf8_lossy(&output.stderr);
    if complained.contains("Embree cannot be opened") {
        let says_how = complained.contains("apt-get install libembree-dev");
        assert!(says_how, "{complained}");
        return None;
    }
    assert_eq!(output.status.code(), Some(0), "{complained}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(feature = "peers")]
#[test]
fn rivals_run_on_the_same_rays_and_agree() {
    let out = tempfile::tempdir().expect("a folder");
    let (out, file) = (out.path().join("runs"), out.path().join("run.jsonl"));
    let (out, file) = (out.display().to_string(), file.display().to_string());
    let sweep = [
        ["bench", "--peers", "--smoke"].as_slice(),
        &["--scene", "jacks", "--rays", "primary,shadow"],
        &["--builder", "best,high,slow,default"],
        &["--out", &out, "--json", &file],
    ];
    if with_rivals(&sweep.concat()).is_none() {
        return;
    }
    let records = fs::read_to_string(file).expect("written");
    for structure in ["kd", "embree", "embree8", "obvhs", "bvh", "parry3d"] {
        let cells = format!("\"structure\":\"{structure}\"");
        assert_eq!(records.matches(&cells).count(), 2, "{structure}: {records}");
    }
    let baselines = records.matches("\"baseline\":\"embree/medium/own\"");
    assert_eq!(baselines.count(), records.lines().count(), "{records}");
    let versions = records.matches("\"library\":\"Embree ");
    assert_eq!(versions.count(), records.lines().count(), "{records}");
}

/// Every command that measures, on tiny scenes, with texts that it prints and one in its rows; those of rivals where Embree is
/// installed.
#[test]
fn commands_work_on_tiny_scenes() {
    let out = tempfile::tempdir().expect("a folder");
    let file = |name: &str| out.path().join(name).display().to_string();
    let commands: &[(&str, &[&str], &str)] = &[
        (
            "merges",
            &["partition trees: updates in the time of `best`"],
            "\"met\"",
        ),
        (
            "paper merge-table",
            &["auto: update, ms"],
            "\"strategy\":\"dual\"",
        ),
        ("paper merge-table --growth", &["merge ms"], "\"still\""),
        (
            "paper merge-table --rendered",
            &["Mray/s"],
            "\"tracing_ms\"",
        ),
        (
            "paper grid-table",
            &["chosen among all"],
            "\"critical_rays\"",
        ),
    ];
    let of_rivals: &[(&str, &[&str], &str)] = &[
        (
            "paper merge-table --peers",
            &["Embree refit: trace, ms"],
            "\"embree_refit_packets_ms\"",
        ),
        (
            "paper merge-table --rendered --peers",
            &["tracing by Embree / ours"],
            "\"tracing_over_ours\"",
        ),
        (
            "structures --scene jacks --out RUNS",
            &["bvh/objects/wide / obvhs"],
            "\"met\"",
        ),
        (
            "builds --scene tetra,jacks --growth=20000 --out RUNS",
            &[
                "tetra-4",
                "≤ 0.8",
                "tetra best",
                "growth.svg",
                "trees that differ",
            ],
            "\"growth\":\"tetra\"",
        ),
        (
            "rays --scene tetra,jacks --ray-limit 512 --out RUNS",
            &[
                "tetra-4",
                "≥ 1.3",
                "first 4 hits / Embree with a filter",
                "differently: tetra-4 ",
                "rays.jsonl",
            ],
            // No scene is large.
            "\"met\":null,\"row\":\"ao batch",
        ),
    ];
    let of_rivals = of_rivals.iter().filter(|_| cfg!(feature = "peers"));
    let runs = file("runs");
    for (number, (call, parts, field)) in commands.iter().chain(of_rivals).enumerate() {
        let rows = file(&number.to_string());
        let words = call
            .split(' ')
            .map(|word| if word == "RUNS" { &runs } else { word });
        let smoke = ["--smoke", "--samples", "1", "--json", &rows];
        let output = kd_bench(&words.chain(smoke).collect::<Vec<_>>());
        let printed = String::from_utf8_lossy(&output.stdout);
        let complained = String::from_utf8_lossy(&output.stderr);
        if complained.contains("Embree cannot be opened") {
            continue;
        }
        assert_eq!(output.status.code(), Some(0), "{call}: {complained}");
        for part in *parts {
            assert!(printed.contains(part), "{call}: {part} in\n{printed}");
        }
        let rows = fs::read_to_string(rows).expect("written");
        assert!(rows.contains(field), "{call}: {field} in\n{rows}");
        for row in rows.lines() {
            let _: serde_json::Value = serde_json::from_str(row).expect("JSON lines");
        }
    }
}
