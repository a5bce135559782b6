//! Gathers rays into a tile, if they are coherent: their views, slopes and frusta.
//!
//! Rays are read eight at a time and transposed into lanes, a ray each. The extremes of groups come from a second transposition,
//! which puts the same ray of every group into one vector: the minimum of all vectors is the minimum of each group.

use kd_core::{Axis, Ray};
use kd_simd::{F32x8, LANES, Mask, Number, Simd, Task, each, max_lane, min_lane};

use super::frustum::Apex;
use super::leaf::View;
use super::{GROUPS, NOTHING, OVER, PerRay, RAYS, Tile};
use crate::planes::Frame;
use crate::triangle::steepest_axis;
use crate::wide::limits::{LEAST_DIRECTION, MOST_COORDINATE, MOST_DIRECTION};

/// A factor that covers a few roundings.
const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;

const _: () = assert!(GROUPS == LANES, "a lane for each group");

/// Rays that may form a tile.
struct Gather<'a> {
    tile: &'a mut Tile,
    rays: &'a [Ray],
    most_spread: f32,
    frame: &'a Frame,
}

impl<S: Simd> Task<S> for Gather<'_> {
    /// Whether they do.
    type Output = bool;

    #[inline(always)]
    fn run(self, simd: S) -> bool {
        self.tile
            .gather_with(simd, self.rays, self.most_spread, self.frame)
    }
}

impl Tile {
    /// Gathers up to 64 rays; false if they are not coherent.
    ///
    /// Conditions: their directions are largest on the same axis, with the same sign; their slopes differ by at most
    /// `most_spread`, itself at most [`MOST_SPREAD`](super::leaf::MOST_SPREAD), from the central one; they are within the limits of
    /// [`limits`](crate::wide::limits), with `t_min` of 0 or more. The frame must [fit](crate::wide::limits::fits).
    pub(super) fn gather<S: Simd>(
        &mut self,
        simd: S,
        rays: &[Ray],
        most_spread: f32,
        frame: &Frame,
    ) -> bool {
        simd.apart(Gather {
            tile: self,
            rays,
            most_spread,
            frame,
        })
    }

    #[inline(always)]
    fn gather_with<S: Simd>(
        &mut self,
        simd: S,
        rays: &[Ray],
        most_spread: f32,
        frame: &Frame,
    ) -> bool {
        debug_assert!(!rays.is_empty() && rays.len() <= RAYS, "a tile");
        let first = &rays[0];
        let along = steepest_axis(first.direction);
        let axes = each([along.next(), along.next().next(), along], Axis::index);
        let sign = if first.direction[axes[2]] < 0.0 {
            -1.0
        } else {
            1.0
        };
        let Some(is_apex) = self.read(simd, rays, axes, sign) else {
            return false;
        };
        let slopes = [
            extremes(simd, &self.terms[0]),
            extremes(simd, &self.terms[1]),
        ];
        let of_all = [slopes[0].of_all(), slopes[1].of_all()];
        let center = each(of_all, |[lo, hi]| 0.5 * (lo + hi));
        let spread = (of_all[0][1] - center[0]).max(of_all[1][1] - center[1]) * MORE;
        if spread > most_spread {
            return false;
        }
        let mut at = each(axes, |axis| first.origin[axis]);
        let mut apart = 0.0;
        if is_apex {
            self.from = PerRay::default();
        } else {
            (at[2], apart) = self.set_apart(simd, at, sign);
        }
        let apex = Apex::new(at, sign, axes, apart, frame);
        let octant = (0..3).fold(0, |octant, i| {
            let is_down = if i == 2 { sign < 0.0 } else { center[i] < 0.0 };
            octant | usize::from(is_down) << axes[i]
        });
        self.view = View {
            apex,
            axes,
            octant,
            slope: center,
            spread,
            apart,
        };
        self.is_apex = is_apex;

        for axis in 0..2 {
            if is_apex {
                let zero = simd.splat(0.0);
                let [lo, hi] = of_all[axis];
                let bounds = [slopes[axis].least, slopes[axis].most];
                self.groups.set(simd, &apex, axis, [zero; 2], bounds);
                let bounds = [simd.splat(lo), simd.splat(hi)];
                self.whole.set(simd, &apex, axis, [zero; 2], bounds);
            } else {
                self.bound(simd, axis);
            }
        }
        for axis in 0..2 {
            self.set_range(simd, axis, &slopes[axis], center[axis]);
            let center = simd.splat(center[axis]);
            for slopes in &mut self.terms[axis] {
                (simd.load(slopes) - center).store(slopes);
            }
        }
        if !is_apex {
            let [a, b, c, d, cross] = &mut self.terms;
            for group in 0..GROUPS {
                let (a, b) = (simd.load(&a[group]), simd.load(&b[group]));
                let (c, d) = (simd.load(&c[group]), simd.load(&d[group]));
                (b * c - a * d).store(&mut cross[group]);
            }
            for term in 2..self.terms.len() {
                let extremes = extremes(simd, &self.terms[term]);
                self.set_range(simd, term, &extremes, 0.0);
            }
        }
        self.set_ends(simd, rays.len());
        true
    }

