//! What is a hit, and where: the one decision of all traversals, in f64.
//!
//! It is generic over the arithmetic ([`Triple`], [`Real`]): one ray and a triangle by single numbers or with the three corners
//! in a register, eight rays and a triangle for each by lanes. All round alike, so all give the same hits to the bit.
//!
//! The steps are those of [`triangle`](crate::triangle). Nothing here may be contracted to a fused multiply-add: it would break
//! the antisymmetry of edge functions. (Rust never does so by itself.)

use kd_core::{Culling, Hit};
use kd_simd::{Number, Real, Triple, each};

/// See [`Sight::finer_weights`].
const LEAST_SHARE: f64 = 1.0 / (1 << 24) as f64;

/// How rays see triangles: sheared so that each ray runs along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<N> {
    /// Steps across per step along, on both axes across.
    pub(crate) shear: [N; 2],
    /// `t` per step along.
    pub(crate) scale: N,
}

/// Which sides of triangles a ray hits: known to the compiler for most rays.
pub(crate) trait Sees: Copy {
    /// Whether it hits the front, or else the back. `is_front` is called where that matters.
    fn sees(self, is_front: impl FnOnce() -> bool) -> bool;
}

/// A ray without culling.
#[cfg(any(target_arch = "x86_64", test))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct BothSides;

#[cfg(any(target_arch = "x86_64", test))]
impl Sees for BothSides {
    #[inline(always)]
    fn sees(self, _: impl FnOnce() -> bool) -> bool {
        true
    }
}

impl Sees for Culling {
    #[inline(always)]
    fn sees(self, is_front: impl FnOnce() -> bool) -> bool {
        self.is_none() || Self::sees(self, is_front())
    }
}

/// The corners of triangles as rays see them: across, and along.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight<T: Triple> {
    x: T,
    y: T,
    along: T,
    /// Of the view.
    scale: T::Number,
}

impl<N: Real> View<N> {
    /// Sees corners, given from the origin of the ray: across, across and along.
    #[inline(always)]
    pub(crate) fn sight<T: Triple<Number = N>>(&self, [x, y, along]: [T; 3]) -> Sight<T> {
        let [shear_x, shear_y] = self.shear;
        Sight {
            x: x - along.times(shear_x),
            y: y - along.times(shear_y),
            along,
            scale: self.scale,
        }
    }
}

impl View<f64> {
    /// The hit of one ray with one triangle, if it is between `t_min` and `t_max`, on a side that the ray sees. The corners are
    /// given from the origin of the ray: across, across and along. `triangle` is the slot that is reported.
    #[inline(always)]
    pub(crate) fn hit<T: Triple<Number = f64>>(
        &self,
        corners: [T; 3],
        [t_min, t_max]: [f32; 2],
        sees: impl Sees,
        triangle: u32,
    ) -> Option<Hit> {
        let sight = self.sight(corners);
        let weights = sight.deciding_weights();
        // As `are_inside`, with a branch for each: most misses end at the first.
        if !weights.is_one_sided() || !weights.sum().is_not_zero() {
            return None;
        }
        // The axes are right-handed, and the weights are positive where the corners are clockwise from above. The ray looks from
        // below where its direction along is positive.
        if !sees.sees(|| (weights.sum() > 0.0) == (self.scale > 0.0)) {
            return None;
        }
        let hit = hit_at(sight.point(weights), triangle);
        // As `is_within`.
        (hit.t.is_finite() && t_min <= hit.t && hit.t <= t_max).then_some(hit)
    }

    /// [`hit`](Self::hit) of a triangle that is surely hit between the ends of the ray, with finer weights that can be used.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn sure_hit<T: Triple<Number = f64>>(&self, corners: [T; 3], triangle: u32) -> Hit {
        let sight = self.sight(corners);
        hit_at(sight.point_of(weights(sight.x, sight.y)), triangle)
    }
}

/// From `t`, `u` and `v`.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "a hit has f32 values")]
fn hit_at(point: [f64; 3], triangle: u32) -> Hit {
    // Adding zero turns -0.0 into 0.0.
    let [t, u, v] = each(point, |x| x as f32 + 0.0);
    Hit { t, u, v, triangle }
}

impl<T: Triple> Sight<T> {
    /// The weights that decide: of coordinates across rounded to 26 bits, so that the products in edge functions are exact.
    #[inline(always)]
    pub(crate) fn deciding_weights(&self) -> T {
        let [x, y] = self.deciding_places();
        weights(x, y)
    }

    /// Where the ray sees the corners, across, by the numbers that decide. The ray is at zero.
    #[inline(always)]
    pub(crate) fn deciding_places(&self) -> [T; 2] {
        [to_26_bits(self.x), to_26_bits(self.y)]
    }

    /// `t`, `u` and `v` of the point that the ray meets, from the weights that decide.
    #[inline(always)]
    pub(crate) fn point(&self, deciding: T) -> [T::Number; 3] {
        let (finer, is_usable) = self.finer_weights();
        self.point_of(finer.or(is_usable, deciding))
    }

    /// `t`, `u` and `v` of the point that weights stand for.
    #[inline(always)]
    fn point_of(&self, weights: T) -> [T::Number; 3] {
        let t = (weights * self.along.times(self.scale)).sum();
        weights.with_first(t).over(weights.sum())
    }

