//! Hard rays, a kind per trial, on simple meshes.

use std::sync::Arc;

use glam::Vec3;
use kd_core::{Culling, Mesh, Ray};
use kd_trace::brute_force;

use super::{Over, Subject};
use crate::check::source;
use crate::effort;
use crate::rays::that_cannot_hit;
use crate::rng::Rng;
use crate::scenes::{self, Soup};

const INFINITY: f32 = f32::INFINITY;

/// The square [0, 2]² at z = 0, two triangles.
fn square() -> Arc<Mesh> {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let mut soup = Soup::default();
    soup.quad([
        corner(0.0, 0.0),
        corner(2.0, 0.0),
        corner(2.0, 2.0),
        corner(0.0, 2.0),
    ]);
    Arc::new(soup.mesh())
}

/// Rays that are not finite, have no direction, no range or no mask, and one that hits.
#[track_caller]
pub fn rays_that_cannot_hit_do_not(subject: &Subject) {
    let mesh = Arc::new(scenes::cube(2));
    let cube = Over::new(subject, "cube", &mesh);
    let good = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, 1.0]);
    cube.expect(&good, 1);
    for bad in that_cannot_hit() {
        cube.expect(&bad, 0);
    }
}

/// Directions so short that `t` is large but finite, so long that `t` is tiny but not zero, and beyond.
#[track_caller]
pub fn extreme_directions(subject: &Subject) {
    let mesh = Arc::new(scenes::cube(2));
    let cube = Over::new(subject, "cube", &mesh);
    let tiny = f32::from_bits(1);
    for (direction, must_hit) in [
        ([0.0, 0.0, tiny], false),
        ([0.0, tiny, -tiny], false),
        ([f32::MAX, 0.0, f32::MAX], false),
        ([-f32::MAX; 3], false),
        ([0.0, 0.0, 1e-38], true),
        ([0.0, 0.0, f32::MAX], true),
    ] {
        let ray = Ray::new([0.1, 0.2, 0.3], direction);
        let hits = cube.check(&ray);
        assert!(hits > 0 || !must_hit, "{}", source(&ray));
        cube.check(&ray.with_range(-INFINITY, INFINITY));
    }
}