    /// Reads slopes, ends and speeds. Returns whether all rays share one origin; `None` if their directions differ in axis or
    /// sign, or if a ray sees nothing or one side only.
    #[inline(always)]
    fn read<S: Simd>(
        &mut self,
        simd: S,
        rays: &[Ray],
        axes: [usize; 3],
        sign: f32,
    ) -> Option<bool> {
        let origin = rays[0].origin;
        let mut is_apex = true;
        let mut see_all = true;
        let (eights, rest) = rays.as_chunks::<LANES>();
        let last = (!rest.is_empty()).then(|| {
            let mut last = [rest[0]; LANES];
            last[..rest.len()].copy_from_slice(rest);
            last
        });
        let count = rays.len().div_ceil(LANES);
        for (group, rays) in eights.iter().chain(&last).enumerate() {
            let columns = columns(simd, rays);
            let (x, y) = (columns[3 + axes[0]], columns[3 + axes[1]]);
            let speed = columns[3 + axes[2]] * simd.splat(sign);
            let [from_x, from_y, from_z, _, _, _, t_min, t_max] = columns;
            let usual = simd.splat(MOST_COORDINATE);
            // The last axis is the steepest axis of all rays, and the first among equals.
            let is_alike = simd.splat(LEAST_DIRECTION).le(speed)
                & speed.le(simd.splat(MOST_DIRECTION))
                & is_less(x, speed, axes[0] < axes[2])
                & is_less(y, speed, axes[1] < axes[2])
                & from_x.abs().le(usual)
                & from_y.abs().le(usual)
                & from_z.abs().le(usual)
                & simd.splat(0.0).le(t_min)
                & t_min.le(t_max);
            if (!is_alike).bits() != 0 {
                return None;
            }
            let is_apart = from_x.ne(simd.splat(origin.x))
                | from_y.ne(simd.splat(origin.y))
                | from_z.ne(simd.splat(origin.z));
            is_apex &= is_apart.bits() == 0;
            for ray in rays {
                see_all &= (ray.mask != 0) & ray.culling.is_none();
            }
            (t_min * speed).store(&mut self.start[group]);
            (t_max.min(simd.splat(f32::MAX)) * speed).store(&mut self.limit[group]);
            speed.store(&mut self.speed[group]);
            (x / speed).store(&mut self.terms[0][group]);
            (y / speed).store(&mut self.terms[1][group]);
            for (i, axis) in axes.into_iter().enumerate() {
                columns[axis].store(&mut self.turned.origin[i][group]);
                columns[3 + axis].store(&mut self.turned.direction[i][group]);
            }
            t_min.store(&mut self.turned.t_min[group]);
            t_max.store(&mut self.turned.t_max[group]);
        }
        // Groups without rays copy the last group with rays.
        for group in count..GROUPS {
            let ([a, b, ..], [x, y, z]) = (&mut self.terms, &mut self.turned.origin);
            for rows in [a, b, x, y, z, &mut self.start, &mut self.limit] {
                rows[group] = rows[count - 1];
            }
        }
        see_all.then_some(is_apex)
    }

