//! The one place that compares a ray's answers.

use kd_core::{Hit, Mesh, Ray, Tree};
use kd_trace::brute_force;

/// Asks every query about a ray, in each of the trees, and expects what brute force says. Gives the number of hits.
#[track_caller]
pub(crate) fn check<'a>(
    scene: &str,
    mesh: &Mesh,
    trees: impl IntoIterator<Item = &'a Tree>,
    ray: &Ray,
) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    let mut found = Vec::new();
    for (number, tree) in trees.into_iter().enumerate() {
        let place = || format!("{scene}, tree {number}, {}", source(ray));
        let closest = kd_trace::intersect(tree, mesh, ray);
        assert_eq!(closest, expected.first().copied(), "closest: {}", place());
        let occluded = kd_trace::occluded(tree, mesh, ray);
        assert_eq!(occluded, !expected.is_empty(), "any: {}", place());
        for max in [2, usize::MAX] {
            kd_trace::hits(tree, mesh, ray, max, &mut found);
            let first = &expected[..max.min(expected.len())];
            assert_eq!(found, first, "first {max}: {}", place());
        }
    }
    expected.len()
}

/// The ray as Rust source, to paste into a test.
pub(crate) fn source(ray: &Ray) -> String {
    let number = |x: f32| {
        if x.is_finite() {
            format!("{x:?}")
        } else {
            format!("f32::from_bits({:#x})", x.to_bits())
        }
    };
    let list = |v: glam::Vec3| v.to_array().map(number).join(", ");
    format!(
        "Ray::new([{}], [{}]).with_range({}, {})",
        list(ray.origin),
        list(ray.direction),
        number(ray.t_min),
        number(ray.t_max)
    )
}

#[test]
fn the_oracle_agrees_with_itself() {
    let mesh = crate::scenes::soup();
    let mut all = Vec::new();
    let mut rng = crate::rng::Rng(8);
    let mut some = 0;
    for _ in 0..2000 {
        let ray = Ray::new(rng.vec3(), rng.direction());
        brute_force::hits(&mesh, &ray, usize::MAX, &mut all);
        assert!(all.is_sorted_by(Hit::is_before), "{}", source(&ray));
        let closest = brute_force::intersect(&mesh, &ray);
        assert_eq!(closest, all.first().copied(), "{}", source(&ray));
        let any = brute_force::occluded(&mesh, &ray);
        assert_eq!(any, !all.is_empty(), "{}", source(&ray));
        let mut two = Vec::new();
        brute_force::hits(&mesh, &ray, 2, &mut two);
        assert_eq!(two, all[..all.len().min(2)], "{}", source(&ray));
        some += usize::from(any);
    }
    assert!(some > 600, "enough of them hit: {some}");
}
