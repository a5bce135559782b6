//! Placed trees against brute force over transformed meshes.

use glam::{Affine3A, Mat3, Quat, Vec3};
use kd_core::{Mesh, Ray};
use kd_oracle::rays::Rays;
use kd_oracle::rng::Rng;
use kd_oracle::{effort, scenes};
use kd_trace::kit::{Any, Closest, Frame, Ordered, Placement, collect_placed};
use kd_trace::{Level, WideTree, brute_force};

/// Between -1 and 1.
fn number(rng: &mut Rng) -> f32 {
    2.0 * rng.unit() - 1.0
}

fn vector(rng: &mut Rng) -> Vec3 {
    Vec3::new(number(rng), number(rng), number(rng))
}

/// Turns, scales, mirrors and shears, from a little to very much.
fn transforms(rng: &mut Rng) -> Vec<(&'static str, Affine3A)> {
    let turn =
        |rng: &mut Rng| Quat::from_axis_angle(vector(rng).normalize_or(Vec3::X), 3.0 * number(rng));
    let mut all = vec![("identity", Affine3A::IDENTITY)];
    for _ in 0..4 {
        let to = 3.0 * vector(rng);
        all.push(("turned", Affine3A::from_rotation_translation(turn(rng), to)));
        let sign = Vec3::from(vector(rng).to_array().map(f32::signum));
        let scale = sign * (Vec3::splat(0.2) + vector(rng).abs());
        all.push((
            "scaled",
            Affine3A::from_scale_rotation_translation(scale, turn(rng), to),
        ));
        let sheared = Mat3::from_cols(
            vector(rng),
            vector(rng) + 2.0 * Vec3::Y,
            vector(rng) + 2.0 * Vec3::Z,
        );
        all.push(("sheared", Affine3A::from_mat3_translation(sheared, to)));
        let flat = Vec3::new(1.0, 1e-3, 1.0);
        all.push((
            "flat",
            Affine3A::from_scale_rotation_translation(flat, turn(rng), to),
        ));
        let far = 1e4 * vector(rng);
        all.push((
            "far",
            Affine3A::from_scale_rotation_translation(scale, turn(rng), far),
        ));
    }
    let mirror = Vec3::new(-1.0, 1.0, 1.0);
    all.push(("mirrored", Affine3A::from_scale(mirror)));
    all.push((
        "tiny",
        Affine3A::from_scale_rotation_translation(
            Vec3::splat(1e-12),
            turn(rng),
            vector(rng) * 1e-12,
        ),
    ));
    all.push((
        "huge",
        Affine3A::from_scale_rotation_translation(Vec3::splat(1e12), turn(rng), vector(rng) * 1e12),
    ));
    all.push(("extreme", Affine3A::from_scale(Vec3::splat(1e24))));
    all
}