/// Rays in the plane of both triangles of a square, across their edges and along them. The square itself is hit.
#[track_caller]
pub fn edge_on_triangles_are_not_hit(subject: &Subject) {
    let mesh = square();
    let square = Over::new(subject, "square", &mesh);
    for ray in [
        Ray::new([-1.0, 0.5, 0.0], [1.0, 0.0, 0.0]),
        Ray::new([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]),
        Ray::new([1.0, 0.5, 0.0], [0.25, 1.0, -0.0]),
        Ray::new([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        Ray::new([2.0, 2.0, 0.0], [0.0, -1.0, 0.0]),
    ] {
        square.expect(&ray, 0);
        square.expect(&ray.with_range(-INFINITY, INFINITY), 0);
    }
    square.expect(&Ray::new([1.5, 0.5, 1.0], [0.0, 0.0, -1.0]), 1);
}

/// Rays through corners and edges of a square, and just beside them.
#[track_caller]
pub fn edges_and_corners_belong_to_all_their_triangles(subject: &Subject) {
    let mesh = square();
    let square = Over::new(subject, "square", &mesh);
    for (point, triangles) in [
        ([0.0, 0.0], 2),
        ([2.0, 2.0], 2),
        ([1.0, 1.0], 2),
        ([2.0, 0.0], 1),
        ([0.0, 2.0], 1),
        ([1.0, 0.0], 1),
        ([0.0, 0.5], 1),
        ([1.5, 0.5], 1),
        ([f32::from_bits(1).next_down() - f32::MIN_POSITIVE, 0.5], 0),
        ([2.0_f32.next_up(), 0.5], 0),
    ] {
        for sign in [1.0, -1.0] {
            for zero in [0.0, -0.0] {
                let ray = Ray::new([point[0], point[1], -3.0 * sign], [zero, -zero, sign]);
                square.expect(&ray, triangles);
            }
        }
    }
}

/// The range is closed, may be a single number, and may be negative.
#[track_caller]
pub fn ranges_are_closed(subject: &Subject) {
    let mesh = square();
    let square = Over::new(subject, "square", &mesh);
    let ray = Ray::new([1.5, 0.5, 0.3], [0.0, 0.0, -0.7]);
    let t = brute_force::intersect(&mesh, &ray).expect("below").t;
    for (low, high, hits) in [
        (t, t, 1),
        (t, INFINITY, 1),
        (0.0, t, 1),
        (-INFINITY, INFINITY, 1),
        (t.next_up(), INFINITY, 0),
        (0.0, t.next_down(), 0),
        (-INFINITY, -0.0, 0),
    ] {
        square.expect(&ray.with_range(low, high), hits);
    }
    let behind = Ray::new(ray.origin, -ray.direction).with_range(-t, -t);
    square.expect(&behind, 1);
    // An origin on the surface is at t = 0.
    let on_it = Ray::new([1.5, 0.5, 0.0], [0.3, 0.2, 1.0]);
    for (low, high, hits) in [
        (0.0, 0.0, 1),
        (-0.0, 0.0, 1),
        (0.0, -0.0, 1),
        (f32::from_bits(1), 1.0, 0),
    ] {
        square.expect(&on_it.with_range(low, high), hits);
    }
}

/// Limits of no hit, one hit and more hits than exist; the earlier contents of the list have no effect.
#[track_caller]
pub fn as_many_hits_as_asked_for(subject: &Subject) {
    let mesh = Arc::new(scenes::cube(2));
    let cube = Over::new(subject, "cube", &mesh);
    let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
    cube.expect(&ray, 2);
    cube.expect(&ray.with_mask(0), 0);
    let mut all = Vec::new();
    brute_force::hits(&mesh, &ray, usize::MAX, &mut all);
    for (number, structure) in cube.queries().into_iter().enumerate() {
        let mut out = Vec::new();
        for max in [9, 0, 1, 2, 0] {
            structure.hits(&ray, max, &mut out);
            let first = &all[..max.min(2)];
            assert_eq!(out, first, "structure {number}, at most {max}");
        }
        out.clone_from(&all);
        structure.hits(&ray.with_mask(0), 9, &mut out);
        assert!(out.is_empty(), "structure {number}: earlier contents");
    }
}

/// Every limit of hits over coincident triangles: large ones, which slant through many cells, at few distances and in no order.
#[track_caller]
pub fn hits_at_equal_distances(subject: &Subject) {
    let mut rng = Rng(47);
    let mut soup = Soup::default();
    for _ in 0..240 {
        let z = 0.25 * rng.pick(&[-2.0_f32, -1.0, 0.0, 1.0, 2.0]);
        let corner = |x: f32, y: f32| Vec3::new(x, y, z + 0.5 * x);
        let [a, b, c] = [corner(-4.0, -4.0), corner(4.0, -4.0), corner(0.0, 4.0)];
        soup.triangle(if rng.chance(0.5) {
            [a, b, c]
        } else {
            [a, c, b]
        });
        let (center, size) = (rng.vec3(), 0.1);
        soup.triangle([(); 3].map(|()| center + size * rng.vec3()));
    }
    let mesh = Arc::new(soup.mesh());
    let walls = Over::new(subject, "walls", &mesh);
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    for (origin, direction) in [
        ([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]),
        ([0.1, 0.2, 3.0], [0.01, 0.02, -1.0]),
        ([-3.0, 0.0, 0.0], [1.0, 0.01, 0.02]),
        ([3.0, 0.1, 0.0], [-1.0, 0.01, -0.02]),
        ([0.0, 0.0, 0.0], [0.3, 0.2, 1.0]),
    ] {
        let ray = Ray::new(origin, direction).with_range(-1.0, INFINITY);
        brute_force::hits(&mesh, &ray, usize::MAX, &mut expected);
        assert!(expected.len() > 90, "{}: {}", source(&ray), expected.len());
        walls.expect(&ray, expected.len());
        walls.expect(&ray.with_mask(0), 0);
        let more = [31, 32, 33, 40, 64, 90, 239, 240, 241, usize::MAX];
        for (number, structure) in walls.queries().into_iter().enumerate() {
            for max in (1..=20).chain(more) {
                structure.hits(&ray, max, &mut found);
                let first = &expected[..max.min(expected.len())];
                assert!(
                    found == first,
                    "structure {number}, at most {max}: {}",
                    source(&ray)
                );
            }
        }
    }
}

/// Batches of several lengths and packets, full and not full, of random rays and of rays that cannot hit.
#[track_caller]
pub fn batches_and_packets_answer_as_single_rays(subject: &Subject) {
    for (name, mesh) in [("soup", scenes::soup()), ("room", scenes::room())] {
        let mesh = Arc::new(mesh);
        let over = Over::new(subject, name, &mesh);
        let mut source = over.random_rays(46);
        let mut rays: Vec<Ray> = (0..300).map(|_| source.draw()).collect();
        rays.splice(100..100, that_cannot_hit());
        for (culling, ray) in [Culling::BACK, Culling::FRONT]
            .into_iter()
            .cycle()
            .zip(&mut rays[40..90])
        {
            *ray = ray.with_culling(culling);
        }
        let mut hits = 0;
        for ray in &rays {
            hits += over.check(ray);
        }
        assert!(hits > 100, "{name}: {hits} hits");
        for length in [0, 1, 7, 64, rays.len()] {
            over.check_together(&rays[..length]);
        }
    }
}

/// Rays along every axis through every corner, every edge's midpoint and every lattice point, with zeros of both signs.
#[track_caller]
pub fn rays_along_axes_through_everything(subject: &Subject) {
    for (name, mesh) in [("cube", scenes::cube(2)), ("room", scenes::room())] {
        let mesh = Arc::new(mesh);
        let over = Over::new(subject, name, &mesh);
        let bounds = mesh.bounds();
        let mut points: Vec<Vec3> = mesh.positions().iter().map(|&p| p.into()).collect();
        for triangle in 0..u32::try_from(mesh.len()).expect("small") {
            let [a, b, c] = mesh.corners(triangle);
            points.extend([a.midpoint(b), b.midpoint(c), (a + b + c) / 3.0]);
        }
        points.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("finite"));
        points.dedup();
        let (mut rays, mut hit) = (0, 0);
        for point in points {
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    // From outside, from a face of the box and from the point.
                    let outside = bounds.center()[axis] - 10.0 * sign;
                    let face = if sign > 0.0 { bounds.min } else { bounds.max }[axis];
                    for start in [outside, face, point[axis]] {
                        let mut origin = point;
                        origin[axis] = start;
                        let mut direction = Vec3::new(0.0, -0.0, 0.0);
                        direction[axis] = sign;
                        rays += 1;
                        hit += usize::from(over.check(&Ray::new(origin, direction)) > 0);
                    }
                }
            }
        }
        assert!(10 * hit > 3 * rays, "{name}: {hit} of {rays}");
    }
}

