//! What is measured on one scene.

use std::sync::Arc;
use std::time::Duration;

use kd::{BuildOptions, KdTree, Mesh};

use super::first_hits::{self, Restarting};
use crate::check::Answers;
use crate::cli::name_of;
use crate::measure::{self, Repeats};
use crate::peers;
use crate::rays::RayKind;
use crate::record::median_ratio;
use crate::scenes::SceneSource;
use crate::structure::{
    Asked, BuilderName, Distances, LayoutName, Manner, OrderedHits, Structure, StructureName,
    Variant,
};
use crate::workload::{self, Amount, Workload};

/// The kinds of rays, in the order of all arrays below.
pub(super) const KINDS: [RayKind; 5] = [
    RayKind::Primary,
    RayKind::Shadow,
    RayKind::Ao,
    RayKind::Diffuse,
    RayKind::Random,
];

/// Something of each of [`KINDS`].
pub(super) type ByKind = [f64; KINDS.len()];

/// The kinds whose batches are compared with packets, since neighbours go the same way.
pub(super) const COHERENT: [RayKind; 2] = [RayKind::Primary, RayKind::Shadow];
/// The kinds whose batches are compared with single rays, since neighbours part.
pub(super) const INCOHERENT: [RayKind; 3] = [RayKind::Ao, RayKind::Diffuse, RayKind::Random];

/// From so many triangles on, [`INCOHERENT`] batches are measured: they are to pay where a tree does not fit in caches.
const LARGE: usize = 200_000;

/// How to measure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    repeats: Repeats,
    rays: Amount,
}

impl Settings {
    pub(super) fn new(samples: usize, ray_limit: Option<usize>, smoke: bool) -> Self {
        let (side, usual_limit) = if smoke {
            (64, 1 << 10)
        } else {
            (Amount::FULL.side, Amount::FULL.ray_limit)
        };
        Self {
            repeats: Repeats {
                pairs: samples,
                until: Duration::MAX,
            },
            rays: Amount {
                side,
                ray_limit: ray_limit.unwrap_or(usual_limit),
                brute_force_tests: 0,
                ..Amount::FULL
            },
        }
    }
}

/// What was measured on one scene. Speeds are rays in the same time, ours over those of what it is compared with; on one
/// thread if nothing else is said.
#[derive(Debug)]
pub(super) struct Figures {
    pub(super) scene: String,
    /// Single rays, over those of Embree's medium BVH, of its robust one, and of the wide one of obvhs as it is compiled
    /// with this program.
    pub(super) over_medium: ByKind,
    pub(super) over_robust: ByKind,
    pub(super) over_obvhs: ByKind,
    /// Batches of [`COHERENT`] rays, and packets of eight, over Embree's packets.
    pub(super) batches_over_packets: [f64; COHERENT.len()],
    pub(super) packets_over_packets: [f64; COHERENT.len()],
    /// Batches of [`INCOHERENT`] rays, over Embree's single rays; of large meshes only.
    pub(super) batches_over_medium: Option<[f64; INCOHERENT.len()]>,
    /// Batches, over single rays, both of ours.
    pub(super) batches_over_single: ByKind,
    /// The first hits of random rays, over those that a filter collects for Embree and over rays that start again.
    pub(super) first_over_filter: f64,
    pub(super) first_over_restarting: f64,
    /// Random rays in a million whose first hits Embree sees differently.
    pub(super) first_disagreement_ppm: f64,
    /// Single rays on two threads, over those on one.
    pub(super) two_threads: ByKind,
    /// All that our tree keeps but the mesh.
    pub(super) bytes_per_triangle: f64,
    pub(super) problems: Vec<String>,
}

impl Figures {
    pub(super) fn measure(source: &SceneSource, settings: &Settings) -> anyhow::Result<Self> {
        let scene = source.load()?;
        let mesh = &scene.mesh;
        let options = BuildOptions::default().with_threads(1);
        let tree = KdTree::build(Arc::clone(mesh), &options)?;
        let workloads = workload::all(&scene, &KINDS, settings.rays, &tree);
        let mut measuring = Measuring {
            scene: &source.name,
            repeats: settings.repeats,
            tree: &tree,
            workloads: &workloads,
            problems: Vec::new(),
        };
        measuring.note_kinds_without_rays();
        let medium = rival(StructureName::Embree, mesh)?;
        let over_medium = measuring.single_speeds(&*medium);
        let batches_over_medium =
            (mesh.len() >= LARGE).then(|| measuring.speeds(Manner::Batch, INCOHERENT, &*medium));
        drop(medium);
        let over_robust = measuring.single_speeds(&*rival(StructureName::EmbreeRobust, mesh)?);
        let packets = rival(StructureName::Embree8, mesh)?;
        let batches_over_packets = measuring.speeds(Manner::Batch, COHERENT, &*packets);
        let packets_over_packets = measuring.speeds(Manner::Packets, COHERENT, &*packets);
        drop(packets);
        let over_obvhs = measuring.single_speeds(&*rival(StructureName::Obvhs, mesh)?);
        let (first_over_filter, first_disagreement_ppm) =
            measuring.first_over_filter(&*peers::ordered_hits(mesh, 1)?);
        Ok(Self {
            scene: source.name.clone(),
            over_medium,
            over_robust,
            over_obvhs,
            batches_over_packets,
            packets_over_packets,
            batches_over_medium,
            batches_over_single: measuring.speeds(Manner::Batch, KINDS, &tree),
            first_over_filter,
            first_over_restarting: measuring.first_over_restarting(),
            first_disagreement_ppm,
            two_threads: measuring.speed_ups_on_two_threads(),
            bytes_per_triangle: bytes_per_triangle(&tree, mesh),
            problems: measuring.problems,
        })
    }
}

