//! The STL reader on valid and invalid files.

use kd_core::Mesh;
use kd_scene::{LoadOptions, Strictness, WarningCode, load_mesh_with, read_stl};

const TEXT: &str = "solid two triangles\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   \
    vertex 0 1 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1 0 0\n   vertex 1 1e0 0\n   \
    vertex 0 1 0\n  endloop\n endfacet\nendsolid two triangles\n";

const CORNERS: [[f32; 3]; 6] = [
    [0.0; 3],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
];

/// A binary file, with a header that begins as a text does.
fn binary(corners: &[[f32; 3]], attribute: u8) -> Vec<u8> {
    let mut bytes = b"solid facet".to_vec();
    bytes.resize(80, b' ');
    let count = u32::try_from(corners.len() / 3).expect("few");
    bytes.extend(count.to_le_bytes());
    for corners in corners.as_chunks::<3>().0 {
        bytes.extend([0; 12]);
        bytes.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([attribute, 0]);
    }
    bytes
}

fn text_of(read: Result<Mesh, kd_scene::LoadError>) -> String {
    match read {
        Ok(mesh) => format!("{} triangles", mesh.len()),
        Err(error) => error.to_string(),
    }
}

#[test]
fn text_and_binary_agree() {
    let upper = TEXT.to_ascii_uppercase();
    let tabs = TEXT.replace(' ', "\t").replace('\n', "\r\n");
    let two = format!("{TEXT}{TEXT}");
    for text in [TEXT, &upper, &tabs] {
        let mesh = read_stl(text.as_bytes(), "a.stl").expect("valid");
        assert_eq!(mesh.positions(), CORNERS);
        assert_eq!(mesh.triangles(), [[0, 1, 2], [3, 4, 5]]);
    }
    assert_eq!(
        read_stl(two.as_bytes(), "a.stl").expect("two solids").len(),
        4
    );
    let bytes = binary(&CORNERS, 0);
    assert_eq!(
        read_stl(&bytes[..], "a.stl").expect("valid").positions(),
        CORNERS
    );
    let one_line =
        TEXT.replace('\n', " ")
            .replacen("solid two triangles", "solid two triangles\n", 1);
    let mesh = read_stl(one_line.as_bytes(), "a.stl").expect("valid");
    assert_eq!(mesh.positions(), CORNERS, "statements on one line");
    let all_on_one = format!("{TEXT}{TEXT}").replace('\n', " ");
    assert_eq!(
        read_stl(all_on_one.as_bytes(), "a.stl")
            .expect("valid")
            .len(),
        4
    );
    let split = TEXT
        .replace("normal ", "normal\n")
        .replace("vertex 0", "vertex\n0");
    assert_eq!(
        read_stl(split.as_bytes(), "a.stl")
            .expect("valid")
            .positions(),
        CORNERS
    );
    assert!(
        read_stl(&b"solid\nendsolid"[..], "a.stl")
            .expect("empty")
            .is_empty()
    );
    assert!(
        read_stl(&binary(&[], 0)[..], "a.stl")
            .expect("empty")
            .is_empty()
    );
    let quad = TEXT.replacen("   vertex 0 1 0\n", "   vertex 1 1 0\n   vertex 0 1 0\n", 1);
    assert_eq!(read_stl(quad.as_bytes(), "a.stl").expect("a quad").len(), 3);
}

