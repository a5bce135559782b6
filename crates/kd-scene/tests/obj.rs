//! The OBJ reader on valid and invalid files.

use kd_scene::{LoadError, read_obj};
use proptest::prelude::*;

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn valid_files_are_read() {
    let rows: [(&str, &str, &[[u32; 3]]); 23] = [
        ("triangle", "f 1 2 3", &[[0, 1, 2]]),
        ("a quad is a fan", "f 1 2 3 4", &[[0, 1, 2], [0, 2, 3]]),
        (
            "five corners",
            "v .5 2 0\nf 1 2 3 5 4",
            &[[0, 1, 2], [0, 2, 4], [0, 4, 3]],
        ),
        ("relative indices", "f -4 -3 -2", &[[0, 1, 2]]),
        (
            "relative to here",
            "f -4 -3 -2\nv 9 9 9\nf -5 -4 -1",
            &[[0, 1, 2], [0, 1, 4]],
        ),
        (
            "textures and normals",
            "vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1",
            &[[0, 1, 2]],
        ),
        (
            "wild texture index",
            "vt 0 0\nf 1/-9223372036854775808 2/7 3",
            &[[0, 1, 2]],
        ),
        (
            "objects and groups",
            "o a\nf 1 2 3\ng b\nf 1 3 4",
            &[[0, 1, 2], [0, 2, 3]],
        ),
        (
            "materials",
            "mtllib no such file.mtl\nusemtl x\nf 1 2 3",
            &[[0, 1, 2]],
        ),
        (
            "material between",
            "f 1 2 3\nusemtl x\nf 1 3 4",
            &[[0, 1, 2], [0, 2, 3]],
        ),
        ("lines and points", "l 1 2 3\np 1\nf 1 2 3", &[[0, 1, 2]]),
        ("comments", "# f 9 9 9\nf 1 2 3 # here\n#", &[[0, 1, 2]]),
        ("broken line", "f 1 2 \\\n 3 4", &[[0, 1, 2], [0, 2, 3]]),
        (
            "CRLF",
            "f 1 2 3\r\n\r\nf 1 3 4\r\n",
            &[[0, 1, 2], [0, 2, 3]],
        ),
        ("tabs", "\tf\t1  2\t3 ", &[[0, 1, 2]]),
        ("colors on some", "v 5 5 5 .1 .2 .3\nf 1 2 3", &[[0, 1, 2]]),
        ("homogeneous", "v 2 2 2 2\nf 1 2 3", &[[0, 1, 2]]),
        ("old face", "fo 1 2 3", &[[0, 1, 2]]),
        ("repeated corner", "f 1 1 2", &[[0, 0, 1]]),
        ("no faces", "o cloud", &[]),
        (
            "faces of few corners",
            "f 1 2\nf\nf 1 2 3\nf 1",
            &[[0, 1, 2]],
        ),
        ("a weight of zero", "v 1 2 3 0\nf 1 2 5", &[[0, 1, 4]]),
        (
            "a concave polygon",
            "v .2 .2 0\nf 1 2 5 4",
            &[[4, 3, 0], [4, 0, 1]],
        ),
    ];
    for (what, text, triangles) in rows {
        let mesh = read_obj(format!("{CORNERS}{text}").as_bytes(), "row.obj");
        let mesh = mesh.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(mesh.triangles(), triangles, "{what}");
    }
}

#[test]
fn vertices_have_the_positions_of_the_file() {
    let text = "f 3 2 1\nv 0 0 0\nv 1e0 -.5 2.\nv 4 2 8 2\nv 7 7 7\n";
    let mesh = read_obj(text.as_bytes(), "row.obj").expect("faces may precede vertices");
    assert_eq!(
        mesh.positions(),
        [[0.0; 3], [1.0, -0.5, 2.0], [4.0, 2.0, 8.0], [7.0; 3]]
    );
    assert_eq!(mesh.triangles(), [[2, 1, 0]]);
    assert!(
        read_obj(&b""[..], "empty.obj")
            .expect("an empty file")
            .is_empty()
    );
}

/// Text after four valid vertices on lines 1 to 4, and the expected error.
const BAD: [(&str, &str); 17] = [
    (
        "f 1 2 9",
        "x.obj: line 5: face 0: index 9 is out of range, there are 4 vertices",
    ),
    (
        "f 1 2 3\n\nf 0 1 2",
        "x.obj: line 7: face 1: index 0 is out of range, there are 4 vertices",
    ),
    (
        "f 1 2 -5",
        "x.obj: line 5: face 0: index -5 is out of range, there are 4 vertices",
    ),
    (
        "f 1 2 -1\nv 0 0 0\nf -6 1 2",
        "x.obj: line 7: face 1: index -6 is out of range, there are 5 vertices",
    ),
    (
        "f 1 2 -9223372036854775808",
        "x.obj: line 5: face 0: index -9223372036854775808 is out of range, there are 4 vertices",
    ),
    (
        "f 1 2 99999999999999999999",
        "x.obj: line 5: bad face: `f 1 2 99999999999999999999`",
    ),
    ("f 1 2 x", "x.obj: line 5: bad face: `f 1 2 x`"),
    ("f 1 2 3.5", "x.obj: line 5: bad face: `f 1 2 3.5`"),
    ("f /1 /2 /3", "x.obj: line 5: bad face: `f /1 /2 /3`"),
    ("v 1 2", "x.obj: line 5: bad vertex: `v 1 2`"),
    ("v 1 2 x", "x.obj: line 5: bad vertex: `v 1 2 x`"),
    ("v", "x.obj: line 5: bad vertex: `v`"),
    (
        "v nan 0 0\nf 1 2 5",
        "x.obj: line 5: vertex 4 is not finite",
    ),
    (
        "v 0 -Infinity 0\nf 1 2 5",
        "x.obj: line 5: vertex 4 is not finite",
    ),
    (
        "\nv 0 0 1e39\nf 1 2 5",
        "x.obj: line 6: vertex 4 is not finite",
    ),
    (
        "surf 0 1 0 1 1 2 3",
        "x.obj: line 5: free-form curves and surfaces are not supported: `surf 0 1 0 1 1 2 3`",
    ),
    (
        "f 1 2 \\\n\\\n 9",
        "x.obj: line 5: face 0: index 9 is out of range, there are 4 vertices",
    ),
];

