//! Seeded random numbers, the same on every platform.

use glam::Vec3;

/// `SplitMix64` (Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub struct Rng(
    /// The state; any number is a seed.
    pub u64,
);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    /// In [low, high], up to rounding.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// In [0, n); n is not 0.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next() % n as u64).expect("less than n")
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// One element of a list that is not empty.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// In the box [-1, 1]³.
    pub fn vec3(&mut self) -> Vec3 {
        let mut one = || self.between(-1.0, 1.0);
        Vec3::new(one(), one(), one())
    }

    /// A unit vector, roughly uniformly distributed.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vec3();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_ranges() {
        let mut rng = Rng(1);
        let (mut low, mut high, mut seen) = (1.0_f32, 0.0_f32, [0; 8]);
        for _ in 0..4000 {
            let x = rng.unit();
            low = low.min(x);
            high = high.max(x);
            seen[rng.below(8)] += 1;
        }
        assert!(low < 0.01 && high > 0.99 && high < 1.0, "{low} to {high}");
        assert!(seen.iter().all(|&n| n > 400), "{seen:?}");
        let directions: Vec<Vec3> = (0..100).map(|_| rng.direction()).collect();
        assert!(
            directions.iter().sum::<Vec3>().length() < 30.0,
            "no preferred direction"
        );
    }
}
