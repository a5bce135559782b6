//! OBJ files as scenes: normals, texture coordinates and materials.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use glam::Vec3;
use kd_scene::{LoadError, SceneDescription, Surface, TextureSource, read_obj_scene};

const MATERIALS: &str = "
newmtl red
Kd 0.9 0.1 0.1
Ks 0.5 0.5 0.5
Ns 30
illum 2
newmtl glass
Kd 0 0 0
Ks 0.8 0.8 0.8
d 0.25
Ni 1.5
illum 5
newmtl wood
Kd 0 0 0
map_Kd -s 1 1 1 textures\\wood.png
";

const OBJECT: &str = "
mtllib looks.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vn 0 0 2
f 1 2 3
usemtl red
f 1//1 2//1 3//1 4//-1
usemtl wood
f 1/1 2/2 3/-1
f 1 2 4
usemtl glass
f 1/1/1 2/2/1 3/3/1
usemtl nothing
f 2 3 4
";

fn read(object: &str, materials: &str) -> Result<SceneDescription, LoadError> {
    let files: HashMap<PathBuf, &str> = [
        ("a/scene.obj".into(), object),
        ("a/looks.mtl".into(), materials),
    ]
    .into();
    let mut open = |path: &Path| match files.get(path) {
        Some(text) => Ok(text.as_bytes().to_vec()),
        None => Err(io::ErrorKind::NotFound.into()),
    };
    read_obj_scene("a/scene.obj".as_ref(), &mut open)
}

#[test]
fn triangles_have_their_materials_normals_and_uvs() {
    let scene = read(OBJECT, MATERIALS).expect("valid");
    let [part] = scene.parts.as_slice() else {
        panic!("{:?}", scene.parts);
    };
    assert_eq!(part.mesh.len(), 7);
    let Surface {
        materials,
        textures,
        normals,
        uvs,
        ..
    } = &part.surface;
    assert_eq!(*materials, [0, 1, 1, 3, 3, 2, 0], "in file order");
    let none = Surface::NO_TEXTURE;
    assert_eq!(*textures, [none, none, none, 0, none, none, none]);
    assert_eq!(
        uvs[3],
        [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]],
        "v runs from the top"
    );
    let up = [Vec3::new(0.0, 0.0, 2.0); 3];
    let flat = [Vec3::ZERO; 3];
    assert_eq!(*normals, [flat, up, up, flat, flat, up, flat]);
    let wood = TextureSource::File("a/textures/wood.png".into());
    assert_eq!(scene.textures[0].source, wood);
    let [_, red, glass, wood] = scene.materials.as_slice() else {
        panic!("{:?}", scene.materials);
    };
    assert_eq!(
        (red.specular.x, red.mirror, red.shine),
        (0.5, Vec3::ZERO, 30.0)
    );
    assert_eq!(
        (glass.mirror.x, glass.transmittance, glass.refraction),
        (0.8, 0.75, 1.5)
    );
    assert_eq!(wood.diffuse, Vec3::ONE, "white under a texture");
    let warnings: Vec<String> = scene.warnings.iter().map(ToString::to_string).collect();
    let expected = "a/scene.obj: line 19: unknown material `nothing`; using light gray";
    assert_eq!(warnings, [expected]);
}

#[test]
fn missing_material_files_are_warnings() {
    for (object, materials, expected) in [
        (
            "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
            "",
            "a/scene.obj: line 1: cannot read `none.mtl`: ",
        ),
        (
            "mtllib looks.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
            "newmtl a\nKd x",
            "a/looks.mtl: line 2: bad statement, left out: `Kd x`",
        ),
    ] {
        let scene = read(object, materials).expect("valid");
        assert!(
            scene.warnings[0].to_string().starts_with(expected),
            "{:?}",
            scene.warnings
        );
        assert_eq!(scene.parts[0].surface.materials, [0]);
    }
}

#[test]
fn attributes_that_are_not_there_are_warnings() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let lost =
        "line 5: a face names normals or texture coordinates that are not there; it has none";
    for (rest, expected) in [
        ("f 1/2 2/1 3/1", lost),
        ("f 1//1 2//1 3//1", lost),
        ("f 1/x 2 3", lost),
        ("f 1/-9223372036854775808 2 3", lost),
        ("vn 1 2\nf 1 2 3", "line 5: bad numbers, left out: `vn 1 2`"),
        (
            "vt nan 0\nf 1 2 3",
            "line 5: bad numbers, left out: `vt nan 0`",
        ),
    ] {
        let scene = read(&format!("{vertices}{rest}"), "").expect(rest);
        let warnings: Vec<String> = scene.warnings.iter().map(ToString::to_string).collect();
        assert_eq!(warnings, [format!("a/scene.obj: {expected}")], "{rest}");
        assert_eq!(scene.parts[0].mesh.len(), 1, "{rest}");
    }
    let error = read(&format!("{vertices}f 1 2 9"), "").expect_err("no such vertex");
    assert_eq!(
        error.to_string(),
        "a/scene.obj: line 5: face 0: index 9 is out of range, there are 3 vertices"
    );
}
