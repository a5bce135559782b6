//! Key frames of glTF 2.0 (Khronos Group, *glTF 2.0 Specification*, appendix C): step, linear, or cubic spline interpolation.

use glam::{DQuat, DVec3};

/// One or more keys in ascending order of time, in seconds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sampled<T> {
    pub(crate) times: Vec<f64>,
    pub(crate) values: Values<T>,
}

/// The values at the keys, and how to interpolate between them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values<T> {
    /// The value of the preceding key.
    Step(Vec<T>),
    /// Linear interpolation; spherical for rotations.
    Linear(Vec<T>),
    /// A cubic Hermite spline: for each key its incoming tangent, value and outgoing tangent.
    Cubic(Vec<[T; 3]>),
}

/// A value that can be interpolated.
pub(crate) trait Interpolate: Copy {
    /// Linear interpolation from `self` (0) to `other` (1); spherical for rotations.
    fn interpolate(self, other: Self, fraction: f64) -> Self;
    /// The weighted sum, normalized for rotations.
    fn weighted_sum(parts: [(f64, Self); 4]) -> Self;
}

impl Interpolate for f64 {
    fn interpolate(self, other: Self, fraction: f64) -> Self {
        self + fraction * (other - self)
    }

    fn weighted_sum(parts: [(f64, Self); 4]) -> Self {
        parts.iter().map(|(weight, value)| weight * value).sum()
    }
}

impl Interpolate for DVec3 {
    fn interpolate(self, other: Self, fraction: f64) -> Self {
        self.lerp(other, fraction)
    }

    fn weighted_sum(parts: [(f64, Self); 4]) -> Self {
        parts.iter().map(|(weight, value)| *weight * *value).sum()
    }
}

impl Interpolate for DQuat {
    fn interpolate(self, other: Self, fraction: f64) -> Self {
        self.slerp(other, fraction)
    }

    fn weighted_sum(parts: [(f64, Self); 4]) -> Self {
        let zero = Self::from_xyzw(0.0, 0.0, 0.0, 0.0);
        let sum = parts
            .iter()
            .fold(zero, |sum, (weight, value)| sum + *value * *weight);
        if sum.length_squared() > 0.0 {
            sum.normalize()
        } else {
            Self::IDENTITY
        }
    }
}

impl<T: Interpolate> Sampled<T> {
    /// A value that does not change.
    pub(crate) fn constant(value: T) -> Self {
        Self {
            times: vec![0.0],
            values: Values::Step(vec![value]),
        }
    }

    /// The value at `time`, in seconds. It is constant before the first and after the last key.
    pub(crate) fn at(&self, time: f64) -> T {
        let after = self.times.partition_point(|key| *key <= time);
        let before = after.saturating_sub(1);
        let is_inside = after > 0 && after < self.times.len();
        let length = if is_inside {
            self.times[after] - self.times[before]
        } else {
            0.0
        };
        let fraction = if is_inside {
            (time - self.times[before]) / length
        } else {
            0.0
        };
        match &self.values {
            Values::Step(values) => values[before],
            Values::Linear(values) if is_inside => {
                values[before].interpolate(values[after], fraction)
            }
            Values::Linear(values) => values[before],
            Values::Cubic(values) if is_inside => {
                let ([_, from, out], [inwards, to, _]) = (values[before], values[after]);
                let (square, cube) = (fraction * fraction, fraction * fraction * fraction);
                T::weighted_sum([
                    (2.0 * cube - 3.0 * square + 1.0, from),
                    (length * (cube - 2.0 * square + fraction), out),
                    (3.0 * square - 2.0 * cube, to),
                    (length * (cube - square), inwards),
                ])
            }
            Values::Cubic(values) => values[before][1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_linear_and_cubic_keys_interpolate() {
        let values = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)];
        let times = vec![1.0, 2.0, 4.0];
        let at = |values: Values<DVec3>, time: f64| {
            let times = times.clone();
            Sampled { times, values }.at(time)
        };
        for (time, step, straight) in [
            (0.0, DVec3::ZERO, DVec3::ZERO),
            (1.5, DVec3::ZERO, 0.5 * DVec3::X),
            (2.0, DVec3::X, DVec3::X),
            (3.0, DVec3::X, DVec3::new(1.0, 0.5, 0.0)),
            (9.0, values[2], values[2]),
        ] {
            assert_eq!(at(Values::Step(values.clone()), time), step, "{time}");
            assert_eq!(at(Values::Linear(values.clone()), time), straight, "{time}");
        }
        // A cubic spline with the tangents of a line is that line; with zero tangents, it is slow near keys.
        let cubic = |tangents: [DVec3; 3]| {
            let keys = values.iter().zip(tangents);
            Values::Cubic(
                keys.map(|(value, tangent)| [tangent, *value, tangent])
                    .collect(),
            )
        };
        let straight = cubic([DVec3::X, DVec3::X, DVec3::X]);
        assert!((at(straight, 1.25) - 0.25 * DVec3::X).length() < 1e-12);
        let slow = at(cubic([DVec3::ZERO; 3]), 1.25);
        assert!(slow.x < 0.2 && slow.x > 0.1, "{slow}");
    }

    #[test]
    fn interpolated_rotations_have_unit_length() {
        let quarter = DQuat::from_rotation_z(1.5);
        let values = vec![DQuat::IDENTITY, quarter];
        let turn = Sampled {
            times: vec![0.0, 1.0],
            values: Values::Linear(values),
        }
        .at(0.5);
        assert!(turn.angle_between(DQuat::from_rotation_z(0.75)) < 1e-9);
        let zero = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        let cubic = Values::Cubic(vec![[zero, DQuat::IDENTITY, zero], [zero, quarter, zero]]);
        let turn = Sampled {
            times: vec![0.0, 1.0],
            values: cubic,
        }
        .at(0.5);
        assert!(
            (turn.length() - 1.0).abs() < 1e-12
                && turn.angle_between(DQuat::from_rotation_z(0.75)) < 1e-6
        );
    }
}
