//! Minimum and maximum that pass over a NaN on the left, in one instruction: what is not known cuts nothing off a span.

/// The smaller; the second if the first is NaN.
#[inline]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; the second if the first is NaN.
#[inline]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[test]
fn nan_on_the_left_is_passed_over() {
    for (a, b, smaller, larger) in [
        (1.0, 2.0, 1.0, 2.0),
        (2.0, 1.0, 1.0, 2.0),
        (f32::NAN, 3.0, 3.0, 3.0),
    ] {
        assert_eq!((min(a, b), max(a, b)), (smaller, larger), "{a}, {b}");
    }
}
