//! Tells the program which compiler built it, for the record.

use std::process::Command;

fn main() {
    let rustc = std::env::var("RUSTC").expect("cargo names the compiler");
    let output = Command::new(rustc)
        .arg("--version")
        .output()
        .expect("the compiler runs");
    let version = String::from_utf8_lossy(&output.stdout);
    // "rustc 1.89.0 (29483883e 2025-08-04)" -> "1.89.0"
    let version = version.split_whitespace().nth(1).unwrap_or("unknown");
    println!("cargo::rustc-env=KD_BENCH_RUSTC={version}");
    println!("cargo::rerun-if-changed=build.rs");
}
