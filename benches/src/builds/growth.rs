//! Build times over Embree's, by the size of the mesh.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use kd_scene::Spd;
use serde_json::json;

use super::{PRESETS, embree};
use crate::arguments::name_of;
use crate::environment::Environment;
use crate::names::{BuilderName, LayoutName, Variant};
use crate::plots::{Axis, XyPlot};
use crate::run_folder::json_lines;
use crate::session::Session;
use crate::text;
use crate::view::geometric_mean;

/// Meshes that differ only in detail: one whose triangles share no plane, one whose triangles lie in common planes.
const KINDS: [Spd; 2] = [Spd::Tetra, Spd::Lattice];
/// The smallest mesh, in triangles.
const LEAST: u64 = 10_000;
/// The least factor from one mesh to the next.
const STEP: f64 = 2.5;
/// No pair of builds begins after this time.
const LIMIT: Duration = Duration::from_secs(20);
/// The allowed relative distance of a ratio from the mean of its line.
const ALLOWED: f64 = 0.25;

/// Build time of a preset over that of Embree's medium build, by size.
#[derive(Debug)]
struct Line {
    kind: Spd,
    preset: String,
    /// Triangles and ratio.
    points: Vec<(u64, f64)>,
}

/// One line for each kind of mesh and preset.
#[derive(Debug)]
pub(crate) struct Growth(Vec<Line>);

/// Times presets in `layout`, at most `samples` times each.
pub(crate) fn measure(most: u64, samples: usize, layout: LayoutName) -> anyhow::Result<Growth> {
    let environment = Environment::detect();
    let rival = embree(BuilderName::Medium);
    let mut lines: Vec<Line> = Vec::new();
    for kind in KINDS {
        let first = lines.len();
        lines.extend(PRESETS.map(|preset| Line {
            kind,
            preset: name_of(&preset),
            points: Vec::new(),
        }));
        for (size, triangles) in sizes(kind, most) {
            eprintln!("{kind}-{size}: {triangles} triangles");
            let mesh = Arc::new(kind.generate(size)?.mesh);
            let session = Session::new(&environment, kind.name(), mesh.len(), samples);
            let mut session = session.until(LIMIT);
            for (line, preset) in lines[first..].iter_mut().zip(PRESETS) {
                let ours = Variant::kd(preset, layout);
                let cell = session.build(&mesh, (ours, 1), (rival, 1))?;
                line.points.push((triangles, cell.build_ratio()));
            }
        }
    }
    Ok(Growth(lines))
}

/// The sizes of a scene in steps of [`STEP`], with their triangles.
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

    /// The relative distances of the least and of the greatest ratio from the mean.
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
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let lines = self.0.iter().map(|line| {
            let points = line.points.iter().map(|(n, ratio)| (*n as f64, *ratio));
            (line.name(), points.collect())
        });
        XyPlot {
            x_axis: "triangles",
            y_axis: "build time / Embree medium",
            scale: Axis::Logarithmic,
            lines: lines.collect(),
            points: Vec::new(),
        }
        .to_svg()
    }

    /// One JSON object for each line.
    pub(crate) fn to_lines(&self) -> anyhow::Result<String> {
        json_lines(self.0.iter().map(|line| {
            json!({
                "growth": line.kind.name(),
                "preset": line.preset,
                "points": line.points,
                "met": line.is_within_goal(),
            })
        }))
    }
}

impl fmt::Display for Growth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let titles = [
            "build time / Embree medium",
            "by triangles",
            "spread",
            "goal",
            "met",
        ];
        let mut table = text::empty_table(titles);
        for line in &self.0 {
            let points = line.points.iter();
            let points = points.map(|(n, ratio)| format!("{n}: {ratio:.2}"));
            let (low, high) = line.spread();
            table.add_row(vec![
                line.name(),
                points.collect::<Vec<_>>().join("  "),
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
    fn ratios_far_from_their_mean_miss_the_goal() {
        let line = |ratios: [f64; 3]| Line {
            kind: Spd::Tetra,
            preset: "fast".into(),
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
