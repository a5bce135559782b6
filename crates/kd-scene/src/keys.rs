//! Key frames, and the curves between them.
//!
//! The curves are those of BART (J. Lext, U. Assarsson, T. Möller, *BART: A Benchmark for Animated Ray Tracing*, 2000):
//! translations and scales follow splines of Kochanek and Bartels (*Interpolating Splines with Local Tension, Continuity, and
//! Bias Control*, 1984), rotations follow the same splines over quaternions. The first and the last key only define tangents:
//! the curve runs from the second key to the last but one, and is constant outside. The curves of glTF are in [`sampled`].

pub(crate) mod sampled;

use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4};

use sampled::Sampled;

/// An animated transform: scale, then rotation, then translation, each along its own curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keys {
    pub(crate) translation: Option<Curve<DVec3, DVec3>>,
    pub(crate) scale: Option<Curve<DVec3, DVec3>>,
    pub(crate) rotation: Option<Curve<Quaternion, DQuat>>,
    /// Times in seconds from which on the object is visible or invisible.
    pub(crate) visibility: Vec<(f64, bool)>,
}

/// A curve through keys: `S` is the value of a spline, `L` that of a glTF sampler.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Curve<S, L> {
    /// A spline of BART.
    Spline(Track<S>),
    /// A sampler of glTF.
    Sampled(Sampled<L>),
}

impl Curve<DVec3, DVec3> {
    fn at(&self, time: f64) -> DVec3 {
        match self {
            Self::Spline(track) => track.at(time),
            Self::Sampled(samples) => samples.at(time),
        }
    }
}

impl Curve<Quaternion, DQuat> {
    fn at(&self, time: f64) -> DMat3 {
        match self {
            Self::Spline(track) => track.at(time).to_matrix(),
            Self::Sampled(samples) => DMat3::from_quat(samples.at(time)),
        }
    }
}

/// A spline through at least four keys. Their times ascend in a good file; where they do not, the first segment that ends after a time
/// counts, as in the player of BART.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Track<T> {
    keys: Vec<Key<T>>,
}

/// A value at a time in seconds, with the parameters of Kochanek and Bartels for the curve through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Key<T> {
    pub(crate) time: f64,
    pub(crate) value: T,
    pub(crate) tension: f64,
    pub(crate) continuity: f64,
    pub(crate) bias: f64,
}

/// A quaternion of any length, because BART files may give axes of any length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quaternion(DQuat);

/// Sines below this count as zero, as in the reference code of BART.
const SMALL: f64 = 1e-3;

impl Keys {
    /// The transform at `time`, in seconds.
    pub fn transform(&self, time: f64) -> DAffine3 {
        let rotation = self.rotation.as_ref();
        let rotation = rotation.map_or(DMat3::IDENTITY, |curve| curve.at(time));
        let scale = self.scale.as_ref();
        let scale = scale.map_or(DVec3::ONE, |curve| curve.at(time));
        DAffine3 {
            matrix3: rotation * DMat3::from_diagonal(scale),
            translation: self.translation(time),
        }
    }

    /// The translation at `time`, in seconds.
    pub fn translation(&self, time: f64) -> DVec3 {
        let curve = self.translation.as_ref();
        curve.map_or(DVec3::ZERO, |curve| curve.at(time))
    }

    /// Whether the object is visible at `time`, in seconds. It is visible before the first visibility key.
    pub fn is_visible(&self, time: f64) -> bool {
        let passed = self.visibility.iter().take_while(|(from, _)| *from <= time);
        passed.last().is_none_or(|(_, is_visible)| *is_visible)
    }
}

impl<T> Track<T> {
    /// The least number of keys of a curve.
    pub(crate) const MIN_KEYS: usize = 4;

    /// `None` if there are fewer than [`MIN_KEYS`](Self::MIN_KEYS) keys.
    pub(crate) fn new(keys: Vec<Key<T>>) -> Option<Self> {
        (keys.len() >= Self::MIN_KEYS).then_some(Self { keys })
    }

