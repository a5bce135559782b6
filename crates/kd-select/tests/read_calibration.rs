//! Damaged calibration files give a typed error or a sound calibration.

use std::collections::BTreeMap;

use kd_oracle::effort;
use kd_select::{
    Calibration, CalibrationError, Choice, Estimator, Features, MeasuredScene, Opening, RayScheme,
    Structure, Times,
};
use proptest::prelude::*;

/// A calibration of this machine with every field of a file.
fn example() -> Calibration {
    let scene = |scene: &str, rays, triangles: u32| {
        let size = f64::from(triangles);
        let lazy = Times {
            opening: Some(Opening {
                seconds: 2e-7 * size,
                rays: 0.3 * size,
            }),
            ..Times::new(1e-8 * size, 4e-7)
        };
        MeasuredScene {
            scene: scene.into(),
            rays,
            features: Features {
                triangles: triangles.into(),
                refs_per_triangle: 2.625,
                sigma: 4.75,
                sparseness: 0.875,
                hit_share: 0.375,
            },
            times: BTreeMap::from([
                (Structure::Grid, Times::new(5e-8 * size, 1.25e-6)),
                (Structure::Best, Times::new(1e-6 * size, 2.5e-7)),
                (Structure::Lazy, lazy),
            ]),
        }
    };
    let scenes = vec![
        scene("bunny", RayScheme::Random, 69_451),
        scene("bunny", RayScheme::Path, 69_451),
        scene("teapot", RayScheme::Path, 9408),
    ];
    Calibration::new(1, "2026-11-28".into(), "0123abcd".into(), scenes)
}

/// Reads a text and checks the guarantees of the result. Makes decisions from it.
#[track_caller]
fn check(text: &str) -> Result<Calibration, CalibrationError> {
    let read = Calibration::read(text);
    assert_eq!(Calibration::read(text), read, "the same twice: {text}");
    match &read {
        Ok(calibration) => {
            assert_eq!(calibration.check(), Ok(()), "{text}");
            let again = Calibration::read(&calibration.to_json());
            assert_eq!(again.as_ref(), Ok(calibration), "written and read: {text}");
            for scheme in [RayScheme::Random, RayScheme::Path] {
                let estimator = Estimator::of(calibration, scheme);
                for scene in &calibration.scenes {
                    let grid = scene.times[&Structure::Grid];
                    let costs = estimator.estimate(&scene.features, &grid);
                    assert_eq!(costs[0], (Structure::Grid, grid), "as it is: {text}");
                    assert!(Choice::among(&costs, 1e6).is_some(), "the grid: {text}");
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty(), "{text}"),
    }
    read
}

/// The ranges of numbers in a text.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = text.as_bytes();
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.e".contains(byte);
    let mut numbers = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let len = bytes[at..].iter().take_while(|b| is_of_number(b)).count();
        if len > 0 && bytes[..at].ends_with(b": ") {
            numbers.push(at..at + len);
        }
        at += len.max(1);
    }
    numbers
}

const BAD_NUMBERS: [&str; 14] = [
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e999",
    "5e-324",
    "1e-400",
    "NaN",
    "Infinity",
    "18446744073709551616",
    "4294967296",
    "null",
    "\"7\"",
];

#[test]
fn the_example_is_right() {
    assert_eq!(check(&example().to_json()), Ok(example()), "as it was");
}

