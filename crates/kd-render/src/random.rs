//! Directions by chance.

use fastrand::Rng;
use kd::glam::Vec3;

/// A unit vector on the side of a unit normal, as often as its cosine with that.
pub(crate) fn cosine_around(normal: Vec3, random: &mut Rng) -> Vec3 {
    // A point of the unit sphere over the tip of the normal.
    let z = 2.0 * random.f32() - 1.0;
    let angle = std::f32::consts::TAU * random.f32();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let on_sphere = Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
    (normal + on_sphere).normalize_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_around_the_normal_and_as_often_as_they_should_be() {
        let mut random = Rng::with_seed(1);
        let normal = Vec3::new(0.6, -0.8, 0.0);
        let mut cosine = || cosine_around(normal, &mut random).dot(normal);
        let cosines: Vec<f32> = (0..20_000).map(|_| cosine()).collect();
        assert!(cosines.iter().all(|cosine| *cosine > -1e-6));
        // The mean of a cosine that is as often as large is 2/3.
        let mean = cosines.iter().sum::<f32>() / 20_000.0;
        assert!((mean - 2.0 / 3.0).abs() < 0.01, "{mean}");
    }
}
