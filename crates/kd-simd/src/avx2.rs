//! Lanes in registers of AVX2.
#![allow(
    unsafe_code,
    reason = "intrinsics; `portable` is the twin, and a test compares the two"
)]
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "one instruction after the other, all safe for the same reason: the processor has AVX2"
)]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};
use std::sync::atomic::{AtomicU8, Ordering};

use crate::{F32x8, F64x8, LANES, Mask, Number, Real, Simd, Task, Triple, U32x8};

/// Proof that the processor has AVX2, FMA, POPCNT, LZCNT and BMI1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Avx2(());

/// The outcome of detection: it takes five checks, and small kernels of builders ask each time.
static DETECTED: AtomicU8 = AtomicU8::new(UNKNOWN);
const UNKNOWN: u8 = 0;
const ABSENT: u8 = 1;
const PRESENT: u8 = 2;

impl Avx2 {
    /// The proof, on a processor that has these instructions. Every known processor with AVX2 has the others.
    #[inline]
    pub fn detect() -> Option<Self> {
        // No other memory depends on it, and every thread detects the same.
        match DETECTED.load(Ordering::Relaxed) {
            PRESENT => Some(Self(())),
            ABSENT => None,
            _ => Self::ask_processor(),
        }
    }

    #[cold]
    fn ask_processor() -> Option<Self> {
        let has_all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("popcnt")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("bmi1");
        let outcome = if has_all { PRESENT } else { ABSENT };
        DETECTED.store(outcome, Ordering::Relaxed);
        has_all.then_some(Self(()))
    }
}

/// Eight lanes of f32. Only an [`Avx2`] makes them, and the lanes below.
#[derive(Clone, Copy, Debug)]
pub struct Floats(__m256);

/// Eight lanes of f64. (Two registers: their operations overlap, where a chain of operations on one has latency.)
#[derive(Clone, Copy, Debug)]
pub struct Doubles([__m256d; 2]);

/// Three numbers of f64. The fourth lane is meaningless.
#[derive(Clone, Copy, Debug)]
pub struct Corners(__m256d);

/// Eight lanes of u32.
#[derive(Clone, Copy, Debug)]
pub struct Counters(__m256i);

/// For each of eight lanes, all bits or none.
#[derive(Clone, Copy, Debug)]
pub struct FloatMask(__m256);

/// For each of eight lanes, all bits or none.
#[derive(Clone, Copy, Debug)]
pub struct DoubleMask([__m256d; 2]);

impl Simd for Avx2 {
    type F32 = Floats;
    type F64 = Doubles;
    type Triple = Corners;
    type U32 = Counters;

    #[inline(always)]
    fn run<T: Task<Self>>(self, task: T) -> T::Output {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { run(self, task) }
    }

