//! Figures 1 and 2: errors of the estimate of R_C, by the number of scenes of its calibration.

use kd_select::paper::{EPSILON, Hierarchy};
use kd_select::{Estimator, RayScheme, Structure as Kind};

use super::measure::Measured;
use super::of_scheme;
use super::table::{KD, name};
use crate::plots::{Axis, XyPlot};
use crate::sampling::Random;

/// The widened estimate, which takes longer, is fitted for a fraction 1 / `FEWER` of the combinations.
const FEWER: usize = 20;

/// Where the estimated rays of the kd-tree are hardly faster than the grid's, the estimate of R_C is unbounded, and so would be a
/// mean with it. Estimates of more than `FAR_OFF` times R_C are counted, and left out of means.
const FAR_OFF: f64 = 10.0;

/// Errors in per cent of R_C, for calibrations of one scene, of two and more.
#[derive(Clone, Debug)]
pub(super) struct Estimates {
    scheme: RayScheme,
    /// The paper's estimate: its mean error, and the mean of the sizes of its errors.
    paper: Vec<[f64; 2]>,
    widened: Vec<[f64; 2]>,
    /// The share of the paper's estimates and of the widened ones, in per cent, that are beyond [`FAR_OFF`].
    missed: [f64; 2],
}

/// A sum of errors.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    signed: f64,
    sizes: f64,
    count: f64,
    missed: f64,
}

impl Errors {
    fn add(&mut self, estimate: f64, truth: f64) {
        if estimate > FAR_OFF * truth {
            self.missed += 1.0;
            return;
        }
        let error = 100.0 * (estimate - truth) / truth;
        self.signed += error;
        self.sizes += error.abs();
        self.count += 1.0;
    }

    /// Adds the counts of another calibration.
    fn add_counts(&mut self, others: &Self) {
        self.missed += others.missed;
        self.count += others.count;
    }

    /// The share that is left out, in per cent.
    fn missed_share(&self) -> f64 {
        100.0 * self.missed / (self.missed + self.count).max(1.0)
    }

    fn means(&self) -> [f64; 2] {
        let count = self.count.max(1.0);
        [self.signed / count, self.sizes / count]
    }
}

impl Estimates {
    /// For random combinations of the scenes: some to calibrate, the others to estimate. Scenes whose grid is as fast for rays
    /// have no R_C and are left out.
    pub(super) fn of(measured: &[Measured], scheme: RayScheme, combinations: usize) -> Self {
        let mut scenes = of_scheme(measured, scheme);
        scenes.retain(|scene| once_built(scene).is_some());
        let mut random = Random::new(1);
        let (mut paper, mut widened) = (Vec::new(), Vec::new());
        let mut all = [Errors::default(); 2];
        for calibrated in 1..scenes.len() {
            let (mut simple, mut wide) = (Errors::default(), Errors::default());
            for combination in 0..combinations {
                for place in 0..calibrated {
                    let other = place + random.below(scenes.len() - place);
                    scenes.swap(place, other);
                }
                let (known, unknown) = scenes.split_at(calibrated);
                let estimator = (combination % FEWER == 0)
                    .then(|| Estimator::fit(known.iter().map(|known| &known.scene), true));
                for scene in unknown {
                    let truth = once_built(scene).expect("only such are left");
                    let estimate =
                        paper_estimate(known, scene).critical_rays(ray_of_grid(scene), EPSILON);
                    simple.add(estimate, truth);
                    if let Some(estimator) = &estimator {
                        wide.add(widened_estimate(estimator, scene), truth);
                    }
                }
            }
            paper.push(simple.means());
            widened.push(wide.means());
            all[0].add_counts(&simple);
            all[1].add_counts(&wide);
        }
        Self {
            scheme,
            paper,
            widened,
            missed: all.map(|errors| errors.missed_share()),
        }
    }

    /// In words.
    pub(super) fn summary(&self, scheme: RayScheme) -> String {
        let (Some(paper), Some(widened)) = (self.paper.last(), self.widened.last()) else {
            return format!("{} rays: too few scenes to estimate from", name(scheme));
        };
        let paper_says = match scheme {
            RayScheme::Random => "about 25 % too high",
            RayScheme::Path => "off by about 30 %, mostly too low",
        };
        format!(
            "{} rays, R_C estimated from {} scenes for one more: off by {:.0} % (mean error {:+.0} %; the paper: {paper_says}), \
             with the grid's statistics by {:.0} % ({:+.0} %); {:.1} % of all of the former and {:.1} % of the latter are more than ten \
             times R_C, and in no mean",
            name(scheme),
            self.paper.len(),
            paper[1],
            paper[0],
            widened[1],
            widened[0],
            self.missed[0],
            self.missed[1],
        )
    }
}

fn ray_of_grid(scene: &Measured) -> f64 {
    scene.times(Kind::Grid).ray_seconds
}

fn paper_estimate(known: &[&Measured], scene: &Measured) -> Hierarchy {
    let calibration = known
        .iter()
        .map(|known| (known.triangles(), known.times(KD)));
    Hierarchy::estimate(calibration, scene.triangles()).expect("at least one scene is known")
}

