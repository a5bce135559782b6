//! A spinning LiDAR, as a source of rays.

use glam::{DVec3, Vec3};
use kd_core::Ray;

use crate::camera::{any_perpendicular, up_or_y};

/// A LiDAR that turns about an axis: beams at fixed elevations, all of which fire at each step of a turn.
///
/// Angles come from libm, so that a LiDAR gives the same rays on every platform. Directions have unit length, so that the `t` of a hit is
/// a distance in scene units.
///
/// ```
/// use glam::Vec3;
/// use kd_scene::Lidar;
///
/// let lidar = Lidar { steps: 4, channels: 2, elevation_degrees: [-10.0, 0.0], ..Lidar::new(Vec3::ZERO, Vec3::Z) };
/// assert_eq!(lidar.len(), 8);
/// let first = lidar.ray(0, 1);
/// let quarter = lidar.ray(1, 1);
/// assert!(first.direction.dot(quarter.direction).abs() < 1e-6);
/// assert!(lidar.ray(0, 0).direction.z < 0.0, "the lowest channel is the first");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lidar {
    /// Origin of all rays, in scene units.
    pub position: Vec3,
    /// The axis, of any length. One of length zero counts as +y.
    pub up: Vec3,
    /// About the direction of the first step, of any length. If it is parallel to the axis, any direction across it is.
    pub forward: Vec3,
    /// Elevation of the lowest and of the highest channel above the plane across the axis, in degrees.
    pub elevation_degrees: [f32; 2],
    /// Number of beams, evenly spaced in elevation.
    pub channels: u32,
    /// Number of steps in a turn, which is counterclockwise seen from above.
    pub steps: u32,
    /// The distances between which a surface is detected, in scene units.
    pub range: [f32; 2],
}

impl Lidar {
    /// 64 channels from −24.8 to 2 degrees, as of a sensor on the roof of a car, 1800 steps, and any distance.
    pub fn new(position: Vec3, up: Vec3) -> Self {
        Self {
            position,
            up,
            forward: Vec3::X,
            elevation_degrees: [-24.8, 2.0],
            channels: 64,
            steps: 1800,
            range: [0.0, f32::INFINITY],
        }
    }

    /// The number of rays in a turn.
    pub fn len(&self) -> u64 {
        u64::from(self.steps) * u64::from(self.channels)
    }

    /// Whether a turn has no ray.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The ray of a channel at a step, both from 0. A turn has its rays step by step, and in each step from the lowest channel.
    pub fn ray(&self, step: u32, channel: u32) -> Ray {
        let up = up_or_y(self.up);
        let forward = self.forward.as_dvec3();
        let forward = (forward - forward.dot(up) * up).try_normalize();
        let forward = forward.unwrap_or_else(|| any_perpendicular(up));
        let left = up.cross(forward);
        let turn = f64::from(step) / f64::from(self.steps.max(1)) * std::f64::consts::TAU;
        let [low, high] = self.elevation_degrees.map(f64::from);
        let between = match self.channels {
            0 | 1 => 0.5,
            channels => f64::from(channel) / f64::from(channels - 1),
        };
        let elevation = (low + between * (high - low)).to_radians();
        let (sine, cosine) = libm::sincos(turn);
        let (rise, reach) = libm::sincos(elevation);
        let direction: DVec3 = reach * (cosine * forward + sine * left) + rise * up;
        let [near, far] = self.range;
        Ray {
            t_min: near,
            t_max: far,
            ..Ray::new(self.position, direction.as_vec3())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_counterclockwise_and_its_beams_are_evenly_spaced() {
        let lidar = Lidar {
            steps: 4,
            channels: 3,
            elevation_degrees: [-30.0, 30.0],
            range: [0.5, 20.0],
            ..Lidar::new(Vec3::ONE, Vec3::new(0.0, 0.0, 2.0))
        };
        let directions = [0, 1, 2, 3].map(|step| lidar.ray(step, 1).direction);
        let expected = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y];
        for (found, expected) in directions.into_iter().zip(expected) {
            assert!(found.distance(expected) < 1e-6, "{found}, not {expected}");
        }
        let heights = [0, 1, 2].map(|channel| lidar.ray(0, channel).direction.z);
        assert!(
            (heights[0] + 0.5).abs() < 1e-6 && (heights[2] - 0.5).abs() < 1e-6,
            "{heights:?}"
        );
        let ray = lidar.ray(3, 0);
        assert_eq!((ray.origin, ray.t_min, ray.t_max), (Vec3::ONE, 0.5, 20.0));
        assert!((ray.direction.length() - 1.0).abs() < 1e-6, "a unit vector");
    }

    #[test]
    fn odd_axes_give_rays() {
        for (up, forward) in [
            (Vec3::ZERO, Vec3::X),
            (Vec3::X, Vec3::X),
            (Vec3::Y, Vec3::ZERO),
        ] {
            let lidar = Lidar {
                forward,
                channels: 1,
                ..Lidar::new(Vec3::ZERO, up)
            };
            let direction = lidar.ray(7, 0).direction;
            assert!(
                (direction.length() - 1.0).abs() < 1e-6,
                "{up} {forward}: {direction}"
            );
        }
    }
}