    #[inline(never)]
    fn apart<T: Task<Self>>(self, task: T) -> T::Output {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { run(self, task) }
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Floats {
        // SAFETY: `self` proves that the processor has AVX2.
        Floats(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Floats {
        // SAFETY: `self` proves that the processor has AVX2, and eight numbers to read.
        Floats(unsafe { _mm256_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn values(self, [a, b, c, d, e, f, g, h]: [f32; LANES]) -> Floats {
        // SAFETY: `self` proves that the processor has AVX2.
        Floats(unsafe { _mm256_setr_ps(a, b, c, d, e, f, g, h) })
    }

    #[inline(always)]
    fn transpose(self, [a, b, c, d, e, f, g, h]: [&[f32; LANES]; LANES]) -> [Floats; LANES] {
        let rows = [a, b, c, d, e, f, g, h];
        let [mut x, mut y] = [[self.splat(0.0).0; LANES]; 2];
        for (x, row) in x.iter_mut().zip(rows) {
            *x = self.load(row).0;
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe {
            // Pairs of rows, then fours, then both halves.
            for i in 0..4 {
                y[2 * i] = _mm256_unpacklo_ps(x[2 * i], x[2 * i + 1]);
                y[2 * i + 1] = _mm256_unpackhi_ps(x[2 * i], x[2 * i + 1]);
            }
            for i in 0..2 {
                let [p, q, r, s] = [y[4 * i], y[4 * i + 1], y[4 * i + 2], y[4 * i + 3]];
                x[4 * i] = _mm256_shuffle_ps::<0b01_00_01_00>(p, r);
                x[4 * i + 1] = _mm256_shuffle_ps::<0b11_10_11_10>(p, r);
                x[4 * i + 2] = _mm256_shuffle_ps::<0b01_00_01_00>(q, s);
                x[4 * i + 3] = _mm256_shuffle_ps::<0b11_10_11_10>(q, s);
            }
            for i in 0..4 {
                y[i] = _mm256_permute2f128_ps::<0x20>(x[i], x[4 + i]);
                y[4 + i] = _mm256_permute2f128_ps::<0x31>(x[i], x[4 + i]);
            }
        }
        let [a, b, c, d, e, f, g, h] = y;
        [
            Floats(a),
            Floats(b),
            Floats(c),
            Floats(d),
            Floats(e),
            Floats(f),
            Floats(g),
            Floats(h),
        ]
    }

    #[inline(always)]
    fn splat_f64(self, x: f64) -> Doubles {
        // SAFETY: `self` proves that the processor has AVX2.
        Doubles([unsafe { _mm256_set1_pd(x) }; 2])
    }

    #[inline(always)]
    fn widen(self, from: &[f32; LANES]) -> Doubles {
        let all = self.load(from).0;
        // SAFETY: `self` proves that the processor has AVX2.
        let (low, high) = unsafe { (_mm256_castps256_ps128(all), _mm256_extractf128_ps::<1>(all)) };
        // SAFETY: the same.
        Doubles(unsafe { [_mm256_cvtps_pd(low), _mm256_cvtps_pd(high)] })
    }

    #[inline(always)]
    fn triple(self, [a, b, c]: [f32; 3]) -> Corners {
        // SAFETY: `self` proves that the processor has AVX2.
        Corners(unsafe { _mm256_cvtps_pd(_mm_setr_ps(a, b, c, 0.0)) })
    }

    #[inline(always)]
    fn splat_u32(self, x: u32) -> Counters {
        // SAFETY: `self` proves that the processor has AVX2.
        Counters(unsafe { _mm256_set1_epi32(x.cast_signed()) })
    }

    #[inline(always)]
    fn to_f32(self, numbers: Counters) -> Floats {
        // SAFETY: `self` proves that the processor has AVX2.
        Floats(unsafe { _mm256_cvtepi32_ps(numbers.0) })
    }
}

/// Applies an instruction to each register of some lanes, with those of other lanes.
macro_rules! each {
    ($lanes:ident, $instruction:expr, $a:expr, $b:expr, one) => {{
        // SAFETY: such lanes exist, so the processor has AVX2.
        $lanes(unsafe { $instruction($a.0, $b.0) })
    }};
    ($lanes:ident, $instruction:expr, $a:expr, $b:expr, two) => {{
        let ([a, b], [c, d]) = ($a.0, $b.0);
        // SAFETY: such lanes exist, so the processor has AVX2.
        $lanes(unsafe { [$instruction(a, c), $instruction(b, d)] })
    }};
}

/// Operators that are one instruction.
macro_rules! operator {
    ($lanes:ident, $count:ident: $($trait:ident $function:ident $instruction:ident),* $(,)?) => {$(
        impl $trait for $lanes {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                each!(Self, $instruction, self, other, $count)
            }
        }
    )*};
}

operator!(
    Floats, one:
    Add add _mm256_add_ps,
    Sub sub _mm256_sub_ps,
    Mul mul _mm256_mul_ps,
    Div div _mm256_div_ps,
);
operator!(
    Doubles, two:
    Add add _mm256_add_pd,
    Sub sub _mm256_sub_pd,
    Mul mul _mm256_mul_pd,
    Div div _mm256_div_pd,
);
operator!(FloatMask, one: BitAnd bitand _mm256_and_ps, BitOr bitor _mm256_or_ps);
operator!(DoubleMask, two: BitAnd bitand _mm256_and_pd, BitOr bitor _mm256_or_pd);

/// [`Number`] for both kinds of lanes.
macro_rules! numbers {
    ($lanes:ident, $mask:ident, $count:ident, $andnot:ident, $min:ident, $max:ident, $compare:ident, $xor:ident) => {
        impl Number for $lanes {
            type Mask = $mask;

            #[inline(always)]
            fn abs(self) -> Self {
                each!(Self, $andnot, Self::sign(), self, $count)
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                each!(Self, $min, self, other, $count)
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                each!(Self, $max, self, other, $count)
            }

            #[inline(always)]
            fn le(self, other: Self) -> $mask {
                each!($mask, $compare::<_CMP_LE_OQ>, self, other, $count)
            }

            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                each!($mask, $compare::<_CMP_LT_OQ>, self, other, $count)
            }

            #[inline(always)]
            fn ne(self, other: Self) -> $mask {
                each!($mask, $compare::<_CMP_NEQ_UQ>, self, other, $count)
            }

            #[inline(always)]
            fn eq(self, other: Self) -> $mask {
                each!($mask, $compare::<_CMP_EQ_OQ>, self, other, $count)
            }

            #[inline(always)]
            fn or(self, mask: $mask, other: Self) -> Self {
                self.blend(mask, other)
            }
        }

        impl Not for $mask {
            type Output = Self;

            #[inline(always)]
            fn not(self) -> Self {
                each!(Self, $xor, self, Self::all(), $count)
            }
        }
    };
}

numbers!(
    Floats,
    FloatMask,
    one,
    _mm256_andnot_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    _mm256_cmp_ps,
    _mm256_xor_ps
);
numbers!(
    Doubles,
    DoubleMask,
    two,
    _mm256_andnot_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    _mm256_cmp_pd,
    _mm256_xor_pd
);

impl Floats {
    /// The bit of the sign alone. Only for callers that have such lanes.
    #[inline(always)]
    fn sign() -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self(unsafe { _mm256_set1_ps(-0.0) })
    }

    #[inline(always)]
    fn blend(self, mask: FloatMask, other: Self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_blendv_ps(other.0, self.0, mask.0) })
    }
}

impl Doubles {
    /// The bit of the sign alone. Only for callers that have such lanes.
    #[inline(always)]
    fn sign() -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self([unsafe { _mm256_set1_pd(-0.0) }; 2])
    }

    /// Zero. Only for callers that have such lanes.
    #[inline(always)]
    fn zero() -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self([unsafe { _mm256_setzero_pd() }; 2])
    }