    /// Chooses depth 0, and computes where rays are there. Returns its coordinate along, and the largest distance from the apex of a
    /// ray's origin or of its point at depth 0.
    #[inline(always)]
    fn set_apart<S: Simd>(&mut self, simd: S, at: [f32; 3], sign: f32) -> (f32, f32) {
        let [x, y, along] = &self.turned.origin;
        let starts = extremes(simd, along).of_all();
        let nearest = if sign < 0.0 { starts[1] } else { starts[0] };
        let mut apart = simd.splat(0.0);
        for group in 0..GROUPS {
            let depth = (simd.load(&along[group]) - simd.splat(nearest)) * simd.splat(sign);
            depth.store(&mut self.from[group]);
            apart = apart.max(depth.abs());
            for (axis, across) in [x, y].into_iter().enumerate() {
                let slope = simd.load(&self.terms[axis][group]);
                let start = simd.load(&across[group]) - simd.splat(at[axis]);
                let there = start - slope * depth;
                there.store(&mut self.terms[2 + axis][group]);
                apart = apart.max(start.abs()).max(there.abs());
            }
        }
        let mut array = [0.0; LANES];
        apart.store(&mut array);
        (nearest, max_lane(&array))
    }

    /// Frusta across one axis, between the points of the rays at depth 0 and at the largest depth.
    #[inline(always)]
    fn bound<S: Simd>(&mut self, simd: S, axis: usize) {
        let apex = self.view.apex;
        let deepest = simd.splat(apex.deepest);
        let mut ends = PerRay::default();
        for (group, end) in ends.iter_mut().enumerate() {
            let slope = simd.load(&self.terms[axis][group]);
            let at = simd.load(&self.terms[2 + axis][group]);
            slope.mul_add(deepest, at).store(end);
        }
        let at = extremes(simd, &self.terms[2 + axis]);
        let end = extremes(simd, &ends);
        let slopes = [
            (end.least - at.least) / deepest,
            (end.most - at.most) / deepest,
        ];
        self.groups
            .set(simd, &apex, axis, [at.least, at.most], slopes);
        let ([at_lo, at_hi], [end_lo, end_hi]) = (at.of_all(), end.of_all());
        let (at_lo, at_hi) = (simd.splat(at_lo), simd.splat(at_hi));
        let slopes = [
            (simd.splat(end_lo) - at_lo) / deepest,
            (simd.splat(end_hi) - at_hi) / deepest,
        ];
        self.whole.set(simd, &apex, axis, [at_lo, at_hi], slopes);
    }

    #[inline(always)]
    fn set_range<S: Simd>(&mut self, simd: S, term: usize, of: &Extremes<S::F32>, center: f32) {
        let center = simd.splat(center);
        let (lo, hi) = (of.least - center, of.most - center);
        let middle = (lo + hi) * simd.splat(0.5);
        let radius = (hi - middle).max(middle - lo) * simd.splat(MORE);
        middle.store(&mut self.ranges[term].middle);
        radius.store(&mut self.ranges[term].radius);
    }

    /// The depths at which rays begin and end, from their distances.
    #[inline(always)]
    fn set_ends<S: Simd>(&mut self, simd: S, count: usize) {
        for group in 0..GROUPS {
            let from = simd.load(&self.from[group]);
            let (start, limit) = (&mut self.start[group], &mut self.limit[group]);
            (simd.load(start) + from).store(start);
            (simd.load(limit) + from).store(limit);
            self.place[group] = [NOTHING; LANES];
            self.nearest[group] = [f32::INFINITY; LANES];
        }
        self.limit.as_flattened_mut()[count..].fill(OVER);
        let (starts, limits) = (extremes(simd, &self.start), extremes(simd, &self.limit));
        let deepest = simd.splat(self.view.apex.deepest);
        let limits = limits.most.min(deepest);
        starts.least.store(&mut self.groups.start);
        limits.store(&mut self.groups.limit);
        self.whole.start = [starts.of_all()[0]; LANES];
        self.whole.limit = [max_lane(&self.groups.limit); LANES];
    }
}

/// The components of eight rays, in lanes: three of the origin, three of the direction, `t_min`, `t_max`.
#[inline(always)]
fn columns<S: Simd>(simd: S, rays: &[Ray; LANES]) -> [S::F32; LANES] {
    let words = bytemuck::must_cast_ref::<[Ray; LANES], [[f32; 10]; LANES]>(rays);
    let [a, b, c, d, e, f, g, h] = words;
    simd.transpose([
        first_eight(a),
        first_eight(b),
        first_eight(c),
        first_eight(d),
        first_eight(e),
        first_eight(f),
        first_eight(g),
        first_eight(h),
    ])
}

