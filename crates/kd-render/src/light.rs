//! Lights at one time.

use kd::Ray;
use kd::glam::{DAffine3, Vec3};
use kd_scene::{Light, LightKind};

/// A light at the current time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShownLight {
    kind: LightKind,
    position: Vec3,
    /// Unit vector.
    direction: Vec3,
    pub(crate) color: Vec3,
}

impl ShownLight {
    /// The light at `time`, in seconds, with the transforms of the nodes at that time.
    pub(crate) fn new(light: &Light, time: f64, nodes: &[DAffine3]) -> Self {
        let (position, direction) = light.placed(time, nodes);
        Self {
            kind: light.kind,
            position,
            direction,
            color: light.color,
        }
    }

    /// The unit vector from a point to the light, and the color that arrives there if nothing occludes it.
    #[inline]
    pub(crate) fn seen_from(&self, at: Vec3) -> (Vec3, Vec3) {
        let to_light = match self.kind {
            LightKind::Directional => -self.direction,
            LightKind::Point | LightKind::Spot { .. } => (self.position - at).normalize_or_zero(),
        };
        let LightKind::Spot { inner, outer } = self.kind else {
            return (to_light, self.color);
        };
        // Between the two cones the strength falls with the square of the cosine (KHR_lights_punctual).
        let [of_inner, of_outer] = [inner, outer].map(f32::cos);
        let cosine = -to_light.dot(self.direction);
        let range = (of_inner - of_outer).max(1e-3);
        let strength = ((cosine - of_outer) / range).clamp(0.0, 1.0);
        (to_light, strength * strength * self.color)
    }

    /// The ray from a point to the light.
    #[inline]
    pub(crate) fn shadow_ray(&self, from: Vec3) -> Ray {
        match self.kind {
            LightKind::Directional => Ray::new(from, -self.direction),
            LightKind::Point | LightKind::Spot { .. } => Ray::between(from, self.position),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_reach_what_is_in_their_cone() {
        let show = |kind| {
            let position = Vec3::new(0.0, 0.0, 2.0);
            let light = Light {
                kind,
                ..Light::point(position, Vec3::ONE)
            };
            ShownLight::new(&light, 0.0, &[])
        };
        let point = show(LightKind::Point);
        assert_eq!(point.seen_from(Vec3::ZERO), (Vec3::Z, Vec3::ONE));
        let reach = point.shadow_ray(Vec3::ZERO).t_max;
        assert!(
            reach <= 1.0 && reach > 0.9999,
            "no farther than the light: {reach}"
        );
        let sun = show(LightKind::Directional);
        assert_eq!(sun.seen_from(Vec3::splat(1e6)), (Vec3::Z, Vec3::ONE));
        assert_eq!(sun.shadow_ray(Vec3::ZERO).t_max, f32::INFINITY);
        let spot = show(LightKind::Spot {
            inner: 0.1,
            outer: 0.5,
        });
        let strength = |angle: f32| spot.seen_from(Vec3::new(2.0 * angle.tan(), 0.0, 0.0)).1.x;
        assert_eq!((strength(0.05), strength(0.6)), (1.0, 0.0));
        assert!(
            strength(0.2) > strength(0.4) && strength(0.4) > 0.0,
            "between the cones"
        );
    }
}