/// Every answer at every level; rays around the transformed mesh.
#[test]
fn placed_trees_answer_as_transformed_meshes() {
    const FIRST_SLOT: u32 = 1000;
    let mut rng = Rng(9);
    for (name, mesh) in [
        ("soup", scenes::soup()),
        ("room", scenes::room()),
        ("sphere", scenes::sphere(2)),
        (
            "one",
            Mesh::new(
                vec![[0.1, 0.2, 0.3], [1.0, 0.0, 0.1], [0.2, 1.0, 0.0]],
                vec![[0, 1, 2]],
            )
            .expect("valid"),
        ),
    ] {
        let tree = WideTree::from_objects(&mesh);
        for (kind, transform) in transforms(&mut rng) {
            let placement = Placement::new(&tree, &transform, FIRST_SLOT);
            let placement = placement.unwrap_or_else(|| panic!("{name}, {kind}: {transform}"));
            let placed = mesh.transformed(&transform).expect("finite");
            let bounds = placement.bounds();
            assert_eq!(
                bounds.union(&placed.bounds()),
                bounds,
                "{name}, {kind}: in its box"
            );
            // A scene larger than the instance, now and then.
            let around = bounds.union(&kd_core::Aabb {
                min: bounds.min * 3.0,
                max: bounds.min * 3.0,
            });
            let frame = Frame::new(if rng.below(2) == 0 { &bounds } else { &around });
            let mut rays = Rays::new(&placed, Vec::new(), 3);
            let mut hit = 0;
            for number in 0..effort::count(300, 5000) {
                let mut ray = rays.draw();
                if number % 16 == 0 {
                    ray = Ray::new(ray.origin - 1e4 * ray.direction, ray.direction);
                }
                let mut expected = Vec::new();
                brute_force::hits(&placed, &ray, usize::MAX, &mut expected);
                hit += usize::from(!expected.is_empty());
                for hit in &mut expected {
                    hit.triangle += FIRST_SLOT;
                }
                for level in [Level::detect(), Level::portable()] {
                    let tree = tree.clone().with_level(level);
                    let place = || format!("{name}, {kind}, {level:?}: {transform}, {ray:?}");
                    let mut closest = Closest::default();
                    collect_placed(&tree, &placement, &frame, &ray, &mut closest);
                    assert_eq!(closest.0, expected.first().copied(), "{}", place());
                    let mut any = Any::default();
                    collect_placed(&tree, &placement, &frame, &ray, &mut any);
                    assert_eq!(any.0, !expected.is_empty(), "{}", place());
                    let mut all = Vec::new();
                    Ordered::fill(&mut all, usize::MAX, |ordered| {
                        collect_placed(&tree, &placement, &frame, &ray, ordered);
                    });
                    assert_eq!(all, expected, "{}", place());
                }
            }
            assert!(hit > 30, "{name}, {kind}: {hit} rays hit");
        }
    }
}

/// Rays at every corner and the middle of every edge of closed meshes that are turned and sheared, from inside.
#[test]
fn placed_trees_are_watertight() {
    let mut rng = Rng(10);
    let mesh = scenes::sphere(3);
    let tree = WideTree::from_objects(&mesh);
    for (kind, transform) in transforms(&mut rng) {
        let placement = Placement::new(&tree, &transform, 0).expect("good");
        let placed = mesh.transformed(&transform).expect("finite");
        let frame = Frame::new(&placement.bounds());
        let center = transform.transform_point3(0.1 * vector(&mut rng));
        for triangle in 0..u32::try_from(placed.len()).expect("few") {
            let [a, b, c] = placed.corners(triangle);
            for target in [a, b, c, 0.5 * (a + b), 0.5 * (b + c)] {
                let ray = Ray::new(center, target - center);
                let expected = brute_force::intersect(&placed, &ray);
                let mut closest = Closest::default();
                collect_placed(&tree, &placement, &frame, &ray, &mut closest);
                assert_eq!(closest.0, expected, "{kind}: {ray:?}");
                assert!(
                    expected.is_some() || kind == "flat" || kind == "extreme",
                    "{kind}: {ray:?} leaks"
                );
            }
        }
    }
}

/// No tree is placed by a transform that flattens it, or that leads out of f32.
#[test]
fn what_cannot_be_placed_is_refused() {
    let tree = WideTree::from_objects(&scenes::sphere(1));
    let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let nearly = Affine3A::from_rotation_x(0.5) * Affine3A::from_scale(Vec3::new(1.0, 1e-7, 1.0));
    let line = Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::X, Vec3::Y));
    let point = Affine3A::from_scale(Vec3::ZERO);
    let huge = Affine3A::from_scale(Vec3::splat(3e38));
    let far = Affine3A::from_translation(Vec3::splat(1e8));
    for transform in [flat, nearly, line, point, huge, far] {
        assert!(
            Placement::new(&tree, &transform, 0).is_none(),
            "{transform}"
        );
    }
}

/// Each coordinate of a block is transformed as that of a mesh: whatever is decided, is decided alike.
#[test]
fn an_empty_tree_has_no_hits() {
    let tree = WideTree::from_objects(&Mesh::new(vec![], vec![]).expect("valid"));
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    if let Some(placement) = Placement::new(&tree, &Affine3A::IDENTITY, 0) {
        assert!(placement.bounds().is_empty(), "nothing");
        let mut closest = Closest::default();
        collect_placed(
            &tree,
            &placement,
            &Frame::new(&placement.bounds()),
            &ray,
            &mut closest,
        );
        assert_eq!(closest.0, None);
    }
}
