//! Fuzzes the readers of OBJ and MTL: the bytes are both the object and the material file that it names.
#![no_main]

use std::path::Path;

use kd_core::Mesh;
use kd_scene::{LoadError, read_obj, read_obj_scene};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    kd_fuzz::check(bytes, |bytes| read_obj(bytes, "fuzz"));
    kd_fuzz::check(bytes, read_with_materials);
});

fn read_with_materials(bytes: &[u8]) -> Result<Mesh, LoadError> {
    let mut files = |path: &Path| {
        let first: &[u8] = if path.ends_with("m.mtl") {
            b""
        } else {
            b"mtllib m.mtl\n"
        };
        Ok([first, bytes].concat())
    };
    let scene = read_obj_scene(Path::new("fuzz"), &mut files)?;
    Ok(Mesh::clone(&scene.parts[0].mesh))
}
