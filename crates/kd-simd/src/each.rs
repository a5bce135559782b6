//! Arrays mapped in place of a loop.

/// `values.map(f)`, inlined always.
///
/// The function of the standard library is no candidate for inlining in a crate of several codegen units: it is then a call, and
/// `f` is compiled without the instructions of its caller.
///
/// With this function in the triangle test, and the portable body of a task behind a call, single rays through wide nodes take 4 to
/// 9 % fewer instructions (`cargo xtask instructions --scene gears,tree`, its option `--over`, 2026-11-30).
#[inline(always)]
pub fn each<T: Copy, U, const N: usize>(values: [T; N], mut f: impl FnMut(T) -> U) -> [U; N] {
    std::array::from_fn(
        #[inline(always)]
        |i| f(values[i]),
    )
}
