//! What is measured on one scene.

use std::sync::Arc;
use std::time::Duration;

use clap::ValueEnum as _;
use kd::Mesh;

use crate::check::Answers;
use crate::cli::name_of;
use crate::goals::geometric_mean;
use crate::measure::{Repeats, timed_in_pairs};
use crate::rays::RayKind;
use crate::record::median_ratio;
use crate::scenes::SceneSource;
use crate::structure::{BuilderName, LayoutName, REFERENCE, Structure, StructureName, Variant};
use crate::workload::{self, Amount, Workload};

const fn variant(structure: StructureName, builder: BuilderName, layout: LayoutName) -> Variant {
    Variant {
        structure,
        builder,
        layout,
    }
}

pub(super) const GRID: Variant = variant(StructureName::Grid, BuilderName::Exact, LayoutName::Own);
pub(super) const BOXES: Variant = variant(StructureName::Grid, BuilderName::Boxes, LayoutName::Own);
const LOW: Variant = variant(StructureName::Embree, BuilderName::Low, LayoutName::Own);
const OBVHS: Variant = variant(StructureName::Obvhs, BuilderName::Medium, LayoutName::Own);

/// Hierarchies that are laid out wide.
pub(super) const HIERARCHIES: [Variant; 3] = [
    variant(StructureName::Bvh, BuilderName::Binned, LayoutName::Wide),
    variant(StructureName::Bvh, BuilderName::Sweep, LayoutName::Wide),
    variant(StructureName::Bvh, BuilderName::Objects, LayoutName::Wide),
];

/// Every structure that the papers describe, in its plain form, and wide nodes without a kd-tree.
pub(super) const ALL: [Variant; 10] = [
    GRID,
    variant(StructureName::Bvh, BuilderName::Binned, LayoutName::Binary),
    variant(StructureName::Bvh, BuilderName::Sweep, LayoutName::Binary),
    variant(
        StructureName::Bvh,
        BuilderName::BottomUp,
        LayoutName::Binary,
    ),
    variant(
        StructureName::Bvh,
        BuilderName::Midpoint,
        LayoutName::Binary,
    ),
    variant(
        StructureName::Bvh,
        BuilderName::EqualCounts,
        LayoutName::Binary,
    ),
    variant(StructureName::Bvh, BuilderName::Objects, LayoutName::Wide),
    variant(StructureName::Octree, BuilderName::Median, LayoutName::Own),
    variant(StructureName::Bsp, BuilderName::Polygon, LayoutName::Own),
    variant(StructureName::Kd, BuilderName::Median, LayoutName::Binary),
];

/// How to measure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    repeats: Repeats,
    rays: Amount,
}

impl Settings {
    pub(super) fn new(samples: usize, smoke: bool) -> Self {
        let (side, ray_limit) = if smoke { (32, 1 << 8) } else { (192, 1 << 14) };
        Self {
            repeats: Repeats {
                pairs: samples,
                until: Duration::MAX,
            },
            rays: Amount {
                side,
                ray_limit,
                brute_force_tests: 0,
                ..Amount::FULL
            },
        }
    }
}

/// What was measured on one scene.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) scene: String,
    /// Build times of [`GRID`] and [`BOXES`] over that of Embree's quickest build, on one thread.
    pub(super) grids_over_low: [f64; 2],
    /// How many times as fast [`GRID`] is built on two threads.
    pub(super) grid_two_threads: f64,
    /// Rays through [`HIERARCHIES`] in the time of one of obvhs.
    pub(super) over_obvhs: [f64; HIERARCHIES.len()],
    /// Of [`ALL`]: build times over that of our default tree, and rays in the time of one through it.
    pub(super) builds: [f64; ALL.len()],
    pub(super) speeds: [f64; ALL.len()],
    pub(super) problems: Vec<String>,
}

impl Figures {
    pub(super) fn measure(source: &SceneSource, settings: &Settings) -> anyhow::Result<Self> {
        let scene = source.load()?;
        let mesh = &scene.mesh;
        let reference = REFERENCE.build(mesh, 1)?.structure;
        let kinds = RayKind::value_variants();
        let workloads = workload::all(&scene, kinds, settings.rays, &*reference);
        let mut measuring = Measuring {
            scene: &source.name,
            mesh,
            repeats: settings.repeats,
            workloads: &workloads,
            problems: Vec::new(),
        };
        let grids_over_low = [
            measuring.build_ratio(GRID, 1, LOW, 1)?,
            measuring.build_ratio(BOXES, 1, LOW, 1)?,
        ];
        let grid_two_threads = measuring.build_ratio(GRID, 2, GRID, 1)?.recip();
        let obvhs = OBVHS.build(mesh, 1)?.structure;
        let mut over_obvhs = [0.0; HIERARCHIES.len()];
        for (speed, variant) in over_obvhs.iter_mut().zip(HIERARCHIES) {
            *speed = measuring.speed(variant, &*obvhs)?;
        }
        drop(obvhs);
        let (mut builds, mut speeds) = ([0.0; ALL.len()], [0.0; ALL.len()]);
        for ((build, speed), variant) in builds.iter_mut().zip(&mut speeds).zip(ALL) {
            *build = measuring.build_ratio(variant, 1, REFERENCE, 1)?;
            *speed = measuring.speed(variant, &*reference)?;
        }
        Ok(Self {
            scene: source.name.clone(),
            grids_over_low,
            grid_two_threads,
            over_obvhs,
            builds,
            speeds,
            problems: measuring.problems,
        })
    }
}

struct Measuring<'a> {
    scene: &'a str,
    mesh: &'a Arc<Mesh>,
    repeats: Repeats,
    workloads: &'a [Workload],
    problems: Vec<String>,
}

impl Measuring<'_> {
    /// The build time of one over that of another, each on so many threads.
    fn build_ratio(
        &self,
        variant: Variant,
        threads: usize,
        other: Variant,
        other_threads: usize,
    ) -> anyhow::Result<f64> {
        let pairs = timed_in_pairs(
            self.repeats,
            || anyhow::Ok(other.build(self.mesh, other_threads)?.seconds),
            || anyhow::Ok(variant.build(self.mesh, threads)?.seconds),
        )?;
        Ok(median_ratio(&pairs.own, &pairs.baseline))
    }

    /// Rays in the time of one through another structure, which is ours or a rival's. Answers must be those of our default
    /// tree.
    fn speed(&mut self, variant: Variant, other: &dyn Structure) -> anyhow::Result<f64> {
        let structure = variant.build(self.mesh, 1)?.structure;
        let mut speeds = Vec::new();
        for workload in self
            .workloads
            .iter()
            .filter(|workload| !workload.rays.is_empty())
        {
            let mut answers = Answers::none(workload.kind, workload.rays.len());
            let pairs = workload.time(self.repeats, 1, other, &*structure, &mut answers);
            speeds.push(median_ratio(&pairs.baseline, &pairs.own));
            let wrong = answers.differences(&workload.expected).len();
            if wrong > 0 {
                let (scene, kind) = (self.scene, name_of(&workload.kind));
                self.problems.push(format!(
                    "{scene} {variant} {kind}: {wrong} answers are wrong"
                ));
            }
        }
        Ok(geometric_mean(&speeds))
    }
}