    /// The segment that contains `time`: the index of its first key, and the fraction of it that has passed. The fraction is
    /// `None` outside of the curve, where the value is that of the key.
    fn segment_at(&self, time: f64) -> (usize, Option<f64>) {
        let last = self.keys.len() - 2;
        if time <= self.keys[1].time {
            return (1, None);
        }
        // Segments that end before they begin are never selected.
        match (1..last).find(|i| time < self.keys[i + 1].time) {
            None => (last, None),
            Some(i) => {
                let [from, to] = [i, i + 1].map(|i| self.keys[i].time);
                (i, Some((time - from) / (to - from)))
            }
        }
    }

    /// The weights of the value differences of the segments before, at and after `first` in the two tangents of the segment:
    /// outgoing tangent `[before, at]`, incoming tangent `[at, after]`.
    fn weights(&self, first: usize) -> ([f64; 2], [f64; 2]) {
        let keys = &self.keys[first - 1..first + 3];
        let length = keys[2].time - keys[1].time;
        let (one, two) = (&keys[1], &keys[2]);
        // Two segments that go forth and back have no length, and give the curve no direction.
        let share = |whole: f64| if whole == 0.0 { 0.0 } else { length / whole };
        let out = share(keys[2].time - keys[0].time) * (1.0 - one.tension);
        let inwards = share(keys[3].time - keys[1].time) * (1.0 - two.tension);
        (
            [
                out * (1.0 + one.continuity) * (1.0 + one.bias),
                out * (1.0 - one.continuity) * (1.0 - one.bias),
            ],
            [
                inwards * (1.0 - two.continuity) * (1.0 + two.bias),
                inwards * (1.0 + two.continuity) * (1.0 - two.bias),
            ],
        )
    }
}

impl Track<DVec3> {
    fn at(&self, time: f64) -> DVec3 {
        let (first, fraction) = self.segment_at(time);
        let Some(u) = fraction else {
            return self.keys[first].value;
        };
        let [p0, p1, p2, p3] = std::array::from_fn(|i| self.keys[first - 1 + i].value);
        let at = p2 - p1;
        let ([before, own], [own_in, after]) = self.weights(first);
        let out = own * at + before * (p1 - p0);
        let inwards = after * (p3 - p2) + own_in * at;
        let (square, cube) = (u * u, u * u * u);
        p1 + u * out + square * (3.0 * at - 2.0 * out - inwards) + cube * (out + inwards - 2.0 * at)
    }
}

impl Track<Quaternion> {
    fn at(&self, time: f64) -> Quaternion {
        let (first, fraction) = self.segment_at(time);
        let Some(u) = fraction else {
            return self.keys[first].value;
        };
        let (mut q0, mut q1) = (self.keys[0].value, self.keys[1].value);
        // Each quaternion takes the sign that is closer to its predecessor, from the second key to the end of this segment.
        let mut q2 = q1;
        for i in 1..=first {
            (q0, q1) = if i == 1 { (q0, q1) } else { (q1, q2) };
            q2 = self.keys[i + 1].value;
            if q1.dot(q2) < 0.0 {
                q2 = q2.scaled(-1.0);
            }
        }
        let q3 = self.keys[first + 2].value;
        let at = q1.ratio(q2).log();
        let ([before, own], [own_in, after]) = self.weights(first);
        let out = own * at + before * q0.ratio(q1).log();
        let inwards = after * q2.ratio(q3).log() + own_in * at;
        let a = q1.times(Quaternion::exp((out - at) * 0.5));
        let b = q2.times(Quaternion::exp((at - inwards) * 0.5));
        q1.slerp(q2, u).slerp(a.slerp(b, u), 2.0 * u * (1.0 - u))
    }
}

impl Quaternion {
    /// A rotation about an axis by an angle in degrees. The axis is not normalized.
    pub(crate) fn about(axis: DVec3, degrees: f64) -> Self {
        let (sine, cosine) = libm::sincos(degrees.to_radians() * 0.5);
        let vector = axis * sine;
        Self(DQuat::from_xyzw(vector.x, vector.y, vector.z, cosine))
    }

    fn from_scalar_and_vector(scalar: f64, vector: DVec3) -> Self {
        Self(DQuat::from_xyzw(vector.x, vector.y, vector.z, scalar))
    }

    fn vector(self) -> DVec3 {
        self.0.xyz()
    }

    fn dot(self, other: Self) -> f64 {
        self.0.dot(other.0)
    }

