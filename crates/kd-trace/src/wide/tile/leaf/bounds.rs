//! How near errors come to their bounds, by a search for inputs with large ones.
//!
//! The f64 arithmetic of the decision is the judge: its errors are 2⁻²⁹ of those of f32.

use std::array::from_fn;

use glam::Vec3;
use kd_core::{Aabb, Ray, is_zero_area};
use kd_oracle::effort;
use kd_oracle::rng::Rng;
use kd_simd::{Level, Task, Three, Triple, each};

use super::*;
use crate::decision;
use crate::planes::Frame;
use crate::search::{self, in_memory, vary};
use crate::wide::tile::Tile;

/// A ray for each group of a tile, and a triangle for each lane of a block.
#[derive(Clone, Copy, Debug)]
struct Case {
    rays: [Ray; LANES],
    triangles: [[Vec3; 3]; LANES],
}

/// The errors for one ray and one triangle, each over its bound: 0 where no bound applies.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Of edge functions, for a group and for one ray.
    group: f64,
    alone: f64,
    /// Of depths, where the bound is mostly for rounding depths, for the place of the ray, or for the normal.
    rounding: f64,
    place: f64,
    normal: f64,
}

impl<S: Simd> Task<S> for &Case {
    /// The errors of each ray with each triangle; none if the rays are not coherent.
    type Output = Vec<Errors>;

    #[inline(always)]
    fn run(self, simd: S) -> Vec<Errors> {
        let frame = Frame::new(&Aabb::around(self.triangles.as_flattened().iter().copied()));
        let rays: Vec<Ray> = self.rays.iter().flat_map(|ray| [*ray; LANES]).collect();
        let mut tile = Tile::new();
        if !tile.gather(simd, &rays, MOST_SPREAD, &frame) {
            return Vec::new();
        }
        if tile.is_apex {
            self.errors::<S, TERMS_FROM_APEX>(simd, &mut tile)
        } else {
            self.errors::<S, TERMS>(simd, &mut tile)
        }
    }
}

impl Case {
    #[inline(always)]
    fn errors<S: Simd, const TERMS: usize>(&self, simd: S, tile: &mut Tile) -> Vec<Errors> {
        let mut block = Block::EMPTY;
        for (lane, corners) in self.triangles.iter().enumerate() {
            block.set(lane, 0, *corners);
        }
        prepare::<S, TERMS>(simd, &tile.view, &block, &mut tile.edges);
        let mut all = Vec::new();
        for (group, ray) in self.rays.iter().enumerate() {
            for (lane, corners) in self.triangles.iter().enumerate() {
                // A block has no corners of such a triangle.
                if is_zero_area(*corners) {
                    continue;
                }
                let exact = Exact::new(&tile.view, ray, *corners);
                let mut errors = Errors {
                    group: group_error::<S, TERMS>(simd, tile, group, lane, &exact),
                    ..Errors::default()
                };
                let mut terms = [simd.splat(0.0); TERMS];
                for (term, rows) in terms.iter_mut().zip(&tile.terms) {
                    *term = simd.load(&rows[group]);
                }
                ray_errors(simd, tile, [group, lane], &terms, &exact, &mut errors);
                all.push(errors);
            }
        }
        all
    }
}

/// What f64 says about a ray and a triangle.
struct Exact {
    weights: [f64; 3],
    /// The reported `t`, as if the ray were endless.
    t: Option<f32>,
    /// The depth there.
    depth: f64,
    /// Depth per unit of `t`.
    speed: f32,
}

impl Exact {
    fn new(view: &View, ray: &Ray, corners: [Vec3; 3]) -> Self {
        let [dx, dy, along] = each(view.axes, |axis| f64::from(ray.direction[axis]));
        let decided = decision::View {
            shear: [dx / along, dy / along],
            scale: 1.0 / along,
        };
        let corners = each(view.axes, |axis| {
            Three(each(corners, |corner| f64::from(corner[axis]))).minus(ray.origin[axis].into())
        });
        let Three(weights) = decided.sight(corners).deciding_weights();
        let hit = decided.hit(corners, [f32::MIN, f32::MAX], decision::BothSides, 0);
        let speed = ray.direction[view.axes[2]] * view.apex.sign;
        let from = f64::from(ray.origin[view.axes[2]]) - f64::from(view.apex.at[2]);
        Self {
            weights,
            t: hit.map(|hit| hit.t),
            depth: hit.map_or(f64::NAN, |hit| f64::from(hit.t) * f64::from(speed))
                + from * f64::from(view.apex.sign),
            speed,
        }
    }

