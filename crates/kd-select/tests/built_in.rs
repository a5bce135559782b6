//! The built-in calibration is what its generator writes.

#[allow(dead_code, reason = "the example has a main function of its own")]
#[path = "../examples/built_in.rs"]
mod generator;

use kd_select::Calibration;

#[test]
fn the_source_is_generated() {
    let source = generator::source_of(&Calibration::built_in()).expect("a text");
    let file = include_str!("../src/built_in/data.rs");
    assert!(source == file, "src/built_in/data.rs was changed by hand");
}
