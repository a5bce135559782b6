//! Moved trees compared with moved meshes: the tree covers the mesh, and rays get the answers of brute force.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use kd_core::{BoundsOnly, Mesh, Ray, Tree, TreeError};
use kd_sah::{BuildOptions, build};
use kd_scene::Spd;
use kd_trace::brute_force;
use proptest::prelude::*;

fn along_axes(scale: Vec3, translation: Vec3) -> Affine3A {
    Affine3A {
        matrix3: Mat3A::from_diagonal(scale),
        translation: translation.into(),
    }
}

/// Transforms tree and mesh, and checks that the tree covers the mesh.
#[track_caller]
fn check(mesh: &Mesh, tree: &Tree, by: &Affine3A) -> (Mesh, Tree) {
    let mesh = mesh.transformed(by).expect("finite positions");
    let tree = tree.moved(by).expect("a transform along axes");
    tree.check_coverage(&mesh)
        .unwrap_or_else(|missing| panic!("{by:?}: {missing}"));
    (mesh, tree)
}

#[test]
fn trees_over_bounds_stay_correct_when_moved() {
    let transforms = [
        ("identity", Vec3::ONE, Vec3::ZERO),
        ("translated", Vec3::ONE, Vec3::new(3.0, -700.0, 1e6)),
        ("shrunk", Vec3::splat(1e-20), Vec3::ZERO),
        (
            "stretched",
            Vec3::new(0.1, 3.0, 1.1),
            Vec3::new(0.1, 0.2, 0.3),
        ),
        ("mirrored", Vec3::new(-1.0, 1.0, -0.7), Vec3::splat(0.3)),
        ("flattened", Vec3::new(1.0, 0.0, 1.0), Vec3::splat(0.3)),
    ];
    for spd in [Spd::Gears, Spd::Balls, Spd::Rings] {
        let mesh = spd.generate(1).expect("small").mesh;
        let tree = build(&BoundsOnly(&mesh), &BuildOptions::best()).expect("valid");
        for (name, scale, translation) in transforms {
            let (mesh, tree) = check(&mesh, &tree, &along_axes(scale, translation));
            let bounds = mesh.bounds();
            let mut rng = fastrand::Rng::with_seed(1);
            let mut point = |extent: Vec3| {
                let one = Vec3::new(rng.f32(), rng.f32(), rng.f32());
                bounds.center() + extent * (one - 0.5)
            };
            let mut hits = 0;
            for _ in 0..200 {
                let origin = point(2.0 * Vec3::splat(bounds.extent().max_element()));
                let ray = Ray::new(origin, point(0.5 * bounds.extent()) - origin);
                let hit = brute_force::intersect(&mesh, &ray);
                assert_eq!(
                    kd_trace::intersect(&tree, &mesh, &ray),
                    hit,
                    "{spd:?}, {name}: {ray:?}"
                );
                hits += usize::from(hit.is_some());
            }
            assert!(
                hits > 20 || name == "flattened",
                "{spd:?}, {name}: {hits} hits"
            );
        }
    }
}

#[test]
fn rotations_and_overflow_are_refused() {
    let mesh = Spd::Tetra.generate(2).expect("small").mesh;
    let tree = build(&BoundsOnly(&mesh), &BuildOptions::fast()).expect("valid");
    for by in [
        Affine3A::from_rotation_x(0.1),
        Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_2),
        Affine3A::from_translation(Vec3::new(f32::NAN, 0.0, 0.0)),
    ] {
        let refused = tree.moved(&by).expect_err("not along the axes");
        assert_eq!(refused, TreeError::NotAlongAxes, "{by:?}");
    }
    let far = tree.moved(&along_axes(Vec3::splat(f32::MAX), Vec3::splat(f32::MAX)));
    let is_not_finite = matches!(
        far,
        Err(TreeError::SplitNotFinite { .. } | TreeError::BadBounds)
    );
    assert!(is_not_finite, "{far:?}");
}

#[test]
fn an_empty_tree_can_be_moved() {
    let nothing = Mesh::new(Vec::new(), Vec::new()).expect("valid");
    let tree = build(&BoundsOnly(&nothing), &BuildOptions::fast()).expect("valid");
    let (_, tree) = check(&nothing, &tree, &Affine3A::from_translation(Vec3::ONE));
    assert_eq!(tree.stats().leaves, 1, "an empty leaf");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_triangles_can_be_moved(
        positions in prop::collection::vec(
            [0_u8..5, 0_u8..5, 0_u8..5].prop_map(|p| p.map(|x| f32::from(x) * 0.25)),
            3..90,
        ),
        scale in prop::array::uniform3(prop_oneof![
            Just(1.0_f32), Just(-1.0), Just(0.0), -3.0_f32..3.0,
        ]),
        translation in prop::array::uniform3(prop_oneof![Just(0.0_f32), -1.0e4_f32..1.0e4]),
    ) {
        let count = u32::try_from(positions.len() / 3).expect("small");
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions, triangles).expect("valid");
        let tree = build(&BoundsOnly(&mesh), &BuildOptions::best().with_threads(1)).expect("valid");
        let by = along_axes(Vec3::from(scale), Vec3A::from(translation).into());
        let (_, moved) = check(&mesh, &tree, &by);
        prop_assert_eq!(moved.stats().references, tree.stats().references);
    }
}
