//! Worlds in f64: cities at UTM coordinates trace as at zero, hits err by the stated rounding, and nothing leaks 10⁷ from zero.

mod city;
mod far;
mod reference;
mod scenes;
#[path = "../strategies/mod.rs"]
mod strategies;

use city::{City, Grid};
use kd::glam::{DVec3, Vec3};
use kd::world::{World, WorldMesh, WorldRay};
use kd::{BuildOptions, Hit, KdTree, Layout, Mesh, Ray, RayPacket8};
use kd_oracle::effort;
use kd_oracle::rays::Rays;
use kd_oracle::rng::Rng;
use kd_oracle::scenes as meshes;
use kd_trace::brute_force;
use reference::Seen;

/// UTM coordinates of a city in the Alps.
const UTM: DVec3 = DVec3::new(5e5, 5.2e6, 0.0);

const LAYOUTS: [Layout; 2] = [Layout::Wide, Layout::Binary];

fn tree(mesh: Mesh, layout: Layout) -> KdTree {
    let options = BuildOptions::fast().with_layout(layout).with_threads(1);
    KdTree::build(mesh, &options).expect("small")
}

fn world(mesh: WorldMesh, layout: Layout) -> World<KdTree> {
    World::new(tree(mesh.mesh, layout), mesh.origin)
}

/// All answers to some rays: single rays, batches, and ordered hits.
#[derive(Debug, PartialEq)]
struct Answers {
    closest: Vec<Option<Hit>>,
    occluded: Vec<bool>,
    hits: Vec<Vec<Hit>>,
}

impl Answers {
    fn of_world(world: &World<KdTree>, rays: &[WorldRay]) -> Self {
        let mut closest = vec![None; rays.len()];
        world.intersect_batch(rays, &mut closest);
        let mut occluded = vec![false; rays.len()];
        world.occluded_batch(rays, &mut occluded);
        for ((ray, closest), occluded) in rays.iter().zip(&closest).zip(&occluded) {
            assert_eq!(world.intersect(ray), *closest, "{ray:?}");
            assert_eq!(world.occluded(ray), *occluded, "{ray:?}");
        }
        for (rays, closest) in rays.chunks_exact(8).zip(closest.chunks_exact(8)) {
            let lanes: Vec<Ray> = rays
                .iter()
                .map(|ray| ray.relative_to(world.origin))
                .collect();
            let found = world.structure.intersect8(&RayPacket8::new(&lanes));
            assert_eq!(found, closest, "{rays:?}");
        }
        let hits = rays.iter().map(|ray| {
            let mut hits = Vec::new();
            world.hits(ray, usize::MAX, &mut hits);
            hits
        });
        Self {
            closest,
            occluded,
            hits: hits.collect(),
        }
    }

    fn of_tree(tree: &KdTree, rays: &[Ray]) -> Self {
        let mut closest = vec![None; rays.len()];
        tree.intersect_batch(rays, &mut closest);
        let mut occluded = vec![false; rays.len()];
        tree.occluded_batch(rays, &mut occluded);
        let hits = rays.iter().map(|ray| {
            let mut hits = Vec::new();
            tree.hits(ray, usize::MAX, &mut hits);
            hits
        });
        Self {
            closest,
            occluded,
            hits: hits.collect(),
        }
    }

    fn share_of_hits(&self) -> f64 {
        let hits = self.occluded.iter().filter(|hit| **hit).count();
        hits as f64 / self.occluded.len() as f64
    }
}

/// Offsets of an exact shift are exact, and all answers equal those of the same city in f32 at zero.
#[test]
fn cities_of_f32_trace_at_utm_as_at_zero() {
    // Up to 500 from zero on a grid of 2⁻¹⁴, and any f32.
    for grid in [Grid::Of(1.0 / 16384.0), Grid::OfF32] {
        let city = City::new(16, 60.0, grid);
        let near = Mesh::new(city.rounded(), city.triangles.clone()).expect("valid");
        let far = Mesh::from_f64(&city.shifted(UTM), city.triangles.clone()).expect("valid");
        assert_eq!(far.rounding, DVec3::ZERO, "{grid:?}: {}", far.origin);
        let mut rng = Rng(6);
        let mut rays = Vec::new();
        let mut rounded = 0;
        while rays.len() < effort::count(4000, 40_000) {
            let (start, direction) = city.ray(&mut rng);
            let ray = WorldRay::new(start + UTM, direction);
            // Starts of any f32 may be finer than the offsets.
            if ray.rounding_from(far.origin) == DVec3::ZERO {
                rays.push((Ray::new(start.as_vec3(), direction), ray));
            } else {
                rounded += 1;
            }
        }
        assert!(rounded < rays.len() / 4, "{grid:?}: {rounded} are rounded");
        let (near_rays, far_rays): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        for layout in LAYOUTS {
            let expected = Answers::of_tree(&tree(near.clone(), layout), &near_rays);
            let found = Answers::of_world(&world(far.clone(), layout), &far_rays);
            assert!(found == expected, "{grid:?}, {layout:?}: answers differ");
            assert!(found.share_of_hits() > 0.5, "{}", found.share_of_hits());
        }
    }
}

