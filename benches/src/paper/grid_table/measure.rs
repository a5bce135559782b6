//! The measurements of the table.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use kd::{BuildOptions, LazyTree, Mesh};
use kd_grid::{GridOptions, UniformGrid};
use kd_select::sample::{self, Run, Tried};
use kd_select::{Features, MeasuredScene, Opening, RayScheme, Structure as Kind, Times};

use super::PaperArgs;
use super::rays;
use crate::check::Answers;
use crate::names::{BuilderName, LayoutName, StructureName, Variant};
use crate::paper::batches::Batches;
use crate::record::median;
use crate::scenes::SceneSource;
use crate::structure::{Manner, Queried, Shape, Structure};

/// The amount of work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    repeats: usize,
    random_rays: usize,
    /// Pixels along the side of the path-traced picture.
    side: u32,
    /// Random combinations of scenes for each size of a calibration.
    pub(super) combinations: usize,
}

/// A scene measured with one kind of rays.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) family: String,
    pub(super) scene: MeasuredScene,
    /// What the decision knows of the grid: the time of one build, and the result of a sample of rays.
    tried_build_seconds: f64,
    pub(super) tried: Tried,
}

/// A lazy tree is also measured after one of this number of rays.
const EARLY: usize = 16;

/// The structures that are built before their first ray.
const BUILT: [(Kind, Variant); 5] = [
    (
        Kind::Grid,
        Variant::own(StructureName::Grid, BuilderName::Exact),
    ),
    (
        Kind::Objects,
        Variant::bvh(BuilderName::Objects, LayoutName::Wide),
    ),
    (Kind::Fast, Variant::kd(BuilderName::Fast, LayoutName::Wide)),
    (
        Kind::Balanced,
        Variant::kd(BuilderName::Balanced, LayoutName::Wide),
    ),
    (Kind::Best, Variant::kd(BuilderName::Best, LayoutName::Wide)),
];

impl Settings {
    pub(super) fn new(arguments: &PaperArgs) -> Self {
        let (random_rays, side, combinations) = if arguments.smoke {
            (1 << 10, 24, 50)
        } else {
            (1 << 15, 96, 5000)
        };
        Self {
            repeats: arguments.samples,
            random_rays,
            side,
            combinations,
        }
    }
}

impl Measured {
    pub(super) fn triangles(&self) -> u64 {
        self.scene.features.triangles
    }

    pub(super) fn times(&self, kind: Kind) -> &Times {
        let times = self.scene.times_of(kind);
        times.expect("every structure is measured on every scene")
    }

    /// What the decision knows of the grid.
    pub(super) fn sampled_grid(&self) -> Times {
        let ray_seconds = self.tried.ray_seconds().unwrap_or(0.0);
        Times::new(self.tried_build_seconds, ray_seconds)
    }

    /// What the decision knows of the scene.
    pub(super) fn sampled_features(&self) -> Features {
        Features {
            hit_share: self.tried.hit_share(),
            ..self.scene.features
        }
    }
}

/// Seconds of one structure, run by run.
#[derive(Debug, Default)]
struct Runs {
    build: Vec<f64>,
    /// Of all rays of each kind.
    rays: [Vec<f64>; 2],
}

/// The scene with each kind of rays; empty for a scene without triangles.
pub(super) fn measure(
    source: &SceneSource,
    settings: &Settings,
    problems: &mut Vec<String>,
) -> anyhow::Result<Vec<Measured>> {
    let (loaded, description) = source.load_described()?;
    if loaded.mesh.is_empty() {
        return Ok(Vec::new());
    }
    let mesh = &loaded.mesh;
    let kinds = [
        rays::random(mesh, settings.random_rays),
        rays::path_traced(&description, settings.side)?,
    ];
    let stats = UniformGrid::build(Arc::clone(mesh), &GridOptions::new())?.stats();

    let mut runs: BTreeMap<Kind, Runs> = BTreeMap::new();
    // Of the last run.
    let mut sampled = [(0.0, Tried::default()); 2];
    let mut hit_shares = [0.0; 2];
    let mut lazy = [Vec::new(), Vec::new()];
    for repeat in 0..settings.repeats {
        let mut expected: Option<Vec<Vec<Answers>>> = None;
        for (kind, variant) in BUILT.iter().rev() {
            let built = variant.build(mesh, 1)?;
            let structure = &*built.structure;
            let of_kind = runs.entry(*kind).or_default();
            of_kind.build.push(built.seconds);
            let mut all = Vec::new();
            for (number, rays) in kinds.iter().enumerate() {
                if *kind == Kind::Grid {
                    let tried = try_grid(structure, rays, built.seconds);
                    sampled[number] = (built.seconds, tried);
                }
                let (seconds, answers) = rays.trace(structure, |_| Manner::Single);
                of_kind.rays[number].push(seconds);
                hit_shares[number] = rays::hits(&answers) as f64 / rays.len().max(1) as f64;
                all.push(answers);
            }
            let expected = expected.get_or_insert_with(|| all.clone());
            if repeat == 0 && all != *expected {
                problems.push(format!(
                    "{}: answers of {kind} differ from a kd-tree's",
                    source.name
                ));
            }
        }
        for (lazy, rays) in lazy.iter_mut().zip(&kinds) {
            lazy.push(lazy_times(mesh, rays)?);
        }
    }
    let measured = [RayScheme::Random, RayScheme::Path].into_iter().enumerate();
    let measured = measured.map(|(number, scheme)| {
        let count = kinds[number].len() as f64;
        let built = runs.iter().map(|(kind, runs)| {
            let ray = median(&runs.rays[number]) / count;
            (*kind, Times::new(median(&runs.build), ray))
        });
        let mut times: BTreeMap<Kind, Times> = built.collect();
        times.insert(Kind::Lazy, middle(&lazy[number]));
        Measured {
            family: source.family().to_owned(),
            tried_build_seconds: sampled[number].0,
            tried: sampled[number].1,
            scene: MeasuredScene {
                scene: source.name.clone(),
                rays: scheme,
                features: Features::new(&stats, hit_shares[number]),
                times,
            },
        }
    });
    Ok(measured.collect())
}