#[test]
fn invalid_files_are_errors_with_their_line() {
    for (text, expected) in BAD {
        let read = read_obj(format!("{CORNERS}{text}").as_bytes(), "x.obj");
        let error = read.err().unwrap_or_else(|| panic!("{text:?} was read"));
        assert_eq!(error.to_string(), expected, "{text:?}");
    }
    let not_text = [b"v 1 2 \xff".as_slice(), b"\0\0\0\0", b"v 0 0 0\nf 1\0 1 1"];
    for bytes in not_text {
        let error = read_obj(bytes, "x.obj").expect_err("not text");
        assert!(matches!(error, LoadError::BadLine { .. }), "{error}");
        assert!(error.to_string().contains("not text"), "{error}");
    }
    let marked = format!("\u{feff}{CORNERS}f 1 2 4");
    assert_eq!(
        read_obj(marked.as_bytes(), "x.obj")
            .expect("all four vertices")
            .len(),
        1
    );
    let latin = b"# caf\xe9\no caf\xe9\nv 0 0 0\nf 1 1 1".as_slice();
    assert_eq!(
        read_obj(latin, "latin.obj")
            .expect("names may be invalid UTF-8")
            .len(),
        1
    );
}

#[test]
fn error_texts_stay_short() {
    let text = format!("v 1 2 {}", "x".repeat(10_000));
    let error = read_obj(text.as_bytes(), "x.obj")
        .expect_err("not a number")
        .to_string();
    assert!(error.len() < 120, "{error}");
}

/// Fragments that combine to mostly valid lines in invalid combinations.
const FRAGMENTS: [&str; 24] = [
    "v ",
    "f ",
    "l ",
    "1",
    "-1",
    "0",
    "9",
    "/",
    "//",
    ".",
    "1e38",
    "nan",
    " ",
    "\n",
    "\r\n",
    "\\\n",
    "#",
    "surf",
    "fo ",
    "o a",
    "é",
    "\0",
    "vt 0 0",
    "99999999999999999999",
];

proptest! {
    #[test]
    fn every_input_is_a_mesh_or_an_error(
        fragments in proptest::collection::vec(0..FRAGMENTS.len(), 0..60),
        junk in proptest::collection::vec(any::<u8>(), 0..20),
    ) {
        let mut bytes: Vec<u8> = CORNERS.into();
        bytes.extend(fragments.into_iter().flat_map(|fragment| FRAGMENTS[fragment].bytes()));
        bytes.extend(junk);
        if let Ok(mesh) = read_obj(bytes.as_slice(), "any.obj") {
            prop_assert!(mesh.positions().iter().flatten().all(|number| number.is_finite()));
        }
    }

    #[test]
    fn written_meshes_read_back_unchanged(
        positions in proptest::collection::vec(any::<[i16; 3]>(), 3..30),
        faces in proptest::collection::vec(any::<[u8; 3]>(), 1..30),
    ) {
        let mut text = String::new();
        for [x, y, z] in &positions {
            text += &format!("v {} {} {}\n", f32::from(*x) / 7.0, f32::from(*y) / 7.0, f32::from(*z) / 7.0);
        }
        let corner = |index: u8| usize::from(index) % positions.len();
        for &[a, b, c] in &faces {
            let [a, b, c] = [a, b, c].map(corner);
            text += &format!("f {} {} -{}\n", a + 1, b + 1, positions.len() - c);
        }
        let mesh = read_obj(text.as_bytes(), "any.obj").expect("a mesh");
        prop_assert_eq!(mesh.len(), faces.len());
        let options = tobj::LoadOptions::default();
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
            Err(tobj::LoadError::GenericFailure)
        })
        .expect("a file without materials");
        let theirs = models[0].mesh.positions.as_chunks::<3>().0;
        let theirs = models[0].mesh.indices.iter().map(|corner| theirs[*corner as usize]);
        let ours = mesh.triangles().iter().flatten().map(|corner| mesh.positions()[*corner as usize]);
        prop_assert!(ours.eq(theirs), "as tobj reads it");
        for (face, triangle) in faces.iter().zip(mesh.triangles()) {
            for (index, read) in face.iter().zip(triangle) {
                let expected = positions[corner(*index)].map(|number| f32::from(number) / 7.0);
                prop_assert_eq!(mesh.positions()[*read as usize], expected);
            }
        }
    }
}
