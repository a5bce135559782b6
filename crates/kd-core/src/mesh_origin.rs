//! The choice of an origin for coordinates in f64, on one axis.
//!
//! A coordinate `x` whose lowest bit is 2⁻ᵏ, and an origin `o` that is a multiple of 2⁻ᵏ, have a difference that is a multiple of
//! 2⁻ᵏ. It is exact in f32 if it is at most 2²⁴⁻ᵏ. So among the multiples of 2⁻ʲ every origin in
//!
//! ```text
//! the intersection of [x - 2²⁴⁻ᵐ, x + 2²⁴⁻ᵐ] over all x, with m = max(j, k of x)
//! ```
//!
//! makes every difference exact. The search takes the smallest `j ≥ 0` that has such an origin: whole numbers first, then halves, and
//! so on, to the finest lowest bit of a coordinate. Finer origins would not help: where one makes every difference exact, all coordinates
//! are within 2²⁴⁻ᵏ of each other for the finest `k`, and the smallest of them is an origin as well.
//!
//! Among the multiples of 2⁻ʲ it takes the one nearest to the middle. Lowest bits below 1 and differences do not change when all
//! coordinates move by a whole number, so the origin moves with them.

/// The finest lowest bit that f32 has: 2⁻¹⁴⁹.
const FINEST: usize = 149;
/// Bits of a mantissa of f32.
const BITS: i32 = 24;

/// The coordinates of an axis by their lowest bit: the smallest and the largest whose lowest bit is 2⁻ᵏ, for each `k`. Whole numbers
/// are in the first.
struct Coordinates {
    spans: [Option<[f64; 2]>; FINEST + 1],
}

/// The origin of an axis: one that makes every difference exact in f32, if there is a multiple of 2⁻¹⁴⁹ that does for whole numbers
/// up to 2²⁴ away; else the middle. Zero without coordinates, which are finite.
pub(crate) fn origin_on_axis(coordinates: impl Iterator<Item = f64> + Clone) -> f64 {
    let nothing = [f64::INFINITY, f64::NEG_INFINITY];
    let [min, max] = coordinates
        .clone()
        .fold(nothing, |[min, max], x| [x.min(min), x.max(max)]);
    if min > max {
        return 0.0;
    }
    let middle = min.midpoint(max);
    let coordinates = Coordinates::new(coordinates);
    coordinates
        .and_then(|coordinates| coordinates.exact_origin(middle))
        .unwrap_or(middle)
}

impl Coordinates {
    /// `None` if one has a lowest bit that f32 lacks.
    fn new(coordinates: impl Iterator<Item = f64>) -> Option<Self> {
        let mut spans = [None; FINEST + 1];
        for x in coordinates {
            let span: &mut Option<[f64; 2]> = spans.get_mut(fineness(x))?;
            let [min, max] = span.unwrap_or([x, x]);
            *span = Some([x.min(min), x.max(max)]);
        }
        Some(Self { spans })
    }

    /// The coarsest origin from which every coordinate is exact in f32; among those the nearest to `middle`.
    fn exact_origin(&self, middle: f64) -> Option<f64> {
        let finest = self.spans.iter().rposition(Option::is_some)?;
        (0..=finest).find_map(|fineness| {
            let [low, high] = self.origins(fineness);
            multiple_within([low, high], middle, power_of_two(fineness))
        })
    }

    /// The ends of the interval of origins that are multiples of 2⁻ʲ, where `j` is `fineness`; the first is above the second if there
    /// are none.
    fn origins(&self, fineness: usize) -> [f64; 2] {
        let mut ends = [f64::NEG_INFINITY, f64::INFINITY];
        for (own, span) in self.spans.iter().enumerate() {
            if let Some([min, max]) = span {
                let reach = 2.0_f64.powi(BITS) * power_of_two(own.max(fineness));
                ends = [ends[0].max(max - reach), ends[1].min(min + reach)];
            }
        }
        ends
    }
}

/// 2⁻ᵏ, where `k` is `fineness`.
fn power_of_two(fineness: usize) -> f64 {
    let exponent = i32::try_from(fineness).expect("at most 149");
    2.0_f64.powi(-exponent)
}

/// The multiple of a power of two in an interval that is nearest to `middle`, the lower one of two.
fn multiple_within([low, high]: [f64; 2], middle: f64, unit: f64) -> Option<f64> {
    if low > high {
        return None;
    }
    let wanted = middle.clamp(low, high);
    let below = (wanted / unit).floor() * unit;
    let above = below + unit;
    let is_inside = |x: &f64| (low..=high).contains(x);
    let nearest = if wanted - below <= above - wanted {
        [below, above]
    } else {
        [above, below]
    };
    nearest.into_iter().find(is_inside)
}

