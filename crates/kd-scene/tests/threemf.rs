//! The 3MF reader: objects, components, colors, and errors.

use std::io::{Cursor, Write};
use std::path::Path;

use glam::Vec3;
use kd_scene::{
    LoadError, LoadOptions, SceneDescription, Strictness, WarningCode, load_scene_with, read_3mf,
};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const RELATIONS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/main.model" Id="r0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>"#;

const CORE: &str = r#"xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02""#;

const TRIANGLE: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1e0" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>"#;

/// An archive of some files.
fn archive(files: &[(&str, &str)]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        archive
            .start_file(*name, SimpleFileOptions::default())
            .expect("an entry");
        archive.write_all(content.as_bytes()).expect("its content");
    }
    archive.finish().expect("an archive").into_inner()
}

fn read_bytes(bytes: &[u8]) -> Result<SceneDescription, LoadError> {
    read_3mf(Path::new("a.3mf"), &mut |_| Ok(bytes.to_vec()))
}

/// Reads a file of one model.
fn read(resources: &str, build: &str) -> Result<SceneDescription, LoadError> {
    let model =
        format!("<model {CORE}><resources>{resources}</resources><build>{build}</build></model>");
    read_bytes(&archive(&[
        ("_rels/.rels", RELATIONS),
        ("3D/main.model", &model),
    ]))
}

#[test]
fn items_and_components_are_placed() {
    let resources = format!(
        r#"<object id="1">{TRIANGLE}</object><object id="2"><components>
        <component objectid="1"/><component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 0 0"/>
        </components></object>"#
    );
    let build = r#"<item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 0 5"/><item objectid="1"/>"#;
    let scene = read(&resources, build).expect("valid");
    let mesh = &scene.parts[0].mesh;
    assert_eq!(mesh.len(), 3);
    assert_eq!(mesh.corners(0)[1], Vec3::new(2.0, 0.0, 5.0));
    assert_eq!(
        mesh.corners(1),
        [
            Vec3::new(20.0, 0.0, 5.0),
            Vec3::new(20.0, 2.0, 5.0),
            Vec3::new(18.0, 0.0, 5.0)
        ]
    );
    assert_eq!(mesh.corners(2)[1], Vec3::X);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);

    let whole = read(&resources, "").expect("valid");
    assert_eq!(
        whole.parts[0].mesh.len(),
        2,
        "the object that is in no other one"
    );
    assert_eq!(whole.warnings[0].code, WarningCode::NoScene);
}

#[test]
fn objects_may_be_in_other_models() {
    let part = format!(
        "<model {CORE}><resources><object id=\"7\">{TRIANGLE}</object></resources><build/></model>"
    );
    let main = format!(
        "<model {CORE} xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" requiredextensions=\"p\">\
         <resources/><build><item objectid=\"7\" p:path=\"/3D/part.model\"/></build></model>"
    );
    let files = [
        ("3D/3dmodel.model", main.as_str()),
        ("3D/part.model", &part),
    ];
    let scene = read_bytes(&archive(&files)).expect("valid, also without relations");
    assert_eq!(scene.parts[0].mesh.len(), 1);
}

