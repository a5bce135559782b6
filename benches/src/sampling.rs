//! Deterministic random numbers and directions.
//!
//! Only integers, + − × ÷ and √ are used, which are exact or rounded equally on every machine: equal seeds give equal rays.
//! Trigonometric functions of the platform would not.

use kd::glam::Vec3;

/// SplitMix64 (Steele, Lea, Flood: *Fast Splittable Pseudorandom Number Generators*, 2014).
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform below `end`, which is not 0, up to a bias of `end` in 2⁶⁴.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next_u64() % end as u64).expect("less than the end")
    }

    /// Uniform in [-1, 1), in steps of 2⁻²³.
    pub(crate) fn signed_unit(&mut self) -> f32 {
        const STEP: f32 = 1.0 / (1 << 23) as f32;
        (self.next_u64() >> 40) as f32 * STEP - 1.0
    }

    /// Uniform in the unit disc, by rejection, with its squared distance from the center.
    fn in_disc(&mut self) -> (f32, f32, f32) {
        loop {
            let (x, y) = (self.signed_unit(), self.signed_unit());
            let squared = x * x + y * y;
            if squared < 1.0 {
                return (x, y, squared);
            }
        }
    }

    /// A unit vector around the unit vector `normal`, with density proportional to the cosine between them: a point in
    /// the disc, lifted to the hemisphere (Malley's method).
    pub(crate) fn cosine_around(&mut self, normal: Vec3) -> Vec3 {
        let (x, y, squared) = self.in_disc();
        let (right, up) = frame(normal);
        (x * right + y * up + (1.0 - squared).sqrt() * normal).normalize()
    }

    /// Uniform on the unit sphere (Marsaglia: *Choosing a Point from the Surface of a Sphere*, 1972).
    pub(crate) fn on_sphere(&mut self) -> Vec3 {
        let (x, y, squared) = self.in_disc();
        let stretch = 2.0 * (1.0 - squared).sqrt();
        Vec3::new(x * stretch, y * stretch, 1.0 - 2.0 * squared)
    }
}

/// Two unit vectors at right angles to the unit vector `n` and to each other (Duff et al.: *Building an Orthonormal
/// Basis, Revisited*, 2017).
fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeded_values_are_pinned() {
        let mut random = Random::new(1_234_567);
        // The first outputs that the reference implementation gives for this seed.
        let values = [random.next_u64(), random.next_u64(), random.next_u64()];
        assert_eq!(
            values,
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423
            ],
            "SplitMix64"
        );
        let mut random = Random::new(1);
        let directions = [random.on_sphere(), random.cosine_around(Vec3::Y)];
        let bits = directions.map(|d| d.to_array().map(f32::to_bits));
        assert_eq!(bits, PINNED, "{directions:?}");
    }

    const PINNED: [[u32; 3]; 2] = [
        [0x3e6a_a1df, 0x3f58_990e, 0x3ef6_6b48],
        [0x3f71_2744, 0x3ea2_1ac8, 0x3de3_e7a0],
    ];

    #[test]
    fn directions_are_unit_and_spread_as_they_should() {
        let mut random = Random::new(7);
        let normal = Vec3::new(2.0, -3.0, 6.0) / 7.0;
        let (mut of_sphere, mut of_cosine, mut above) = (Vec3::ZERO, 0.0, 0);
        let count = 20_000;
        for _ in 0..count {
            let (anywhere, around) = (random.on_sphere(), random.cosine_around(normal));
            for direction in [anywhere, around] {
                assert!((direction.length() - 1.0).abs() < 1e-6, "{direction}");
            }
            of_sphere += anywhere / count as f32;
            of_cosine += around.dot(normal) / count as f32;
            above += i32::from(around.dot(normal) >= 0.0);
        }
        assert!(
            of_sphere.length() < 0.02,
            "no side is preferred: {of_sphere}"
        );
        assert!(
            (of_cosine - 2.0 / 3.0).abs() < 0.01,
            "the mean cosine is 2/3: {of_cosine}"
        );
        assert_eq!(above, count, "all of the hemisphere");
    }

    #[test]
    fn frames_are_orthonormal_at_the_poles_too() {
        for n in [
            Vec3::X,
            Vec3::NEG_Y,
            Vec3::Z,
            Vec3::NEG_Z,
            Vec3::new(0.6, 0.0, -0.8),
        ] {
            let (a, b) = frame(n);
            let off = a.dot(b).abs() + a.dot(n).abs() + b.dot(n).abs();
            assert!(
                off < 1e-6 && (a.length() - 1.0).abs() < 1e-6,
                "{n}: {a} {b}"
            );
        }
    }
}
