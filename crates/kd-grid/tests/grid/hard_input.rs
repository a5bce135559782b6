//! Meshes and limits that are hard on a grid.

use std::sync::Arc;

use kd_core::{Mesh, Ray};
use kd_grid::{GridOptions, UniformGrid};
use kd_oracle::check;
use kd_oracle::rays::Rays;
use kd_oracle::scenes::{self, Soup};

use crate::grids::{borders, grid};

#[test]
fn an_empty_grid_is_one_cell() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let grid = UniformGrid::build(mesh, &GridOptions::new()).expect("valid");
    let stats = grid.stats();
    assert_eq!((stats.cells, stats.references), (1, 0), "{stats}");
    assert_eq!(
        (stats.sparseness(), stats.mean, stats.skewness),
        (1.0, 0.0, 0.0),
        "{stats}"
    );
}

/// Scenes without extent along an axis.
#[test]
fn flat_scenes_are_divided_into_squares() {
    for axis in 0..3 {
        let turned = |mut p: glam::Vec3| {
            (p[1], p[axis]) = (p[axis], p[1]);
            p
        };
        let mesh = scenes::moved(&scenes::flat(), turned);
        let grid = UniformGrid::build(mesh, &GridOptions::new()).expect("valid");
        let resolution = grid.resolution();
        assert_eq!(resolution[axis], 1, "{resolution:?}");
        assert!(
            grid.stats().cells > 150,
            "the others share the cells: {resolution:?}"
        );
    }
}

/// A number of triangles whose pairs would be too many.
#[test]
fn a_million_triangles_in_one_place_are_bounded() {
    let corners = vec![[0.0, 0.0, 0.0], [3.0, 0.0, 1.0], [0.0, 2.0, 0.0]];
    let mesh = Mesh::new(corners, vec![[0, 1, 2]; 1_000_000]);
    let mesh = Arc::new(mesh.expect("valid"));
    let grid = grid(&mesh, &GridOptions::new());
    let stats = grid.stats();
    assert!(stats.halvings > 0, "{stats}");
    assert!(stats.references <= 32_000_000 + 65_536, "{stats}");
    let ray = Ray::new([0.5, 0.5, 9.0], [0.0, 0.1, -1.0]);
    let hit = grid.intersect(&ray).expect("in the middle");
    assert_eq!(hit.triangle, 0, "the lowest of all");
    assert_eq!(
        Some(hit),
        kd_trace::brute_force::intersect(&mesh, &ray),
        "to the bit"
    );
}

#[test]
fn limits_hold() {
    let mesh = Arc::new(scenes::soup());
    let mut last = usize::MAX;
    for max_refs in [5000, 1000, 250] {
        let options = GridOptions::new()
            .with_density(20.0)
            .with_max_refs(max_refs);
        let grid = grid(&mesh, &options);
        let stats = grid.stats();
        assert!(stats.references as u64 <= max_refs, "{max_refs}: {stats}");
        assert!(stats.cells < last, "{max_refs}: {stats}");
        last = stats.cells;
        let mut rays = Rays::new(&mesh, borders(&grid), 7);
        for _ in 0..3000 {
            check("limited", &mesh, &[&grid], &rays.draw());
        }
    }
    for max_cells in [1, 7, 100] {
        let options = GridOptions::new()
            .with_density(1e6)
            .with_max_cells(max_cells);
        let cells = grid(&mesh, &options).stats().cells;
        assert!(cells as u64 <= max_cells, "{cells} of {max_cells}");
    }
    let few = UniformGrid::build(mesh, &GridOptions::new().with_max_refs(3));
    let message = few.expect_err("250 triangles").to_string();
    assert_eq!(
        message, "option `max_refs` must be from one per triangle to 2^32 - 1",
        "by name"
    );
}

/// A small dense object in a large scene is in one cell.
#[test]
fn a_teapot_in_a_stadium_is_in_few_cells() {
    let mesh = Arc::new(scenes::stadium());
    let grid = grid(&mesh, &GridOptions::new());
    let stats = grid.stats();
    assert!(stats.max_refs >= 300, "the ball is in one cell: {stats}");
    assert!(stats.standard_deviation() > 5.0, "{stats}");
}

/// Walls in planes between cells are in both cells.
#[test]
fn walls_between_cells_are_on_both_sides() {
    let mut soup = Soup::default();
    soup.cuboid(glam::Vec3::ZERO, glam::Vec3::splat(8.0));
    let corner = |y: f32, z: f32| glam::Vec3::new(4.0, y, z);
    soup.quad([
        corner(0.0, 0.0),
        corner(8.0, 0.0),
        corner(8.0, 8.0),
        corner(0.0, 8.0),
    ]);
    let mesh = Arc::new(soup.mesh());
    // Eight cells.
    let grid = grid(&mesh, &GridOptions::new().with_density(8.01 / 14.0));
    assert_eq!(grid.resolution(), [2; 3], "along each axis");
    for place in [[0, 0, 0], [1, 0, 0]] {
        let within = grid.triangles_in(place);
        assert!(
            within.contains(&12) || within.contains(&13),
            "{place:?}: {within:?}"
        );
    }
    let mut rays = Rays::new(&mesh, borders(&grid), 8);
    for _ in 0..10_000 {
        check("wall", &mesh, &[&grid], &rays.draw());
    }
}