    #[inline(always)]
    fn blend(self, mask: DoubleMask, other: Self) -> Self {
        let ([a, b], [c, d], [m, n]) = (self.0, other.0, mask.0);
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { [_mm256_blendv_pd(c, a, m), _mm256_blendv_pd(d, b, n)] })
    }
}

impl FloatMask {
    /// All bits. Only for callers that have such lanes.
    #[inline(always)]
    fn all() -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self(unsafe { _mm256_set1_ps(f32::from_bits(u32::MAX)) })
    }
}

impl DoubleMask {
    /// All bits. Only for callers that have such lanes.
    #[inline(always)]
    fn all() -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self([unsafe { _mm256_set1_pd(f64::from_bits(u64::MAX)) }; 2])
    }
}

impl Mask for FloatMask {
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: such lanes exist, so the processor has AVX2.
        unsafe { _mm256_movemask_ps(self.0) }.cast_unsigned()
    }
}

impl Mask for DoubleMask {
    #[inline(always)]
    fn bits(self) -> u32 {
        let [a, b] = self.0;
        // SAFETY: such lanes exist, so the processor has AVX2.
        let (a, b) = unsafe { (_mm256_movemask_pd(a), _mm256_movemask_pd(b)) };
        (a | b << 4).cast_unsigned()
    }
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn run<T: Task<Avx2>>(simd: Avx2, task: T) -> T::Output {
    task.run(simd)
}

/// The identity, opaque to the compiler. Otherwise it fuses a load, a blend and a store to one address into a masked store, which
/// took a twentieth of the time of camera rays on Zen 3 (2026-11-25, five meshes).
#[target_feature(enable = "avx2")]
#[inline]
#[cfg_attr(miri, allow(unused_mut, reason = "Miri runs no assembly"))]
fn opaque(mut lanes: __m256) -> __m256 {
    #[cfg(not(miri))]
    // SAFETY: the block is empty.
    unsafe {
        std::arch::asm!("/* {0} */", inout(ymm_reg) lanes, options(pure, nomem, nostack, preserves_flags));
    }
    lanes
}

impl F32x8 for Floats {
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2 and FMA.
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        // SAFETY: such lanes exist, so the processor has AVX2, and room for eight.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) };
    }

    #[inline(always)]
    fn store_where(self, mask: FloatMask, to: &mut [f32; LANES]) {
        // SAFETY: such lanes exist, so the processor has AVX2, and eight numbers to read.
        let old = Self(unsafe { _mm256_loadu_ps(to.as_ptr()) });
        // SAFETY: the same.
        Self(unsafe { opaque(self.blend(mask, old).0) }).store(to);
    }

    #[inline(always)]
    fn put(mask: FloatMask, number: u32, to: &mut [u32; LANES]) {
        // SAFETY: such lanes exist, so the processor has AVX2.
        let new = Self(unsafe { _mm256_set1_ps(f32::from_bits(number)) });
        // The bits are only copied.
        new.store_where(mask, bytemuck::must_cast_mut(to));
    }

    #[inline(always)]
    fn low_bytes(self) -> [u8; LANES] {
        let bytes = bytemuck::must_cast::<__m256, [[u8; 4]; LANES]>(self.0);
        bytes.map(|[lowest, ..]| lowest)
    }
}

impl Counters {
    /// The same number in all lanes. Only for callers that have such lanes.
    #[inline(always)]
    fn splat(x: u32) -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self(unsafe { _mm256_set1_epi32(x.cast_signed()) })
    }
}

impl U32x8 for Counters {
    type Mask = FloatMask;

