//! The PLY reader on valid and invalid files.

use kd_core::Mesh;
use kd_scene::{LoadError, LoadOptions, Strictness, WarningCode, load_mesh_with, read_ply};
use proptest::prelude::*;

const BODY: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n";
const FANS: [[u32; 3]; 3] = [[0, 1, 2], [0, 1, 2], [0, 2, 3]];

fn header(format: &str, vertices: u64, faces: u64) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\n\
         property float y\nproperty float z\nelement face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

fn ascii() -> String {
    header("ascii", 4, 2) + BODY
}

#[track_caller]
fn read(bytes: impl AsRef<[u8]>) -> Mesh {
    read_ply(bytes.as_ref(), "row.ply").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn valid_text_files_are_read() {
    let plain = ascii();
    let rows = [
        ("plain", plain.clone()),
        ("CRLF", plain.replace('\n', "\r\n")),
        (
            "other name",
            plain.replace("vertex_indices", "vertex_index"),
        ),
        (
            "comments",
            plain.replace(
                "element vertex",
                "comment c\nobj_info o\ncomment\nelement vertex",
            ),
        ),
        (
            "sized names",
            plain
                .replace("float", "float32")
                .replace("uchar", "uint8")
                .replace("int v", "int32 v"),
        ),
        ("doubles", plain.replace("float", "double")),
        ("integers", plain.replace("float", "short")),
        (
            "wide counts",
            plain.replace("uchar", "uint").replace("int v", "ushort v"),
        ),
        ("blank lines", plain.replace("0 1 0\n", "0 1 0\n\n  \n")),
        ("old line ends", plain.replace('\n', "\r")),
        ("a byte order mark", format!("\u{feff}{plain}")),
        (
            "blanks in the header",
            plain.replace("property", "  \n\tproperty"),
        ),
        (
            "values over lines",
            plain
                .replace("1 1 0\n4 0", "1 1 0\n4\n0")
                .replace("1 0 0\n", "1\n0 0\n"),
        ),
        ("left over", plain.clone() + "3 0 1 2\n"),
        ("no final line end", plain.trim_end().to_owned()),
        (
            "unusual spellings of numbers",
            plain.replace("1 1 0\n", "1. +1e0 -.0\n"),
        ),
    ];
    for (what, text) in rows {
        let mesh = read_ply(text.as_bytes(), "row.ply");
        let mesh = mesh.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(mesh.triangles(), FANS, "{what}");
        assert_eq!(mesh.positions()[2], [1.0, 1.0, 0.0], "{what}");
    }
}

#[test]
fn other_elements_and_properties_are_skipped() {
    let text = "ply\nformat ascii 1.0\nelement camera 2\nproperty list uchar float lens\n\
        property double x\nelement face 1\nproperty list char short texture\n\
        property list uchar int vertex_indices\nproperty uchar red\nelement nothing 4000000000\n\
        element vertex 3\nproperty float nx\nproperty float z\nproperty float y\n\
        property list int double w\nproperty float x\nend_header\n\
        2 1 2 5\n0 6\n2 7 8 3 0 1 2 255\n9 3 2 0 1\n9 6 5 1 1.5 4\n9 9 8 0 7\n";
    let mesh = read(text);
    assert_eq!(
        mesh.positions(),
        [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]
    );
    assert_eq!(mesh.triangles(), [[0, 1, 2]]);
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n1 2 3\n";
    let cloud = read(cloud);
    assert_eq!(
        (cloud.positions().len(), cloud.len()),
        (1, 0),
        "points without faces"
    );
    assert!(read(header("ascii", 0, 0)).is_empty());
    assert!(read(header("binary_big_endian", 0, 0)).is_empty());
}

#[test]
#[cfg(feature = "scenes")]
fn a_scene_has_the_colors_and_normals_of_vertices() {
    use glam::Vec3;

    let path = std::env::temp_dir().join(format!("kd-ply-looks-{}.ply", std::process::id()));
    let properties = "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nproperty float quality\nelement face";
    let text = header("ascii", 3, 1).replace("element face", properties)
        + "0 0 0 0 0 1 255 0 0 5\n1 0 0 0 1 0 0 255 0 5\n0 1 0 1 0 0 0 0 255 5\n3 0 1 2\n";
    std::fs::write(&path, text).expect("a temporary file");
    let scene = kd_scene::load_scene_with(&path, &LoadOptions::new())
        .expect("valid")
        .value;
    let surface = &scene.parts[0].surface;
    assert_eq!(surface.colors, [[Vec3::X, Vec3::Y, Vec3::Z]]);
    assert_eq!(surface.normals, [[Vec3::Z, Vec3::Y, Vec3::X]]);
    let texts: Vec<String> = scene.warnings.iter().map(|it| it.message.clone()).collect();
    assert_eq!(texts, ["of `vertex`, quality is not used"]);
    let mesh = load_mesh_with(&path, &LoadOptions::new()).expect("valid");
    assert!(mesh.warnings.is_empty(), "a mesh has geometry only");
    drop(std::fs::remove_file(&path));
}

#[test]
#[cfg(feature = "scenes")]
fn colors_that_are_no_colors_are_harmless() {
    let path = std::env::temp_dir().join(format!("kd-ply-colors-{}.ply", std::process::id()));
    let properties = "property float red\nproperty float green\nproperty float blue\nelement face";
    let text = header("ascii", 3, 1).replace("element face", properties)
        + "0 0 0 nan 0 0.5\n1 0 0 -2 inf 0\n0 1 0 0 0 7\n3 0 1 2\n";
    std::fs::write(&path, text).expect("a temporary file");
    let scene = kd_scene::load_scene_with(&path, &LoadOptions::new());
    drop(std::fs::remove_file(&path));
    let surface = &scene.expect("valid").value.parts[0].surface;
    let expected = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(surface.colors, [expected.map(glam::Vec3::from_array)]);
}

#[test]
fn strips_become_triangles() {
    let text = header("ascii", 5, 1).replace("element face", "element tristrips");
    let mesh = read(text + "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n10 0 1 2 3 3 4 -1 2 3 4\n");
    // The repeated corner keeps the order of the strip.
    assert_eq!(mesh.triangles(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    // An unsigned -1, with counts of one and of four bytes.
    for (count, bytes) in [("uchar", &[7][..]), ("uint", &[7, 0, 0, 0])] {
        let head =
            header("binary_little_endian", 3, 1).replace("element face", "element tristrips");
        let mut file = head
            .replace("uchar int", &format!("{count} uint"))
            .into_bytes();
        file.extend([0; 36]);
        file.extend(bytes);
        for corner in [0, 1, 2, u32::MAX, 2, 1, 0] {
            file.extend(corner.to_le_bytes());
        }
        assert_eq!(read(file).triangles(), [[0, 1, 2], [2, 1, 0]], "{count}");
    }
}

#[test]
fn a_lenient_reader_leaves_out_what_the_header_lacks() {
    let path = std::env::temp_dir().join(format!("kd-ply-{}.ply", std::process::id()));
    let text = ascii().replace("3 0 1 2", "3 0 1 2 9 9");
    let text = text.replace("1.0\n", "1.0\nCreated by hand\n");
    std::fs::write(&path, text).expect("a temporary file");
    let load = |strictness| load_mesh_with(&path, &LoadOptions::new().with_strictness(strictness));
    assert!(load(Strictness::Usual).is_err(), "an error");
    let loaded = load(Strictness::Lenient).expect("read");
    assert_eq!(loaded.value.triangles(), FANS);
    let codes: Vec<_> = loaded.warnings.iter().map(|it| it.code).collect();
    assert_eq!(codes, [WarningCode::BadElement, WarningCode::LeftOver]);
    drop(std::fs::remove_file(&path));
}

/// The fault, the text, and the expected error.
fn bad_texts() -> Vec<(&'static str, String, &'static str)> {
    let good = ascii();
    let with = |from: &str, to: &str| good.replacen(from, to, 1);
    vec![
        (
            "empty",
            String::new(),
            "x.ply: header: `end_header` is missing",
        ),
        (
            "no ply",
            "obj\n".into(),
            "x.ply: line 1: bad header line: `obj`",
        ),
        (
            "header ends",
            "ply\nformat ascii 1.0\n".into(),
            "x.ply: header: `end_header` is missing",
        ),
        (
            "bad line",
            with("element vertex 4", "elephant vertex 4"),
            "x.ply: line 3: bad header line: `elephant vertex 4`",
        ),
        (
            "negative count",
            with("vertex 4", "vertex -4"),
            "x.ply: line 3: bad header line: `element vertex -4`",
        ),
        (
            "huge count",
            with("vertex 4", "vertex 99999999999999999999"),
            "x.ply: line 3: bad header line: `element vertex 99999999999999999999`",
        ),
        (
            "unknown type",
            with("float y", "quad y"),
            "x.ply: line 5: bad header line: `property quad y`",
        ),
        (
            "unknown format",
            with("ascii", "binary_middle_endian"),
            "x.ply: line 2: bad header line: `format binary_middle_endian 1.0`",
        ),
        (
            "no y",
            with("float y", "float why"),
            "x.ply: header: `vertex` has no scalar property `y`",
        ),
        (
            "list y",
            with("float y", "list uchar float y"),
            "x.ply: header: `vertex` has no scalar property `y`",
        ),
        (
            "no list",
            with("vertex_indices", "corners"),
            "x.ply: header: `face` needs one of the lists `vertex_indices` and `vertex_index`",
        ),
        (
            "float list",
            with("uchar int", "uchar float"),
            "x.ply: header: `vertex_indices` is not a list of integers",
        ),
        (
            "no list of it",
            with("list uchar int", "int"),
            "x.ply: header: `vertex_indices` is not a list of integers",
        ),
        (
            "same property",
            with("float y", "float x"),
            "x.ply: header: two elements or two properties have the same name",
        ),
        (
            "same element",
            with("element face", "element vertex"),
            "x.ply: header: two elements or two properties have the same name",
        ),
        (
            "no list of strips",
            with("element face", "element tristrips").replace("vertex_indices", "corners"),
            "x.ply: header: `tristrips` needs one of the lists `vertex_indices` and `vertex_index`",
        ),
        (
            "no format",
            with("format ascii 1.0\n", ""),
            "x.ply: header: `format` is missing",
        ),
        (
            "too many vertices claimed",
            with("vertex 4", "vertex 4000000000"),
            "x.ply: line 14: vertex 4: more values than the header declares: `3 0 1 2`",
        ),
        (
            "too many faces claimed",
            with("face 2", "face 4000000000"),
            "x.ply: ends at face 2 of 4000000000",
        ),
        (
            "cut",
            good[..good.len() - 10].to_owned(),
            "x.ply: ends at face 1 of 2",
        ),
        (
            "cut in a line",
            good[..good.len() - 3].to_owned(),
            "x.ply: line 15: face 1: too few values: `4 0 1 2`",
        ),
        (
            "short vertex",
            with("1 0 0", "1 0"),
            "x.ply: line 11: vertex 1: too few values: `1 0`",
        ),
        (
            "long vertex",
            with("1 0 0", "1 0 0 0"),
            "x.ply: line 11: vertex 1: more values than the header declares: `1 0 0 0`",
        ),
        (
            "no number",
            with("1 0 0", "1 zero 0"),
            "x.ply: line 11: vertex 1: bad number: `1 zero 0`",
        ),
        (
            "nan",
            with("1 0 0", "1 nan 0"),
            "x.ply: line 11: vertex 1 is not finite",
        ),
        (
            "too large",
            with("1 0 0", "1e39 0 0"),
            "x.ply: line 11: vertex 1 is not finite",
        ),
        (
            "two corners",
            with("3 0 1 2", "2 0 1"),
            "x.ply: line 14: face 0 has 2 corners, at least 3 are needed",
        ),
        (
            "no corners",
            with("3 0 1 2", "0"),
            "x.ply: line 14: face 0 has 0 corners, at least 3 are needed",
        ),
        (
            "minus three corners",
            with("3 0 1 2", "-3 0 1 2"),
            "x.ply: line 14: face 0: bad list count: `-3 0 1 2`",
        ),
        (
            "out of range",
            with("3 0 1 2", "3 0 1 4"),
            "x.ply: line 14: face 0: index 4 is out of range, there are 4 vertices",
        ),
        (
            "negative",
            with("4 0 1 2 3", "4 0 1 2 -1"),
            "x.ply: line 15: face 1: index -1 is out of range, there are 4 vertices",
        ),
        (
            "list longer than its line",
            with("3 0 1 2", "4000000000 0 1 2"),
            "x.ply: line 14: face 0: too few values: `4000000000 0 1 2`",
        ),
        (
            "fraction",
            with("3 0 1 2", "3 0 1 1.5"),
            "x.ply: line 14: face 0: bad number: `3 0 1 1.5`",
        ),
    ]
}

#[test]
fn invalid_text_files_are_errors_with_their_line() {
    for (what, text, expected) in bad_texts() {
        let read = read_ply(text.as_bytes(), "x.ply");
        let error = read.err().unwrap_or_else(|| panic!("{what}: was read"));
        assert_eq!(error.to_string(), expected, "{what}");
    }
}

/// A binary file: vertices of `f32`, faces as lists of `i32` with a `u8` count.
fn binary(big: bool, positions: &[[f32; 3]], faces: &[Vec<i32>]) -> Vec<u8> {
    let order = if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let mut bytes = header(order, positions.len() as u64, faces.len() as u64).into_bytes();
    for number in positions.iter().flatten() {
        bytes.extend(if big {
            number.to_be_bytes()
        } else {
            number.to_le_bytes()
        });
    }
    for face in faces {
        bytes.push(u8::try_from(face.len()).expect("a small face"));
        for index in face {
            bytes.extend(if big {
                index.to_be_bytes()
            } else {
                index.to_le_bytes()
            });
        }
    }
    bytes
}

fn corners() -> Vec<[f32; 3]> {
    vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
}

fn faces() -> Vec<Vec<i32>> {
    vec![vec![0, 1, 2], vec![0, 1, 2, 3]]
}

#[test]
fn text_and_both_byte_orders_agree() {
    let text = read(ascii());
    for big in [false, true] {
        let mut bytes = binary(big, &corners(), &faces());
        assert_eq!(read(&bytes), text, "big endian: {big}");
        bytes.push(b'\n');
        assert_eq!(read(&bytes), text, "a line end after the data is ignored");
    }
    let crlf = header("binary_little_endian", 4, 2).replace('\n', "\r\n");
    let little = binary(false, &corners(), &faces());
    let data = &little[header("binary_little_endian", 4, 2).len()..];
    assert_eq!(
        read([crlf.as_bytes(), data].concat()),
        text,
        "CRLF in the header only"
    );
}

#[test]
fn binary_numbers_of_every_type() {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement other 2\n\
        property list ushort short skip\nproperty char c\nelement face 1\n\
        property list int ushort vertex_index\nproperty double area\nelement vertex 3\n\
        property double x\nproperty uchar y\nproperty int z\nend_header\n"
        .to_vec();
    bytes.extend(b"\0\x02\0\x09\0\x09\xff\0\0\x07");
    bytes.extend(b"\0\0\0\x03\0\0\0\x01\0\x02\0\0\0\0\0\0\0\0");
    for x in [0.5_f64, -2.25, 1e10] {
        bytes.extend(x.to_be_bytes());
        bytes.extend([200, 0xff, 0xff, 0xff, 0xfe]);
    }
    let mesh = read(bytes);
    assert_eq!(
        mesh.positions(),
        [
            [0.5, 200.0, -2.0],
            [-2.25, 200.0, -2.0],
            [1e10, 200.0, -2.0]
        ]
    );
    assert_eq!(mesh.triangles(), [[0, 1, 2]]);
}

#[test]
fn invalid_binary_files_are_errors_with_their_element() {
    let nan = [corners(), vec![[0.0, f32::NAN, 0.0]]].concat();
    let lying = |vertices, faces| {
        let mut bytes = header("binary_little_endian", vertices, faces).into_bytes();
        bytes.extend([0; 20]);
        bytes
    };
    let good = binary(false, &corners(), &faces());
    let rows = [
        (
            "nan",
            binary(false, &nan, &faces()),
            "x.ply: vertex 4 is not finite",
        ),
        (
            "inf",
            binary(true, &[[f32::INFINITY; 3]], &[]),
            "x.ply: vertex 0 is not finite",
        ),
        (
            "negative",
            binary(false, &corners(), &[vec![0, 1, 2], vec![0, 1, -7]]),
            "x.ply: face 1: index -7 is out of range, there are 4 vertices",
        ),
        (
            "out of range",
            binary(true, &corners(), &[vec![0, 1, 4]]),
            "x.ply: face 0: index 4 is out of range, there are 4 vertices",
        ),
        (
            "two corners",
            binary(true, &corners(), &[vec![0, 1]]),
            "x.ply: face 0 has 2 corners, at least 3 are needed",
        ),
        (
            "cut face",
            good[..good.len() - 1].to_vec(),
            "x.ply: ends at face 1 of 2",
        ),
        (
            "cut vertex",
            good[..good.len() - 31].to_vec(),
            "x.ply: ends at vertex 3 of 4",
        ),
        (
            "vertices claimed",
            lying(4_000_000_000, 0),
            "x.ply: ends at vertex 1 of 4000000000",
        ),
        (
            "faces claimed",
            lying(1, u64::MAX),
            "x.ply: face 0 has 0 corners, at least 3 are needed",
        ),
    ];
    for (what, bytes, expected) in rows {
        let read = read_ply(bytes.as_slice(), "x.ply");
        let error = read.err().unwrap_or_else(|| panic!("{what}: was read"));
        assert_eq!(error.to_string(), expected, "{what}");
    }
    let signed_count = "ply\nformat binary_little_endian 1.0\nelement face 1\n\
        property list char int vertex_indices\nend_header\n\u{1}";
    let mut signed_count = signed_count.as_bytes().to_vec();
    *signed_count.last_mut().expect("a count") = 0x80;
    let error = read_ply(signed_count.as_slice(), "x.ply").expect_err("-128 corners");
    assert!(
        matches!(error, LoadError::BadElement { index: 0, .. }),
        "{error}"
    );
}

/// A list that declares 2^32 - 1 entries, and an element without properties that declares 2^64 - 1 rows.
#[test]
fn declared_counts_allocate_nothing() {
    let mut list = b"ply\nformat binary_little_endian 1.0\nelement face 1\n\
        property list uint int vertex_indices\nend_header\n"
        .to_vec();
    list.extend([0xff; 64]);
    let error = read_ply(list.as_slice(), "x.ply")
        .expect_err("too short")
        .to_string();
    assert_eq!(error, "x.ply: ends at face 0 of 1");
    let empty =
        b"ply\nformat binary_little_endian 1.0\nelement void 18446744073709551615\nend_header\n";
    assert!(read(empty).is_empty());
}

#[test]
fn every_truncated_file_is_an_error() {
    for big in [false, true] {
        let good = binary(big, &corners(), &faces());
        for end in 0..good.len() {
            assert!(
                read_ply(&good[..end], "cut.ply").is_err(),
                "cut at {end} of {}",
                good.len()
            );
        }
    }
}

proptest! {
    #[test]
    fn random_data_after_a_header_does_not_panic(
        format in 0..3_usize,
        vertices in 0..9_u64,
        faces in 0..9_u64,
        data in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let format = ["ascii", "binary_little_endian", "binary_big_endian"][format];
        let bytes = [header(format, vertices, faces).into_bytes(), data].concat();
        if let Ok(mesh) = read_ply(bytes.as_slice(), "any.ply") {
            prop_assert_eq!(mesh.positions().len() as u64, vertices);
        }
    }

    #[test]
    fn random_words_after_a_text_header_do_not_panic(
        words in proptest::collection::vec("[0-4]|-1|nan|1e39|[0-9]{1,12}|\n|\n|\n|x", 0..60),
    ) {
        let text = header("ascii", 2, 2) + &words.join(" ");
        if let Ok(mesh) = read_ply(text.as_bytes(), "any.ply") {
            prop_assert_eq!(mesh.positions().len(), 2);
        }
    }

    #[test]
    fn damaged_files_do_not_panic(place in 0..1000_usize, byte in any::<u8>(), big in any::<bool>()) {
        let mut bytes = binary(big, &corners(), &faces());
        let place = place % bytes.len();
        bytes[place] = byte;
        if let Ok(mesh) = read_ply(bytes.as_slice(), "any.ply") {
            prop_assert!(mesh.positions().iter().flatten().all(|number| number.is_finite()));
        }
    }

    #[test]
    fn written_meshes_read_back_unchanged(
        positions in proptest::collection::vec(any::<[i16; 3]>(), 1..30),
        faces in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 3..6), 0..30),
        big in any::<bool>(),
    ) {
        let positions: Vec<_> =
            positions.iter().map(|it| it.map(|number| f32::from(number) / 7.0)).collect();
        let corner = |index: &u8| i32::from(*index) % i32::try_from(positions.len()).expect("fits in 32 bits");
        let faces: Vec<Vec<i32>> =
            faces.iter().map(|face| face.iter().map(corner).collect()).collect();
        let mesh = read(binary(big, &positions, &faces));
        prop_assert_eq!(mesh.positions(), &positions);
        prop_assert_eq!(mesh.len(), faces.iter().map(|face| face.len() - 2).sum::<usize>());
    }
}
