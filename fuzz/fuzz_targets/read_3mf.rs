//! Fuzzes the 3MF reader: the input is the archive, or the model in one.
#![no_main]

use std::io::{Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;

/// An archive of one model.
fn archive(model: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    archive
        .start_file("3D/3dmodel.model", stored)
        .expect("an entry");
    archive.write_all(model).expect("its content");
    archive.finish().expect("an archive").into_inner()
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = if bytes.starts_with(b"PK") {
        bytes.to_vec()
    } else {
        archive(bytes)
    };
    match kd_scene::read_3mf(Path::new("fuzz.3mf"), &mut |_| Ok(file.clone())) {
        Ok(scene) => {
            let finite = |position: &[f32; 3]| position.iter().all(|number| number.is_finite());
            let positions = scene.parts[0].mesh.positions();
            assert!(positions.iter().all(finite), "a position is not finite");
        }
        Err(error) => assert!(!error.to_string().is_empty(), "an error has a text"),
    }
});
