//! Round cubic curves as primitives: hair, fur, grass.

use kd::custom::{PrimitiveHit, Primitives};
use kd::glam::{DVec3, DVec4, Vec4};
use kd::{Aabb, Ray};

/// How often a curve is halved. The rest is round cones: sixteen of them.
const LEVELS: u32 = 4;

/// A cubic Bézier curve with a thickness: the sphere around a point of the curve sweeps over it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve(
    /// Control points x, y, z and radius, in scene units. Radii are not below 0.
    pub(crate) [Vec4; 4],
);

/// A list of curves. Rays meet them from outside alone. The `u` of a hit is the parameter of the curve, 0 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Curves(
    /// By number.
    pub(crate) Vec<Curve>,
);

impl Primitives for Curves {
    fn count(&self) -> u32 {
        u32::try_from(self.0.len()).expect("32 bits number the curves")
    }

    /// A curve is within the hull of its control points.
    fn bounds(&self, curve: u32) -> Aabb {
        let Aabb { min, max } = Piece::whole(&self.0[curve as usize]).bounds();
        Aabb {
            min: min.map(f32::next_down),
            max: max.map(f32::next_up),
        }
    }

    fn intersect(&self, curve: u32, ray: &Ray) -> Option<PrimitiveHit> {
        let mut search = Search::new(ray);
        search.piece(&Piece::whole(&self.0[curve as usize]), LEVELS);
        search.first
    }
}

impl Curve {
    /// The center x, y, z and the radius of the sphere at parameter `u`, 0 to 1.
    pub(crate) fn at(&self, u: f32) -> Vec4 {
        let [lower, _] = Piece::whole(self).divided(f64::from(u));
        lower.points[3].as_vec4()
    }
}

/// A part of a curve.
#[derive(Clone, Copy)]
struct Piece {
    points: [DVec4; 4],
    /// The parameters at its ends.
    from: f64,
    to: f64,
}

impl Piece {
    fn whole(curve: &Curve) -> Self {
        Self {
            points: curve.0.map(|point| point.as_dvec4()),
            from: 0.0,
            to: 1.0,
        }
    }

    /// Both parts of it, divided at a parameter of its own (de Casteljau).
    fn divided(&self, at: f64) -> [Self; 2] {
        let [a, b, c, d] = self.points;
        let [ab, bc, cd] = [a.lerp(b, at), b.lerp(c, at), c.lerp(d, at)];
        let [abc, bcd] = [ab.lerp(bc, at), bc.lerp(cd, at)];
        let middle = abc.lerp(bcd, at);
        let parameter = self.from + at * (self.to - self.from);
        let lower = Self {
            points: [a, ab, abc, middle],
            to: parameter,
            ..*self
        };
        let upper = Self {
            points: [middle, bcd, cd, d],
            from: parameter,
            ..*self
        };
        [lower, upper]
    }

    /// The box around its control points and their spheres, up to rounding.
    fn bounds(&self) -> Aabb {
        let radius = self.points.iter().fold(0.0, |most: f64, p| most.max(p.w));
        let points = self.points.map(DVec4::truncate);
        Aabb {
            min: points
                .into_iter()
                .fold(DVec3::INFINITY, |least, p| least.min(p - radius))
                .as_vec3(),
            max: points
                .into_iter()
                .fold(DVec3::NEG_INFINITY, |most, p| most.max(p + radius))
                .as_vec3(),
        }
    }
}

/// A ray that looks for its first hit with a curve.
struct Search<'a> {
    ray: &'a Ray,
    origin: DVec3,
    /// Of length 1.
    direction: DVec3,
    /// Steps of length 1 for `t = 1`.
    speed: f64,
    first: Option<PrimitiveHit>,
}

impl<'a> Search<'a> {
    fn new(ray: &'a Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        let speed = direction.length();
        Self {
            ray,
            origin: ray.origin.as_dvec3(),
            direction: direction / speed,
            speed,
            first: None,
        }
    }

    /// Drops a piece whose box the line of the ray passes; halves another, until it is nearly straight (M. Pharr, W. Jakob, G. Humphreys,
    /// *Physically Based Rendering*, 2016, 3.7: there for ribbons).
    ///
    /// The range of the ray does not matter here: a hit is the same, however far the ray goes.
    fn piece(&mut self, piece: &Piece, levels: u32) {
        if !self.meets(&piece.bounds()) {
            return;
        }
        if levels > 0 {
            for half in piece.divided(0.5) {
                self.piece(&half, levels - 1);
            }
            return;
        }
        let [a, _, _, b] = piece.points;
        if let Some((distance, along)) = self.cone(a, b) {
            self.take(distance, piece.from + along * (piece.to - piece.from));
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "rounded once")]
    fn take(&mut self, distance: f64, parameter: f64) {
        let t = (distance / self.speed) as f32;
        let is_in_range = self.ray.t_min <= t && t <= self.ray.t_max;
        if is_in_range && self.first.is_none_or(|first| t < first.t) {
            let u = parameter as f32;
            self.first = Some(PrimitiveHit { t, u, v: 0.0 });
        }
    }

    fn meets(&self, bounds: &Aabb) -> bool {
        let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let per_step = 1.0 / self.direction[axis];
            let faces = [bounds.min[axis].next_down(), bounds.max[axis].next_up()];
            let [a, b] = faces.map(|face| (f64::from(face) - self.origin[axis]) * per_step);
            // A ray in the plane of a face gives a NaN, which both ignore.
            enter = enter.max(a.min(b));
            exit = exit.min(a.max(b));
        }
        enter <= exit
    }

    /// Where the line enters the hull of two spheres, and how far between them that is, 0 to 1 (I. Quilez, *rounded cone intersection*,
    /// 2018; with an origin near the cone, so that far rays lose no bits).
    fn cone(&self, a: DVec4, b: DVec4) -> Option<(f64, f64)> {
        let (center, axis) = (a.truncate(), b.truncate() - a.truncate());
        let to_origin = (center - self.origin).dot(self.direction);
        let from_a = self.origin + to_origin * self.direction - center;
        let from_b = from_a - axis;
        let narrowing = a.w - b.w;
        let length = axis.dot(axis);
        let along = axis.dot(from_a);
        let slope = axis.dot(self.direction);
        let across = self.direction.dot(from_a);
        let square = length - narrowing * narrowing;
        // Otherwise one sphere contains the other.
        if square > 0.0 {
            let k2 = square - slope * slope;
            let k1 = square * across - along * slope + slope * narrowing * a.w;
            let k0 = square * from_a.dot(from_a) - along * along + 2.0 * along * narrowing * a.w
                - length * a.w * a.w;
            let rest = k1 * k1 - k0 * k2;
            if rest < 0.0 {
                return None;
            }
            let t = (-rest.sqrt() - k1) / k2;
            let place = along - a.w * narrowing + t * slope;
            // Also false for NaN.
            if place > 0.0 && place < square {
                return Some((to_origin + t, place / square));
            }
        }
        let entry = |from: DVec3, radius: f64| {
            let middle = -from.dot(self.direction);
            let nearest = from + middle * self.direction;
            let rest = radius * radius - nearest.dot(nearest);
            (rest >= 0.0).then(|| to_origin + middle - rest.sqrt())
        };
        match [entry(from_a, a.w), entry(from_b, b.w)] {
            [Some(one), Some(other)] if other < one => Some((other, 1.0)),
            [Some(one), _] => Some((one, 0.0)),
            [None, other] => other.map(|other| (other, 1.0)),
        }
    }
}
