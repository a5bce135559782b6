//! Key frames of glTF 2.0 (Khronos Group, *glTF 2.0 Specification*, appendix C): constant, straight, or along cubic splines.

use glam::{DQuat, DVec3};

/// Values at times, which ascend; at least one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sampled<T> {
    pub(crate) times: Vec<f64>,
    pub(crate) values: Values<T>,
}

/// What is between keys.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values<T> {
    /// What was at the key before.
    Step(Vec<T>),
    /// The straight, or the shortest, way.
    Linear(Vec<T>),
    /// For each key the tangent in, the value, and the tangent out.
    Cubic(Vec<[T; 3]>),
}

/// What can be between two of its kind.
pub(crate) trait Between: Copy {
    fn straight(self, other: Self, part: f64) -> Self;
    /// What is left of sums of such values.
    fn sum(parts: [(f64, Self); 4]) -> Self;
}

impl Between for DVec3 {
    fn straight(self, other: Self, part: f64) -> Self {
        self.lerp(other, part)
    }

    fn sum(parts: [(f64, Self); 4]) -> Self {
        parts.iter().map(|(weight, value)| *weight * *value).sum()
    }
}

impl Between for DQuat {
    fn straight(self, other: Self, part: f64) -> Self {
        self.slerp(other, part)
    }

    fn sum(parts: [(f64, Self); 4]) -> Self {
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

impl<T: Between> Sampled<T> {
    /// A value that does not change.
    pub(crate) fn constant(value: T) -> Self {
        Self {
            times: vec![0.0],
            values: Values::Step(vec![value]),
        }
    }

    /// The value at a time; before the first key that of the first, after the last that of the last.
    pub(crate) fn at(&self, time: f64) -> T {
        let after = self.times.partition_point(|key| *key <= time);
        let before = after.saturating_sub(1);
        let is_inside = after > 0 && after < self.times.len();
        let length = if is_inside {
            self.times[after] - self.times[before]
        } else {
            0.0
        };
        let part = if is_inside {
            (time - self.times[before]) / length
        } else {
            0.0
        };
        match &self.values {
            Values::Step(values) => values[before],
            Values::Linear(values) if is_inside => values[before].straight(values[after], part),
            Values::Linear(values) => values[before],
            Values::Cubic(values) if is_inside => {
                let ([_, from, out], [inwards, to, _]) = (values[before], values[after]);
                let (square, cube) = (part * part, part * part * part);
                T::sum([
                    (2.0 * cube - 3.0 * square + 1.0, from),
                    (length * (cube - 2.0 * square + part), out),
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
    fn each_kind_goes_its_way() {
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
        // With tangents of the straight way, cubic is straight; without any, it is slow at keys.
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
    fn turns_stay_turns() {
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
