//! The contents of cells, and determinism.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use kd_core::{Aabb, Mesh, clipped_bounds};
use kd_grid::{GridOptions, Overlap, UniformGrid};
use kd_oracle::scenes;

use crate::grids::grid;

/// The box of a cell, enlarged by a share of the grid's longest side; a negative share makes it smaller.
fn cell(grid: &UniformGrid, place: [u32; 3], larger: f64) -> Aabb {
    let bounds = grid.bounds();
    let (min, extent) = (
        bounds.min.as_dvec3(),
        bounds.max.as_dvec3() - bounds.min.as_dvec3(),
    );
    let resolution = DVec3::from_array(grid.resolution().map(f64::from));
    let low = DVec3::from_array(place.map(f64::from));
    let larger = DVec3::splat(larger * extent.max_element());
    Aabb {
        min: (min + extent * low / resolution - larger).as_vec3(),
        max: (min + extent * (low + 1.0) / resolution + larger).as_vec3(),
    }
}

fn places(grid: &UniformGrid) -> impl Iterator<Item = [u32; 3]> {
    let [x, y, z] = grid.resolution();
    (0..x * y * z).map(move |i| [i % x, i / x % y, i / (x * y)])
}

/// Every cell against a clipped copy of every triangle.
#[test]
fn triangles_are_in_the_cells_they_meet() {
    for (name, mesh) in scenes::all() {
        let mesh = Arc::new(mesh);
        for overlap in [Overlap::Box, Overlap::Exact] {
            let options = GridOptions::new().with_density(3.0).with_overlap(overlap);
            let grid = grid(&mesh, &options);
            let cells: Vec<_> = places(&grid)
                .map(|place| {
                    let (within, around) = (cell(&grid, place, -1e-6), cell(&grid, place, 3e-6));
                    (grid.triangles_in(place), within, around)
                })
                .collect();
            assert!(
                cells.iter().all(|(entered, ..)| entered.is_sorted()),
                "{name}: in order"
            );
            let (mut needless, mut entries) = (0, 0);
            for triangle in 0..u32::try_from(mesh.len()).expect("few") {
                let corners = mesh.corners(triangle);
                let bounds = Aabb::around(corners);
                let (mut by_box, mut entered, mut met) = (0, 0, 0);
                for (triangles, within, around) in &cells {
                    let is_entered = triangles.binary_search(&triangle).is_ok();
                    let meets = |cell: &Aabb| clipped_bounds(corners, cell).is_some();
                    let box_meets = !bounds.intersection(around).is_empty();
                    assert!(
                        is_entered || !meets(within),
                        "{name}: {triangle} is in {within:?}"
                    );
                    assert!(
                        !is_entered || box_meets,
                        "{name}: {triangle} is not in {around:?}"
                    );
                    by_box += usize::from(box_meets);
                    entered += usize::from(is_entered);
                    met += usize::from(meets(around));
                }
                // Small triangles are entered by box, and so are triangles without area, which no ray hits.
                if by_box >= 32 && mesh.normal(triangle) != Vec3::ZERO {
                    needless += entered - met.min(entered);
                    entries += entered;
                }
            }
            if overlap == Overlap::Exact {
                assert!(20 * needless <= entries, "{name}: {needless} of {entries}");
            }
        }
    }
}

/// Long thin triangles in a grid of thousands of cells along an axis: every cell that contains a point of them.
#[test]
fn slivers_are_in_all_of_very_many_cells() {
    let slivers = [
        [[0.0, 0.0, 0.0], [1.0, 1e-3, 1e-3], [0.5, 1e-3, 2e-4]],
        [[0.0, 0.0, 0.0], [1.0, 1e-3, 1e-3], [1.0, 1.0001e-3, 1e-3]],
        [[0.0, 1e-3, 0.0], [0.7, 0.0, 1e-3], [1.0, 1e-3, 3e-4]],
    ];
    for sliver in slivers {
        let mesh = Mesh::new(sliver.to_vec(), vec![[0, 1, 2]]);
        let mesh = Arc::new(mesh.expect("valid"));
        let options = GridOptions::new().with_density(1e6).with_max_refs(1 << 21);
        let grid = grid(&mesh, &options);
        let resolution = grid.resolution();
        assert!(resolution[0] >= 4000, "{resolution:?}");
        let [a, b, c] = mesh.corners(0).map(Vec3::as_dvec3);
        let (min, max) = (grid.bounds().min.as_dvec3(), grid.bounds().max.as_dvec3());
        let per_unit = DVec3::from_array(resolution.map(f64::from)) / (max - min);
        for (u, v) in (0..1000).flat_map(|u| (0..1000 - u).map(move |v| (u, v))) {
            let point = a + (b - a) * f64::from(u) / 1000.0 + (c - a) * f64::from(v) / 1000.0;
            let place = ((point - min) * per_unit).max(DVec3::ZERO).as_uvec3();
            let place = place.to_array();
            let place = [0, 1, 2].map(|axis| place[axis].min(resolution[axis] - 1));
            assert_eq!(grid.triangles_in(place), [0], "{sliver:?}: {place:?}");
        }
    }
}

