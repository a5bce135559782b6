//! How build times grow with the mesh, over those of Embree.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use kd_scene::Spd;
use serde_json::json;

use super::figures::{PRESETS, Settings};
use crate::goals::geometric_mean;
use crate::plots::{Axis, LinePlot};
use crate::structure::BuilderName;
use crate::terminal;

/// Meshes that only get finer: one without any plane to share, one where triangles lie in planes.
const KINDS: [Spd; 2] = [Spd::Tetra, Spd::Lattice];
/// Where growth starts.
const LEAST: u64 = 10_000;
/// From mesh to mesh, by so much at least.
const STEP: f64 = 2.5;
/// After so long no further pair of builds begins.
const LIMIT: Duration = Duration::from_secs(20);
/// How far a ratio may be from the mean of its line, as a part of it.
const ALLOWED: f64 = 0.25;

/// Build time of a preset over that of Embree's medium build, by size.
#[derive(Debug)]
struct Line {
    kind: Spd,
    preset: &'static str,
    /// Triangles and ratio.
    points: Vec<(u64, f64)>,
}

/// One line for each kind of mesh and preset.
#[derive(Debug)]
pub(super) struct Growth(Vec<Line>);

pub(super) fn measure(most: u64, settings: &Settings) -> anyhow::Result<Growth> {
    let settings = settings.until(LIMIT);
    let mut lines: Vec<Line> = Vec::new();
    for kind in KINDS {
        let first = lines.len();
        lines.extend(PRESETS.map(|preset| Line {
            kind,
            preset,
            points: Vec::new(),
        }));
        for (size, triangles) in sizes(kind, most) {
            eprintln!("{kind}-{size}: {triangles} triangles");
            let mesh = Arc::new(kind.generate(size)?.mesh);
            let ratios = settings.over_embree(&mesh, [BuilderName::Medium; 3])?;
            for (line, ratio) in lines[first..].iter_mut().zip(ratios) {
                line.points.push((triangles, ratio));
            }
        }
    }
    Ok(Growth(lines))
}

/// The sizes of a scene that make steps of [`STEP`], with their triangles.
fn sizes(kind: Spd, most: u64) -> Vec<(u32, u64)> {
    let mut sizes: Vec<(u32, u64)> = Vec::new();
    for size in 1.. {
        let Some(triangles) = kind.triangles(size).filter(|count| *count <= most) else {
            break;
        };
        let least = sizes
            .last()
            .map_or(LEAST as f64, |(_, last)| *last as f64 * STEP);
        if triangles as f64 >= least {
            sizes.push((size, triangles));
        }
    }
    sizes
}

impl Line {
    fn mean(&self) -> f64 {
        let ratios: Vec<f64> = self.points.iter().map(|(_, ratio)| *ratio).collect();
        geometric_mean(&ratios)
    }

    /// How far the ratios are from their mean, at most below and at most above, as parts of it.
    fn spread(&self) -> (f64, f64) {
        let off = self
            .points
            .iter()
            .map(|(_, ratio)| ratio / self.mean() - 1.0);
        off.fold((0.0, 0.0), |(low, high), off| {
            (f64::min(low, off), f64::max(high, off))
        })
    }

    fn is_within_goal(&self) -> bool {
        let (low, high) = self.spread();
        low >= -ALLOWED && high <= ALLOWED
    }

    fn name(&self) -> String {
        format!("{} {}", self.kind, self.preset)
    }
}

impl Growth {
    pub(super) fn to_svg(&self) -> anyhow::Result<String> {
        let lines = self.0.iter().map(|line| {
            let points = line.points.iter().map(|(n, ratio)| (*n as f64, *ratio));
            (line.name(), points.collect())
        });
        LinePlot {
            x_axis: "triangles",
            y_axis: "build time / Embree medium",
            scale: Axis::Logarithmic,
            lines: lines.collect(),
        }
        .to_svg()
    }

    /// One JSON object for each line.
    pub(super) fn to_lines(&self) -> anyhow::Result<String> {
        let mut lines = String::new();
        for line in &self.0 {
            let line = json!({
                "growth": line.kind.name(),
                "preset": line.preset,
                "points": line.points,
                "met": line.is_within_goal(),
            });
            lines += &serde_json::to_string(&line)?;
            lines.push('\n');
        }
        Ok(lines)
    }
}

impl fmt::Display for Growth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = [
            "build time / Embree medium",
            "by triangles",
            "spread",
            "goal",
            "met",
        ];
        let mut table = terminal::empty_table(head.map(String::from).to_vec());
        for line in &self.0 {
            let points = line.points.iter();
            let points: Vec<String> = points
                .map(|(n, ratio)| format!("{n}: {ratio:.2}"))
                .collect();
            let (low, high) = line.spread();
            table.add_row(vec![
                line.name(),
                points.join("  "),
                format!("{:+.0} % {:+.0} %", low * 100.0, high * 100.0),
                format!("± {:.0} %", ALLOWED * 100.0),
                if line.is_within_goal() { "yes" } else { "NO" }.into(),
            ]);
        }
        table.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_cover_the_range_in_steps() {
        for kind in KINDS {
            let sizes = sizes(kind, 4_200_000);
            let counts: Vec<u64> = sizes.iter().map(|(_, count)| *count).collect();
            assert!(
                counts.first() < Some(&40_000) && counts.last() > Some(&1_500_000),
                "{kind}: {counts:?}"
            );
            assert!(counts.len() >= 5, "{kind}: {counts:?}");
        }
    }

    #[test]
    fn ratios_far_from_their_mean_are_told() {
        let line = |ratios: [f64; 3]| Line {
            kind: Spd::Tetra,
            preset: "fast",
            points: (1..).zip(ratios).collect(),
        };
        assert!(line([1.0, 1.1, 0.9]).is_within_goal(), "10 %");
        let grows = line([1.0, 2.0, 4.0]);
        assert!(
            !grows.is_within_goal(),
            "twice and half: {:?}",
            grows.spread()
        );
        let growth = Growth(vec![grows]);
        let text = growth.to_string();
        for part in ["tetra fast", "3: 4.00", "-50 % +100 %", "± 25 %", "NO"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        assert!(
            growth.to_svg().expect("drawn").contains("tetra fast"),
            "named"
        );
    }
}
