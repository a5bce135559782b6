//! Triangles of zero area: never hit, by one exact rule, in every structure; and hit again once they have an area.

use glam::Vec3;
use kd_core::{Mesh, Ray, is_zero_area};
use kd_sah::{BuildOptions, build};
use kd_trace::{Division, Join, Level, PackedTree, RayQuery, WideForest, WideTree, brute_force};

use crate::rng::Rng;

/// Corners on lines, exactly: on a grid of small integers, so that a multiple of a step is exact. Every fourth triangle has an area.
/// `raised` moves some corners off their lines.
fn needles(count: u32, raised: impl Fn(u32) -> bool) -> Mesh {
    let mut rng = Rng(5);
    let grid = |v: Vec3| (v * 64.0).round();
    let mut positions = Vec::new();
    for number in 0..count {
        let (from, step) = (grid(rng.vec3()), grid(0.25 * rng.vec3()));
        let mut last = from + 3.0 * step;
        if number % 4 == 0 || raised(number) {
            last += Vec3::new(1.0, 2.0, -1.0);
        }
        // Halves and thirds of the grid would round: the whole is scaled by a power of two.
        let corners = [from, from + 7.0 * step, last].map(|corner| corner / 64.0);
        positions.extend(corners.map(|corner| corner.to_array()));
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Mesh::new(positions, triangles.collect()).expect("valid")
}

/// Rays at points on the longest edge of each triangle.
fn rays_at_edges(mesh: &Mesh) -> Vec<Ray> {
    let mut rng = Rng(6);
    let triangles = 0..u32::try_from(mesh.len()).expect("few");
    triangles
        .flat_map(|triangle| {
            let [a, b, _] = mesh.corners(triangle);
            [0.0, 0.3, 0.5, 1.0].map(|at| {
                let origin = 4.0 * rng.vec3();
                Ray::new(origin, a.lerp(b, at) - origin)
            })
        })
        .collect()
}

#[track_caller]
fn check(structure: &impl RayQuery<Hit = kd_core::Hit>, mesh: &Mesh, rays: &[Ray], what: &str) {
    let mut batch = vec![None; rays.len()];
    structure.intersect_batch(rays, &mut batch);
    for (ray, in_batch) in rays.iter().zip(batch) {
        let expected = brute_force::intersect(mesh, ray);
        assert_eq!(structure.intersect(ray), expected, "{what}: {ray:?}");
        assert_eq!(in_batch, expected, "{what}, in a batch: {ray:?}");
        assert_eq!(
            structure.occluded(ray),
            expected.is_some(),
            "{what}: {ray:?}"
        );
    }
}

#[test]
fn no_structure_reports_them() {
    let mesh = needles(1200, |_| false);
    let rays = rays_at_edges(&mesh);
    let (mut hits, mut all) = (Vec::new(), 0);
    for ray in &rays {
        brute_force::hits(&mesh, ray, usize::MAX, &mut hits);
        let mut without_area = hits.iter().filter(|hit| mesh.is_zero_area(hit.triangle));
        assert_eq!(without_area.next(), None, "{ray:?}");
        all += hits.len();
    }
    assert!(all > 300, "triangles with an area are hit: {all}");

    let tree = build(&mesh, &BuildOptions::balanced()).expect("valid");
    check(&PackedTree::new(&tree, &mesh), &mesh, &rays, "8-byte nodes");
    let most_references = u64::MAX;
    for level in [Level::detect(), Level::portable()] {
        check(
            &WideTree::new(&tree, &mesh).with_level(level),
            &mesh,
            &rays,
            "of a kd-tree",
        );
        for division in [Division::Objects, Division::Planes { most_references }] {
            let wide = WideTree::build(&mesh, division, false, None).expect("not cancelled");
            let what = format!("{division:?}, {level:?}");
            check(&wide.with_level(level), &mesh, &rays, &what);
        }
    }
}

#[test]
fn they_do_not_enlarge_boxes() {
    let few = needles(400, |_| false);
    let with_area = few
        .triangles()
        .iter()
        .enumerate()
        .filter(|(number, _)| number % 4 == 0);
    let with_area = with_area.map(|(_, corners)| *corners).collect();
    let alone = Mesh::new(few.positions().to_vec(), with_area).expect("valid");
    let cost = |mesh: &Mesh| WideTree::from_objects(mesh).stats(mesh).sah_cost_own;
    let (mixed, alone) = (cost(&few), cost(&alone));
    assert!(mixed < 1.1 * alone, "{mixed} beside {alone}");
}

#[test]
fn a_refit_takes_in_what_regains_an_area_and_leaves_out_what_loses_it() {
    let flat = needles(1200, |_| false);
    let raised = needles(1200, |number| number % 3 == 0);
    let area = |mesh: &Mesh| mesh.len() - mesh.zero_area_count();
    assert!(
        area(&raised) > area(&flat) + 200,
        "{} and {}",
        area(&raised),
        area(&flat)
    );
    assert!(is_zero_area(flat.corners(3)) && !is_zero_area(raised.corners(3)));
    for level in [Level::detect(), Level::portable()] {
        let mut forest = WideForest::new().with_level(level);
        forest.push(&WideTree::from_objects(&flat), 0);
        for (mesh, what) in [
            (&raised, "raised"),
            (&flat, "flat again"),
            (&raised, "again"),
        ] {
            forest.refit(0, mesh, 0);
            forest.join(Join::default());
            check(forest.tree(), mesh, &rays_at_edges(mesh), what);
        }
    }
}

#[test]
fn a_mesh_of_nothing_else_is_never_hit() {
    for count in [1, 8, 30, 1000] {
        let mesh = needles(4 * count, |_| false);
        let flat = mesh
            .triangles()
            .iter()
            .enumerate()
            .filter(|(number, _)| number % 4 != 0);
        let flat = flat.map(|(_, corners)| *corners).collect();
        let mesh = Mesh::new(mesh.positions().to_vec(), flat).expect("valid");
        let wide = WideTree::from_objects(&mesh);
        assert_eq!(
            wide.stats(&mesh).references,
            mesh.len(),
            "they keep their places"
        );
        let rays = rays_at_edges(&mesh);
        assert!(
            rays.iter()
                .all(|ray| brute_force::intersect(&mesh, ray).is_none())
        );
        check(
            &wide,
            &mesh,
            &rays[..rays.len().min(500)],
            "nothing but lines",
        );
    }
}