/// Exact overlap pays for large triangles that are not aligned with axes.
#[test]
fn exact_overlap_excludes_most_of_a_box() {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    let mesh = Arc::new(Mesh::new(corners, vec![[0, 1, 2]]).expect("valid"));
    let references = |overlap| {
        let options = GridOptions::new()
            .with_density(8000.0)
            .with_overlap(overlap);
        grid(&mesh, &options).stats().references
    };
    let (by_box, exact) = (references(Overlap::Box), references(Overlap::Exact));
    assert!(by_box > 6000 && exact < by_box / 8, "{exact} of {by_box}");
}

#[test]
fn threads_have_no_effect() {
    let mesh = scenes::moved(&scenes::sphere(6), |p| p * Vec3::new(1.0, 3.0, 2.0));
    let mesh = Arc::new(mesh);
    assert!(mesh.len() > 80_000, "several chunks and slabs");
    let usual = GridOptions::new().with_density(9.0);
    // One reference per triangle: the resolution is halved to a few cells.
    let limited = usual.clone().with_max_refs(mesh.len() as u64 + 1000);
    for options in [
        usual.clone().with_overlap(Overlap::Box),
        usual.with_overlap(Overlap::Exact),
        limited,
    ] {
        let of = |threads: usize| grid(&mesh, &options.clone().with_threads(threads));
        let one = of(1);
        for threads in [0, 2, 3] {
            let other = of(threads);
            assert_eq!(one.resolution(), other.resolution(), "{threads} threads");
            assert_eq!(one.stats(), other.stats(), "{threads} threads");
            for place in places(&one) {
                assert_eq!(
                    one.triangles_in(place),
                    other.triangles_in(place),
                    "{threads} threads: {place:?}"
                );
            }
        }
    }
}

/// The equations of the paper, computed directly from the cells.
#[test]
fn statistics_are_those_of_the_cells() {
    let mesh = Arc::new(scenes::stadium());
    let grid = grid(&mesh, &GridOptions::new().with_density(2.0));
    let counts: Vec<f64> = places(&grid)
        .map(|place| grid.triangles_in(place).len() as f64)
        .collect();
    let stats = grid.stats();
    let t = counts.len() as f64;
    let moment =
        |power: i32, around: f64| -> f64 { counts.iter().map(|n| (n - around).powi(power)).sum() };
    let mean = moment(1, 0.0) / t;
    let variance = moment(2, mean) / (t - 1.0);
    let deviation = variance.sqrt();
    let rows = [
        (stats.cells as f64, t),
        (stats.references as f64, moment(1, 0.0)),
        (
            stats.sparseness(),
            counts.iter().filter(|n| **n == 0.0).count() as f64 / t,
        ),
        (
            f64::from(stats.max_refs),
            counts.iter().copied().fold(0.0, f64::max),
        ),
        (stats.mean, mean),
        (stats.variance, variance),
        (stats.standard_deviation(), deviation),
        (stats.skewness, moment(3, mean) / t / deviation.powi(3)),
        (
            stats.kurtosis,
            moment(4, mean) / t / deviation.powi(4) - 3.0,
        ),
        (
            stats.refs_per_triangle(),
            moment(1, 0.0) / mesh.len() as f64,
        ),
    ];
    for (number, (ours, expected)) in rows.into_iter().enumerate() {
        assert!(
            (ours - expected).abs() <= 1e-9 * expected.abs(),
            "row {number}: {ours} {expected}"
        );
    }
}

#[test]
fn statistics_have_one_text_form() {
    let mesh = Arc::new(scenes::duplicates());
    let grid = grid(&mesh, &GridOptions::new());
    let text = grid
        .stats()
        .with_zero_area(mesh.zero_area_count())
        .to_string();
    insta::assert_snapshot!(text);
}
