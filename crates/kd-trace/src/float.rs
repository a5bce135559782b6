//! Minimum and maximum that take one instruction, because they do not care about NaN on the right.

/// The smaller; the second if the first is NaN.
#[inline]
pub fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; the second if the first is NaN.
#[inline]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