/// Rays along axes, edges and planes, at corners, and with ranges that end at a hit: no decision depends on where the world is.
#[test]
fn hard_rays_do_not_notice_where_the_world_is() {
    for near in [meshes::room(), meshes::cube(4)] {
        let positions = near.positions().iter();
        let positions: Vec<[f64; 3]> = positions
            .map(|position| (Vec3::from(*position).as_dvec3() + UTM).to_array())
            .collect();
        let far = Mesh::from_f64(&positions, near.triangles().to_vec()).expect("valid");
        assert_eq!(far.rounding, DVec3::ZERO, "exact");
        let mut rng = Rng(14);
        let mut rays = Rays::new(&near, vec![(0, 4.0), (1, 0.5), (2, 1.0)], 15);
        let mut draw = || {
            let mut ray = rays.draw();
            ray.origin = (ray.origin * 256.0).round() / 256.0;
            if rng.chance(0.4) {
                let corner = Vec3::from(rng.pick(near.positions()));
                let other = Vec3::from(rng.pick(near.positions()));
                ray.direction = rng.pick(&[corner, corner.midpoint(other)]) - ray.origin;
            }
            ray
        };
        let moved = |ray: Ray| {
            let far = WorldRay::new(UTM + ray.origin.as_dvec3(), ray.direction);
            (ray, far.with_range(ray.t_min, ray.t_max))
        };
        let draws = effort::count(4000, 40_000);
        let (near_rays, far_rays): (Vec<Ray>, Vec<WorldRay>) = (0..draws)
            .map(|_| moved(draw()))
            .filter(|(_, ray)| ray.rounding_from(far.origin) == DVec3::ZERO)
            .unzip();
        assert!(near_rays.len() > draws / 4 * 3, "most starts are exact");
        for layout in LAYOUTS {
            let tree = tree(near.clone(), layout);
            let expected = Answers::of_tree(&tree, &near_rays);
            for (ray, hits) in near_rays.iter().zip(&expected.hits).take(500) {
                let mut slow = Vec::new();
                brute_force::hits(&near, ray, usize::MAX, &mut slow);
                assert_eq!(*hits, slow, "{ray:?}");
            }
            let found = Answers::of_world(&world(far.clone(), layout), &far_rays);
            assert!(found == expected, "{layout:?}: answers differ");
            assert!(found.share_of_hits() > 0.5, "{}", found.share_of_hits());
        }
    }
}

/// Where f32 cannot hold all offsets of a grid of 2⁻²⁰, the same are rounded alike everywhere, and so are the starts of rays.
#[test]
fn cities_on_a_grid_trace_at_utm_as_at_zero() {
    let unit = 1.0 / f64::from(1 << 20);
    let whole = [UTM, DVec3::new(-4.4e6, 3.0, 4.5e6)];
    let on_grid = [UTM + DVec3::new(-0.75, unit, 99.0 * unit)];
    for (lots, lot, shifts) in [
        // Eight kilometres, and eight metres, whose offsets are exact.
        (20, 400.0, [whole.to_vec(), on_grid.to_vec()].concat()),
        (8, 1.0, whole.to_vec()),
    ] {
        let city = City::new(lots, lot, Grid::Of(unit));
        let near = Mesh::from_f64(&city.positions, city.triangles.clone()).expect("valid");
        assert_eq!(near.rounding == DVec3::ZERO, lots < 20);
        let mut rng = Rng(7);
        let draws = effort::count(3000, 30_000);
        let mut draw = || {
            let (start, direction) = city.ray(&mut rng);
            // A few from afar, whose starts f32 rounds.
            let back = if rng.chance(0.1) { 1e4 } else { 0.0 };
            let start = start - back * DVec3::from(direction.map(f64::from));
            (city.grid.snap(start), direction)
        };
        let rays: Vec<_> = (0..draws).map(|_| draw()).collect();
        let at = |shift: DVec3| -> Vec<WorldRay> {
            let rays = rays.iter();
            rays.map(|(start, direction)| WorldRay::new(*start + shift, *direction))
                .collect()
        };
        for layout in LAYOUTS {
            let expected = Answers::of_world(&world(near.clone(), layout), &at(DVec3::ZERO));
            assert!(expected.share_of_hits() > 0.5, "most rays hit");
            for shift in &shifts {
                let far = Mesh::from_f64(&city.shifted(*shift), city.triangles.clone());
                let far = far.expect("valid");
                assert_eq!(far.origin, near.origin + shift, "the origin moves along");
                assert_eq!(far.rounding, near.rounding, "the same rounding");
                assert!(far.mesh == near.mesh, "the same offsets");
                let found = Answers::of_world(&world(far, layout), &at(*shift));
                assert!(found == expected, "{shift}, {layout:?}: answers differ");
            }
        }
    }
}

