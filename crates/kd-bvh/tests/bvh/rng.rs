//! Seeded random numbers, the same on every platform.

use glam::Vec3;

/// A counter, hashed (the mixer of `SplitMix64`: Steele, Lea and Flood 2014).
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        for (shift, factor) in [(30, 0xBF58_476D_1CE4_E5B9), (27, 0x94D0_49BB_1331_11EB)] {
            z = (z ^ z >> shift).wrapping_mul(factor);
        }
        z ^ z >> 31
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.bits() % n as u64).expect("less than n")
    }

    pub(crate) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// In the cube [-1, 1]³.
    pub(crate) fn vec3(&mut self) -> Vec3 {
        Vec3::from_array([(); 3].map(|()| 2.0 * self.unit() - 1.0))
    }
}