    fn scaled(self, by: f64) -> Self {
        Self(self.0 * by)
    }

    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }

    /// The rotation from `self` to `other`.
    fn ratio(self, other: Self) -> Self {
        Self(self.0.conjugate() * other.0)
    }

    fn log(self) -> DVec3 {
        let angle = libm::acos(self.0.w.clamp(-1.0, 1.0));
        let sine = libm::sin(angle);
        if sine.abs() > SMALL {
            self.vector() * (angle / sine)
        } else {
            self.vector()
        }
    }

    fn exp(vector: DVec3) -> Self {
        let angle = vector.length();
        let (sine, cosine) = libm::sincos(angle);
        if sine.abs() > SMALL {
            Self::from_scalar_and_vector(cosine, vector * (sine / angle))
        } else {
            Self::from_scalar_and_vector(cosine, vector)
        }
    }

    fn slerp(self, other: Self, fraction: f64) -> Self {
        let angle = libm::acos(self.dot(other).clamp(-1.0, 1.0));
        let sine = libm::sin(angle);
        if sine.abs() <= SMALL {
            return self;
        }
        let weights =
            [(1.0 - fraction) * angle, fraction * angle].map(|angle| libm::sin(angle) / sine);
        let sum = DVec4::from(self.0) * weights[0] + DVec4::from(other.0) * weights[1];
        Self(DQuat::from_vec4(sum))
    }

    fn to_matrix(self) -> DMat3 {
        let angle = 2.0 * libm::acos(self.0.w.clamp(-1.0, 1.0));
        let axis = self.vector().normalize_or_zero();
        if axis == DVec3::ZERO {
            return DMat3::IDENTITY;
        }
        rotation_about(axis, angle)
    }
}