/// Replaces every number of a file, in turn, by impossible numbers.
#[test]
fn impossible_numbers_are_refused() {
    let text = example().to_json();
    let numbers = numbers(&text);
    assert_eq!(numbers.len(), 2 + 3 * 13, "format, threads, and of scenes");
    let (mut right, mut malformed, mut of_scenes, mut of_format) = (0, 0, 0, 0);
    for place in numbers {
        for bad in BAD_NUMBERS {
            let mut text = text.clone();
            text.replace_range(place.clone(), bad);
            match check(&text) {
                Ok(_) => right += 1,
                Err(CalibrationError::Malformed(_)) => malformed += 1,
                Err(CalibrationError::Scene { .. }) => of_scenes += 1,
                Err(CalibrationError::Format { .. }) => of_format += 1,
                Err(other) => panic!("{bad}: {other}"),
            }
        }
    }
    assert!(right > 50, "{right}: a large number may be one");
    assert!(malformed > 200, "{malformed}: some are no numbers");
    assert!(of_scenes > 50, "{of_scenes}: some are none of a scene");
    assert!(of_format > 0, "{of_format}");
}

#[test]
fn truncated_files_are_refused() {
    let text = example().to_json();
    for end in 0..text.trim_end().len() {
        let refused = check(&text[..end]).expect_err("half a file");
        let is_malformed = matches!(refused, CalibrationError::Malformed(_));
        assert!(is_malformed, "{end}: {refused}");
    }
}

#[test]
fn a_wrong_byte_does_no_harm() {
    let bytes = example().to_json().into_bytes();
    let (mut right, mut refused) = (0, 0);
    for at in 0..bytes.len() {
        for flipped in [1, 4, 16, 64, 128] {
            let mut bytes = bytes.clone();
            bytes[at] ^= flipped;
            match check(&String::from_utf8_lossy(&bytes)) {
                Ok(_) => right += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(right > 100, "{right}: in names and digits");
    assert!(refused > 1000, "{refused}");
}

/// A change of a text. Positions wrap around at its end.
#[derive(Clone, Debug)]
enum Damage {
    Flip(usize, u8),
    Cut(usize),
    Number(usize, &'static str),
    /// A copy of a range, inserted elsewhere.
    Repeat(usize, usize, usize),
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let place = |at: usize, len: usize| at % len.max(1);
        match *self {
            Self::Flip(at, bits) if !bytes.is_empty() => {
                let at = place(at, bytes.len());
                bytes[at] ^= bits;
            }
            Self::Flip(..) => {}
            Self::Cut(at) => bytes.truncate(place(at, bytes.len() + 1)),
            Self::Number(number, with) => {
                let mut text = String::from_utf8_lossy(bytes).into_owned();
                let numbers = numbers(&text);
                if !numbers.is_empty() {
                    let place = place(number, numbers.len());
                    text.replace_range(numbers[place].clone(), with);
                }
                *bytes = text.into_bytes();
            }
            Self::Repeat(from, len, to) => {
                let from = place(from, bytes.len());
                let part = bytes[from..].iter().take(len).copied();
                let part: Vec<u8> = part.collect();
                let to = place(to, bytes.len() + 1);
                bytes.splice(to..to, part);
            }
        }
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = 0..10_000_usize;
    prop_oneof![
        3 => (at.clone(), 1..=u8::MAX).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        1 => at.clone().prop_map(Damage::Cut),
        6 => (at.clone(), prop::sample::select(&BAD_NUMBERS[..]))
            .prop_map(|(number, with)| Damage::Number(number, with)),
        2 => (at.clone(), 0..400_usize, at).prop_map(|(from, len, to)| Damage::Repeat(from, len, to)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(200, 2000)))]

    #[test]
    fn any_damage_to_a_file(damages in prop::collection::vec(damage(), 1..5)) {
        let mut bytes = example().to_json().into_bytes();
        for damage in &damages {
            damage.apply(&mut bytes);
        }
        let _ = check(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn any_numbers_in_all_places(with in prop::collection::vec("[-]?[1-9](\\.[0-9]{1,3})?e[-+]?[0-9]{1,3}|[0-9]{1,12}", 41)) {
        let mut text = example().to_json();
        let places = numbers(&text);
        // From the end, so that places stay where they are; the format is left.
        for (place, with) in places.into_iter().zip(&with).skip(1).rev() {
            text.replace_range(place, with);
        }
        let _ = check(&text);
    }
}
