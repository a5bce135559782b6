//! One row per way of being awkward.

use glam::Vec3;
use kd_comparators::Options;
use kd_core::{Mesh, Ray};
use kd_oracle::rays::that_cannot_hit;

use crate::check::{Subject, check, source};
use crate::scenes::{self, Soup};

const INFINITY: f32 = f32::INFINITY;

#[test]
fn rays_that_cannot_hit_do_not() {
    let mesh = scenes::cube(2);
    let subjects = Subject::all(&mesh);
    let good = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, 1.0]);
    assert!(check("cube", &mesh, &subjects, &good) > 0, "a plain ray");
    for bad in that_cannot_hit() {
        let hits = check("cube", &mesh, &subjects, &bad);
        assert_eq!(hits, 0, "{}", source(&bad));
    }
    let tiny = f32::from_bits(1);
    for direction in [
        [0.0, 0.0, tiny],
        [0.0, tiny, -tiny],
        [f32::MAX, 0.0, f32::MAX],
        [-f32::MAX; 3],
        [0.0, 0.0, 1e-38],
        [0.0, 0.0, f32::MAX],
    ] {
        let ray = Ray::new([0.1, 0.2, 0.3], direction);
        check("cube", &mesh, &subjects, &ray);
        let line = ray.with_range(-INFINITY, INFINITY);
        check("cube", &mesh, &subjects, &line);
    }
}

#[test]
fn hits_clears_and_counts() {
    let mesh = scenes::cube(2);
    let subject = Subject::new(&mesh, Options::default());
    let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
    let mut out = Vec::new();
    for (ray, max, count) in [
        (ray, 9, 2),
        (ray, 0, 0),
        (ray, 1, 1),
        (ray.with_mask(0), 9, 0),
    ] {
        subject.octree.hits(&mesh, &ray, max, &mut out);
        assert_eq!(out.len(), count, "octree, at most {max}");
        subject.bsp.hits(&mesh, &ray, max, &mut out);
        assert_eq!(out.len(), count, "bsp, at most {max}");
    }
}

#[test]
fn no_triangles_no_hits() {
    let mesh = Mesh::new(vec![[1.0; 3]], vec![]).expect("valid");
    let subjects = Subject::all(&mesh);
    let ray = Ray::new([0.0; 3], [1.0; 3]);
    assert_eq!(check("empty", &mesh, &subjects, &ray), 0, "nothing there");
    for subject in &subjects {
        for stats in [subject.octree.stats(), subject.bsp.stats()] {
            let sizes = (stats.nodes, stats.leaves, stats.references, stats.bytes);
            assert_eq!(sizes, (0, 0, 0, 0), "nothing is stored");
        }
    }
}

#[test]
fn triangles_without_area_are_kept_and_not_hit() {
    let mut soup = Soup::default();
    let (a, b) = (Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.3, 1.2));
    for _ in 0..20 {
        for corners in [[a, a, a], [a, b, b], [a, b, a.midpoint(b)]] {
            soup.triangle(corners);
        }
    }
    let mesh = soup.mesh();
    let subjects = Subject::all(&mesh);
    for target in [a, b, a.midpoint(b)] {
        check("no area", &mesh, &subjects, &Ray::new([0.0; 3], target));
    }
    for subject in &subjects {
        for stats in [subject.octree.stats(), subject.bsp.stats()] {
            assert!(stats.references >= mesh.len(), "all are kept: {stats:?}");
        }
    }
}

/// Along every axis through every corner, every edge's middle and every lattice point, with zeros of both signs.
#[test]
fn rays_along_axes_through_everything() {
    for mesh in [scenes::cube(2), scenes::room()] {
        let subjects = Subject::all(&mesh);
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
                    // From outside, from a face of the box, from the point itself.
                    let outside = bounds.center()[axis] - 10.0 * sign;
                    let face = if sign > 0.0 { bounds.min } else { bounds.max }[axis];
                    for start in [outside, face, point[axis]] {
                        let mut origin = point;
                        origin[axis] = start;
                        let mut direction = Vec3::new(0.0, -0.0, 0.0);
                        direction[axis] = sign;
                        let ray = Ray::new(origin, direction);
                        rays += 1;
                        hit += usize::from(check("axes", &mesh, &subjects, &ray) > 0);
                    }
                }
            }
        }
        assert!(10 * hit > 3 * rays, "{hit} of {rays}");
    }
}

/// Nearly parallel to planes, grazing along faces.
#[test]
fn grazing_rays() {
    let mesh = scenes::room();
    let subjects = Subject::all(&mesh);
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
                    hit += usize::from(check("room", &mesh, &subjects, &ray) > 0);
                }
            }
        }
    }
    assert!(10 * hit > 3 * rays, "{hit} of {rays}");
}

#[test]
fn scenes_at_the_ends_of_f32_agree() {
    for scale in [1e-37, 1e-32, 1e-25, 1e18, 1e20, 1e37, 3e38] {
        let mesh = scenes::moved(&scenes::cube(2), |p| p * scale);
        let subjects = Subject::all(&mesh);
        let mut some = 0;
        for direction in [
            [0.0, 0.0, 1.0],
            [0.1, 0.2, 1.0],
            [1e-30, -1e-19, 1.0],
            [1e30, 1e29, 1e30],
        ] {
            let ray = Ray::new(Vec3::new(0.1, 0.2, -0.3) * scale, direction);
            some += check("scaled", &mesh, &subjects, &ray);
        }
        assert!(some > 0, "scale {scale}");
    }
}

/// Rounding corners to 26 bits lets a ray that passes an edge at 1.4e-8 hit. Planes beside the edge, an octree's and those of
/// other triangles, cut out cells around the ray that the triangle does not reach into: only their slack finds it.
#[test]
fn a_hit_beside_its_triangle_is_found() {
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| {
            let mut p = Vec3::ZERO;
            p[axis] = x;
            p[(axis + 1) % 3] = y;
            p[(axis + 2) % 3] = z;
            p
        };
        let mut soup = Soup::default();
        // One edge runs through the middle of the box.
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
        let mesh = soup.mesh();
        let fine = Options::default().with_small_leaf(0);
        let subjects = [Subject::new(&mesh, fine)];
        for sign in [1.0, -1.0] {
            for x in [1.4e-8, 1e-9] {
                let ray = Ray::new(turned(x, 0.0, -3.0 * sign), turned(0.0, 0.0, sign));
                let hits = check("beside", &mesh, &subjects, &ray);
                assert!(hits > 0, "{}", source(&ray));
            }
        }
    }
}
