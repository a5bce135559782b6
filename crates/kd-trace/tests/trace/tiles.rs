//! Batches of neighboring rays, which are traced together: every answer is that of brute force, whatever they have in
//! common.

use glam::Vec3;
use kd_core::{Mesh, Ray};
use kd_oracle::effort;
use kd_sah::{BuildOptions, build};
use kd_trace::{Level, RayQuery, WideTree, brute_force};

use crate::check::source;
use crate::rng::Rng;
use crate::scenes::{self, Soup, moved, soup, sphere};

/// Ways in which rays are neighbors.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bundle {
    /// From one point.
    From,
    /// Segments to one point.
    To,
    /// In one direction.
    Along,
    /// From places near each other, to places near each other.
    Beside,
}

pub(crate) const BUNDLES: [Bundle; 4] = [Bundle::From, Bundle::To, Bundle::Along, Bundle::Beside];

/// Rays whose ends are so far apart, in sizes of the mesh.
pub(crate) fn bundle(
    kind: Bundle,
    count: usize,
    width: f32,
    mesh: &Mesh,
    rng: &mut Rng,
) -> Vec<Ray> {
    let bounds = mesh.bounds();
    let size = bounds.extent().max_element();
    let near = |rng: &mut Rng, point: Vec3| point + width * size * rng.vec3();
    let from = bounds.center() + 0.8 * size * rng.vec3();
    let to = bounds.center() + 0.4 * size * rng.vec3();
    (0..count)
        .map(|_| match kind {
            Bundle::From => Ray::new(from, near(rng, to) - from),
            Bundle::To => Ray::between(near(rng, from), to),
            Bundle::Along => Ray::new(near(rng, from), to - from),
            Bundle::Beside => {
                let start = near(rng, from);
                Ray::new(start, near(rng, to) - start)
            }
        })
        .collect()
}

/// Asks both batches at every level, and gives the number of hits.
#[track_caller]
pub(crate) fn check(scene: &str, mesh: &Mesh, trees: &[WideTree], rays: &[Ray]) -> usize {
    let expected: Vec<_> = rays
        .iter()
        .map(|ray| brute_force::intersect(mesh, ray))
        .collect();
    for tree in trees {
        let mut hits = vec![None; rays.len()];
        tree.intersect_batch(rays, &mut hits);
        let mut occluded = vec![false; rays.len()];
        tree.occluded_batch(rays, &mut occluded);
        for (i, ray) in rays.iter().enumerate() {
            let place = || format!("{scene}, {}, {i}: {}", tree.level(), source(ray));
            assert_eq!(hits[i], expected[i], "closest in {}", place());
            assert_eq!(occluded[i], expected[i].is_some(), "any in {}", place());
        }
    }
    expected.iter().flatten().count()
}

/// The default tree, traced at each level.
pub(crate) fn levels(mesh: &Mesh) -> [WideTree; 2] {
    let tree = build(mesh, &BuildOptions::default()).expect("valid");
    let wide = WideTree::new(&tree, mesh);
    let portable = wide.clone().with_level(Level::portable());
    [wide, portable]
}

#[test]
fn neighbors_answer_as_if_alone() {
    let mut rng = Rng(71);
    for (scene, mesh) in scenes::all() {
        let trees = levels(&mesh);
        let mut hits = 0;
        for kind in BUNDLES {
            // From a beam to more than can be traced together.
            for width in [0.0, 1e-6, 1e-3, 0.01, 0.05, 0.2, 1.0] {
                for count in [64, 13, 150] {
                    let rays = bundle(kind, count, width, &mesh, &mut rng);
                    hits += check(scene, &mesh, &trees, &rays);
                }
            }
        }
        assert!(hits > 200 || mesh.is_empty(), "{scene}: {hits} hits");
    }
}

