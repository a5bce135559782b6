//! OBJ files as scenes: normals, texture coordinates and materials.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use glam::Vec3;
use kd_scene::{
    AlphaMode, LoadError, LoadOptions, SceneDescription, Strictness, Surface, TextureSource,
    WarningCode, load_scene_with, read_obj_scene,
};

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
fn a_texture_of_opacity_needs_no_other_one() {
    let materials = "newmtl red\nKd 1 0 0\nnewmtl wood\nd 0.5\nmap_d leaf.png\nnewmtl glass\n";
    let scene = read(OBJECT, materials).expect("valid");
    let leaf = &scene.materials[2];
    assert_eq!((leaf.alpha, leaf.alpha_mode), (0.5, AlphaMode::Blend));
    assert_eq!(leaf.alpha_texture, Some(0));
    assert_eq!(scene.textures[0].name, "leaf.png");
    let surface = &scene.parts[0].surface;
    assert!(surface.textures.is_empty(), "no color");
    assert_eq!(surface.uvs.len(), scene.parts[0].mesh.len());
    assert_eq!(surface.uvs[3], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
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

/// Faces before their vertices: a concave one, one with an index that no vertex has, one with a vertex that is not finite.
#[test]
fn a_lenient_reader_keeps_surfaces_with_their_triangles() {
    let folder = std::env::temp_dir().join(format!("kd-obj-lenient-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let path = folder.join("scene.obj");
    let object = "mtllib looks.mtl\nvn 0 0 1\nusemtl red\nf 1//1 2//1 5//1 4//1\nusemtl glass\nf 1 2 99\n\
        usemtl wood\nf 1 2 6\nusemtl red\nf 1 2 3\n\
        v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .2 .2 0\nv nan 0 0\n\
        usemtl wood\nf 1 2 6\nf 1 2 0\nf 2 3 4\n";
    std::fs::write(&path, object).expect("written");
    std::fs::write(folder.join("looks.mtl"), MATERIALS).expect("written");
    let load = |strictness| load_scene_with(&path, &LoadOptions::new().with_strictness(strictness));
    let error = load(Strictness::Usual)
        .expect_err("a vertex that is not finite")
        .to_string();
    assert!(
        error.ends_with("line 16: vertex 5 is not finite"),
        "{error}"
    );
    let loaded = load(Strictness::Lenient).expect("the rest is read");
    let codes: Vec<_> = loaded
        .warnings
        .iter()
        .map(|it| (it.code, it.count))
        .collect();
    use WarningCode::{BadIndex, NotFinite};
    assert_eq!(codes, [(NotFinite, 1), (NotFinite, 2), (BadIndex, 2)]);
    let part = &loaded.value.parts[0];
    assert_eq!(
        part.mesh.triangles(),
        [[4, 3, 0], [4, 0, 1], [0, 1, 2], [1, 2, 3]]
    );
    let (red, wood) = (1, 3);
    assert_eq!(part.surface.materials, [red, red, red, wood]);
    let (up, flat) = ([Vec3::Z; 3], [Vec3::ZERO; 3]);
    assert_eq!(part.surface.normals, [up, up, flat, flat]);
    drop(std::fs::remove_dir_all(&folder));
}

#[test]
fn names_may_have_a_number_sign() {
    let materials = "newmtl Mat #1 # red\nKd 1 0 0 # red\nnewmtl Mat #2\nKd 0 1 0\n";
    let object = "mtllib looks.mtl\nv 0 0 0\nv 1 0 0 # x\nv 0 1 0\nusemtl Mat #2\nf 1 2 3\n";
    let scene = read(object, materials).expect("valid");
    let material = scene.parts[0].surface.materials[0] as usize;
    assert_eq!(scene.materials[material].diffuse, Vec3::Y);
    // Comments after names, the last of which ends as a line that continues.
    let commented = "mtllib looks.mtl # all\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Mat #2 # shiny\ng a # C:\\\nf 1 2 3\n";
    for object in [commented.to_owned(), commented.replace("Mat #2", "red")] {
        let materials = materials.replace("Mat #1", "red") + "map_Kd a.png # wood\n";
        let scene = read(&object, &materials).expect("valid");
        let material = scene.parts[0].surface.materials[0] as usize;
        let expected = if object.contains("red") {
            Vec3::X
        } else {
            Vec3::Y
        };
        assert_eq!(scene.materials[material].diffuse, expected, "{object}");
        assert_eq!(
            scene.textures[0].source,
            TextureSource::File("a/a.png".into())
        );
    }
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn colors_of_vertices_are_read() {
    let object = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0 1\nv 0 1 0\nv 1 1 0 0 0 2\nf 1 2 3\nf 2 4 3\n";
    let scene = read(object, "").expect("valid");
    let expected = [[Vec3::X, Vec3::Y, Vec3::ONE], [Vec3::Y, Vec3::Z, Vec3::ONE]];
    assert_eq!(scene.parts[0].surface.colors, expected);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}
