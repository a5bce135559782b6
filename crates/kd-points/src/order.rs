//! Points in an order in which neighbors follow each other.

use glam::Vec3;
use kd_core::Aabb;

/// Steps of the curve along each axis: three axes of 10 bits.
const STEPS: f32 = (1 << 10) as f32;

/// The numbers of points, fewer than 2³², along the curve of G. M. Morton (1966); points in one step, in the order of their numbers. A point
/// that is not finite may be anywhere. O(N log N), with 12 bytes of memory for each point. Parallel: on the threads of the pool in scope.
pub(crate) fn along_a_curve(points: &[Vec3], is_parallel: bool) -> Vec<u32> {
    let finite = points.iter().filter(|point| point.is_finite());
    let bounds = Aabb::around(finite.copied());
    // One length for all axes makes the cells of the curve cubes. Halves keep it finite.
    let half_side = (0.5 * bounds.max - 0.5 * bounds.min).max_element();
    let per_unit = if half_side > 0.0 {
        0.5 / half_side
    } else {
        0.0
    };
    let numbered = (0_u64..).zip(points);
    let mut keys: Vec<u64> = numbered
        .map(|(number, point)| code((*point - bounds.min) * per_unit) << 32 | number)
        .collect();
    kd_tasks::sort(&mut keys, is_parallel);
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the lower half is a number"
    )]
    let numbers = keys.iter().map(|key| *key as u32);
    numbers.collect()
}

/// The interleaved bits of three numbers from 0 to 1.
fn code(place: Vec3) -> u64 {
    let [x, y, z] = place.to_array().map(|place| spread(place * STEPS));
    x << 2 | y << 1 | z
}

/// The lowest 10 bits of a number, each followed by two zeros.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers are not negative, and numbers beyond the last step become the last step; NaN becomes 0"
)]
fn spread(x: f32) -> u64 {
    let mut bits = x.min(STEPS - 1.0) as u64;
    bits = (bits | bits << 16) & 0x0300_00ff;
    bits = (bits | bits << 8) & 0x0300_f00f;
    bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_comes_once_and_neighbors_follow_each_other() {
        let mut points: Vec<Vec3> = (0..4096_u16)
            .map(|i| {
                let mixed = i.wrapping_mul(2897) % 4096;
                Vec3::from_array([mixed % 16, mixed / 16 % 16, mixed / 256].map(f32::from))
            })
            .collect();
        let order = along_a_curve(&points, false);
        let mut steps = order.windows(2).map(|pair| {
            let [a, b] = [points[pair[0] as usize], points[pair[1] as usize]];
            a.distance(b)
        });
        let mean = steps.by_ref().sum::<f32>() / 4095.0;
        assert!(mean < 2.5, "{mean} steps of the lattice");
        points.extend([
            Vec3::NAN,
            Vec3::INFINITY,
            Vec3::splat(f32::MAX),
            -Vec3::splat(f32::MAX),
        ]);
        for is_parallel in [false, true] {
            let mut order = along_a_curve(&points, is_parallel);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..4100), "each once");
        }
        assert_eq!(along_a_curve(&[], false), [0; 0], "nothing");
        assert_eq!(
            along_a_curve(&[Vec3::ONE; 3], false),
            [0, 1, 2],
            "one place"
        );
    }
}
