//! Fuzzes the AFF reader. The input may include itself, as `fuzz.aff` or `again.aff`. A valid scene is evaluated at one time.
#![no_main]

use std::path::Path;

use kd_scene::{AffOptions, read_aff};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut files = |path: &Path| match path.to_str() {
        Some("fuzz.aff" | "again.aff") => Ok(bytes.to_vec()),
        _ => Err(std::io::ErrorKind::NotFound.into()),
    };
    let options = AffOptions {
        lenient: bytes.len() % 2 == 0,
        resolution: 1,
        max_triangles: 10_000,
        ..AffOptions::default()
    };
    match read_aff("fuzz.aff".as_ref(), &mut files, &options) {
        Ok(scene) => {
            let time = scene.span.map_or(0.0, |span| span.time_of(span.frames / 2));
            let _ = scene.mesh_at(time);
            let _ = scene.camera_at(time);
        }
        Err(error) => assert!(!error.to_string().is_empty(), "an error has a text"),
    }
});