/// Rays along axes from between triangles, with zeros of both signs, and segments that end before or behind a triangle.
#[track_caller]
pub fn along_an_axis_and_past_its_end(subject: &Subject) {
    let mesh = Arc::new(scenes::soup());
    let soup = Over::new(subject, "soup", &mesh);
    let mut rng = Rng(43);
    let mut hits = 0;
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for sign in [1.0, -1.0] {
            for _ in 0..60 {
                let ray = Ray::new(rng.vec3(), sign * axis);
                hits += soup.check(&ray);
                let negative_zeros = Ray::new(ray.origin, ray.direction + Vec3::splat(-0.0));
                hits += soup.check(&negative_zeros);
                let segment = ray.with_range(rng.unit(), 1.0 + rng.unit());
                hits += soup.check(&segment);
            }
        }
    }
    assert!(hits > 200, "{hits} hits");
}

/// Rays nearly parallel to planes, along faces.
#[track_caller]
pub fn grazing_rays(subject: &Subject) {
    let mesh = Arc::new(scenes::room());
    let room = Over::new(subject, "room", &mesh);
    let (mut rays, mut hit) = (0, 0);
    let tilts = [
        0.0, -0.0, 1e-45, -1e-38, 1e-30, 1e-19, -1e-18, 1e-12, -1e-7, 1e-5,
    ];
    for lattice in 0..9 {
        for tilt in tilts {
            for axis in 0..3 {
                let mut origin = Vec3::new(0.3, 1.7, 2.1);
                let mut direction = Vec3::new(0.6, 1.0, -0.4);
                for nudge in [0.0, 1e-7, -1e-7, 1e-5] {
                    origin[axis] = lattice as f32 + nudge;
                    direction[axis] = tilt;
                    let ray = Ray::new(origin, direction).with_range(-INFINITY, INFINITY);
                    rays += 1;
                    hit += usize::from(room.check(&ray) > 0);
                }
            }
        }
    }
    assert!(10 * hit > 3 * rays, "{hit} of {rays}");
}

