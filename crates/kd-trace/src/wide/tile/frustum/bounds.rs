//! How near the errors of coordinates across come to the distances by which faces are moved, by a search for large ones.

use std::array::from_fn;

use glam::Vec3;
use kd_core::{Aabb, Ray};
use kd_oracle::rng::Rng;
use kd_simd::{Level, Task, each};

use super::*;
use crate::search::{self, in_memory, vary};
use crate::wide::tile::Tile;
use crate::wide::tile::leaf::MOST_SPREAD;

/// A ray for each group of a tile, and the box of a scene that all of them pass.
#[derive(Clone, Copy, Debug)]
struct Case {
    rays: [Ray; LANES],
    bounds: [Vec3; 2],
    /// How far through the box: 0 to 1.
    part: f32,
}

/// The largest errors over the distance by which faces are moved, by what most of that distance is for.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    per_distance: f64,
    per_coordinate: f64,
    per_spread: f64,
}

impl<S: Simd> Task<S> for &Case {
    /// None if the rays are not coherent.
    type Output = Errors;

    #[inline(always)]
    fn run(self, simd: S) -> Errors {
        let frame = Frame::new(&Aabb::around(self.bounds));
        let rays: Vec<Ray> = self.rays.iter().flat_map(|ray| [*ray; LANES]).collect();
        let mut tile = Tile::new();
        let mut errors = Errors::default();
        if !tile.gather(simd, &rays, MOST_SPREAD, &frame) {
            return errors;
        }
        let View { apex, axes, .. } = tile.view;
        let [lower, upper] = each(frame.corners, |corner| corner[axes[2]]);
        let depth = (lower + self.part * (upper - lower) - apex.at[2]) * apex.sign;
        if depth < 0.0 || apex.deepest < depth {
            return errors;
        }
        let depths = [simd.splat(depth); 2];
        for axis in 0..2 {
            let blur = PER_SPREAD * tile.view.spread * depth;
            let groups = tile.groups.load(simd).across(axis, depths).map(in_memory);
            let [lower, upper] = each(frame.corners, |corner| {
                (corner[axes[axis]] - apex.at[axis]).abs()
            });
            let distance = lower.max(upper);
            for (group, ray) in self.rays.iter().enumerate() {
                let exact = exact(&tile.view, axis, ray, depth);
                if (exact - f64::from(apex.at[axis])).abs() > f64::from(distance) {
                    continue;
                }
                let slope = simd.load(&tile.terms[axis][group]) + simd.splat(tile.view.slope[axis]);
                let at = if tile.is_apex {
                    simd.splat(0.0)
                } else {
                    simd.load(&tile.terms[2 + axis][group])
                };
                let alone = across(simd, &tile.view, axis, at, slope, depths).map(in_memory);
                for (ends, lane, blur) in [(groups, group, 0.0), (alone, 0, blur)] {
                    let [least, most] = ends.map(|end| f64::from(end[lane]));
                    let is_between = least <= exact && exact <= most;
                    assert!(is_between, "{exact:e} in {least:e} to {most:e}");
                    let pad = apex.pad[axis] + blur;
                    let share = (least - exact).max(exact - most) / f64::from(pad) + 1.0;
                    let by_distance = PER_DISTANCE * (distance + tile.view.apart);
                    let by_coordinate = PER_COORDINATE * apex.at[axis].abs();
                    for (part, largest) in [
                        (by_distance, &mut errors.per_distance),
                        (by_coordinate, &mut errors.per_coordinate),
                        (blur, &mut errors.per_spread),
                    ] {
                        if part > 0.8 * pad {
                            *largest = largest.max(share);
                        }
                    }
                }
            }
        }
        errors
    }
}

/// Where a ray is across at a depth.
fn exact(view: &View, axis: usize, ray: &Ray, depth: f32) -> f64 {
    let View { apex, axes, .. } = view;
    let [x, z] = [axes[axis], axes[2]];
    let slope = f64::from(ray.direction[x]) / f64::from(ray.direction[z]);
    let from_apex = f64::from(apex.at[2]) - f64::from(ray.origin[z]);
    let along = f64::from(depth) * f64::from(apex.sign) + from_apex;
    f64::from(ray.origin[x]) + slope * along
}

