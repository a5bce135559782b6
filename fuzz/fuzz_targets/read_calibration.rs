//! Fuzzes the reader of calibrations. A valid calibration is written, read again, and used for a choice per scene.
//!
//! `<cpu>` and `<level>` in the input are replaced by those of this machine; otherwise nearly every input would be refused as
//! foreign.
#![no_main]

use kd_select::{Calibration, Choice, Estimator, Machine, RayScheme, Structure};

libfuzzer_sys::fuzz_target!(|text: &str| {
    let here = Machine::here();
    let text = text
        .replace("<cpu>", &here.cpu)
        .replace("<level>", &here.level);
    match Calibration::read(&text) {
        Ok(calibration) => {
            assert_eq!(
                calibration.check(),
                Ok(()),
                "a calibration that was read passes its check"
            );
            let again = Calibration::read(&calibration.to_json());
            assert_eq!(
                again,
                Ok(calibration.clone()),
                "a written calibration reads back unchanged"
            );
            for scheme in [RayScheme::Random, RayScheme::Path] {
                let estimator = Estimator::of(&calibration, scheme);
                for scene in &calibration.scenes {
                    let grid = scene.times[&Structure::Grid];
                    let costs = estimator.estimate(&scene.features, &grid);
                    assert!(
                        Choice::among(&costs, 1e6).is_some(),
                        "at least the grid is a choice"
                    );
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty(), "an error has a text"),
    }
});