/// Rays along an axis from distances up to the largest of f32. All of them hit.
#[track_caller]
pub fn rays_from_anywhere(subject: &Subject) {
    let mesh = Arc::new(scenes::room());
    let room = Over::new(subject, "room", &mesh);
    for distance in [1e3_f32, 1e6, 1e8, 1e9, 1e12, 1e20, 1e30, 1e38] {
        for number in 0..effort::count(60, 200) {
            let mut origin = Vec3::new(0.03, 0.02, 0.01) * number as f32 + 0.5;
            let mut direction = Vec3::new(0.0, 1e-45, -0.0);
            origin[number % 3] = -distance;
            direction[number % 3] = 1.0;
            let ray = Ray::new(origin, direction);
            assert!(room.check(&ray) > 0, "{}", source(&ray));
        }
    }
}

/// Corners rounded to 26 bits let a ray hit that passes an edge at 1.4e-8. Planes beside the edge, an octree's and those of
/// other triangles, bound cells around the ray that the triangle does not overlap: only the slack of planes finds the hit.
#[track_caller]
pub fn a_hit_beside_its_triangle(subject: &Subject) {
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| scenes::turned(axis, [x, y, z]);
        let mut soup = Soup::default();
        // One edge passes through the middle of the box.
        soup.triangle([
            turned(-1.1, -0.75, 0.0),
            turned(1.1, 0.75, 0.0),
            turned(-1.1, 0.75, 0.0),
        ]);
        // The planes of these are those of the box's middle.
        for height in [-1.0, 1.0] {
            let (low, high) = (0.5 * height, height);
            let [p, q] = [turned(0.0, -0.75, low), turned(0.0, 0.75, low)];
            soup.triangle([p, q, turned(0.0, 0.0, high)]);
            let [p, q] = [turned(-1.1, 0.0, low), turned(1.1, 0.0, low)];
            soup.triangle([p, q, turned(0.0, 0.0, high)]);
        }
        let mesh = Arc::new(soup.mesh());
        let beside = Over::new(subject, "beside", &mesh);
        for sign in [1.0, -1.0] {
            for x in [1.4e-8, 1e-9] {
                let ray = Ray::new(turned(x, 0.0, -3.0 * sign), turned(0.0, 0.0, sign));
                assert!(beside.check(&ray) > 0, "{}", source(&ray));
            }
            // No hit further away.
            let ray = Ray::new(turned(1e-3, 0.0, -3.0 * sign), turned(0.0, 0.0, sign));
            beside.check(&ray);
        }
    }
}

/// The same hits at an edge of a needle's box, by rays that are outside the box everywhere, and start so near that no distance to
/// a face is large.
#[track_caller]
pub fn hits_beside_a_needle(subject: &Subject) {
    let mut rng = Rng(45);
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| scenes::turned(axis, [z, x, y]);
        for width in [1e-5, 1e-3] {
            let mut soup = Soup::default();
            soup.triangle([
                turned(0.0, 0.0, -0.5),
                turned(0.0, 0.0, 0.5),
                turned(width, width, 0.1),
            ]);
            let mesh = Arc::new(soup.mesh());
            let needle = Over::new(subject, "needle", &mesh);
            let mut hits = 0;
            for _ in 0..effort::count(1000, 10_000) {
                let (slope, aside) = (rng.between(0.5, 1.0), 4e-9 * rng.unit());
                let direction = turned(slope, -slope, rng.pick(&[-1.0, 1.0]));
                let start = turned(-aside, -aside, rng.between(-0.1, 0.1));
                let ray = Ray::new(start, direction).with_range(-INFINITY, INFINITY);
                hits += usize::from(needle.check(&ray) > 0);
            }
            assert!(hits > effort::count(200, 2000), "{width}: {hits} hits");
        }
    }
}

