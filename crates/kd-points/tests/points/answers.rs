//! Queries of generated meshes against brute force.

use glam::Vec3;
use kd_core::{Aabb, Mesh};
use kd_oracle::rng::Rng;
use kd_oracle::{effort, scenes};
use kd_points::{
    Nearest, PointTree, brute_force, closest_point, closest_point_batch, contains, contains_batch,
    signed_distance, signed_distance_batch, triangles_in_box, triangles_in_box_batch,
    triangles_in_sphere, triangles_in_sphere_batch,
};

use crate::hard::{Trees, no_points, points};

fn meshes() -> Vec<(&'static str, Mesh)> {
    let empty = Mesh::new(vec![], vec![]).expect("valid");
    let mut all = scenes::all();
    all.extend(scenes::extreme());
    all.push(("empty", empty));
    all.push(("bumpy", scenes::bumpy()));
    all
}

#[test]
fn closest_points_equal_brute_force() {
    for (name, mesh) in meshes() {
        let trees = Trees::new(&mesh);
        let mut points = points(&mesh, effort::count(400, 4000), 1);
        points.extend(no_points());
        for max_distance in [f32::INFINITY, 0.1 * mesh.bounds().diagonal(), 0.0] {
            let expected: Vec<Option<Nearest>> = points
                .iter()
                .map(|point| brute_force::closest_point(&mesh, *point, max_distance))
                .collect();
            for (tree, trees) in trees.all() {
                for (point, expected) in points.iter().zip(&expected) {
                    let found = closest_point(&trees, *point, max_distance);
                    assert_eq!(found, *expected, "{name}, {tree}, {point}, {max_distance}");
                }
                for threads in [1, 2] {
                    let mut found = vec![None; points.len()];
                    kd_tasks::with_threads(threads, || {
                        closest_point_batch(&trees, &points, max_distance, &mut found, threads > 1);
                    })
                    .expect("two threads");
                    assert!(
                        found == expected,
                        "a batch: {name}, {tree}, {threads} threads"
                    );
                }
            }
        }
    }
}

#[test]
fn signs_equal_brute_force() {
    for (name, mesh) in meshes() {
        let trees = Trees::new(&mesh);
        let mut points = points(&mesh, effort::count(400, 4000), 2);
        points.extend(no_points());
        let of_each = points.iter();
        let inside: Vec<bool> = of_each.map(|p| brute_force::contains(&mesh, *p)).collect();
        let of_each = points.iter();
        let distances: Vec<Option<f32>> = of_each
            .map(|p| brute_force::signed_distance(&mesh, *p))
            .collect();
        for (tree, trees) in trees.all() {
            for ((point, inside), distance) in points.iter().zip(&inside).zip(&distances) {
                assert_eq!(contains(&trees, *point), *inside, "{name}, {tree}, {point}");
                let found = signed_distance(&trees, *point);
                assert_eq!(found, *distance, "{name}, {tree}, {point}");
            }
            for threads in [1, 2] {
                let mut found = (vec![false; points.len()], vec![None; points.len()]);
                kd_tasks::with_threads(threads, || {
                    contains_batch(&trees, &points, &mut found.0, threads > 1);
                    signed_distance_batch(&trees, &points, &mut found.1, threads > 1);
                })
                .expect("two threads");
                let place = format!("a batch: {name}, {tree}, {threads} threads");
                assert!(found.0 == inside && found.1 == distances, "{place}");
            }
        }
    }
}

#[test]
fn lists_equal_brute_force() {
    for (name, mesh) in meshes() {
        let trees = Trees::new(&mesh);
        let mut rng = Rng(3);
        let points = points(&mesh, effort::count(200, 2000), 3);
        let diagonal = mesh.bounds().diagonal();
        let mut radius = || diagonal * [0.0, 1e-6, 1e-3, 0.1, 0.5, 1e9][rng.below(6)] * rng.unit();
        let spheres: Vec<(Vec3, f32)> = points.iter().map(|point| (*point, radius())).collect();
        let boxes: Vec<Aabb> = spheres
            .windows(2)
            .map(|pair| {
                let ((center, radius), (other, _)) = (pair[0], pair[1]);
                let corner = if radius < 0.3 * diagonal {
                    center
                } else {
                    other
                };
                Aabb::around([center - 0.5 * radius, center + radius, corner])
            })
            .collect();
        let expected_in_spheres: Vec<Vec<u32>> = spheres
            .iter()
            .map(|(center, radius)| {
                let mut list = vec![7];
                brute_force::triangles_in_sphere(&mesh, *center, *radius, &mut list);
                list
            })
            .collect();
        let expected_in_boxes: Vec<Vec<u32>> = boxes
            .iter()
            .map(|bounds| {
                let mut list = vec![7];
                brute_force::triangles_in_box(&mesh, bounds, &mut list);
                list
            })
            .collect();
        for (tree, trees) in trees.all() {
            check_spheres(
                &format!("{name}, {tree}"),
                &trees,
                &spheres,
                &expected_in_spheres,
            );
            check_boxes(
                &format!("{name}, {tree}"),
                &trees,
                &boxes,
                &expected_in_boxes,
            );
        }
    }
}

