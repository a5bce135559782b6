//! Items along a space-filling curve.

use glam::Vec3A;

use crate::box_tree::Item;

/// Steps of the curve along each axis: three axes of 21 bits fit in 64.
const STEPS: f32 = (1 << 21) as f32;

/// The items in the order of their centers along the curve of G. M. Morton (1966); centers in one place, in the order of their
/// numbers. O(N log N). Parallel: on the threads of the pool in scope.
pub fn in_morton_order(items: &[Item], is_parallel: bool) -> Vec<Item> {
    let center = |item: &Item| 0.5 * item.min() + 0.5 * item.max();
    let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let (start, end) = items.iter().fold(nothing, |(start, end), item| {
        (start.min(center(item)), end.max(center(item)))
    });
    // One length for all axes makes the cells of the curve cubes. The halves keep it finite.
    let half_side = (0.5 * end - 0.5 * start).max_element();
    let per_unit = if half_side > 0.0 {
        0.5 / half_side
    } else {
        0.0
    };
    let code = |item: &Item| {
        let place = (center(item) - start).min(Vec3A::splat(f32::MAX)) * per_unit;
        code(place)
    };
    let numbered = items.iter().enumerate();
    let mut order: Vec<(u64, u32, usize)> = numbered
        .map(|(place, item)| (code(item), item.number(), place))
        .collect();
    kd_tasks::sort(&mut order, is_parallel);
    let sorted = order.into_iter();
    sorted.map(|(_, _, place)| items[place]).collect()
}

/// The interleaved bits of three numbers from 0 to 1.
fn code(place: Vec3A) -> u64 {
    let [x, y, z] = place.to_array().map(|place| spread(place * STEPS));
    x << 2 | y << 1 | z
}

/// The lowest 21 bits of a number, each followed by two zeros.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers are not negative, and numbers beyond the last step become the last step"
)]
fn spread(x: f32) -> u64 {
    let mut x = u64::from((x as u32).min((1 << 21) - 1));
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_interleaved() {
        for x in [0_u32, 1, 2, 5, 0x1f_ffff, 0x15_5555, 0x0a_bcde] {
            let expected = (0..21).fold(0, |code, bit| code | u64::from(x >> bit & 1) << (3 * bit));
            assert_eq!(spread(x as f32), expected, "{x:#x}");
        }
        assert_eq!(spread(1e30), spread((1 << 21) as f32 - 1.0), "the last");
        let octant = |x, y, z| code(Vec3A::new(x, y, z)) >> 60;
        assert_eq!(octant(0.6, 0.4, 0.4), 4, "x is the highest bit");
        assert_eq!(octant(0.4, 0.4, 0.6), 1, "z is the lowest bit");
    }
}