    /// Weights from coordinates that were not rounded, and whether they can be used.
    ///
    /// They do not move the hit by 2⁻²⁶ of the triangle's size, which is visible on a floor a million times larger than the
    /// objects on it. The rounded coordinates decide what is a hit, so the finer ones may call it outside. Rounding makes each of
    /// the finer weights err by up to 2⁻⁵² M², M being the largest coordinate. Where their sum is not far larger than that, the
    /// point that they stand for could be anywhere in the triangle, while exact weights of rounded coordinates keep it within
    /// 2⁻²⁶ M of the ray. With the limit here it is within 3 · 2⁻⁵² M² / (2⁻²⁴ M²) · M < 2⁻²⁶ M.
    #[inline(always)]
    fn finer_weights(&self) -> (T, <T::Number as Number>::Mask) {
        let finer = weights(self.x, self.y);
        let size = self.x.abs().max(self.y.abs()).max_element();
        let is_sound = (size.scaled(LEAST_SHARE) * size).le(finer.sum().abs());
        (finer, is_sound & are_inside(finer))
    }
}

/// How much each corner counts at the point where the ray passes, up to a common factor of either sign: twice the areas of the
/// triangles that the point makes with the opposite edges. Of corners a, b and c: the edge functions of c and b, a and c,
/// b and a.
#[inline(always)]
fn weights<T: Triple>(x: T, y: T) -> T {
    x.previous() * y.next() - y.previous() * x.next()
}

/// Inside or on an edge, for either winding. All weights are zero for a triangle seen edge-on, or of no area.
#[inline(always)]
pub(crate) fn are_inside<T: Triple>(weights: T) -> <T::Number as Number>::Mask {
    weights.is_one_sided() & weights.sum().is_not_zero()
}

/// Whether a reported `t` is finite and between the ends of the ray. `most` is [`f32::MAX`].
#[inline(always)]
pub(crate) fn is_within<N: Number>(t: N, [t_min, t_max]: [N; 2], most: N) -> N::Mask {
    t_min.le(t) & t.le(t_max) & t.abs().le(most)
}

/// The nearest numbers with 26 significant bits, halves away from zero: an error of at most 2⁻²⁶.
#[inline(always)]
fn to_26_bits<T: Triple>(x: T) -> T {
    const DROPPED: u32 = f64::MANTISSA_DIGITS - 26;
    // A carry out of the mantissa goes to the exponent, where it belongs.
    x.add_and_mask_bits(1 << (DROPPED - 1), u64::MAX << DROPPED)
}

#[cfg(test)]
mod tests {
    use kd_simd::{Level, Simd, Task, Three};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rounding_keeps_26_bits() {
        let ulp = 2.0_f64.powi(-25);
        for (x, rounded) in [
            (0.0, 0.0),
            (-0.0, 0.0),
            (1.0, 1.0),
            (1.0 + ulp, 1.0 + ulp),
            (1.0 + 0.49 * ulp, 1.0),
            (-1.0 - 0.5 * ulp, -1.0 - ulp),
            (2.0 - 0.1 * ulp, 2.0),
            (f64::INFINITY, f64::INFINITY),
        ] {
            let Three(found) = to_26_bits(Three([x, 1.0, x]));
            assert_eq!(found, [rounded, 1.0, rounded], "{x:e}");
        }
    }

    #[test]
    fn weights_that_are_mostly_rounding_are_not_used() {
        let seen = |[a, b, c]: [[f64; 2]; 3]| Sight {
            x: Three([a[0], b[0], c[0]]),
            y: Three([a[1], b[1], c[1]]),
            along: Three([1.0; 3]),
            scale: 1.0,
        };
        let wide = seen([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]]);
        assert!(wide.finer_weights().1, "as wide as long");
        for height in [1e-9, 1e-15, 1e-17, 0.0] {
            let sliver = seen([[-1.0, -1.0 - height], [1.0, 1.0], [0.0, height]]);
            let (weights, is_usable) = sliver.finer_weights();
            assert!(
                weights.sum() <= 0.0,
                "{height:e}: the ray passes inside or on it"
            );
            assert!(!is_usable, "{height:e}: too thin");
        }
    }

    /// One triangle and one ray, at some level.
    struct OneHit {
        view: View<f64>,
        corners: [[f32; 3]; 3],
    }

    impl<S: Simd> Task<S> for &OneHit {
        type Output = Option<[u32; 3]>;

        #[inline(always)]
        fn run(self, simd: S) -> Self::Output {
            let [x, y, along] = self.corners;
            let corners = [simd.triple(x), simd.triple(y), simd.triple(along)];
            let hit = self.view.hit(corners, [-10.0, 10.0], BothSides, 7);
            hit.map(|hit| [hit.t, hit.u, hit.v].map(f32::to_bits))
        }
    }

    proptest! {
        #[test]
        fn products_of_rounded_numbers_are_exact(x in -1e9_f64..1e9, y in -1e-9_f64..1e-9) {
            let Three([a, b, _]) = to_26_bits(Three([x, y, 0.0]));
            prop_assert!((a - x).abs() <= x.abs() * 2.0_f64.powi(-26));
            // The remainder of the product, exactly.
            prop_assert_eq!(a.mul_add(b, -(a * b)), 0.0);
        }

        /// Corners in a register give the same hit as corners in variables.
        #[test]
        fn all_levels_decide_alike(
            corners in prop::array::uniform3(prop::array::uniform3(prop_oneof![
                3 => -1.0_f32..1.0,
                1 => (-2_i8..=2).prop_map(f32::from),
                1 => (-1.0_f32..1.0).prop_map(|x| 1e-6 * x),
            ])),
            shear in prop::array::uniform2(-1.0_f64..1.0),
            scale in prop_oneof![Just(1.0), -3.0..3.0_f64],
        ) {
            let one = OneHit { view: View { shear, scale }, corners };
            prop_assert_eq!(Level::detect().run(&one), Level::portable().run(&one));
        }
    }
}