/// The same hits at the edges of the scene's box, by rays that are outside the box everywhere.
#[track_caller]
pub fn hits_from_outside_the_box(subject: &Subject) {
    let mut rng = Rng(44);
    let mut hits = 0;
    for axis in 0..3 {
        for (sign_x, sign_y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            // To an edge of the box at (0, 0), where f32 resolves the smallest distances.
            let turned = |x: f32, y: f32, z: f32| scenes::turned(axis, [z, sign_x * x, sign_y * y]);
            // Each triangle contains the middle of the edge, and together they fill the box.
            let mut soup = Soup::default();
            for fan in 0..9 {
                let far = turned(0.125 * fan as f32 - 1.0, -0.125 * fan as f32, 0.0);
                soup.triangle([turned(0.0, 0.0, -1.0), turned(0.0, 0.0, 1.0), far]);
            }
            let mesh = Arc::new(soup.mesh());
            let fan = Over::new(subject, "fan", &mesh);
            for _ in 0..1000 {
                // Past the edge: beyond it along x after the edge, and along y before.
                let (x, y) = (rng.between(0.0, 3e-9), rng.between(0.0, 3e-9));
                let origin = turned(x, y, rng.between(-0.9, 0.9));
                let (dx, dy) = (rng.between(0.1, 0.9), rng.between(-0.9, -0.1));
                let ray = Ray::new(origin, turned(dx, dy, 1.0));
                hits += usize::from(fan.check(&ray.with_range(-INFINITY, INFINITY)) > 0);
            }
            let beside = Ray::new(turned(1e-3, 1e-3, 0.0), turned(0.5, -0.5, 1.0));
            fan.expect(&beside.with_range(-INFINITY, INFINITY), 0);
        }
    }
    assert!(hits > 1000, "{hits} of 12000");
}

/// Rays that are in a face of the scene's box up to a distance that vanishes beside the size of the box, and leave the box before
/// the last triangle on their way, or enter it before the first.
#[track_caller]
pub fn rays_almost_in_a_face(subject: &Subject) {
    let mut rng = Rng(45);
    let mut hits = 0;
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            // y is along the axis, with a face of the box at 0.
            let turned = |x: f32, y: f32, z: f32| scenes::turned(axis, [sign * y, x, z]);
            // Sheets in a row, each with an edge in the face.
            let mut soup = Soup::default();
            for sheet in 0..9 {
                let x = 0.25 * sheet as f32 - 1.0;
                let corners = [(0.0, -1.0), (0.0, 1.0), (-1.0, 0.0)];
                soup.triangle(corners.map(|(y, z)| turned(x, y, z)));
            }
            let mesh = Arc::new(soup.mesh());
            let sheets = Over::new(subject, "sheets", &mesh);
            for _ in 0..400 {
                // Through the face between the first sheet and the last.
                let (exit, z) = (rng.between(-0.9, 0.9), rng.between(-0.9, 0.9));
                let start = rng.pick(&[-1.5, -1.5, -30.0, -1e3, -1e6, -6e7]);
                let slope = rng.pick(&[1e-9, 1e-12, 1e-15, 1e-17, 1e-20, 1e-30]);
                let slope = slope * rng.pick(&[1.0, -1.0]);
                let origin = turned(start, slope * (start - exit), z);
                hits += sheets.check(&Ray::new(origin, turned(1.0, slope, 0.0)));
            }
            let above = Ray::new(turned(-2.0, 1e-3, 0.0), turned(1.0, 0.0, 0.0));
            sheets.expect(&above, 0);
        }
    }
    assert!(hits > 6000, "{hits} by 2400 rays");
}
