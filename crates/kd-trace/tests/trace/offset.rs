//! Rays that leave a surface at [`Mesh::offset_origin`] do not hit it again, and a quarter of the step is too little.

use glam::{DVec3, Vec3};
use kd_core::{Hit, Mesh, Ray, offset_origin};
use kd_oracle::effort;
use kd_oracle::rng::Rng;
use kd_oracle::scenes;
use kd_sah::{BuildOptions, build};
use kd_trace::kit::TriangleTest;
use kd_trace::{RayQuery, WideTree};
use proptest::prelude::*;

/// A triangle by itself.
#[derive(Clone, Copy, Debug)]
struct Plane {
    corners: [Vec3; 3],
    /// Of unit length, on the side that rays leave to.
    normal: DVec3,
}

impl Plane {
    /// On the side of a vector. `None` for a triangle without a normal.
    fn new(corners: [Vec3; 3], side: Vec3) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a).try_normalize()?;
        let sign = normal.dot(side.as_dvec3()).signum();
        Some(Self {
            corners,
            normal: sign * normal,
        })
    }

    /// The exact point of a hit, up to f64.
    fn point(&self, hit: &Hit) -> DVec3 {
        let [a, b, c] = self.corners.map(|corner| corner.as_dvec3());
        a + f64::from(hit.u) * (b - a) + f64::from(hit.v) * (c - a)
    }

    /// A direction that leaves: steep or grazing, along edges, to corners, or any other.
    fn leaving(&self, origin: Vec3, rng: &mut Rng) -> Vec3 {
        let [a, b, c] = self.corners.map(|corner| corner.as_dvec3());
        loop {
            let along = match rng.below(6) {
                0 => b - a,
                1 => c - b,
                2 => a - c,
                3 => rng.pick(&[a, b, c]) - origin.as_dvec3(),
                _ => rng.direction().as_dvec3(),
            };
            let along = (along - along.dot(self.normal) * self.normal).normalize_or_zero();
            let along = if rng.chance(0.5) { along } else { -along };
            let steepness = if rng.chance(0.5) {
                f64::from(rng.between(0.5, 2.0))
            } else {
                10.0_f64.powf(f64::from(rng.between(-12.0, 1.0)))
            };
            let direction = (along + steepness * self.normal).as_vec3();
            // Components in f32 can turn a grazing direction into the surface.
            if direction.as_dvec3().dot(self.normal) > 1e-13 * direction.as_dvec3().length() {
                return direction;
            }
        }
    }

    /// Whether some of many rays from an origin that leave the triangle hit it.
    fn is_hit_from(&self, origin: Vec3, rays: usize, rng: &mut Rng) -> bool {
        (0..rays).any(|_| {
            let ray = Ray::new(origin, self.leaving(origin, rng));
            let test = TriangleTest::new(&ray, f32::INFINITY);
            test.decide(self.corners, 0).is_some()
        })
    }
}

/// A hit inside, on an edge, very near one, or on a corner.
fn any_hit(rng: &mut Rng) -> Hit {
    let (u, v) = (rng.unit(), rng.unit());
    let (u, v) = if u + v > 1.0 {
        (1.0 - u, 1.0 - v)
    } else {
        (u, v)
    };
    let (u, v) = match rng.below(8) {
        0 => (0.0, v),
        1 => (u, 0.0),
        2 => (u, 1.0 - u),
        3 => (0.0, 1.0),
        4 => (1e-7, v),
        _ => (u, v),
    };
    Hit {
        t: 1.0,
        u,
        v,
        triangle: 0,
    }
}

/// Points that rays from far away find, and how many of them shadow themselves.
#[derive(Debug, Default)]
struct Count {
    points: usize,
    /// From [`Mesh::offset_origin`].
    shadowed: usize,
    /// From [`offset_origin`] of [`Hit::point`].
    shadowed_by_fixed_rule: usize,
}

