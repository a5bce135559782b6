//! The quality of decisions: the structure chosen for a budget of rays, compared with the best one.

use kd_select::paper::{self, EPSILON, Hierarchy};
use kd_select::sample::HARDLY_ANY;
use kd_select::{Choice, Estimator, RayScheme, Structure as Kind, Times};

use super::measure::Measured;
use super::table::{KD, critical_rays, name};
use super::{of_scheme, rays_text};
use crate::view::{Goal, Row, Table, arithmetic_mean, maximum, minimum};

/// Budgets of each scene, from a tenth of its true break-even to ten times that.
const BUDGETS: i32 = 9;
/// The factor over the best total that counts as good.
const AS_GOOD: f64 = 1.1;

/// A rule of decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    /// The least total by estimates from a grid that is always tried, calibrated on this machine.
    Widened,
    /// The rule of `Accel::auto_by`, calibrated on this machine: the grid is tried only where it is mostly best; a tried grid
    /// need not be built again.
    Thrifty,
    /// The rule of `Accel::auto`: the same by the calibration of another machine, of which only ratios count.
    Foreign,
    /// The paper's eight steps.
    Paper,
    /// Havran et al.: a grid where it is regular.
    Regular,
    /// One structure always.
    Always(Kind),
}

const RULES: [Rule; 9] = [
    Rule::Widened,
    Rule::Thrifty,
    Rule::Foreign,
    Rule::Paper,
    Rule::Regular,
    Rule::Always(Kind::Grid),
    Rule::Always(Kind::Lazy),
    Rule::Always(Kind::Fast),
    Rule::Always(Kind::Balanced),
];

impl Rule {
    fn name(self) -> String {
        match self {
            Self::Widened => "chosen among all".into(),
            Self::Thrifty => "as Accel::auto_by does".into(),
            Self::Foreign => "as Accel::auto does".into(),
            Self::Paper => "the paper's rule".into(),
            Self::Regular => "grid if σ ≤ 2".into(),
            Self::Always(kind) => format!("always {kind}"),
        }
    }
}

/// The choice of a rule for a budget, compared with the best.
#[derive(Clone, Debug)]
struct Case {
    scene: String,
    rays: f64,
    chosen: Kind,
    best: Kind,
    /// The total of the one over that of the other.
    over_best: f64,
    /// The same with the cost of the decision: the sample of rays, and the grid if it is not kept.
    over_best_all_paid: f64,
    /// The same, compared with the better of the grid and the kd-tree of the table.
    over_best_of_two: f64,
}

/// All cases of each rule.
#[derive(Clone, Debug)]
pub(super) struct Decisions {
    of_rules: Vec<Vec<Case>>,
    /// Scenes whose rays are as fast in the grid as in the kd-tree.
    without_break_even: usize,
}

impl Decisions {
    /// By scene, with all scenes of its family left out of the calibration.
    pub(super) fn of(measured: &[Measured], scheme: RayScheme) -> Self {
        let scenes = of_scheme(measured, scheme);
        let mut decisions = Self {
            of_rules: vec![Vec::new(); RULES.len()],
            without_break_even: 0,
        };
        for scene in &scenes {
            let Some(break_even) = critical_rays(scene).filter(|rays| *rays > 0.0) else {
                decisions.without_break_even += 1;
                continue;
            };
            let others: Vec<&Measured> = scenes
                .iter()
                .filter(|other| other.family != scene.family)
                .copied()
                .collect();
            if others.is_empty() {
                continue;
            }
            let estimators = [true, false].map(|is_same_machine| {
                Estimator::fit(others.iter().map(|other| &other.scene), is_same_machine)
            });
            for budget in 0..BUDGETS {
                let rays = break_even
                    * 10.0_f64.powf(f64::from(2 * budget) / f64::from(BUDGETS - 1) - 1.0);
                for (cases, rule) in decisions.of_rules.iter_mut().zip(RULES) {
                    let (chosen, tries_grid) = choose(rule, scene, &others, &estimators, rays);
                    cases.push(Case::new(scene, rays, chosen, tries_grid));
                }
            }
        }
        decisions
    }

    /// The worst case of the choice among all.
    pub(super) fn worst(&self, scheme: RayScheme) -> String {
        let cases = &self.of_rules[0];
        let worst = cases
            .iter()
            .max_by(|a, b| a.over_best.total_cmp(&b.over_best));
        let Some(worst) = worst else {
            return format!("{} rays: nothing to decide", name(scheme));
        };
        let never: Vec<&str> = Kind::ALL
            .into_iter()
            .filter(|kind| cases.iter().all(|case| case.best != *kind))
            .map(Kind::name)
            .collect();
        format!(
            "{} rays: worst {}, {} rays: {} chosen, {} is best, {:.2} times its total; never the best: {}; {} scenes have no \
             break-even",
            name(scheme),
            worst.scene,
            rays_text(Some(worst.rays)),
            worst.chosen,
            worst.best,
            worst.over_best,
            if never.is_empty() {
                "none".to_owned()
            } else {
                never.join(", ")
            },
            self.without_break_even,
        )
    }
}