#[test]
fn colors_are_those_of_the_materials() {
    let triangles = TRIANGLE.replace(
        "</triangles>",
        r#"<triangle v1="0" v2="1" v3="2" pid="3" p1="1"/><triangle v1="0" v2="1" v3="2" pid="4" p1="0" p2="1" p3="1"/></triangles>"#,
    );
    let resources = format!(
        r##"<basematerials id="3"><base name="a" displaycolor="#FF0000"/><base name="b" displaycolor="#00FF0080"/></basematerials>
        <m:colorgroup xmlns:m="x" id="4"><m:color color="#0000FF"/><m:color color="#FFFFFF"/></m:colorgroup>
        <object id="1" pid="3" pindex="0">{triangles}</object>"##
    );
    let scene = read(&resources, r#"<item objectid="1"/>"#).expect("valid");
    let surface = &scene.parts[0].surface;
    let diffuse: Vec<Vec3> = surface
        .materials
        .iter()
        .map(|it| scene.materials[*it as usize].diffuse)
        .collect();
    assert_eq!(diffuse, [Vec3::X, Vec3::Y, Vec3::ONE]);
    assert_eq!(surface.colors[2], [Vec3::Z, Vec3::ONE, Vec3::ONE]);
    assert_eq!(
        surface.colors[0],
        [Vec3::ONE; 3],
        "the material has the color"
    );
}

#[test]
fn errors_name_what_is_wrong() {
    let item = r#"<item objectid="1"/>"#;
    let object = |content: &str| format!("<object id=\"1\">{content}</object>");
    let with = |from: &str, to: &str| object(&TRIANGLE.replace(from, to));
    for (resources, expected) in [
        (
            String::new(),
            "a.3mf/3D/main.model: object 1: does not exist",
        ),
        (
            with("v3=\"2\"", "v3=\"3\""),
            "a.3mf/3D/main.model: face 0: index 3 is out of range, there are 3 vertices",
        ),
        (
            with("1e0", "1e99"),
            "a.3mf/3D/main.model: vertex 2 is not finite",
        ),
        (
            with("1e0", "one"),
            "a.3mf/3D/main.model: vertex 2: `y` is missing, or not valid",
        ),
        (
            with("v3=\"2\"", ""),
            "a.3mf/3D/main.model: triangle 0: `v3` is missing, or not valid",
        ),
        (
            object(r#"<components><component objectid="1"/></components>"#),
            "a.3mf/3D/main.model: object 1: components are nested more than 64 deep",
        ),
        (
            object(r#"<components><component objectid="1" transform="1 0 0"/></components>"#),
            "a.3mf/3D/main.model: component 0: `transform` is missing, or not valid",
        ),
    ] {
        let read = read(&resources, item);
        let error = read.err().unwrap_or_else(|| panic!("{resources} was read"));
        assert_eq!(error.to_string(), expected);
    }
    let of_model = |model: &str| {
        let error = read_bytes(&archive(&[("3D/3dmodel.model", model)])).expect_err(model);
        error.to_string()
    };
    assert!(
        of_model("<model><object").starts_with("a.3mf/3D/3dmodel.model: byte "),
        "cut"
    );
    assert_eq!(
        of_model("<a/>"),
        "a.3mf/3D/3dmodel.model: header: expected a whole `model`"
    );
    let required = "<model xmlns:b=\"beams\" requiredextensions=\"b\"></model>";
    let expected = "a.3mf/3D/3dmodel.model: header: the required extension beams is not supported";
    assert_eq!(of_model(required), expected);
    let error = read_bytes(b"PK\x03\x04").expect_err("cut").to_string();
    assert!(
        error.starts_with("a.3mf: header: not a 3MF archive: "),
        "{error}"
    );
    let error = read_bytes(&archive(&[("a.txt", "")]))
        .expect_err("no model")
        .to_string();
    assert_eq!(
        error,
        "a.3mf: header: the archive has no `3D/3dmodel.model`"
    );
}

#[test]
fn what_is_not_read_harms_nothing_else() {
    let slices = r#"<slicestack id="9"><slice><vertices><vertex x="1" y="2"/></vertices></slice></slicestack>"#;
    let colored = TRIANGLE.replace("v3=\"2\"", "v3=\"2\" pid=\"7\" p1=\"3\"");
    let resources = format!("{slices}<object id=\"1\">{colored}</object>");
    let scene = read(&resources, r#"<item objectid="1"/>"#).expect("valid");
    assert_eq!(scene.parts[0].mesh.len(), 1);
    let codes: Vec<_> = scene.warnings.iter().map(|it| it.code).collect();
    assert_eq!(codes, [WarningCode::Unused, WarningCode::UnknownMaterial]);
    let mirrored = format!("<object id=\"1\">{TRIANGLE}</object>");
    let build = r#"<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>"#;
    let scene = read(&mirrored, build).expect("valid");
    assert_eq!(scene.parts[0].mesh.triangles(), [[0, 2, 1]]);
}

#[test]
fn names_of_models_are_decoded() {
    let part = format!(
        "<model {CORE}><resources><object id=\"7\">{TRIANGLE}</object></resources></model>"
    );
    let main = format!(
        "<model {CORE}><build><item objectid=\"7\" path=\"/3D/a&amp;b.model\"/></build></model>"
    );
    let files = [("3D/3dmodel.model", main.as_str()), ("3D/a&b.model", &part)];
    assert_eq!(
        read_bytes(&archive(&files)).expect("valid").parts[0]
            .mesh
            .len(),
        1
    );
}

#[test]
fn a_lenient_reader_leaves_out_damaged_triangles() {
    let triangles = TRIANGLE.replace(
        "</triangles>",
        r#"<triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="1" v3="9"/></triangles>"#,
    );
    let triangles = triangles.replace(
        "</vertices>",
        r#"<vertex x="1e99" y="0" z="0"/></vertices>"#,
    );
    let model = format!(
        "<model {CORE}><resources><object id=\"1\">{triangles}</object></resources><build><item objectid=\"1\"/></build></model>"
    );
    let path = std::env::temp_dir().join(format!("kd-{}.3mf", std::process::id()));
    std::fs::write(&path, archive(&[("3D/3dmodel.model", &model)])).expect("a temporary file");
    let options = LoadOptions::new().with_strictness(Strictness::Lenient);
    let loaded = load_scene_with(&path, &options).expect("the rest is read");
    assert_eq!(loaded.value.parts[0].mesh.len(), 1);
    let codes: Vec<_> = loaded.warnings.iter().map(|it| it.code).collect();
    use WarningCode::{BadIndex, NotFinite};
    assert_eq!(codes, [NotFinite, NotFinite, BadIndex]);
    drop(std::fs::remove_file(&path));
}

/// A chain of objects, of which the innermost is built first.
#[test]
fn a_long_chain_of_components_is_an_error() {
    let mut resources = format!("<object id=\"0\">{TRIANGLE}</object>");
    let mut build = String::new();
    for id in 1..20_000 {
        let inner = id - 1;
        resources += &format!(
            "<object id=\"{id}\"><components><component objectid=\"{inner}\"/></components></object>"
        );
        build += &format!("<item objectid=\"{id}\"/>");
    }
    let error = read(&resources, &build).expect_err("too deep").to_string();
    assert!(
        error.ends_with("object 64: components are nested more than 64 deep"),
        "{error}"
    );
}

/// Thirty levels of an object that has the next one twice: 2^30 triangles.
#[test]
fn a_short_file_cannot_have_any_number_of_triangles() {
    let mut resources = format!("<object id=\"0\">{TRIANGLE}</object>");
    for id in 1..=30 {
        let component = format!("<component objectid=\"{}\"/>", id - 1);
        resources += &format!(
            "<object id=\"{id}\"><components>{component}{component}</components></object>"
        );
    }
    let error = read(&resources, "<item objectid=\"30\"/>")
        .expect_err("too many")
        .to_string();
    assert!(
        error.ends_with("repeats its objects to more than 67108864 vertices and triangles"),
        "{error}"
    );
}

#[test]
fn damaged_files_do_not_panic() {
    let model = format!(
        "<model {CORE}><resources><object id=\"1\">{TRIANGLE}</object></resources><build><item objectid=\"1\"/></build></model>"
    );
    let whole = archive(&[("3D/3dmodel.model", &model)]);
    let mut rng = fastrand::Rng::with_seed(8);
    for _ in 0..2000 {
        let mut bytes = whole.clone();
        let mut text = model.clone().into_bytes();
        let is_inside = rng.bool();
        let target = if is_inside { &mut text } else { &mut bytes };
        for _ in 0..rng.usize(1..3) {
            let at = rng.usize(..target.len());
            target[at] = if is_inside {
                b"<>\"9 -x"[rng.usize(..7)]
            } else {
                rng.u8(..)
            };
        }
        if is_inside {
            bytes = archive(&[("3D/3dmodel.model", &String::from_utf8_lossy(&text))]);
        }
        if let Ok(scene) = read_bytes(&bytes) {
            assert!(
                scene.parts[0]
                    .mesh
                    .positions()
                    .iter()
                    .flatten()
                    .all(|x| x.is_finite()),
                "finite"
            );
        }
    }
}