/// Any other city: hits err by the roundings of the mesh and of the ray, and by the triangle test.
#[test]
fn hits_in_any_city_err_by_the_stated_rounding() {
    let city = City::new(12, 211.0, Grid::None);
    let positions = city.shifted(UTM);
    let mesh = Mesh::from_f64(&positions, city.triangles.clone()).expect("valid");
    let extent = mesh.mesh.bounds().extent().max_element();
    assert!(mesh.rounding.max_element() > 0.0, "not on a grid");
    let most = f64::from(extent) / f64::from(1 << 25);
    assert!(mesh.rounding.max_element() <= most, "{}", mesh.rounding);
    let corners: Vec<[DVec3; 3]> = city
        .triangles
        .iter()
        .map(|corners| corners.map(|corner| DVec3::from(positions[corner as usize])))
        .collect();
    // The triangle test moves corners by up to ¾ · 2⁻²⁵ of the extent on each of two axes. Weights are rounded to f32.
    let of_test = f64::from(extent) / f64::from(1 << 24);
    let mut rng = Rng(8);
    let (mut hits, mut clear) = (0, 0);
    let rounding = mesh.rounding;
    let world = world(mesh, Layout::Wide);
    for _ in 0..effort::count(1500, 15_000) {
        let (start, direction) = city.ray(&mut rng);
        let ray = WorldRay::new(start + UTM, direction);
        let most = (rounding + ray.rounding_from(world.origin)).length() + of_test;
        let seen = |triangle: usize| Seen {
            corners: corners[triangle].map(|corner| corner - ray.at(0.0)),
            direction: ray.ray.direction.as_dvec3(),
        };
        let found = world.intersect(&ray);
        if let Some(hit) = found {
            hits += 1;
            let seen = seen(hit.triangle as usize);
            let (distance, difference) = seen.errors(&hit);
            let t = f64::from(hit.t.abs()) / f64::from(1 << 23);
            assert!(distance <= most, "{distance} of {most}: {ray:?}");
            let most = most / seen.direction.length() + t;
            assert!(difference <= most, "{difference} of {most}: {ray:?}");
            let point = world.point(world.structure.mesh(), &hit);
            let [a, b, c] = seen.corners.map(|corner| corner + ray.at(0.0));
            let (u, v) = (f64::from(hit.u), f64::from(hit.v));
            let exact = a + u * (b - a) + v * (c - a);
            let error = (point - exact).abs();
            let most = rounding + DVec3::splat(5.2e6 * f64::EPSILON);
            assert!(error.cmple(most).all(), "{error} of {most}: {ray:?}");
        }
        let found = found.map_or(f64::INFINITY, |hit| f64::from(hit.t));
        for triangle in 0..corners.len() {
            let Some((t, per_move)) = seen(triangle).clear_hit(2.0 * most) else {
                continue;
            };
            let slack = most * per_move + t.abs() / f64::from(1 << 23);
            if t > slack {
                clear += 1;
                assert!(found <= t + slack, "triangle {triangle} is missed: {ray:?}");
            }
        }
    }
    assert!(
        hits > 500 && clear > 500,
        "{hits} hits, {clear} of them clear"
    );
}

/// A ray from a satellite, advanced to the city, hits what a ray that starts there hits.
#[test]
fn advanced_rays_round_as_if_they_started_there() {
    let city = City::new(8, 60.0, Grid::Of(1.0 / 16384.0));
    let mesh = Mesh::from_f64(&city.shifted(UTM), city.triangles.clone()).expect("valid");
    let world = world(mesh, Layout::Wide);
    let mut rng = Rng(9);
    let (mut hits, mut rounded) = (0, 0);
    for _ in 0..1000 {
        let (target, _) = city.ray(&mut rng);
        // Steps of powers of two, so that both starts are exact.
        let direction = [0.125 * rng.below(3) as f32, -0.25, -1.0];
        let near = target.with_z(512.0) + UTM;
        let height = f64::from(1 << 20);
        let far = near - height * DVec3::from(direction.map(f64::from));
        let far = WorldRay::new(far, direction).with_range(5e5, 2e6);
        let advanced = far.advanced(height);
        assert_eq!(advanced.rounding_from(world.origin), DVec3::ZERO, "near");
        let found = world.intersect(&advanced);
        let expected = world.intersect(&WorldRay::new(near, direction));
        assert_eq!(found, expected, "{far:?}");
        hits += usize::from(found.is_some());
        rounded += usize::from(far.rounding_from(world.origin) != DVec3::ZERO);
    }
    assert!(hits > 500, "{hits} hits");
    assert!(rounded > 500, "{rounded} were rounded from afar");
}