impl Case {
    fn new(scene: &Measured, rays: f64, chosen: Kind, tries_grid: bool) -> Self {
        let total = |kind: Kind| scene.times(kind).total(rays);
        let kinds = scene.scene.times.keys().copied();
        let best = kinds.min_by(|a, b| total(*a).total_cmp(&total(*b)));
        let best = best.expect("some structures");
        let grid = scene.times(Kind::Grid).build_seconds;
        let tried = match (tries_grid, chosen) {
            (false, _) => 0.0,
            (true, Kind::Grid) => scene.tried.seconds(),
            (true, _) => scene.tried.seconds() + grid,
        };
        Self {
            scene: scene.scene.scene.clone(),
            rays,
            chosen,
            best,
            over_best: total(chosen) / total(best),
            over_best_all_paid: (total(chosen) + tried) / total(best),
            over_best_of_two: total(chosen) / total(Kind::Grid).min(total(KD)),
        }
    }
}

/// The choice of a rule, and whether it tries a grid for it.
fn choose(
    rule: Rule,
    scene: &Measured,
    others: &[&Measured],
    [here, elsewhere]: &[Estimator; 2],
    rays: f64,
) -> (Kind, bool) {
    let features = &scene.sampled_features();
    let grid = scene.sampled_grid();
    let thrifty = |estimator: &Estimator| {
        if rays <= HARDLY_ANY as f64 {
            return (Kind::Grid, false);
        }
        if !estimator.may_be_few(features.triangles, rays) {
            let chosen = least(&estimator.by_size(features.triangles), rays);
            return (chosen, false);
        }
        let mut costs = estimator.estimate(features, &grid);
        costs[0].1.build_seconds = 0.0;
        (least(&costs, rays), true)
    };
    let chosen = match rule {
        Rule::Thrifty => return thrifty(here),
        Rule::Foreign => return thrifty(elsewhere),
        Rule::Always(kind) => return (kind, false),
        Rule::Widened => least(&here.estimate(features, &grid), rays),
        Rule::Paper => {
            let calibration = others
                .iter()
                .map(|other| (other.triangles(), other.times(KD)));
            let hierarchy = Hierarchy::estimate(calibration, features.triangles);
            let hierarchy = hierarchy.expect("other scenes are measured");
            let decision = paper::decide(grid.ray_seconds, &hierarchy, rays, EPSILON);
            if decision.keeps_grid() {
                Kind::Grid
            } else {
                KD
            }
        }
        Rule::Regular if paper::is_regular(features.sigma) => Kind::Grid,
        Rule::Regular => KD,
    };
    (chosen, true)
}

fn least(costs: &[(Kind, Times)], rays: f64) -> Kind {
    let choice = Choice::among(costs, rays);
    choice.expect("some structures").structure
}

/// The share of good decisions of each rule, and its losses, by kind of rays.
pub(super) fn table(decisions: &[Decisions; 2]) -> Table {
    let mut rows = Vec::new();
    for (number, rule) in RULES.into_iter().enumerate() {
        let mut add = |what: &str, goal, over: fn(&Case) -> f64| {
            let of_cases = |of: &dyn Fn(&[f64]) -> f64| -> Vec<Option<f64>> {
                let values = decisions.iter().map(|decisions| {
                    let ratios: Vec<f64> = decisions.of_rules[number].iter().map(over).collect();
                    (!ratios.is_empty()).then(|| of(&ratios))
                });
                values.collect()
            };
            let name = |figure: &str| format!("{}, over {what}: {figure}", rule.name());
            let within = of_cases(&|ratios| {
                let good = ratios.iter().filter(|ratio| **ratio <= AS_GOOD).count();
                100.0 * good as f64 / ratios.len() as f64
            });
            rows.push(Row::new(name("within 10 %, %"), goal, within, minimum));
            let mean = of_cases(&arithmetic_mean);
            rows.push(Row::new(name("mean"), Goal::None, mean, maximum));
            let worst = of_cases(&maximum);
            rows.push(Row::new(name("worst"), Goal::None, worst, maximum));
        };
        let goal = match rule {
            Rule::Widened => Goal::AtLeast(90.0),
            _ => Goal::None,
        };
        add("the best", goal, |case| case.over_best);
        if matches!(rule, Rule::Widened | Rule::Thrifty | Rule::Foreign) {
            let what = "the best, decision included";
            add(what, Goal::None, |case| case.over_best_all_paid);
        }
        if rule == Rule::Paper {
            add("the better of two", Goal::None, |case| {
                case.over_best_of_two
            });
        }
    }
    Table {
        library: String::new(),
        scenes: vec!["random".into(), "path-traced".into()],
        rows,
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::lawful_scenes;
    use super::*;

    #[test]
    fn scenes_that_follow_the_laws_are_decided_right() {
        let schemes = [RayScheme::Random, RayScheme::Path];
        let decisions = schemes.map(|scheme| Decisions::of(&lawful_scenes(scheme), scheme));
        let table = table(&decisions);
        let value = |name: &str| table.row(name).of_all();
        assert!(
            value("chosen among all, over the best: within 10 %, %") > 95.0,
            "{table}"
        );
        // It loses a little between the break-even without the cost of the grid and that of totals.
        let paper = value("the paper's rule, over the better of two: worst");
        assert!(paper < 1.1, "{table}");
        assert!(
            value("always balanced, over the best: worst") > 3.0,
            "{table}"
        );
        assert!(
            value("always grid, over the best: within 10 %, %") < 60.0,
            "{table}"
        );
        let in_vain = value("chosen among all, over the best, decision included: mean");
        assert!(
            in_vain > value("chosen among all, over the best: mean"),
            "{table}"
        );
        let worst = decisions[0].worst(RayScheme::Random);
        assert!(
            worst.starts_with("random rays: worst ") && worst.contains("lazy"),
            "{worst}"
        );
    }
}