fn widened_estimate(estimator: &Estimator, scene: &Measured) -> f64 {
    let grid = scene.times(Kind::Grid);
    let estimates = estimator.estimate(&scene.scene.features, grid);
    let found = estimates.iter().find(|(kind, _)| *kind == KD);
    let (_, times) = found.expect("it was measured on every scene");
    let hierarchy = Hierarchy {
        build_seconds: times.build_seconds,
        ray_seconds: times.ray_seconds,
    };
    hierarchy.critical_rays(grid.ray_seconds, EPSILON)
}

/// The R_C of the decision, without the cost of the grid, as measured.
fn once_built(scene: &Measured) -> Option<f64> {
    let kd = scene.times(KD);
    let measured = Hierarchy {
        build_seconds: kd.build_seconds,
        ray_seconds: kd.ray_seconds,
    };
    let is_faster = kd.ray_seconds < ray_of_grid(scene);
    is_faster.then(|| measured.critical_rays(ray_of_grid(scene), EPSILON))
}

/// Both figures as one.
pub(super) fn to_svg(estimates: &[Estimates; 2]) -> anyhow::Result<String> {
    let mut lines = Vec::new();
    for of_scheme in estimates {
        // Short, since names are beside the plot.
        let rays = match of_scheme.scheme {
            RayScheme::Random => "random",
            RayScheme::Path => "paths",
        };
        let line = |what: &str, values: &[[f64; 2]], which: usize| {
            let points = (1..)
                .zip(values)
                .map(|(scenes, errors)| (f64::from(scenes), errors[which]));
            (format!("{rays}, {what}"), points.collect::<Vec<_>>())
        };
        lines.push(line("error", &of_scheme.paper, 0));
        lines.push(line("|error|", &of_scheme.paper, 1));
        lines.push(line("widened |error|", &of_scheme.widened, 1));
    }
    let plot = XyPlot {
        x_axis: "scenes of the calibration",
        y_axis: "error of the estimate of R_C, %",
        scale: Axis::Linear,
        lines,
        points: Vec::new(),
    };
    plot.to_svg()
}

#[cfg(test)]
mod tests {
    use kd_select::Times;

    use super::super::measure::lawful_scenes;
    use super::*;

    #[test]
    fn scenes_that_follow_the_laws_are_estimated_right() {
        let scenes = lawful_scenes(RayScheme::Path);
        let estimates = Estimates::of(&scenes, RayScheme::Path, 40);
        assert_eq!(estimates.paper.len(), scenes.len() - 1, "from one scene on");
        for [signed, size] in &estimates.paper {
            assert!(signed.abs() < 1e-6 && *size < 1e-6, "{estimates:?}");
        }
        assert_eq!(estimates.missed, [0.0; 2], "{estimates:?}");
        let svg = to_svg(&[estimates.clone(), estimates]).expect("drawn");
        assert!(svg.contains("paths, widened"), "the names of its lines");
        let none = Estimates::of(&[], RayScheme::Random, 40).summary(RayScheme::Random);
        assert!(none.contains("too few scenes"), "{none}");
    }

    /// Some scenes have far better trees than the laws predict: estimates find no R_C there.
    #[test]
    fn what_is_left_out_of_means_is_counted() {
        let mut scenes = lawful_scenes(RayScheme::Path);
        for measured in scenes.iter_mut().step_by(6) {
            let times = &mut measured.scene.times;
            let law = times[&KD].ray_seconds;
            times.insert(Kind::Grid, Times::new(1e-3, 0.9 * law));
            times.insert(KD, Times::new(1e-2, 0.1 * law));
        }
        let estimates = Estimates::of(&scenes, RayScheme::Path, 40);
        let [paper, widened] = estimates.missed;
        assert!(paper > 0.0 && widened > 0.0, "{paper} and {widened} %");
        assert_ne!(paper, widened, "each has a number of its own");
        let summary = estimates.summary(RayScheme::Path);
        let expected = format!(
            "{paper:.1} % of all of the former and {widened:.1} % of the latter are more than ten times R_C, and in no mean"
        );
        assert!(summary.ends_with(&expected), "{summary}");
    }

    #[test]
    fn errors_have_a_sign_and_a_size() {
        let mut errors = Errors::default();
        for estimate in [150.0, 50.0, 110.0, f64::INFINITY, 1001.0] {
            errors.add(estimate, 100.0);
        }
        let [signed, size] = errors.means();
        assert!(
            (signed - 10.0 / 3.0).abs() < 1e-9 && (size - 110.0 / 3.0).abs() < 1e-9,
            "{errors:?}"
        );
        assert_eq!(errors.missed, 2.0, "beyond all bounds");
        assert_eq!(errors.missed_share(), 40.0, "two of five");
        let mut twice = errors;
        twice.add_counts(&errors);
        assert_eq!((twice.missed, twice.count), (4.0, 6.0), "{twice:?}");
        assert_eq!(Errors::default().missed_share(), 0.0, "none of none");
    }
}