/// All but the mask and the culling.
#[inline(always)]
fn first_eight(words: &[f32; 10]) -> &[f32; LANES] {
    words.first_chunk().expect("ten")
}

/// The minimum and maximum of each group.
#[derive(Clone, Copy, Debug)]
struct Extremes<F> {
    least: F,
    most: F,
}

impl<F: F32x8> Extremes<F> {
    /// The minimum and maximum of all groups.
    #[inline(always)]
    fn of_all(&self) -> [f32; 2] {
        let mut arrays = [[0.0; LANES]; 2];
        self.least.store(&mut arrays[0]);
        self.most.store(&mut arrays[1]);
        [min_lane(&arrays[0]), max_lane(&arrays[1])]
    }
}

#[inline(always)]
fn extremes<S: Simd>(simd: S, of: &PerRay<f32>) -> Extremes<S::F32> {
    let [a, b, c, d, e, f, g, h] = of;
    let rays = simd.transpose([a, b, c, d, e, f, g, h]);
    let mut extremes = Extremes {
        least: rays[0],
        most: rays[0],
    };
    for ray in rays {
        extremes.least = ray.min(extremes.least);
        extremes.most = ray.max(extremes.most);
    }
    extremes
}

/// Whether absolute values are less, or less or equal if not `strictly`.
#[inline(always)]
fn is_less<N: Number>(x: N, than: N, strictly: bool) -> N::Mask {
    if strictly {
        x.abs().lt(than)
    } else {
        x.abs().le(than)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;
    use crate::wide::limits::fits;
    use kd_simd::Portable;

    /// Eight by eight rays; the argument is their position in a square from -1 to 1.
    fn square(ray: impl Fn(Vec3) -> Ray) -> Vec<Ray> {
        let at = |i: u8| f32::from(i) / 3.5 - 1.0;
        (0..64)
            .map(|i| ray(Vec3::new(at(i % 8), at(i / 8), 0.0)))
            .collect()
    }

    #[test]
    fn coherent_rays_are_gathered() {
        let frame = Frame::new(&Aabb::around([Vec3::splat(-9.0), Vec3::splat(9.0)]));
        assert!(fits(&frame), "within the limits");
        let (eye, ahead) = (Vec3::new(0.1, 0.2, -5.0), Vec3::Z);
        let camera = square(|at| Ray::new(eye, ahead + 0.1 * at));
        let sun = square(|at| Ray::new(at, Vec3::new(0.1, 0.5, -1.0)));
        let lamp = square(|at| Ray::between(at, [0.3, 20.0, 0.7]));
        for (what, rays, is_apex) in [
            ("from an eye", &camera[..], true),
            ("from an eye, not all", &camera[..13], true),
            ("parallel", &sun, false),
            ("to a lamp", &lamp, false),
        ] {
            let mut tile = Tile::new();
            assert!(tile.gather(Portable, rays, 0.25, &frame), "{what}");
            assert_eq!(tile.is_apex, is_apex, "{what}");
        }

        let around = square(|at| Ray::new(eye, at + 0.01 * Vec3::Z));
        let wide = square(|at| Ray::new(eye, ahead + 0.3 * at));
        let mut tiles = vec![("on all sides", around), ("too far from each other", wide)];
        for (what, odd) in [
            ("one without a mask", camera[0].with_mask(0)),
            ("one with a negative t_min", camera[0].with_range(-1.0, 1.0)),
            ("one without a range", camera[0].with_range(1.0, 0.0)),
            ("one that is not finite", Ray::new([f32::NAN; 3], ahead)),
            ("one in the opposite direction", Ray::new(eye, -ahead)),
            ("one that is very long", Ray::new(eye, 1e9 * ahead)),
        ] {
            let mut rays = camera.clone();
            rays[37] = odd;
            tiles.push((what, rays));
        }
        for (what, rays) in tiles {
            assert!(!Tile::new().gather(Portable, &rays, 0.25, &frame), "{what}");
        }
        let huge = Frame::new(&Aabb::around([Vec3::splat(-9e15), Vec3::splat(9e15)]));
        assert!(!fits(&huge), "products would overflow");
    }
}