/// Looks at a convex mesh around `center` from `distance`, and from the points that it sees in directions that leave.
fn look(mesh: &Mesh, center: Vec3, radius: f32, distance: f32, rng: &mut Rng) -> Count {
    let tree = build(mesh, &BuildOptions::default()).expect("a tree");
    let wide = WideTree::new(&tree, mesh);
    let mut count = Count::default();
    for _ in 0..effort::count(1_500, 20_000) {
        let eye = center + (radius + distance) * rng.direction();
        let ray = Ray::new(eye, center + 0.8 * radius * rng.vec3() - eye);
        let Some(hit) = wide.intersect(&ray) else {
            continue;
        };
        // At a silhouette, the test of far rays hits walls from behind.
        let side = mesh.surface_point(&hit) - center;
        let plane = Plane::new(mesh.corners(hit.triangle), side).expect("an area");
        let mut is_shadowed = |origin: Vec3| {
            (0..4).any(|_| wide.occluded(&Ray::new(origin, plane.leaving(origin, rng))))
        };
        count.points += 1;
        count.shadowed += usize::from(is_shadowed(mesh.offset_origin(&hit, side)));
        let by_point = offset_origin(hit.point(&ray), plane.normal.as_vec3());
        count.shadowed_by_fixed_rule += usize::from(is_shadowed(by_point));
    }
    count
}

#[test]
fn no_point_of_a_sphere_shadows_itself() {
    let mut rng = Rng(1);
    let sphere = scenes::sphere(3);
    let radius = sphere.bounds().max.x;
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e7] {
        let sphere = scenes::moved(&sphere, |p| scale * p);
        for power in 0..=7 {
            let (radius, distance) = (scale * radius, scale * radius * 10.0_f32.powi(power));
            let count = look(&sphere, Vec3::ZERO, radius, distance, &mut rng);
            assert!(count.points > 300, "1e{power} radii: {count:?}");
            assert_eq!(count.shadowed, 0, "scale {scale:e}, 1e{power} radii");
            if power >= 4 && scale >= 1.0 {
                let fixed = count.shadowed_by_fixed_rule;
                assert!(10 * fixed > count.points, "the rays are hard: {count:?}");
            }
        }
    }
}

/// Walls of integer coordinates, so that triangles in one plane are in it exactly.
#[test]
fn no_point_of_a_box_far_from_the_origin_shadows_itself() {
    let mut rng = Rng(2);
    let center = Vec3::new(500_000.0, 5_000_000.0, 100.0);
    for side in [1, 8] {
        let half = side as f32;
        let mesh = scenes::moved(&scenes::cube(side), |p| (half * p).round() + center);
        for power in 0..=7 {
            let distance = half * 10.0_f32.powi(power);
            let count = look(&mesh, center, half, distance, &mut rng);
            assert!(count.points > 100, "1e{power}: {count:?}");
            assert_eq!(count.shadowed, 0, "side {side}, 1e{power}");
        }
        // Inside, where a step that is too long leaves the box.
        let tree = build(&mesh, &BuildOptions::default()).expect("a tree");
        let wide = WideTree::new(&tree, &mesh);
        let mut left_by_fixed_rule = 0;
        for _ in 0..1000 {
            let ray = Ray::new(center, rng.direction());
            let hit = wide.intersect(&ray).expect("a closed box");
            let inwards = -ray.direction;
            let normal = mesh.normal(hit.triangle);
            let normal = normal * normal.dot(inwards).signum();
            let across = |origin: Vec3| wide.intersect(&Ray::new(origin, normal));
            let opposite = across(mesh.offset_origin(&hit, inwards));
            let width = opposite.expect("the opposite wall").t;
            assert!(width > 2.0 * half - 1.0 && width < 2.0 * half, "{width}");
            let by_point = offset_origin(hit.point(&ray), normal);
            left_by_fixed_rule += usize::from(across(by_point).is_none());
        }
        assert!(left_by_fixed_rule > 300, "{left_by_fixed_rule}");
    }
}

