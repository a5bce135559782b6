//! Properties of all scenes: documented counts, bounding boxes, determinism.

use super::*;

/// Numbers of triangles at a size, computed by hand from the documented numbers of primitives.
const COUNTS: [(Spd, u32, usize); 33] = [
    (Spd::Balls, 1, 10 * 192 + 2),
    (Spd::Balls, 2, 91 * 192 + 2),
    (Spd::Balls, 4, 1_417_154),
    (Spd::Gears, 1, 574),
    (Spd::Gears, 2, 4_578),
    (Spd::Gears, 4, 36_610),
    (Spd::Mount, 1, 8 + 768),
    (Spd::Mount, 4, 512 + 768),
    (Spd::Mount, 6, 8_960),
    (Spd::Rings, 1, 30 * 224 + 2),
    (Spd::Rings, 2, 150 * 224 + 2),
    (Spd::Rings, 7, 940_802),
    (Spd::Teapot, 2, 240 + 2 * 4),
    (Spd::Teapot, 12, 9_120 + 2 * 144),
    (Spd::Teapot, 40, 105_280),
    (Spd::Tetra, 1, 4),
    (Spd::Tetra, 6, 4_096),
    (Spd::Tetra, 9, 262_144),
    (Spd::Tree, 1, 3 * 224 + 2),
    (Spd::Tree, 3, 15 * 224 + 2),
    (Spd::Tree, 11, 917_282),
    (Spd::Lattice, 1, 8 * 192 + 12 * 32),
    (Spd::Lattice, 2, 27 * 192 + 54 * 32),
    (Spd::Lattice, 12, 616_512),
    (Spd::Shells, 1, 361 * 192),
    (Spd::Shells, 2, 721 * 192),
    (Spd::Shells, 5, 1_106_112),
    (Spd::Sombrero, 1, 1_922),
    (Spd::Sombrero, 2, 2 * 63 * 63),
    (Spd::Sombrero, 4, 130_050),
    (Spd::Jacks, 1, 336),
    (Spd::Jacks, 2, 9 * 336),
    (Spd::Jacks, 4, 196_560),
];

#[test]
fn counts_are_as_documented() {
    for (scene, size, triangles) in COUNTS {
        let setup = scene.generate(size).expect("a scene");
        assert_eq!(setup.mesh.len(), triangles, "{}", setup.name);
        let promised = scene.triangles(size).map(usize::try_from);
        assert_eq!(promised, Some(Ok(triangles)), "{}", setup.name);
        assert_eq!(setup.name, format!("{scene}-{size}"));
    }
}

#[test]
fn bounds_are_as_expected() {
    let rows = [
        (Spd::Balls, 2, [-12.0, -12.0, -0.5], [12.0, 12.0, 0.785]),
        (Spd::Gears, 2, [-2.0, -2.0, 0.0], [2.0, 2.0, 1.0]),
        (Spd::Tetra, 3, [-1.0; 3], [1.0; 3]),
        (Spd::Tree, 2, [-50.0, -50.0, 0.0], [50.0, 50.0, 2.138]),
        (Spd::Lattice, 2, [-0.125; 3], [1.125; 3]),
        (Spd::Teapot, 6, [-4.0, -4.0, 0.0], [4.0, 4.0, 3.15]),
        (Spd::Sombrero, 1, [-4.0, -1.8196, -4.0], [4.0, 3.0, 4.0]),
    ];
    for (scene, size, low, high) in rows {
        let bounds = scene.generate(size).expect("a scene").mesh.bounds();
        let off = (bounds.min - Vec3::from(low))
            .abs()
            .max((bounds.max - Vec3::from(high)).abs());
        assert!(off.max_element() < 0.01, "{scene}: {bounds:?}");
    }
}

#[test]
fn no_scene_has_triangles_without_area() {
    for scene in Spd::ALL {
        let setup = scene.generate(2).expect("a scene");
        assert_eq!(setup.mesh.zero_area_count(), 0, "{scene}");
    }
}

#[test]
fn cameras_see_a_quarter_of_the_vertices() {
    for scene in Spd::ALL {
        let setup = scene.generate(2).expect("a scene");
        let camera = setup.camera;
        assert!(!setup.lights.is_empty(), "{scene}");
        let view = camera.view(1.0);
        let inside = |position: &[f32; 3]| {
            let offset = Vec3::from(*position) - camera.eye;
            let across = |axis: Vec3| (offset.dot(axis) / axis.length_squared()).abs();
            let depth = offset.dot(view.forward);
            depth > 0.0 && across(view.right) < depth && across(view.down) < depth
        };
        let seen = setup
            .mesh
            .positions()
            .iter()
            .filter(|position| inside(position))
            .count();
        let all = setup.mesh.positions().len();
        assert!(4 * seen > all, "{scene}: {seen} of {all} vertices in view");
    }
}

/// Positions are identical on every platform. A changed hash means a changed scene for all records.
#[test]
fn scenes_do_not_change() {
    let pinned = [
        (Spd::Balls, 0x6223_f100_4380_600f),
        (Spd::Gears, 0xa5bf_7d4c_c5b9_0aef),
        (Spd::Mount, 0xf760_eee6_6f79_9020),
        (Spd::Rings, 0xdcd6_6493_4296_973f),
        (Spd::Teapot, 0x1f73_af55_158c_bb5d),
        (Spd::Tetra, 0xd409_f7b4_8472_e445),
        (Spd::Tree, 0x68f3_865e_4b41_2cef),
        (Spd::Lattice, 0x6eb5_f0e7_1638_1828),
        (Spd::Shells, 0xec05_cab3_d6ff_c72a),
        (Spd::Sombrero, 0x9e64_0626_c656_9b91),
        (Spd::Jacks, 0xf696_4623_d60a_890d),
    ];
    let hashes = pinned.map(|(scene, _)| {
        let mesh = scene.generate(2).expect("a scene").mesh;
        let positions = mesh
            .positions()
            .iter()
            .flatten()
            .map(|coordinate| coordinate.to_bits());
        let words = positions.chain(mesh.triangles().iter().flatten().copied());
        // FNV-1a over 32-bit words.
        let step = |hash: u64, word: u32| (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
        (scene, words.fold(0xcbf2_9ce4_8422_2325, step))
    });
    assert_eq!(hashes, pinned);
}

#[test]
fn sizes_out_of_range_are_errors() {
    for scene in Spd::ALL {
        assert_eq!(scene.generate(0), Err(SpdError::SizeZero { scene }));
        for size in [10_000, u32::MAX / 2, u32::MAX] {
            assert_eq!(
                scene.generate(size),
                Err(SpdError::TooLarge { scene, size })
            );
        }
        let largest = (1..=1000)
            .rev()
            .find(|&size| scene.triangles(size).is_some());
        let largest = largest.expect("size 1 fits");
        assert!(scene.default_size() <= largest, "{scene}: {largest}");
        for size in 1..largest {
            assert!(
                scene.triangles(size) < scene.triangles(size + 1),
                "{scene} grows with size"
            );
        }
    }
}

#[test]
fn names_parse_to_their_scene() {
    for scene in Spd::ALL {
        assert_eq!(scene.name().parse(), Ok(scene));
    }
    let error = "bals"
        .parse::<Spd>()
        .expect_err("no such scene")
        .to_string();
    assert!(
        error.starts_with("unknown scene `bals`, expected one of balls, gears"),
        "{error}"
    );
}
