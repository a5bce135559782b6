//! A search for inputs with large errors, for tests of bounds.

use kd_oracle::effort;
use kd_oracle::rng::Rng;
use kd_simd::{F32x8, LANES};

/// The largest value found: random cases are varied, and what increases the value is kept.
pub(crate) fn largest<C: Copy>(
    random: impl Fn(&mut Rng) -> C,
    varied: impl Fn(C, &mut Rng) -> C,
    value: impl Fn(&C) -> f64,
) -> f64 {
    let mut rng = Rng(5);
    let mut most = 0.0;
    for _ in 0..effort::count(12, 60) {
        let mut case = random(&mut rng);
        let mut largest = value(&case);
        for number in 0..effort::count(800, 2000) {
            let other = if number < 20 {
                random(&mut rng)
            } else {
                varied(case, &mut rng)
            };
            let found = value(&other);
            if found >= largest {
                (case, largest) = (other, found);
            }
        }
        most = f64::max(most, largest);
    }
    most
}

/// To a number beside it, or one that differs by a part of `size`.
pub(crate) fn vary(x: &mut f32, size: f32, rng: &mut Rng) {
    *x = match rng.below(4) {
        0 => x.next_up(),
        1 => x.next_down(),
        2 => *x + 0.1 * size * rng.between(-1.0, 1.0),
        _ => *x + 1e-3 * size * rng.between(-1.0, 1.0),
    };
}

pub(crate) fn in_memory<F: F32x8>(x: F) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    x.store(&mut lanes);
    lanes
}
