//! Sums of two f64 with what rounding takes from them.

/// `a + b` in f64, and the exact rest. Their sum is that of `a` and `b`, unless it overflows. (D. Knuth, *The Art of Computer
/// Programming*, volume 2, 4.2.2, theorem B.)
pub(crate) fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let b_of_sum = sum - a;
    let a_of_sum = sum - b_of_sum;
    [sum, (a - a_of_sum) + (b - b_of_sum)]
}

/// The nearest f32, infinite beyond its range.
#[allow(
    clippy::cast_possible_truncation,
    reason = "callers measure or state the rounding"
)]
pub(crate) fn to_f32(number: f64) -> f32 {
    number as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_is_what_the_sum_lacks() {
        let small = 2.0_f64.powi(-60);
        for (a, b) in [(1.0, small), (-small, 1.0), (1.0, -small)] {
            let [sum, rest] = two_sum(a, b);
            assert_eq!(sum, if a == -small { b } else { a }, "{a} + {b}");
            assert_eq!(rest.abs(), small, "{a} + {b}");
        }
        assert_eq!(two_sum(5e5, -499_712.0), [288.0, 0.0], "an exact sum");
    }
}