    fn is_inside(&self) -> bool {
        let [a, b, c] = self.weights;
        (a > 0.0 && b > 0.0 && c > 0.0) || (a < 0.0 && b < 0.0 && c < 0.0)
    }
}

fn first_lane<F: F32x8>(x: F) -> f32 {
    in_memory(x)[0]
}

/// The largest error of an edge function for a group, whose rays are all the same.
#[inline(always)]
fn group_error<S: Simd, const TERMS: usize>(
    simd: S,
    tile: &Tile,
    group: usize,
    lane: usize,
    exact: &Exact,
) -> f64 {
    let mut most = 0.0_f64;
    for (edge, exact) in exact.weights.into_iter().enumerate() {
        let bound = simd.load(&tile.edges.bound);
        let (lo, hi) = between::<S, TERMS>(simd, &tile.edges, edge, &tile.ranges, group, bound);
        let [lo, hi] = each([lo, hi], |end| f64::from(in_memory(end)[lane]));
        assert!(lo <= exact && exact <= hi, "{exact:e} in {lo:e} to {hi:e}");
        most = most.max((2.0 * exact - lo - hi).abs() / (hi - lo));
    }
    most
}

/// The errors of an edge function and of the depth for one ray.
#[inline(always)]
fn ray_errors<S: Simd, const TERMS: usize>(
    simd: S,
    tile: &Tile,
    [group, lane]: [usize; 2],
    terms: &[S::F32; TERMS],
    exact: &Exact,
    errors: &mut Errors,
) {
    let edges = &tile.edges;
    let endless = [simd.splat(f32::MIN), simd.splat(f32::MAX)];
    let sight = sight(simd, edges, lane, terms, endless);
    let is_sure = sight.is_some_and(|sight| sight.is_inside.bits() != 0);
    assert!(!is_sure || exact.is_inside(), "surely hit, but missed");
    // Far from a triangle, only the sign counts.
    if TERMS == TERMS_FROM_APEX || is_sure || exact.t.is_some() {
        let found = weights(simd, edges, lane, terms);
        for (found, exact) in found.into_iter().zip(exact.weights) {
            let error = (f64::from(first_lane(found)) - exact).abs();
            errors.alone = errors.alone.max(error / f64::from(edges.bound_alone[lane]));
        }
        assert!(errors.alone <= 1.0, "an edge function errs by {errors:?}");
    }
    let Some(t) = exact.t else {
        return;
    };
    let sight = sight.expect("a hit is not rejected");
    let [nearest, farthest] = each([sight.nearest, sight.farthest], first_lane);
    // The depth of the hit, and that of a ray's end there.
    let end = t * exact.speed + tile.from[group][0];
    let depths = [exact.depth, end.into()];
    let [nearest, farthest] = each([nearest, farthest], f64::from);
    for depth in depths {
        let is_between = nearest <= depth && depth <= farthest;
        assert!(is_between, "{depth:e} in {nearest:e} to {farthest:e}");
    }
    let corner_a = seen_from(simd, &edges.corners[0], lane, terms);
    let (found, bound) = depth(simd, edges, lane, terms, corner_a);
    let (found, bound) = (f64::from(first_lane(found)), f64::from(first_lane(bound)));
    if !(found.is_finite() && bound.is_finite()) {
        return;
    }
    let error = depths.map(|depth| (depth - found).abs());
    let share = error[0].max(error[1]) / bound;
    assert!(share <= 1.0, "a depth errs by {share}");
    // By the part of the bound that is most of it.
    let rounding = f64::from(edges.rounding[lane]);
    let [x, y, _] = each(edges.normal, |row| f64::from(row[lane].abs()));
    let place = rounding * (x + y) / f64::from(edges.bound_depth[lane]);
    if rounding > 0.8 * bound {
        errors.rounding = share;
    } else if rounding < 0.05 * bound && place > 0.8 {
        errors.place = share;
    } else if rounding < 0.2 * bound && place < 0.2 {
        errors.normal = share;
    }
}

/// How rays and triangles lie. The triangles are 1 to 1.2 away from the apex.
#[derive(Clone, Copy, Debug)]
struct Setup {
    /// The distance between the origins of rays.
    apart: f32,
    /// The slopes of rays from the central one.
    spread: f32,
    /// Of triangles, across and along.
    across: f32,
    along: f32,
}

