//! Minimum and maximum that compile to one instruction: they give the second operand if either is NaN.

/// The smaller; `b` if either is NaN, or if both are equal.
#[inline(always)]
pub fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; `b` if either is NaN, or if both are equal.
#[inline(always)]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