/// Rays at corners and edges, from and to surfaces, and ending at what they hit.
#[test]
fn neighbors_that_nearly_miss() {
    let mut rng = Rng(72);
    for (scene, mesh) in scenes::all() {
        if mesh.is_empty() {
            continue;
        }
        let trees = levels(&mesh);
        let size = mesh.bounds().extent().max_element();
        for _ in 0..60 {
            let triangle = u32::try_from(rng.below(mesh.len())).expect("small");
            let [a, b, c] = mesh.corners(triangle);
            let from = a + size * rng.vec3();
            let mut targets = vec![a, b, c];
            for part in [0.1, 0.25, 0.5, 0.75] {
                targets.extend([a.lerp(b, part), b.lerp(c, part), c.lerp(a, part)]);
                targets.push(a.lerp(b, 0.4).lerp(c, part));
            }
            let mut rays: Vec<Ray> = targets.iter().map(|to| Ray::new(from, to - from)).collect();
            rays.extend(targets.iter().map(|to| Ray::between(*to, from)));
            rays.extend(targets.iter().map(|to| Ray::new(*to, from - to)));
            check(scene, &mesh, &trees, &rays);
            // Up to the hit, and up to just before it.
            let ends: Vec<Ray> = rays
                .iter()
                .filter_map(|ray| Some((ray, brute_force::intersect(&mesh, ray)?.t)))
                .flat_map(|(ray, t)| {
                    [
                        ray.with_range(0.0, t),
                        ray.with_range(0.0, t.next_down()),
                        ray.with_range(t, f32::INFINITY),
                        ray.with_range(t.next_up(), f32::INFINITY),
                    ]
                })
                .collect();
            check(scene, &mesh, &trees, &ends);
        }
    }
}

/// Rays that end where they hit something, or just before.
#[test]
fn neighbors_that_end_where_they_hit() {
    let mut rng = Rng(75);
    let mesh = sphere(4);
    let trees = levels(&mesh);
    let mut hits = 0;
    for round in 0..effort::count(150, 400) {
        let kind = BUNDLES[round % BUNDLES.len()];
        // Up to where no group is left together.
        let width = rng.pick(&[1e-3, 0.03, 0.1]);
        // One of them lies far behind the others, so that depths are large where distances are small.
        let away = rng.pick(&[0.0, 10.0, 1000.0]);
        let last = rng.below(64);
        let mut rays = bundle(kind, 64, width, &mesh, &mut rng);
        for (number, ray) in rays.iter_mut().enumerate() {
            *ray = ray.with_range(0.0, f32::INFINITY);
            if number == last {
                ray.origin -= away * ray.direction;
            }
            if let Some(hit) = brute_force::intersect(&mesh, ray) {
                let end = rng.pick(&[hit.t, hit.t.next_down(), hit.t.next_up()]);
                *ray = ray.with_range(0.0, end);
            }
        }
        hits += check("sphere", &mesh, &trees, &rays);
    }
    assert!(hits > effort::count(1500, 5000), "{hits} hits");
}

/// Rays that go the same way as others that are no neighbors, as behind curved mirrors.
#[test]
fn rays_that_are_alike_but_apart() {
    let mut rng = Rng(76);
    for (scene, mesh) in scenes::all() {
        let trees = levels(&mesh);
        let mut hits = 0;
        for round in 0..40 {
            // Pieces of bundles, one after the other or in turn.
            let width = rng.pick(&[0.05, 0.2, 1.0, 3.0]);
            let bundles: Vec<Vec<Ray>> = (0..1 + round % 4)
                .map(|_| bundle(rng.pick(&BUNDLES), 160, width, &mesh, &mut rng))
                .collect();
            let piece = rng.pick(&[1, 5, 40]);
            let mut rays: Vec<Ray> = (0..160 / piece)
                .flat_map(|i| bundles.iter().map(move |rays| &rays[i * piece..][..piece]))
                .flatten()
                .copied()
                .collect();
            for _ in 0..round % 5 {
                let place = rng.below(rays.len());
                let ray = &mut rays[place];
                *ray = rng.pick(&[
                    ray.with_mask(0),
                    ray.with_range(-1.0, 0.5),
                    Ray::new(ray.origin, Vec3::ZERO),
                    Ray::new(Vec3::NAN, ray.direction),
                    Ray::new(ray.origin, Vec3::INFINITY),
                ]);
            }
            hits += check(scene, &mesh, &trees, &rays);
        }
        assert!(hits > 200 || mesh.is_empty(), "{scene}: {hits} hits");
    }
}

/// Rays from near a surface to corners and edges on all sides, so that those of a tile are up to half a right angle apart.
#[test]
fn rays_on_all_sides_that_nearly_miss() {
    let mut rng = Rng(77);
    for (scene, mesh) in scenes::all() {
        if mesh.is_empty() {
            continue;
        }
        let trees = levels(&mesh);
        let size = mesh.bounds().extent().max_element();
        for _ in 0..6 {
            let from = mesh.bounds().center() + 0.5 * size * rng.vec3();
            let near = rng.pick(&[0.0, 1e-3, 0.1]);
            let mut rays = Vec::new();
            for _ in 0..60 {
                let triangle = u32::try_from(rng.below(mesh.len())).expect("small");
                let [a, b, c] = mesh.corners(triangle);
                let start = from + near * size * rng.vec3();
                for to in [
                    a,
                    a.lerp(b, 0.5),
                    b.lerp(c, 0.25),
                    c.lerp(a, 0.4).lerp(b, 0.3),
                ] {
                    rays.extend([Ray::new(start, to - start), Ray::between(to, start)]);
                }
            }
            check(scene, &mesh, &trees, &rays);
        }
    }
}