impl Setup {
    fn case(&self, rng: &mut Rng) -> Case {
        let Self {
            apart,
            spread,
            across,
            along,
        } = *self;
        let most = 1.0 - 1.01 * spread;
        // In all directions, or about where a rounding costs most.
        let mut slope = || rng.pick(&[0.0, 0.5 + spread, most, -most, most * rng.clone().unit()]);
        let center = Vec3::new(slope(), slope(), 1.0);
        // Coordinates are small at the apex, or at triangles, where their differences are rounded, or nowhere.
        let origin = rng.pick(&[Vec3::ZERO, -1.1 * center, rng.clone().vec3()]);
        let speed = rng.pick(&[1.0, 1.01, 1.5, -1.0]);
        let rays: [Ray; LANES] = from_fn(|_| {
            let aside = spread * rng.vec3() * Vec3::new(1.0, 1.0, 0.0);
            Ray::new(origin + apart * rng.vec3(), speed * (center + aside))
        });
        let triangles = rays.map(|ray| {
            let center = ray.origin + ray.direction / speed.abs() * rng.between(1.01, 1.2);
            from_fn(|_| {
                let aside = across * rng.vec3() * Vec3::new(1.0, 1.0, 0.0);
                center + aside + along * rng.between(-1.0, 1.0) * ray.direction
            })
        });
        Case { rays, triangles }
    }
}

/// The same but for a few numbers.
fn varied(mut case: Case, rng: &mut Rng) -> Case {
    for _ in 0..=rng.below(3) {
        let (number, axis, corner) = (rng.below(LANES), rng.below(3), rng.below(3));
        let corners = &mut case.triangles[number];
        let size = (corners[corner] - corners[(corner + 1) % 3]).abs();
        let ray = &mut case.rays[number];
        match rng.below(8) {
            0 => vary(&mut ray.direction[axis.min(1)], 1e-3, rng),
            1 => {
                let is_apex = case
                    .rays
                    .iter()
                    .all(|ray| ray.origin == case.rays[0].origin);
                let mut moved = case.rays[number].origin[axis];
                vary(&mut moved, 1e-3, rng);
                let all = if is_apex {
                    0..LANES
                } else {
                    number..number + 1
                };
                for ray in &mut case.rays[all] {
                    ray.origin[axis] = moved;
                }
            }
            _ => vary(&mut corners[corner][axis], size.max_element(), rng),
        }
    }
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
                .flat_map(|level| level.run(case))
                .map(|errors| value(&errors))
                .fold(0.0, f64::max)
        },
    )
}

#[test]
fn bounds_of_edge_functions_are_needed() {
    let near = Setup {
        apart: 0.0,
        spread: 1e-3,
        across: 1e-4,
        along: 1e-4,
    };
    let from_apex = largest(near, |errors| errors.alone);
    assert!(from_apex > 1.0 / 6.0, "from the apex: {from_apex}");
    let apart = Setup {
        apart: 1e-6,
        ..near
    };
    let group = largest(apart, |errors| errors.group);
    assert!(group > 1.0 / 7.0, "a group: {group}");
    let flat = Setup {
        apart: 1e-5,
        spread: 1e-3,
        across: 1e-2,
        along: 1e-5,
    };
    let alone = largest(flat, |errors| errors.alone);
    assert!(alone > 1.0 / 14.0, "a ray: {alone}");
}

#[test]
fn bounds_of_depths_are_needed() {
    let flat = Setup {
        apart: 1e-3,
        spread: 1e-3,
        across: 1e-2,
        along: 0.0,
    };
    let rounding = largest(flat, |errors| errors.rounding);
    assert!(rounding > 1.0 / 4.0, "rounding: {rounding}");
    let steep = Setup {
        apart: 0.0,
        spread: 1e-3,
        across: 1e-4,
        along: 1e-2,
    };
    let place = largest(steep, |errors| errors.place);
    assert!(place > 1.0 / 6.0, "the place of a ray: {place}");
    let long = Setup {
        apart: 1e-3,
        spread: 1e-2,
        across: 1e-3,
        along: 0.1,
    };
    let normal = largest(long, |errors| errors.normal);
    assert!(normal > 1.0 / 30.0, "the normal: {normal}");
}

/// Triangles as small as roundings, which rays pass at a million times their size.
#[test]
fn a_triangle_far_aside_is_not_surely_hit() {
    let mut rng = Rng(6);
    let mut hits = 0;
    for _ in 0..effort::count(10_000, 100_000) {
        let setup = Setup {
            apart: rng.pick(&[0.1, 1.0, 3.0]),
            spread: rng.pick(&[1e-3, 0.3, 0.9]),
            across: rng.pick(&[6e-8, 2e-7, 4e-7]),
            along: rng.pick(&[0.0, 2e-7]),
        };
        let case = setup.case(&mut rng);
        for level in [Level::portable(), Level::detect()] {
            let errors = level.run(&case);
            hits += errors.iter().filter(|errors| errors.alone > 0.0).count();
        }
    }
    assert!(hits > 1000, "{hits} hits");
}
