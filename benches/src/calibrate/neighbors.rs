//! Trees of models around the fitted one, compared with the tree of the fitted one.

use std::collections::BTreeMap;

use clap::ValueEnum as _;
use kd::{CostModel, KdTree};
use serde::Serialize;

use super::{Grouped, build, seconds, with};
use crate::arguments::name_of;
use crate::rays::RayKind;
use crate::text;
use crate::view::geometric_mean;

/// The bonus of the fitted model, which the fit does not determine.
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

/// Traces all groups in the tree of each model and in that of the fitted one, in turns.
pub(super) fn compare(
    workloads: &[Grouped],
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
            let [own, usual] = [&tree, &baseline].map(|tree| tree.stats().references as f64);
            refs[index].push(own / usual);
            for (kind, ratio) in workload.ratios(&tree, &baseline, samples) {
                ratios[index].entry(name_of(&kind)).or_default().push(ratio);
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

impl Grouped {
    /// The time of each kind of rays over the baseline's. The two take turns, and of each group the fastest pass counts: an
    /// interruption of a pass on a busy machine does not repeat at the same group.
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

/// A row for each model.
pub(super) fn print(comparisons: &[Comparison]) {
    println!("time over that of the fitted model, geometric mean over scenes:");
    let kinds: Vec<String> = RayKind::value_variants().iter().map(name_of).collect();
    let head = ["K_I", "bonus", "refs"].into_iter().map(String::from);
    let all = ["all".to_owned()];
    let mut table = text::empty_table(head.chain(kinds.iter().cloned()).chain(all));
    for row in comparisons {
        let model = [
            format!("{:.3}", row.intersect),
            format!("{:.2}", row.empty_bonus),
            format!("{:.2}", row.refs),
        ];
        let time = |kind: &String| row.time.get(kind).copied().unwrap_or(f64::NAN);
        let times = kinds.iter().map(time);
        let all: Vec<f64> = row.time.values().copied().collect();
        let times = times.chain([geometric_mean(&all)]);
        let times = times.map(|time| format!("{time:.3}"));
        table.add_row(model.into_iter().chain(times));
    }
    text::align_right(&mut table, 0);
    println!("{table}");
}
