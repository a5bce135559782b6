//! Trees built for models around the fitted one, against the tree built for that one.

use std::collections::BTreeMap;

use clap::ValueEnum as _;
use kd::{CostModel, KdTree};
use serde::Serialize;

use super::{Workload, build, seconds, title, with};
use crate::rays::RayKind;

/// The bonus that the fitted model is compared at: the fit says nothing about it.
const EMPTY_BONUS: f32 = 0.8;
/// Around the fitted K_I.
const FACTORS: [f32; 6] = [0.25, 0.5, 1.0, 1.5, 2.0, 4.0];
const BONUSES: [f32; 4] = [0.5, 0.7, 0.9, 1.0];

/// One model against the fitted one.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    pub(super) intersect: f32,
    pub(super) empty_bonus: f32,
    /// Time over that of the fitted model, by kind of ray: the geometric mean over scenes.
    pub(super) time: BTreeMap<String, f64>,
    /// References over those of the fitted model, geometric mean over scenes.
    pub(super) refs: f64,
}

/// Traces all groups in the tree of each model and, in turns, in that of the fitted one.
pub(super) fn compare(
    workloads: &[Workload],
    intersect: f64,
    samples: usize,
) -> anyhow::Result<Vec<Comparison>> {
    #[allow(clippy::cast_possible_truncation, reason = "a model has f32 values")]
    let fitted = with(intersect as f32, EMPTY_BONUS);
    let by_factor = FACTORS.map(|factor| with(factor * fitted.intersect, EMPTY_BONUS));
    let by_bonus = BONUSES.map(|bonus| with(fitted.intersect, bonus));
    let models: Vec<CostModel> = by_factor.into_iter().chain(by_bonus).collect();
    let mut ratios: Vec<BTreeMap<String, Vec<f64>>> = vec![BTreeMap::new(); models.len()];
    let mut refs = vec![Vec::new(); models.len()];
    for workload in workloads {
        let baseline = build(&workload.scene, fitted)?;
        for (index, model) in models.iter().enumerate() {
            let tree = build(&workload.scene, *model)?;
            refs[index].push(tree.tree().refs().len() as f64 / baseline.tree().refs().len() as f64);
            for (kind, ratio) in workload.ratios(&tree, &baseline, samples) {
                ratios[index].entry(title(kind)).or_default().push(ratio);
            }
        }
    }
    let compared = models.iter().zip(ratios).zip(refs);
    let comparison = |((model, ratios), refs): ((&CostModel, BTreeMap<_, Vec<f64>>), Vec<f64>)| {
        let means = ratios
            .into_iter()
            .map(|(kind, of)| (kind, geometric_mean(&of)));
        Comparison {
            intersect: model.intersect,
            empty_bonus: model.empty_bonus,
            time: means.collect(),
            refs: geometric_mean(&refs),
        }
    };
    Ok(compared.map(comparison).collect())
}

impl Workload {
    /// The time of each kind of rays over the baseline's. The two take turns, and of each group the fastest pass counts:
    /// what interrupts a pass on a busy machine does not interrupt the same group every time.
    fn ratios(&self, tree: &KdTree, baseline: &KdTree, samples: usize) -> Vec<(RayKind, f64)> {
        let with_rays = self.groups.iter().filter(|(_, groups)| !groups.is_empty());
        let ratio = |(kind, groups): &(RayKind, Vec<Vec<_>>)| {
            let mut fastest = [(); 2].map(|()| vec![f64::INFINITY; groups.len()]);
            for _ in 0..samples {
                for (fastest, tree) in fastest.iter_mut().zip([baseline, tree]) {
                    for (fastest, rays) in fastest.iter_mut().zip(groups) {
                        *fastest = fastest.min(seconds(tree, *kind, rays));
                    }
                }
            }
            let [before, own] = fastest.map(|times| times.iter().sum::<f64>());
            (*kind, own / before)
        };
        with_rays.map(ratio).collect()
    }
}

fn geometric_mean(values: &[f64]) -> f64 {
    let logarithms: f64 = values.iter().map(|value| value.ln()).sum();
    (logarithms / values.len() as f64).exp()
}

/// A row for each model.
pub(super) fn print(comparisons: &[Comparison]) {
    println!("time over that of the fitted model, geometric mean over scenes:");
    print!("  {:>6} {:>5} {:>6}", "K_I", "bonus", "refs");
    let kinds: Vec<String> = RayKind::value_variants()
        .iter()
        .copied()
        .map(title)
        .collect();
    for kind in &kinds {
        print!(" {kind:>8}");
    }
    println!(" {:>8}", "all");
    for row in comparisons {
        print!(
            "  {:>6.3} {:>5.2} {:>6.2}",
            row.intersect, row.empty_bonus, row.refs
        );
        for kind in &kinds {
            let time = row.time.get(kind).copied().unwrap_or(f64::NAN);
            print!(" {time:>8.3}");
        }
        let all: Vec<f64> = row.time.values().copied().collect();
        println!(" {:>8.3}", geometric_mean(&all));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_geometric() {
        assert!(
            (geometric_mean(&[0.5, 2.0]) - 1.0).abs() < 1e-12,
            "they cancel out"
        );
    }
}