/// Tries a grid as `Accel` does, with rays of a whole picture in place of a user's.
fn try_grid(structure: &dyn Structure, rays: &Batches, build_seconds: f64) -> Tried {
    let runs = rays::runs(rays);
    Tried::ask(runs.len(), sample::RAYS as u64, build_seconds, |place| {
        let (seconds, answers) = runs[place].trace(structure, |_| Manner::Single);
        Run {
            rays: runs[place].len(),
            hits: rays::hits(&answers),
            seconds: Some(seconds),
        }
    })
}

/// The costs of a lazy tree: seconds before the first ray, of rays once all cells that they enter are divided, and of the
/// division of these cells.
fn lazy_times(mesh: &Arc<Mesh>, rays: &Batches) -> anyhow::Result<Times> {
    let options = BuildOptions::balanced().with_threads(1);
    let start = Instant::now();
    let tree = LazyTree::new(Arc::clone(mesh), &options)?;
    let build_seconds = start.elapsed().as_secs_f64();
    let tree = Queried::new(&tree, |_| Shape::default());
    let trace = |rays: &Batches| rays.trace(&tree, |_| Manner::Batch).0;
    let early = rays::spread(rays, rays.len() / EARLY);
    let (first, rest, again) = (trace(&early), trace(rays), trace(rays));
    let ray_seconds = again / rays.len() as f64;
    let early_rays = early.len() as f64;
    // Noise may make the difference negative.
    let opened_early = (first - early_rays * ray_seconds).max(0.0);
    let opened = (opened_early + rest - again).max(opened_early);
    let share = if opened > 0.0 {
        opened_early / opened
    } else {
        1.0
    };
    // From 1 − exp(−early / rays) = share; the clamp keeps the logarithm finite.
    let rays_of_opening = early_rays / -(1.0 - share).clamp(1e-6, 1.0 - 1e-6).ln();
    Ok(Times {
        build_seconds,
        ray_seconds,
        opening: Some(Opening {
            seconds: opened,
            rays: rays_of_opening,
        }),
    })
}

/// The run of median total.
fn middle(runs: &[Times]) -> Times {
    const MANY: f64 = 1e4;
    let mut runs = runs.to_vec();
    runs.sort_by(|a, b| a.total(MANY).total_cmp(&b.total(MANY)));
    runs[runs.len() / 2]
}

/// Scenes that follow the paper's two laws, each in two levels of detail, with rays that are several times slower in a grid.
#[cfg(test)]
pub(super) fn lawful_scenes(scheme: RayScheme) -> Vec<Measured> {
    let scene = |number: u32| {
        let triangles = 1000_u64 << (number % 7);
        let levels = (triangles as f64).log2();
        let grid = Times::new(
            5e-8 * triangles as f64,
            1e-7 * levels * f64::from(3 + number % 3),
        );
        let tree =
            |build: f64, ray: f64| Times::new(build * triangles as f64 * levels, ray * levels);
        Measured {
            family: format!("{}", number / 2),
            tried_build_seconds: grid.build_seconds,
            tried: Tried::ask(50, 512, grid.build_seconds, |_| Run {
                rays: 8,
                hits: 4,
                seconds: Some(8.0 * grid.ray_seconds),
            }),
            scene: MeasuredScene {
                scene: format!("{}-{}", number / 2, number % 2),
                rays: scheme,
                features: Features {
                    triangles,
                    refs_per_triangle: 2.0 + 0.1 * f64::from(number % 5),
                    sigma: 5.0,
                    sparseness: 0.9,
                    hit_share: 0.5,
                },
                times: BTreeMap::from([
                    (Kind::Grid, grid),
                    (Kind::Objects, tree(3e-8, 1.2e-7)),
                    (Kind::Fast, tree(6e-8, 1.1e-7)),
                    (Kind::Balanced, tree(8e-8, 1e-7)),
                    (Kind::Best, tree(1.2e-7, 9.9e-8)),
                    (Kind::Lazy, tree(1e-7, 1e-6)),
                ]),
            },
        }
    };
    (0..24).map(scene).collect()
}
