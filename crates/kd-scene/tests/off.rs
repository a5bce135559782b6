//! The OFF reader on valid and invalid files.

use kd_scene::{LoadOptions, WarningCode, load_mesh_with, read_off};

const TEXT: &str =
    "OFF\n# a square and a triangle\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 3\n";
const TRIANGLES: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [0, 1, 3]];

#[test]
fn valid_files_are_read() {
    let rows = [
        ("plain", TEXT.to_owned()),
        (
            "counts beside the word",
            TEXT.replace("OFF\n# a square and a triangle\n", "OFF "),
        ),
        (
            "counts at the word",
            TEXT.replace("OFF\n# a square and a triangle\n", "\t OFF"),
        ),
        ("no word", TEXT.replace("OFF\n", "")),
        ("no edges", TEXT.replace("4 2 0", "4 2")),
        ("colors of faces", TEXT.replace("2 3\n", "2 3 255 0 0\n")),
        (
            "colors of vertices",
            TEXT.replace("OFF", "COFF")
                .replace("0 0\n1 1", "0 0 9 9 9 9\n1 1"),
        ),
        (
            "normals",
            TEXT.replace("OFF", "NOFF")
                .replace("0 1 0\n4", "0 1 0 0 0 1\n4"),
        ),
        (
            "values over lines",
            TEXT.replace("4 0 1 2 3", "4\n0 1\n\n2 # here\n3")
                .replace("1 1 0", "1\n1 0"),
        ),
        ("CRLF", TEXT.replace('\n', "\r\n")),
        ("comments", TEXT.replace("\n1 1 0", " # corner\n#\n1 1 0")),
        ("left over", TEXT.to_owned() + "3 0 0 0\n"),
    ];
    for (what, text) in rows {
        let mesh = read_off(text.as_bytes(), "a.off");
        let mesh = mesh.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(mesh.triangles(), TRIANGLES, "{what}");
        assert_eq!(mesh.positions()[2], [1.0, 1.0, 0.0], "{what}");
    }
    assert!(
        read_off(&b"OFF 0 0 0"[..], "a.off")
            .expect("empty")
            .is_empty()
    );
}

#[test]
fn errors_name_the_line() {
    let with = |from: &str, to: &str| TEXT.replacen(from, to, 1);
    for (text, expected) in [
        (
            String::new(),
            "header: expected `OFF` and the numbers of vertices and faces",
        ),
        (
            "cat\n1 2 3".into(),
            "line 1: expected the numbers of vertices and faces: `cat`",
        ),
        (
            with("OFF", "4OFF"),
            "line 1: points of other than three dimensions are not supported: `4OFF`",
        ),
        (
            with("OFF", "OFF BINARY"),
            "line 1: binary OFF is not supported: `OFF BINARY`",
        ),
        (
            with("4 2 0", "4 -2 0"),
            "line 3: expected the numbers of vertices and faces: `4 -2 0`",
        ),
        (with("1 1 0", "1 one 0"), "line 6: bad vertex: `1 one 0`"),
        (with("1 1 0", "1 inf 0"), "line 6: vertex 2 is not finite"),
        (
            with("2 3\n", "2 4\n"),
            "line 8: face 0: index 4 is out of range, there are 4 vertices",
        ),
        (
            with("4 0 1 2 3", "4 0 1 x 3"),
            "line 8: bad face: `4 0 1 x 3`",
        ),
        (
            with("4 0 1 2 3", "2 0 1"),
            "line 8: face 0 has 2 corners, at least 3 are needed",
        ),
        (with("4 2 0", "4 9 0"), "ends at face 2 of 9"),
        (
            with("4 2 0", "99999999999 9 0"),
            "line 8: bad face: `3 0 1 3`",
        ),
        (with("3 0 1 3", "9 0 1 3"), "line 9: bad face: `9 0 1 3`"),
    ] {
        let read = read_off(text.as_bytes(), "a.off");
        let error = read.err().unwrap_or_else(|| panic!("{text:?} was read"));
        if !expected.contains("99999999999") && text.contains("99999999999") {
            assert!(error.to_string().starts_with("a.off: "), "{error}");
            continue;
        }
        assert_eq!(error.to_string(), format!("a.off: {expected}"), "{text:?}");
    }
}

#[test]
fn what_is_not_used_has_a_warning() {
    let path = std::env::temp_dir().join(format!("kd-off-{}.off", std::process::id()));
    let text = TEXT
        .replace("1 1 0", "1 1 0 9 9 9")
        .replace("2 3\n", "2 3 1 0 0\n")
        + "more";
    std::fs::write(&path, text).expect("a temporary file");
    let loaded = load_mesh_with(&path, &LoadOptions::new()).expect("valid");
    let codes: Vec<_> = loaded.warnings.iter().map(|it| it.code).collect();
    use WarningCode::{LeftOver, Unused};
    assert_eq!(codes, [Unused, Unused, LeftOver]);
    drop(std::fs::remove_file(&path));
}

#[test]
fn damaged_files_do_not_panic() {
    let mut rng = fastrand::Rng::with_seed(6);
    let mut valid = 0;
    for _ in 0..4000 {
        let mut bytes = TEXT.as_bytes().to_vec();
        for _ in 0..rng.usize(1..3) {
            let at = rng.usize(..bytes.len());
            match rng.u8(..3) {
                0 => bytes[at] = rng.u8(..),
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"\n 9.e-"[rng.usize(..6)]),
            }
        }
        if let Ok(mesh) = read_off(&bytes[..], "a.off") {
            assert!(
                mesh.positions().iter().flatten().all(|x| x.is_finite()),
                "finite"
            );
            valid += 1;
        }
    }
    assert!(valid > 500, "only {valid} are valid");
}