/// The largest step that fails, over the height of the origin, at many points of triangles of a kind.
fn largest_failing_step(rng: &mut Rng, triangle: impl Fn(&mut Rng) -> [Vec3; 3]) -> f64 {
    // Smaller parts are not searched.
    let mut largest = 1.0_f64 / 64.0;
    for _ in 0..effort::count(2_000, 8_000) {
        let corners = triangle(rng);
        let Some(plane) = Plane::new(corners, rng.direction()) else {
            continue;
        };
        let positions = corners.map(|corner| corner.to_array()).to_vec();
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).expect("valid");
        let hit = any_hit(rng);
        let point = plane.point(&hit);
        let origin = mesh.offset_origin(&hit, plane.normal.as_vec3());
        assert!(!plane.is_hit_from(origin, 100, rng), "{plane:?} {hit:?}");
        let height = (origin.as_dvec3() - point).dot(plane.normal);
        // Only steps that would raise the maximum.
        let mut part = 1.0;
        while part > largest {
            let nearer = (point + part * height * plane.normal).as_vec3();
            if plane.is_hit_from(nearer, 100, rng) {
                largest = part;
            }
            part *= 0.9;
        }
    }
    largest
}

#[test]
fn a_quarter_of_the_step_fails() {
    let mut rng = Rng(3);
    let soup = |rng: &mut Rng| [rng.vec3(), rng.vec3(), rng.vec3()];
    let centered = |rng: &mut Rng| {
        let [a, b, c] = soup(rng);
        let center = (a + b + c) / 3.0;
        [a - center, b - center, c - center]
    };
    let sliver = |rng: &mut Rng| {
        let [a, b, c] = soup(rng);
        [a, b, a.lerp(b, rng.unit()) + 1e-3 * c]
    };
    let floor = |rng: &mut Rng| soup(rng).map(|p| p * Vec3::new(1.0, 1.0, 0.0));
    let mut check = |name: &str, triangle: &dyn Fn(&mut Rng) -> [Vec3; 3]| {
        let largest = largest_failing_step(&mut rng, triangle);
        assert!(largest >= 0.25, "{name}: {largest}");
    };
    for scale in [1e-6, 1.0, 1e7] {
        check("soup", &|rng| soup(rng).map(|p| scale * p));
        check("around the origin", &|rng| centered(rng).map(|p| scale * p));
        check("floor", &|rng| floor(rng).map(|p| scale * p));
        check("slivers", &|rng| sliver(rng).map(|p| scale * p));
        let away = Vec3::new(30.0, 10.0, 7.0);
        check("small", &|rng| soup(rng).map(|p| scale * (p + away)));
    }
    for center in [
        Vec3::new(5e5, 5e6, 100.0),
        Vec3::new(-3e5, 2e5, 0.0),
        Vec3::new(0.0, 0.0, 1e5),
    ] {
        check("far away", &|rng| soup(rng).map(|p| p + center));
        check("a floor far away", &|rng| floor(rng).map(|p| p + center));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(3_000, 40_000)))]

    /// A triangle of any scale, place and shape is not hit by rays that leave it, from a hit that a ray found at any distance.
    #[test]
    fn no_triangle_is_hit_by_rays_that_leave_it(
        seed in any::<u64>(),
        scale in -60_i8..60,
        away in prop::sample::select(vec![0.0_f32, 1.0, 1e2, 1e4, 1e6]),
        thickness in prop::sample::select(vec![1.0_f32, 1e-2, 1e-4, 1e-5]),
        distance in -3_i8..8,
    ) {
        let mut rng = Rng(seed);
        let scale = f32::from(scale).exp2();
        let center = away * rng.vec3();
        let [a, b, c] = [rng.vec3(), rng.vec3(), rng.vec3()];
        let corners = [a, b, a.lerp(b, rng.unit()) + thickness * c].map(|p| scale * (p + center));
        let side = rng.direction();
        let Some(plane) = Plane::new(corners, side) else {
            return Ok(());
        };
        let mesh = Mesh::new(corners.map(|p| p.to_array()).to_vec(), vec![[0, 1, 2]]).expect("valid");
        let target = plane.point(&any_hit(&mut rng)).as_vec3();
        let eye = target + scale * 10.0_f32.powi(i32::from(distance)) * rng.direction();
        let ray = Ray::new(eye, target - eye);
        let found = kd_trace::brute_force::intersect(&mesh, &ray);
        for hit in found.into_iter().chain([any_hit(&mut rng)]) {
            let origin = mesh.offset_origin(&hit, plane.normal.as_vec3());
            prop_assert!(!plane.is_hit_from(origin, 50, &mut rng), "{plane:?} {hit:?} {origin:?}");
        }
    }
}
