//! Rays and triangles in f64, written independently of kd, to compare hits up to the stated rounding.

use kd::Hit;
use kd::glam::DVec3;

/// Corners of a triangle and a ray, from the start of the ray.
pub(crate) struct Seen {
    pub(crate) corners: [DVec3; 3],
    pub(crate) direction: DVec3,
}

impl Seen {
    /// The `t` at which the line of the ray passes the triangle, if it passes inside by more than `margin` of every edge, and how
    /// much `t` changes where the plane moves by 1.
    pub(crate) fn clear_hit(&self, margin: f64) -> Option<(f64, f64)> {
        let [a, b, c] = self.corners;
        let side = |p: DVec3, q: DVec3| {
            let across = self.direction.cross(q - p);
            across.dot(p) / across.length()
        };
        let sides = [side(a, b), side(b, c), side(c, a)];
        let is_inside =
            sides.iter().all(|side| *side > margin) || sides.iter().all(|side| *side < -margin);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let speed = normal.dot(self.direction);
        is_inside.then(|| (normal.dot(a) / speed, 1.0 / speed.abs()))
    }

    /// The distance from the ray to the point of a hit by its weights, and the difference of its `t` to that of the point.
    pub(crate) fn errors(&self, hit: &Hit) -> (f64, f64) {
        let [a, b, c] = self.corners;
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let point = a + u * (b - a) + v * (c - a);
        let d = self.direction;
        let along = point.dot(d) / d.length_squared();
        let distance = (point - along * d).length();
        (distance, (along - f64::from(hit.t)).abs())
    }
}
