//! Random directions.

use fastrand::Rng;
use kd::glam::Vec3;

/// A random unit vector in the hemisphere around a unit normal, with a density proportional to the cosine to the normal.
pub(crate) fn cosine_around(normal: Vec3, random: &mut Rng) -> Vec3 {
    // A uniform point of the unit sphere, added to the normal, gives the cosine density.
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
    fn directions_follow_the_cosine_density() {
        let mut random = Rng::with_seed(1);
        let normal = Vec3::new(0.6, -0.8, 0.0);
        let mut cosine = || cosine_around(normal, &mut random).dot(normal);
        let cosines: Vec<f32> = (0..20_000).map(|_| cosine()).collect();
        assert!(cosines.iter().all(|cosine| *cosine > -1e-6));
        // Under a density proportional to the cosine, the mean cosine is 2/3.
        let mean = cosines.iter().sum::<f32>() / 20_000.0;
        assert!((mean - 2.0 / 3.0).abs() < 0.01, "{mean}");
    }
}