#[test]
fn errors_name_the_line_or_the_triangle() {
    let bytes = binary(&CORNERS, 0);
    let mut nan = CORNERS;
    nan[4][1] = f32::NAN;
    let cases: [(&[u8], &str); 11] = [
        (
            b"",
            "a.stl: header: expected 84 bytes of binary STL or `solid`, found 0",
        ),
        (&bytes[..100], "a.stl: ends at triangle 0 of 2"),
        (&bytes[..183], "a.stl: ends at triangle 1 of 2"),
        (&binary(&nan, 0), "a.stl: vertex 4 is not finite"),
        (
            TEXT.replace("1e0", "x").as_bytes().to_vec().leak(),
            "a.stl: line 12: bad vertex: `vertex 1 x 0`",
        ),
        (
            TEXT.replace("1e0", "nan").as_bytes().to_vec().leak(),
            "a.stl: line 9: vertex 4 is not finite",
        ),
        (
            TEXT.replacen(" endfacet\n", "", 1).into_bytes().leak(),
            "a.stl: line 8: the facet before has no `endfacet`: `facet normal 0 0 1`",
        ),
        (
            TEXT.replacen(" facet normal 0 0 1\n", "", 1)
                .into_bytes()
                .leak(),
            "a.stl: line 3: no facet is open: `vertex 0 0 0`",
        ),
        (
            &TEXT.as_bytes()[..100],
            "a.stl: line 2: the file ends in this facet",
        ),
        (
            TEXT.replacen("endloop", "endlop", 1).into_bytes().leak(),
            "a.stl: line 7: not a statement of STL: `endlop`",
        ),
        (
            TEXT.replacen("   vertex 0 1 0\n", "", 1)
                .into_bytes()
                .leak(),
            "a.stl: line 2: face 0 has 2 corners, at least 3 are needed",
        ),
    ];
    for (bytes, expected) in cases {
        assert_eq!(text_of(read_stl(bytes, "a.stl")), expected);
    }
}

#[test]
fn what_is_not_used_has_a_warning() {
    let path = std::env::temp_dir().join(format!("kd-stl-{}.stl", std::process::id()));
    let load = |bytes: &[u8], strictness| {
        std::fs::write(&path, bytes).expect("a temporary file");
        load_mesh_with(&path, &LoadOptions::new().with_strictness(strictness)).expect("valid")
    };
    let colored = load(&binary(&CORNERS, 7), Strictness::Usual);
    assert_eq!(
        (colored.value.len(), colored.warnings[0].code),
        (2, WarningCode::Unused)
    );
    let longer = [binary(&CORNERS, 0), vec![1; 3]].concat();
    let longer = load(&longer, Strictness::Usual);
    assert_eq!(
        (longer.value.len(), longer.warnings[0].code),
        (2, WarningCode::LeftOver)
    );
    let cut = load(
        TEXT.split_once("endsolid").expect("its end").0.as_bytes(),
        Strictness::Usual,
    );
    assert_eq!(
        (cut.value.len(), cut.warnings[0].code),
        (2, WarningCode::MissingEnd)
    );
    let mut nan = CORNERS;
    nan[4][1] = f32::INFINITY;
    let lenient = load(&binary(&nan, 0), Strictness::Lenient);
    assert_eq!(
        (lenient.value.len(), lenient.warnings[0].code),
        (1, WarningCode::NotFinite)
    );
    let colors = load(
        TEXT.replace("vertex 1 0 0", "vertex 1 0 0 .5 .5 .5")
            .as_bytes(),
        Strictness::Usual,
    );
    assert_eq!(
        (colors.value.len(), colors.warnings[0].code),
        (2, WarningCode::Unused)
    );
    for damaged in [
        TEXT.replacen(" endfacet\n", "", 1),
        TEXT.replacen("vertex 0 0 0", "vertex x 0 0", 1),
        TEXT.rsplit_once(" endfacet").expect("its end").0.to_owned(),
    ] {
        let left = load(damaged.as_bytes(), Strictness::Lenient);
        assert_eq!(
            (left.value.len(), left.warnings[0].code),
            (1, WarningCode::BadElement),
            "{damaged}"
        );
    }
    drop(std::fs::remove_file(&path));
}

#[test]
fn damaged_files_do_not_panic() {
    let mut rng = fastrand::Rng::with_seed(5);
    let seeds = [TEXT.as_bytes().to_vec(), binary(&CORNERS, 0)];
    let mut valid = 0;
    for _ in 0..4000 {
        let mut bytes = seeds[rng.usize(..2)].clone();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(..bytes.len());
            match rng.u8(..3) {
                0 => bytes[at] = rng.u8(..),
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"\n 9.e-"[rng.usize(..6)]),
            }
        }
        if let Ok(mesh) = read_stl(&bytes[..], "a.stl") {
            assert!(
                mesh.positions().iter().flatten().all(|x| x.is_finite()),
                "finite"
            );
            valid += 1;
        }
    }
    assert!(valid > 500, "only {valid} are valid");
}