/// The matrix of a rotation about a unit axis. Sines come from libm, so that a scene is the same on every platform.
pub(crate) fn rotation_about(axis: DVec3, radians: f64) -> DMat3 {
    let (sine, cosine) = libm::sincos(radians);
    let DVec3 { x, y, z } = axis;
    let rest = 1.0 - cosine;
    DMat3::from_cols(
        DVec3::new(
            x * x * rest + cosine,
            x * y * rest + z * sine,
            x * z * rest - y * sine,
        ),
        DVec3::new(
            x * y * rest - z * sine,
            y * y * rest + cosine,
            y * z * rest + x * sine,
        ),
        DVec3::new(
            x * z * rest + y * sine,
            y * z * rest - x * sine,
            z * z * rest + cosine,
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key<T>(time: f64, value: T) -> Key<T> {
        Key {
            time,
            value,
            tension: 0.0,
            continuity: 0.0,
            bias: 0.0,
        }
    }

    fn track<T>(keys: impl IntoIterator<Item = (f64, T)>) -> Track<T> {
        let keys = keys.into_iter().map(|(time, value)| key(time, value));
        Track::new(keys.collect()).expect("enough keys, in order")
    }

    #[test]
    fn evenly_spaced_keys_give_linear_motion() {
        let keys = track((0..6).map(|i| (f64::from(i), DVec3::new(f64::from(i), 0.0, 1.0))));
        for (time, x) in [
            (-3.0, 1.0),
            (1.0, 1.0),
            (1.25, 1.25),
            (3.9, 3.9),
            (4.0, 4.0),
            (9.0, 4.0),
        ] {
            let at = keys.at(time);
            assert!(
                (at - DVec3::new(x, 0.0, 1.0)).length() < 1e-12,
                "{time}: {at}"
            );
        }
    }

    #[test]
    fn curves_pass_through_their_keys_for_every_bias() {
        let mut keys = track([0.0, 0.5, 2.0, 2.5, 4.0].map(|t| (t, DVec3::new(t * t, -t, 1.0))));
        for key in &mut keys.keys {
            (key.tension, key.continuity, key.bias) = (0.3, -0.5, 0.8);
        }
        for time in [0.5, 2.0, 2.5] {
            let at = keys.at(time);
            assert!(
                (at - DVec3::new(time * time, -time, 1.0)).length() < 1e-12,
                "{time}: {at}"
            );
        }
        let stiff = |tension: f64| {
            let mut keys = keys.clone();
            for key in &mut keys.keys {
                (key.tension, key.continuity, key.bias) = (tension, 0.0, 0.0);
            }
            keys.at(0.6).x - 0.25
        };
        assert!(stiff(1.0) < stiff(0.0), "tension slows motion at keys");
    }

    #[test]
    fn key_times_may_repeat() {
        let at_ends = track(
            [(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (1.0, 1.0)]
                .map(|(time, x)| (time, DVec3::splat(x))),
        );
        assert_eq!(at_ends.at(0.0), DVec3::ZERO);
        assert!(
            (at_ends.at(0.5) - 0.5).abs().max_element() < 0.2,
            "between the keys"
        );
        let inside = track(
            [
                (0.0, 0.0),
                (1.0, 1.0),
                (2.0, 2.0),
                (2.0, 5.0),
                (3.0, 6.0),
                (4.0, 7.0),
            ]
            .map(|(time, x)| (time, DVec3::splat(x))),
        );
        assert_eq!(inside.at(2.0), DVec3::splat(5.0), "the later key");
        assert!(inside.at(2.5).is_finite(), "{}", inside.at(2.5));
        assert_eq!(Track::<DVec3>::new(vec![]), None, "a curve needs keys");
    }

    #[test]
    fn where_times_go_back_the_first_segment_that_ends_after_a_time_counts() {
        let times = [0.0, 1.0, 5.0, 3.0, 8.0, 9.0];
        let keys = track(times.map(|time| (time, DVec3::splat(10.0 * time))));
        for (time, segment, fraction) in [
            (1.0, 1, None),
            (2.0, 1, Some(0.25)),
            (4.0, 1, Some(0.75)),
            (5.0, 3, Some(0.4)),
            (6.0, 3, Some(0.6)),
            (8.5, 4, None),
        ] {
            assert_eq!(keys.segment_at(time), (segment, fraction), "{time}");
        }
        let forth_and_back = track([0.0, 1.0, 0.0, 1.0, 2.0].map(|time| (time, DVec3::X)));
        for time in [0.5, 1.0, 1.5] {
            assert!(forth_and_back.at(time).is_finite(), "{time}");
        }
    }

    #[test]
    fn rotations_about_one_axis_add_up() {
        let rotations = track((0..5).map(|i| {
            let i = f64::from(i);
            (i, Quaternion::about(DVec3::Y, 40.0 * i))
        }));
        for time in [1.0, 1.3, 2.0, 2.9, 3.0] {
            let keys = Keys {
                rotation: Some(Curve::Spline(rotations.clone())),
                ..Keys::default()
            };
            let rotated = keys.transform(time).transform_vector3(DVec3::X);
            let expected = rotation_about(DVec3::Y, (40.0 * time).to_radians()) * DVec3::X;
            assert!(
                (rotated - expected).length() < 1e-9,
                "{time}: {rotated}, not {expected}"
            );
        }
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let rotations = track(
            [0.0, 10.0, 350.0, 340.0]
                .into_iter()
                .zip(0..)
                .map(|(degrees, i)| (f64::from(i), Quaternion::about(DVec3::Z, degrees))),
        );
        let keys = Keys {
            rotation: Some(Curve::Spline(rotations)),
            ..Keys::default()
        };
        let rotated = keys.transform(1.5).transform_vector3(DVec3::X);
        assert!(rotated.x > 0.9, "through 0 degrees, not 180: {rotated}");
    }

    #[test]
    fn scale_comes_before_rotation() {
        let keys = Keys {
            translation: Some(Curve::Spline(track(
                (0..4).map(|i| (f64::from(i), DVec3::new(5.0, 0.0, 0.0))),
            ))),
            scale: Some(Curve::Spline(track(
                (0..4).map(|i| (f64::from(i), DVec3::new(2.0, 1.0, 1.0))),
            ))),
            rotation: Some(Curve::Spline(track(
                (0..4).map(|i| (f64::from(i), Quaternion::about(DVec3::Z, 90.0))),
            ))),
            visibility: vec![(1.0, false), (2.0, true)],
        };
        let moved = keys.transform(1.5).transform_point3(DVec3::X);
        assert!(
            (moved - DVec3::new(5.0, 2.0, 0.0)).length() < 1e-12,
            "{moved}"
        );
        let seen = [0.5, 1.0, 1.5, 2.0].map(|time| keys.is_visible(time));
        assert_eq!(seen, [true, false, false, true]);
    }
}
