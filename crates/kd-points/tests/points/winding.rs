//! Winding numbers against the sum over all triangles.

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::{effort, scenes};
use kd_points::{WINDING_ERROR, WindingNumbers, brute_force, winding_number_batch};

use crate::hard::{no_points, points};

/// Large enough for groups that are far.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let mut all = scenes::all();
    all.extend(scenes::extreme());
    all.push(("fine sphere", scenes::sphere(5)));
    all.push(("fine cube", scenes::cube(30)));
    all.push(("confetti", scenes::confetti(4000, 9)));
    all.push(("empty", Mesh::new(vec![], vec![]).expect("valid")));
    all
}

#[test]
fn errors_are_within_the_bound() {
    let mut worst = 0.0_f64;
    for (name, mesh) in meshes() {
        let numbers = WindingNumbers::new(&mesh);
        for point in points(&mesh, effort::count(200, 2000), 10) {
            let exact = brute_force::winding_number(&mesh, point);
            let error = (numbers.at(point) - exact).abs();
            assert!(error <= WINDING_ERROR + 1e-6, "{name}, {point}: {error:e}");
            worst = worst.max(error);
        }
    }
    assert!(worst > 1e-5, "some groups are far: {worst:e}");
}

#[test]
fn batches_and_threads_answer_alike() {
    let mesh = scenes::confetti(4000, 9);
    let (alone, together) = (
        WindingNumbers::new(&mesh),
        WindingNumbers::new_parallel(&mesh),
    );
    let mut points = points(&mesh, 1500, 11);
    points.extend(no_points());
    let expected: Vec<f64> = points.iter().map(|point| alone.at(*point)).collect();
    for (numbers, is_parallel) in [(&alone, false), (&alone, true), (&together, true)] {
        let mut found = vec![f64::NAN; points.len()];
        winding_number_batch(numbers, &points, &mut found, is_parallel);
        assert_eq!(found, expected, "to the bit");
    }
    for point in no_points() {
        assert_eq!(alone.at(point), 0.0, "{point}");
    }
}

#[test]
fn nothing_winds_around_no_point() {
    let empty = Mesh::new(vec![], vec![]).expect("valid");
    let flat = Mesh::new(vec![[0.0; 3], [1.0; 3], [2.0; 3]], vec![[0, 1, 2]]).expect("valid");
    for mesh in [empty, flat] {
        let numbers = WindingNumbers::new(&mesh);
        assert_eq!(numbers.at(Vec3::ZERO), 0.0, "{} triangles", mesh.len());
    }
}

/// A hemisphere: half of the directions, from the middle of its opening.
#[test]
fn open_surfaces_count_in_part() {
    let sphere = scenes::sphere(4);
    let upper = (0..)
        .zip(sphere.triangles())
        .filter_map(|(triangle, &[a, b, c])| {
            let corners = sphere.corners(triangle);
            let is_upper = corners.iter().map(|corner| corner.z).sum::<f32>() > 0.0;
            let is_outward = sphere.normal(triangle).dot(corners[0]) > 0.0;
            is_upper.then_some(if is_outward { [a, b, c] } else { [a, c, b] })
        });
    let mesh = Mesh::new(sphere.positions().to_vec(), upper.collect()).expect("valid");
    assert!(!mesh.is_closed(), "half of it");
    let numbers = WindingNumbers::new(&mesh);
    let at = |x: f32, y: f32, z: f32| numbers.at(Vec3::new(x, y, z)).abs();
    assert!(
        (at(0.0, 0.0, 0.0) - 0.5).abs() < 0.03,
        "{}",
        at(0.0, 0.0, 0.0)
    );
    assert!(at(0.0, 0.0, 0.9) > 0.8, "near the middle of the shell");
    assert!(at(0.0, 0.0, -0.9) < 0.2, "far outside of the opening");
}