/// `k` of a number whose lowest bit is 2⁻ᵏ; 0 for whole numbers.
fn fineness(x: f64) -> usize {
    const MANTISSA: u32 = f64::MANTISSA_DIGITS - 1;
    /// The exponent field of a number whose last bit is 1.
    const WHOLE: u64 = 1023 + MANTISSA as u64;
    let bits = x.to_bits();
    let mantissa = bits & ((1 << MANTISSA) - 1);
    let exponent = (bits >> MANTISSA) & 0x7ff;
    let (digits, exponent) = if exponent == 0 {
        (mantissa, 1)
    } else {
        (mantissa | (1 << MANTISSA), exponent)
    };
    if digits == 0 {
        return 0;
    }
    let lowest = exponent + u64::from(digits.trailing_zeros());
    usize::try_from(WHOLE.saturating_sub(lowest)).expect("below 2048")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn origin(coordinates: &[f64]) -> f64 {
        origin_on_axis(coordinates.iter().copied())
    }

    fn is_exact(coordinates: &[f64], origin: f64) -> bool {
        // Differences of these tests are exact in f64.
        let fits = |x: &f64| f64::from(crate::exact::to_f32(x - origin)) == x - origin;
        coordinates.iter().all(fits)
    }

    #[test]
    fn lowest_bits_are_known() {
        for (x, expected) in [
            (0.0, 0),
            (-0.0, 0),
            (1.0, 0),
            (-6.0, 0),
            (1e300, 0),
            (0.5, 1),
            (-2.5, 1),
            (5.2e6 + 0.125, 3),
            (2.0_f64.powi(-149), 149),
            (f64::from_bits(1), 1074),
        ] {
            assert_eq!(fineness(x), expected, "{x}");
        }
    }

    #[test]
    fn origins_are_whole_where_they_can_be() {
        for (coordinates, expected) in [
            (vec![], 0.0),
            (vec![5e5], 5e5),
            (vec![5e5, 5e5 + 0.5], 5e5),
            (vec![-3.0, 7.5], 2.0),
            // Only origins within 2⁻⁴ of the second are exact for it.
            (vec![5e5 - 200.0, 5e5 + 2.0_f64.powi(-28)], 5e5),
            // Two numbers with a lowest bit of 2⁻³⁰ have an origin only between them.
            (
                vec![0.25 + 2.0_f64.powi(-30), 0.26 + 2.0_f64.powi(-30)]
                    .into_iter()
                    .map(|x| (x * 2.0_f64.powi(30)).round() * 2.0_f64.powi(-30))
                    .collect(),
                0.25,
            ),
        ] {
            let found = origin(&coordinates);
            assert_eq!(found, expected, "{coordinates:?}");
            assert!(is_exact(&coordinates, found), "{coordinates:?}");
        }
    }

    #[test]
    fn without_an_exact_origin_it_is_the_middle() {
        let unit = 2.0_f64.powi(-20);
        let wide = vec![-4000.0 - unit, 9000.0 + unit];
        let fine = vec![f64::from_bits(1), 1.0];
        // The first two need an origin near ¼, which is too fine for the distance of the last.
        let unit = 2.0_f64.powi(-30);
        let mixed = vec![0.25 + unit, 0.2578125 - unit, 2.0_f64.powi(23)];
        for coordinates in [wide, fine, mixed] {
            let middle = coordinates[0].midpoint(coordinates[coordinates.len() - 1]);
            assert_eq!(origin(&coordinates), middle, "{coordinates:?}");
        }
    }

    proptest! {
        #[test]
        fn cities_of_f32_have_exact_origins(
            near in prop::collection::vec(prop_oneof![
                -2000.0_f32..2000.0,
                (-2000_i16..2000).prop_map(f32::from),
                -1.0_f32..1.0,
            ], 1..20),
            shift in -10_000_000_i32..10_000_000,
        ) {
            let shift = f64::from(shift);
            let far: Vec<f64> = near.iter().map(|&x| f64::from(x) + shift).collect();
            let shifted_exactly = far.iter().zip(&near).all(|(far, &near)| far - shift == f64::from(near));
            prop_assume!(shifted_exactly);
            let found = origin(&far);
            prop_assert!(is_exact(&far, found), "{found}");
        }

        #[test]
        fn origins_move_by_whole_numbers_with_coordinates(
            on_grid in prop::collection::vec(-(1_i64 << 34)..1 << 34, 1..8),
            digits in 0..30_i32,
            shift in -10_000_000_i32..10_000_000,
        ) {
            let near: Vec<f64> = on_grid.iter().map(|&n| n as f64 * 2.0_f64.powi(-digits)).collect();
            let far: Vec<f64> = near.iter().map(|x| x + f64::from(shift)).collect();
            prop_assert_eq!(origin(&far), origin(&near) + f64::from(shift));
        }
    }
}