    #[inline(always)]
    fn count(self, mask: FloatMask) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2. True is -1.
        Self(unsafe { _mm256_sub_epi32(self.0, _mm256_castps_si256(mask.0)) })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        each!(Self, _mm256_add_epi32, self, other, one)
    }

    #[inline(always)]
    fn plus(self, number: u32) -> Self {
        self.add(Self::splat(number))
    }

    #[inline(always)]
    fn times(self, factor: u32) -> Self {
        each!(Self, _mm256_mullo_epi32, self, Self::splat(factor), one)
    }

    #[inline(always)]
    fn high_halves(self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_srli_epi32::<16>(self.0) })
    }

    #[inline(always)]
    fn is_zero(self) -> FloatMask {
        // SAFETY: such lanes exist, so the processor has AVX2.
        FloatMask(unsafe {
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, _mm256_setzero_si256()))
        })
    }

    #[inline(always)]
    fn to_array(self) -> [u32; LANES] {
        bytemuck::must_cast(self.0)
    }
}

impl Real for Doubles {
    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self([unsafe { _mm256_set1_pd(factor) }; 2]) * self
    }

    #[inline(always)]
    fn is_at_least_zero(self) -> DoubleMask {
        Self::zero().le(self)
    }

    #[inline(always)]
    fn is_at_most_zero(self) -> DoubleMask {
        self.le(Self::zero())
    }

    #[inline(always)]
    fn is_not_zero(self) -> DoubleMask {
        self.ne(Self::zero())
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        let [a, b] = self.0;
        Self([
            Corners(a).add_and_mask_bits(add, mask).0,
            Corners(b).add_and_mask_bits(add, mask).0,
        ])
    }
}

impl F64x8 for Doubles {
    #[inline(always)]
    fn narrow(self) -> [f32; LANES] {
        let [a, b] = self.0;
        let mut array = [0.0; LANES];
        // SAFETY: such lanes exist, so the processor has AVX2, and room for eight.
        unsafe {
            let all = _mm256_set_m128(_mm256_cvtpd_ps(b), _mm256_cvtpd_ps(a));
            _mm256_storeu_ps(array.as_mut_ptr(), all);
        }
        array
    }
}

operator!(
    Corners, one:
    Add add _mm256_add_pd,
    Sub sub _mm256_sub_pd,
    Mul mul _mm256_mul_pd,
);

impl Corners {
    /// The same number three times. Only for callers that have such lanes.
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: the caller has such lanes, so the processor has AVX2.
        Self(unsafe { _mm256_set1_pd(x) })
    }

    #[inline(always)]
    fn to_array(self) -> [f64; 3] {
        // SAFETY: such lanes exist, so the processor has AVX2.
        unsafe {
            let low = _mm256_castpd256_pd128(self.0);
            let high = _mm256_extractf128_pd::<1>(self.0);
            [
                _mm_cvtsd_f64(low),
                _mm_cvtsd_f64(_mm_unpackhi_pd(low, low)),
                _mm_cvtsd_f64(high),
            ]
        }
    }
}

impl Triple for Corners {
    type Number = f64;

    #[inline(always)]
    fn minus(self, number: f64) -> Self {
        self - Self::splat(number)
    }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        self * Self::splat(factor)
    }

    #[inline(always)]
    fn next(self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_permute4x64_pd::<0b11_00_10_01>(self.0) })
    }

    #[inline(always)]
    fn previous(self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_permute4x64_pd::<0b11_01_00_10>(self.0) })
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        let [a, b, c] = self.to_array();
        a + b + c
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        each!(Self, _mm256_max_pd, self, other, one)
    }

    #[inline(always)]
    fn max_element(self) -> f64 {
        let [a, b, c] = self.to_array();
        Number::max(Number::max(a, b), c)
    }

    #[inline(always)]
    fn is_one_sided(self) -> bool {
        const ALL: i32 = 0b111;
        // SAFETY: such lanes exist, so the processor has AVX2.
        let (above, below) = unsafe {
            let zero = _mm256_setzero_pd();
            (
                _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(self.0, zero)),
                _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, zero)),
            )
        };
        (above & ALL == ALL) | (below & ALL == ALL)
    }

    #[inline(always)]
    fn or(self, mask: bool, other: Self) -> Self {
        if mask { self } else { other }
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe {
            let (add, mask) = (
                _mm256_set1_epi64x(add.cast_signed()),
                _mm256_set1_epi64x(mask.cast_signed()),
            );
            let sum = _mm256_add_epi64(_mm256_castpd_si256(self.0), add);
            _mm256_castsi256_pd(_mm256_and_si256(sum, mask))
        })
    }

    #[inline(always)]
    fn with_first(self, first: f64) -> Self {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_blend_pd::<1>(self.0, _mm256_set1_pd(first)) })
    }

    #[inline(always)]
    fn over(self, divisor: f64) -> [f64; 3] {
        // SAFETY: such lanes exist, so the processor has AVX2.
        Self(unsafe { _mm256_div_pd(self.0, _mm256_set1_pd(divisor)) }).to_array()
    }
}