fn check_spheres(
    name: &str,
    trees: &[PointTree<'_>],
    spheres: &[(Vec3, f32)],
    expected: &[Vec<u32>],
) {
    let mut found = vec![7];
    for (sphere, expected) in spheres.iter().zip(expected) {
        triangles_in_sphere(trees, sphere.0, sphere.1, &mut found);
        assert_eq!(found, *expected, "{name}, {sphere:?}");
    }
    for is_parallel in [false, true] {
        let lists = triangles_in_sphere_batch(trees, spheres, is_parallel);
        assert_eq!(lists.len(), spheres.len(), "{name}: one list for each");
        for (number, expected) in expected.iter().enumerate() {
            assert_eq!(lists.list(number), expected, "{name}, list {number}");
        }
    }
}

fn check_boxes(name: &str, trees: &[PointTree<'_>], boxes: &[Aabb], expected: &[Vec<u32>]) {
    let mut found = vec![7];
    for (bounds, expected) in boxes.iter().zip(expected) {
        triangles_in_box(trees, bounds, &mut found);
        assert_eq!(found, *expected, "{name}, {bounds:?}");
    }
    for is_parallel in [false, true] {
        let lists = triangles_in_box_batch(trees, boxes, is_parallel);
        assert_eq!(lists.len(), boxes.len(), "{name}: one list for each");
        for (number, expected) in expected.iter().enumerate() {
            assert_eq!(lists.list(number), expected, "{name}, list {number}");
        }
    }
}

#[test]
fn bad_input_finds_nothing() {
    let mesh = scenes::sphere(1);
    for (tree, trees) in Trees::new(&mesh).all() {
        for max_distance in [f32::NAN, -1.0, f32::NEG_INFINITY] {
            let found = closest_point(&trees, Vec3::ZERO, max_distance);
            assert_eq!(found, None, "{tree}, {max_distance}");
        }
        let mut list = vec![7];
        for radius in [f32::NAN, -1.0] {
            triangles_in_sphere(&trees, Vec3::ZERO, radius, &mut list);
            assert_eq!(list, [0; 0], "{tree}, radius {radius}");
        }
        for point in no_points() {
            triangles_in_sphere(&trees, point, 10.0, &mut list);
            assert_eq!(list, [0; 0], "{tree}, {point}");
            assert_eq!(signed_distance(&trees, point), None, "{tree}, {point}");
            assert!(!contains(&trees, point), "{tree}, {point}");
        }
        let nan = Aabb {
            min: Vec3::NAN,
            max: Vec3::ONE,
        };
        for bounds in [Aabb::EMPTY, nan] {
            triangles_in_box(&trees, &bounds, &mut list);
            assert_eq!(list, [0; 0], "{tree}, {bounds:?}");
        }
        let everything = Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::INFINITY,
        };
        triangles_in_box(&trees, &everything, &mut list);
        assert_eq!(list.len(), mesh.len(), "{tree}: all of them");
        triangles_in_sphere(&trees, Vec3::ZERO, f32::INFINITY, &mut list);
        assert_eq!(list.len(), mesh.len(), "{tree}: all of them");
    }
}

#[test]
#[should_panic(expected = "one answer per point")]
fn batches_of_unequal_length_are_refused() {
    closest_point_batch(&[], &[Vec3::ZERO], 1.0, &mut [], false);
}

/// From independent formulas: corners and edges alone, in f64, by sampling.
#[test]
fn distances_are_those_of_samples() {
    let mesh = scenes::soup();
    for point in points(&mesh, 200, 4) {
        let nearest = brute_force::closest_point(&mesh, point, f32::INFINITY).expect("triangles");
        let corners = mesh
            .corners(nearest.triangle)
            .map(|corner| corner.as_dvec3());
        let reported = f64::from(nearest.distance);
        let scale = reported + 1e-3;
        let at_point = nearest.point.as_dvec3().distance(point.as_dvec3());
        assert!(
            (at_point - reported).abs() < 1e-5 * scale + 1e-6,
            "{nearest:?}"
        );
        // No sample of any triangle is closer than the reported distance.
        for (triangle, _) in (0..).zip(mesh.triangles()) {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            for step in 0..=64_u32 {
                let (i, j) = (step / 8, step % 8);
                let (u, v) = (
                    f64::from(i) / 8.0,
                    f64::from(j) / 8.0 * (1.0 - f64::from(i) / 8.0),
                );
                let sample = a + u * (b - a) + v * (c - a);
                let distance = sample.distance(point.as_dvec3());
                assert!(
                    distance >= reported - 1e-6 * scale,
                    "{triangle}: {nearest:?}"
                );
            }
        }
        let [a, b, c] = corners;
        let (u, v) = (f64::from(nearest.u), f64::from(nearest.v));
        let by_weights = a + u * (b - a) + v * (c - a);
        assert!(
            by_weights.distance(nearest.point.as_dvec3()) < 1e-5,
            "{nearest:?}"
        );
    }
}