/// How rays and a scene lie.
#[derive(Clone, Copy, Debug)]
struct Setup {
    /// Coordinates of the apex.
    origin: f32,
    /// The distance between the origins of rays.
    apart: f32,
    /// The slopes of rays from the central one.
    spread: f32,
    /// The distance to the scene, and the size of the scene.
    distance: f32,
    size: f32,
}

impl Setup {
    fn case(&self, rng: &mut Rng) -> Case {
        let origin = self.origin * (Vec3::ONE + 0.5 * rng.vec3());
        let most = 1.0 - 1.01 * self.spread;
        let mut slope = || {
            rng.pick(&[
                0.0,
                0.5 + self.spread,
                most,
                -most,
                most * rng.clone().unit(),
            ])
        };
        let center = Vec3::new(slope(), slope(), 1.0);
        let middle = origin + self.distance * rng.between(1.0, 1.2) * center;
        let bounds = [
            middle - self.size * rng.unit(),
            middle + self.size * rng.unit(),
        ];
        let rays = from_fn(|_| {
            let origin = origin + self.apart * rng.vec3();
            if self.distance > 0.0 && rng.chance(0.5) {
                let target = bounds[0] + Vec3::splat(rng.unit()) * (bounds[1] - bounds[0]);
                return Ray::new(origin, (target - origin) / self.distance);
            }
            let aside = self.spread * rng.vec3() * Vec3::new(1.0, 1.0, 0.0);
            Ray::new(origin, center + aside)
        });
        Case {
            rays,
            bounds,
            part: rng.unit(),
        }
    }
}

/// The same but for a few numbers.
fn varied(mut case: Case, rng: &mut Rng) -> Case {
    for _ in 0..=rng.below(3) {
        let axis = rng.below(3);
        let ray = &mut case.rays[rng.below(LANES)];
        match rng.below(8) {
            0 => vary(&mut case.part, 1.0, rng),
            1 | 2 => {
                let corner = &mut case.bounds[rng.below(2)];
                vary(&mut corner[axis], 0.1, rng);
            }
            3 => {
                let is_apex = case
                    .rays
                    .iter()
                    .all(|ray| ray.origin == case.rays[0].origin);
                if !is_apex {
                    let ray = &mut case.rays[rng.below(LANES)];
                    vary(&mut ray.origin[axis], 1e-3, rng);
                }
            }
            _ => vary(&mut ray.direction[axis.min(1)], 1e-3, rng),
        }
    }
    case.part = case.part.clamp(0.0, 1.0);
    case.bounds = [
        case.bounds[0].min(case.bounds[1]),
        case.bounds[0].max(case.bounds[1]),
    ];
    case
}

/// The largest value that a search finds.
fn largest(setup: Setup, value: impl Fn(&Errors) -> f64) -> f64 {
    search::largest(
        |rng| setup.case(rng),
        varied,
        |case| {
            [Level::portable(), Level::detect()]
                .iter()
                .map(|level| value(&level.run(case)))
                .fold(0.0, f64::max)
        },
    )
}

#[test]
fn faces_must_be_moved() {
    let far = Setup {
        origin: 1.0,
        apart: 1.0,
        spread: 1e-6,
        distance: 1e3,
        size: 1.0,
    };
    let distance = largest(far, |errors| errors.per_distance);
    assert!(distance > 1.0 / 8.0, "by distances: {distance}");
    let at_large_coordinates = Setup {
        origin: 1e5,
        apart: 0.01,
        spread: 1e-3,
        distance: 1.0,
        ..far
    };
    let coordinate = largest(at_large_coordinates, |errors| errors.per_coordinate);
    assert!(coordinate > 1.0 / 4.0, "by coordinates: {coordinate}");
    let divergent = Setup {
        origin: 0.0,
        apart: 1e-3,
        spread: 0.3,
        distance: 1e6,
        ..far
    };
    let spread = largest(divergent, |errors| errors.per_spread);
    assert!(spread > 1.0 / 4.0, "by the spread: {spread}");
}
