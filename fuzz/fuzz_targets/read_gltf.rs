//! Fuzzes the glTF reader. A valid scene is evaluated at one time.
#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut files = |path: &Path| match path.to_str() {
        Some("fuzz.gltf") => Ok(bytes.to_vec()),
        _ => Err(std::io::ErrorKind::NotFound.into()),
    };
    match kd_scene::read_gltf("fuzz.gltf".as_ref(), &mut files) {
        Ok(scene) => {
            let _ = scene.mesh_at(0.5);
            let _ = scene.camera_at(0.5);
        }
        Err(error) => assert!(!error.to_string().is_empty(), "an error has a text"),
    }
});