/// The medium build of a rival, on one thread.
fn rival(structure: StructureName, mesh: &Arc<Mesh>) -> anyhow::Result<Box<dyn Structure>> {
    let variant = Variant {
        structure,
        builder: BuilderName::Medium,
        layout: LayoutName::Own,
    };
    Ok(variant.build(mesh, 1)?.structure)
}

fn bytes_per_triangle(tree: &KdTree, mesh: &Mesh) -> f64 {
    let stats = tree.stats();
    let bytes = stats.bytes_kept();
    bytes as f64 / mesh.len().max(1) as f64
}

/// A scene while it is measured.
struct Measuring<'a> {
    scene: &'a str,
    repeats: Repeats,
    tree: &'a KdTree,
    /// Those of [`KINDS`].
    workloads: &'a [Workload],
    problems: Vec<String>,
}

impl<'a> Measuring<'a> {
    fn workload(&self, kind: RayKind) -> &'a Workload {
        let mut all = self.workloads.iter();
        all.find(|workload| workload.kind == kind)
            .expect("there is one of each kind")
    }

    /// Rays start where primary rays hit: a camera that looks past the mesh leaves nothing to measure.
    fn note_kinds_without_rays(&mut self) {
        for workload in self.workloads.iter().filter(|w| w.rays.is_empty()) {
            let (scene, kind) = (self.scene, name_of(&workload.kind));
            self.problems.push(format!("{scene}: has no {kind} rays"));
        }
    }

    fn single_speeds(&mut self, rival: &dyn Structure) -> ByKind {
        KINDS.map(|kind| self.speed(kind, "single", self.tree, rival))
    }

    fn speeds<const N: usize>(
        &mut self,
        by: Manner,
        kinds: [RayKind; N],
        rival: &dyn Structure,
    ) -> [f64; N] {
        let tree = self.tree;
        let way = match by {
            Manner::Batch => "batched",
            Manner::Packets => "packed",
        };
        kinds.map(|kind| self.speed(kind, way, &Asked { tree, by }, rival))
    }

    /// How many times as fast ours is; `way` says how it is asked.
    fn speed(
        &mut self,
        kind: RayKind,
        way: &str,
        ours: &dyn Structure,
        rival: &dyn Structure,
    ) -> f64 {
        let workload = self.workload(kind);
        let mut answers = Answers::none(kind, workload.rays.len());
        let pairs = workload.time(self.repeats, 1, rival, ours, &mut answers);
        self.check(kind, way, &answers);
        median_ratio(&pairs.baseline, &pairs.own)
    }

    fn speed_ups_on_two_threads(&mut self) -> ByKind {
        KINDS.map(|kind| {
            let workload = self.workload(kind);
            let mut answers = [(); 2].map(|()| Answers::none(kind, workload.rays.len()));
            let [alone, together] = &mut answers;
            let traced = |answers: &mut Answers, threads| {
                measure::trace(self.tree, &workload.rays, answers, threads);
                Ok::<(), std::convert::Infallible>(())
            };
            let Ok(pairs) =
                measure::in_pairs(self.repeats, || traced(alone, 1), || traced(together, 2));
            self.check(kind, "single, on two threads,", &answers[1]);
            median_ratio(&pairs.baseline, &pairs.own)
        })
    }

    /// Notes answers that are not those of single rays, which the workload has.
    fn check(&mut self, kind: RayKind, way: &str, answers: &Answers) {
        let wrong = answers.differences(&self.workload(kind).expected).len();
        if wrong > 0 {
            let (scene, kind) = (self.scene, name_of(&kind));
            self.problems.push(format!(
                "{scene}: {wrong} {way} {kind} rays differ from single ones"
            ));
        }
    }

    /// The speed, and how many rays in a million the rival answers differently.
    fn first_over_filter(&self, filter: &dyn OrderedHits) -> (f64, f64) {
        let (speed, [ours, theirs]) = self.first_hits_over(filter);
        let different = count_unless(first_hits::agree, &ours, &theirs);
        (speed, different as f64 / ours.len().max(1) as f64 * 1e6)
    }

    fn first_over_restarting(&mut self) -> f64 {
        let (speed, [ours, restarted]) = self.first_hits_over(&Restarting(self.tree));
        let wrong = count_unless(first_hits::are_those_of_restarted, &ours, &restarted);
        if wrong > 0 {
            let scene = self.scene;
            self.problems.push(format!(
                "{scene}: the first hits of {wrong} random rays differ from those of rays that start again"
            ));
        }
        speed
    }

    /// With the hits, ours first.
    fn first_hits_over(&self, other: &dyn OrderedHits) -> (f64, [Vec<Distances>; 2]) {
        let rays = &self.workload(RayKind::Random).rays;
        let (pairs, found) = first_hits::time(self.repeats, rays, self.tree, other);
        (median_ratio(&pairs.baseline, &pairs.own), found)
    }
}

/// How many rays' hits do not go together.
fn count_unless(
    go_together: fn(&Distances, &Distances) -> bool,
    ours: &[Distances],
    others: &[Distances],
) -> usize {
    let pairs = ours.iter().zip(others);
    pairs.filter(|(a, b)| !go_together(a, b)).count()
}