/// A few rays to edges of small squares far away, among rays that pass the squares on all sides. The slopes of both differ so much
/// that a slope relative to the central one is known only up to a rounding of the largest.
#[test]
fn a_few_that_hit_among_many_that_diverge() {
    const SIDE: u8 = 24;
    let mut soup = Soup::default();
    let corner = |i: u8, j: u8| Vec3::new(f32::from(i), f32::from(j), 0.0) / f32::from(SIDE);
    for i in (0..SIDE).step_by(2) {
        for j in (0..SIDE).step_by(2) {
            let (right, up) = (i + 1, j + 1);
            soup.quad([
                corner(i, j),
                corner(right, j),
                corner(right, up),
                corner(i, up),
            ]);
        }
    }
    let mesh = soup.mesh();
    let trees = levels(&mesh);
    let mut rng = Rng(78);
    let mut hits = 0;
    for _ in 0..effort::count(200, 1000) {
        let eye = Vec3::new(rng.unit(), rng.unit(), -rng.pick(&[100.0, 1e3, 1e4]));
        let rays: Vec<Ray> = (0..64)
            .map(|number| {
                if number % 16 != 0 {
                    let slope = Vec3::new(rng.between(-0.01, 0.47), rng.between(-0.01, 0.47), 1.0);
                    return Ray::new(eye, slope);
                }
                let triangle = u32::try_from(rng.below(mesh.len())).expect("small");
                let [a, b, c] = mesh.corners(triangle);
                let on_edge = a.lerp(rng.pick(&[b, c]), rng.unit());
                Ray::new(eye, on_edge.lerp(mesh.bounds().center(), 1e-6) - eye)
            })
            .collect();
        hits += check("squares", &mesh, &trees, &rays);
    }
    assert!(hits > effort::count(100, 500), "{hits} hits");
}

/// Some of a tile that cannot hit anything, go the other way, begin behind themselves or are of another length.
#[test]
fn odd_ones_among_neighbors() {
    let mesh = sphere(3);
    let trees = levels(&mesh);
    let mut rng = Rng(73);
    let mut hits = 0;
    for round in 0..400 {
        let kind = BUNDLES[round % BUNDLES.len()];
        let mut rays = bundle(kind, 64, 0.05, &mesh, &mut rng);
        for _ in 0..=rng.below(3) {
            let ray = &mut rays[rng.below(64)];
            match rng.below(9) {
                0 => *ray = ray.with_mask(0),
                1 => ray.direction = Vec3::ZERO,
                2 => ray.origin.y = f32::NAN,
                3 => ray.direction.x = f32::INFINITY,
                4 => ray.direction = -ray.direction,
                5 => ray.direction *= 1e-30,
                6 => ray.direction *= 1e6,
                7 => *ray = ray.with_range(-5.0, 0.7),
                _ => *ray = ray.with_range(2.0, 1.0),
            }
        }
        hits += check("sphere", &mesh, &trees, &rays);
    }
    assert!(hits > 5000, "{hits} hits");
}

#[test]
fn neighbors_at_any_scale() {
    let mut rng = Rng(74);
    for scale in [1e-30_f32, 1e-15, 1e-6, 1e6, 1e15, 1e30] {
        for shift in [0.0, 100.0] {
            let mesh = moved(&soup(), |p| (p + Vec3::splat(shift)) * scale);
            let trees = levels(&mesh);
            let mut hits = 0;
            for kind in BUNDLES {
                for width in [1e-3, 0.05] {
                    for length in [1.0, 1.0 / scale.clamp(1e-18, 1e18)] {
                        let mut rays = bundle(kind, 64, width, &mesh, &mut rng);
                        for ray in &mut rays {
                            ray.direction *= length;
                        }
                        hits += check("soup", &mesh, &trees, &rays);
                    }
                }
            }
            assert!(hits > 50, "{scale:e}, {shift}: {hits} hits");
        }
    }
}
