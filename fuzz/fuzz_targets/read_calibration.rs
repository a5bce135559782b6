//! Any text through the reader of calibrations; what is read is decided from once. `<cpu>` and `<level>` in it stand for this
//! machine, of which it would hardly be otherwise.
#![no_main]

use kd_select::{Calibration, Choice, Estimator, Machine, RayScheme, Structure};

libfuzzer_sys::fuzz_target!(|text: &str| {
    let here = Machine::here();
    let text = text
        .replace("<cpu>", &here.cpu)
        .replace("<level>", &here.level);
    match Calibration::read(&text) {
        Ok(calibration) => {
            assert_eq!(calibration.check(), Ok(()), "what is read is right");
            let again = Calibration::read(&calibration.to_json());
            assert_eq!(again, Ok(calibration.clone()), "written and read again");
            for scheme in [RayScheme::Random, RayScheme::Path] {
                let estimator = Estimator::of(&calibration, scheme);
                for scene in &calibration.scenes {
                    let grid = scene.times[&Structure::Grid];
                    let costs = estimator.estimate(&scene.features, &grid);
                    assert!(Choice::among(&costs, 1e6).is_some(), "the grid at least");
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty(), "an error says what is wrong"),
    }
});
