//! What each query of rays costs over the closest hit, in every structure, beside the test that holds it and Embree's time.

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use kd::grid::{GridOptions, UniformGrid};
use kd::query::RayHit;
use kd::{
    BuildOptions, Culling, FrameData, KdTree, Layout, LazyTree, Mesh, Ray, RayQuery, Scene,
    Strategy, Verdict,
};
use kd_rivals::Queries;
use serde::Serialize;

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::measure::{Repeats, in_sure_pairs};
use crate::rays::RayKind;
use crate::record::median_ratio;
use crate::scenes::{self, SceneSource};
use crate::workload::{self, Amount};
use crate::{peers, run_folder, text};

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct QueriesArgs {
    /// Measures the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    samples: usize,

    /// Tiny scenes and few rays: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The scenes without `--scene`: a scan, a room and a game level in a folder of meshes; two generated ones without a folder.
const IN_FOLDER: [&str; 3] = ["bunny", "sponza_dabrovic", "czest2ctf"];
const GENERATED: [&str; 2] = ["balls", "gears"];

/// A query, in the order of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Query {
    Intersect,
    Occluded,
    FirstHits,
    AllHits,
    CountHits,
    HitsBehind,
    EachHit,
    AcceptsFirst,
    RejectsHalf,
    OccludedFiltered,
    HitsFiltered,
    BackCulled,
    FrontCulled,
    IntersectBatch,
    OccludedBatch,
    HitsBatch,
    CountBatch,
    FilteredBatch,
    ParIntersect,
    ParOccluded,
    ParHits,
    ParCount,
    ParFiltered,
}

/// The test that compares every query of trees with brute force.
const OF_TREES: &str = "kd::oracle::queries_of_all_hits_on_every_scene_equal_brute_force";
/// Hits that a query of the first ones asks for.
const FIRST: usize = kd_rivals::FIRST;

impl Query {
    const ALL: [Self; 23] = [
        Self::Intersect,
        Self::Occluded,
        Self::FirstHits,
        Self::AllHits,
        Self::CountHits,
        Self::HitsBehind,
        Self::EachHit,
        Self::AcceptsFirst,
        Self::RejectsHalf,
        Self::OccludedFiltered,
        Self::HitsFiltered,
        Self::BackCulled,
        Self::FrontCulled,
        Self::IntersectBatch,
        Self::OccludedBatch,
        Self::HitsBatch,
        Self::CountBatch,
        Self::FilteredBatch,
        Self::ParIntersect,
        Self::ParOccluded,
        Self::ParHits,
        Self::ParCount,
        Self::ParFiltered,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Intersect => "`intersect`",
            Self::Occluded => "`occluded`",
            Self::FirstHits => "`hits`, the first 4",
            Self::AllHits => "`hits`, all",
            Self::CountHits => "`count_hits`",
            Self::HitsBehind => "`hits_behind` the first, 4",
            Self::EachHit => "`each_hit`, the first 4",
            Self::AcceptsFirst => "`intersect_filtered`, the first is accepted",
            Self::RejectsHalf => "`intersect_filtered`, half are rejected",
            Self::OccludedFiltered => "`occluded_filtered`, half are rejected",
            Self::HitsFiltered => "`hits_filtered`, the first 4 of half",
            Self::BackCulled => "`intersect`, back culled",
            Self::FrontCulled => "`intersect`, front culled",
            Self::IntersectBatch => "`intersect_batch`",
            Self::OccludedBatch => "`occluded_batch`",
            Self::HitsBatch => "`hits_batch`, the first 4",
            Self::CountBatch => "`count_hits_batch`",
            Self::FilteredBatch => "`intersect_filtered_batch`, half are rejected",
            Self::ParIntersect => "`par_intersect_batch`",
            Self::ParOccluded => "`par_occluded_batch`",
            Self::ParHits => "`par_hits_batch`",
            Self::ParCount => "`par_count_hits_batch`",
            Self::ParFiltered => "`par_intersect_filtered_batch`",
        }
    }

    fn is_on_all_threads(self) -> bool {
        self.plain() != Self::Intersect
    }

    /// What its time is compared with: a batch on all threads with the batch on one, any other with the closest hit.
    fn plain(self) -> Self {
        match self {
            Self::ParIntersect => Self::IntersectBatch,
            Self::ParOccluded => Self::OccludedBatch,
            Self::ParHits => Self::HitsBatch,
            Self::ParCount => Self::CountBatch,
            Self::ParFiltered => Self::FilteredBatch,
            _ => Self::Intersect,
        }
    }

    /// Asks it of all rays.
    fn run<Q: RayQuery + Sync>(self, query: &Q, rays: &[Ray], answers: &mut Answers<Q::Hit>) {
        let Answers {
            hits,
            occluded,
            counts,
            list,
        } = answers;
        match self {
            Self::Intersect => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = query.intersect(ray);
                }
            }
            Self::Occluded => {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = query.occluded(ray);
                }
            }
            Self::FirstHits | Self::AllHits => {
                let max = if self == Self::FirstHits {
                    FIRST
                } else {
                    usize::MAX
                };
                for (ray, count) in rays.iter().zip(counts) {
                    query.hits(ray, max, list);
                    *count = list.len();
                }
            }
            Self::CountHits => {
                for (ray, count) in rays.iter().zip(counts) {
                    *count = query.count_hits(ray);
                }
            }
            Self::HitsBehind => {
                for ((ray, count), hit) in rays.iter().zip(counts).zip(hits) {
                    *count = 0;
                    if let Some(hit) = hit {
                        query.hits_behind(ray, hit, FIRST, list);
                        *count = list.len();
                    }
                }
            }
            Self::EachHit => {
                for (ray, count) in rays.iter().zip(counts) {
                    *count = query.each_hit(ray).take(FIRST).count();
                }
            }
            Self::AcceptsFirst => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = query.intersect_filtered(ray, |_| Verdict::Accept);
                }
            }
            Self::RejectsHalf => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = query.intersect_filtered(ray, half);
                }
            }
            Self::OccludedFiltered => {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = query.occluded_filtered(ray, half);
                }
            }
            Self::HitsFiltered => {
                for (ray, count) in rays.iter().zip(counts) {
                    query.hits_filtered(ray, FIRST, list, half);
                    *count = list.len();
                }
            }
            Self::BackCulled | Self::FrontCulled => {
                let side = if self == Self::BackCulled {
                    Culling::BACK
                } else {
                    Culling::FRONT
                };
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = query.intersect(&ray.with_culling(side));
                }
            }
            Self::IntersectBatch => query.intersect_batch(rays, hits),
            Self::OccludedBatch => query.occluded_batch(rays, occluded),
            Self::HitsBatch => drop(black_box(query.hits_batch(rays, FIRST))),
            Self::CountBatch => query.count_hits_batch(rays, counts),
            Self::FilteredBatch => query.intersect_filtered_batch(rays, hits, |_, hit| half(hit)),
            Self::ParIntersect => query.par_intersect_batch(rays, hits),
            Self::ParOccluded => query.par_occluded_batch(rays, occluded),
            Self::ParHits => drop(black_box(query.par_hits_batch(rays, FIRST))),
            Self::ParCount => query.par_count_hits_batch(rays, counts),
            Self::ParFiltered => {
                query.par_intersect_filtered_batch(rays, hits, |_, hit| half(hit));
            }
        }
    }

    /// Asks it of Embree, if Embree has it.
    fn run_rival(self, rival: &Rival, rays: &[Ray], answers: &mut Answers<kd::Hit>) -> bool {
        let Answers {
            hits,
            occluded,
            counts,
            list,
        } = answers;
        match self {
            Self::Intersect => rival.plain.intersect_each(rays, hits),
            Self::Occluded => rival.plain.occluded_each(rays, occluded),
            Self::FirstHits | Self::HitsBatch => {
                for (ray, count) in rays.iter().zip(counts) {
                    rival.filtered.hits(ray, FIRST, list);
                    *count = list.len();
                }
            }
            Self::AllHits | Self::CountHits | Self::CountBatch => {
                for (ray, count) in rays.iter().zip(counts) {
                    rival.plain.hits(ray, usize::MAX, list);
                    *count = list.len();
                }
            }
            Self::IntersectBatch => rival.plain.intersect_batch(rays, hits),
            Self::OccludedBatch => rival.plain.occluded_batch(rays, occluded),
            _ => return false,
        }
        true
    }
}

/// A filter that rejects the triangles of odd numbers.
fn half<H: RayHit>(hit: &H) -> Verdict {
    if hit.triangle().is_multiple_of(2) {
        Verdict::Accept
    } else {
        Verdict::Reject
    }
}

/// Room for the answers of all rays.
struct Answers<H> {
    hits: Vec<Option<H>>,
    occluded: Vec<bool>,
    counts: Vec<usize>,
    list: Vec<H>,
}

impl<H: RayHit> Answers<H> {
    fn for_rays(rays: usize) -> Self {
        Self {
            hits: vec![None; rays],
            occluded: vec![false; rays],
            counts: vec![0; rays],
            list: Vec::new(),
        }
    }
}

/// Embree's medium BVH, and one with a filter that collects hits.
struct Rival {
    plain: Box<dyn Queries>,
    filtered: Box<dyn Queries>,
}

/// A line of the record: a query of a structure on a scene.
#[derive(Debug, Serialize)]
struct Row {
    rev: String,
    cpu: String,
    threads: usize,
    scene: String,
    structure: String,
    query: String,
    test: String,
    /// Nanoseconds a ray of the query, and of the plain query before each.
    query_ns: Vec<f64>,
    plain_ns: Vec<f64>,
    /// Nanoseconds a ray of Embree's query, and of ours after each. Empty where Embree has none.
    ours_ns: Vec<f64>,
    rival_ns: Vec<f64>,
    library: String,
}

/// Measures, prints and writes; false if Embree and a tree count other hits.
pub(crate) fn run(arguments: &QueriesArgs) -> anyhow::Result<bool> {
    let environment = Environment::detect();
    let has_rival = peers::check_available().is_ok();
    let mut rows = Vec::new();
    for source in sources(arguments)? {
        let scene = source.load()?;
        let mesh = Arc::clone(&scene.mesh);
        let rays = random_rays(&scene, arguments.smoke);
        let rival = if has_rival {
            Some(Rival {
                plain: peers::medium(&mesh, 1)?,
                filtered: peers::filtered(&mesh, 1)?,
            })
        } else {
            None
        };
        let head = Row {
            rev: environment.rev.clone(),
            cpu: environment.cpu.clone(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            scene: source.name.clone(),
            structure: String::new(),
            query: String::new(),
            test: String::new(),
            query_ns: Vec::new(),
            plain_ns: Vec::new(),
            ours_ns: Vec::new(),
            rival_ns: Vec::new(),
            library: String::new(),
        };
        let measure = Measure {
            samples: arguments.samples,
            rays: &rays,
            head: &head,
        };
        let tree = |layout| {
            let options = BuildOptions::balanced().with_layout(layout);
            KdTree::build(Arc::clone(&mesh), &options)
        };
        let wide = tree(Layout::Wide)?;
        measure.structure(["kd-tree, wide", OF_TREES], &wide, &mut rows);
        if let Some(rival) = &rival {
            measure.rival(&wide, rival, &mut rows);
        }
        measure.structure(
            ["kd-tree, binary", OF_TREES],
            &tree(Layout::Binary)?,
            &mut rows,
        );
        let (frame, shared) = (copied(&mesh)?, shared(&mesh)?);
        measure.structure(
            [
                "scene",
                "kd::sight::masks_and_culling_hold_for_every_query_of_every_strategy",
            ],
            &*frame,
            &mut rows,
        );
        measure.structure(
            [
                "scene, shared trees",
                "kd::instances::shared_trees_answer_as_copies",
            ],
            &*shared,
            &mut rows,
        );
        let lazy = LazyTree::new(Arc::clone(&mesh), &BuildOptions::balanced())?;
        measure.structure(
            ["lazy tree", "kd::lazy::every_query_equals_brute_force"],
            &lazy,
            &mut rows,
        );
        let grid = UniformGrid::build(Arc::clone(&mesh), &GridOptions::new())?;
        measure.structure(
            ["grid", "crates/kd-grid/tests/grid/trials.rs"],
            &grid,
            &mut rows,
        );
    }
    println!("{}", table(&rows));
    println!(
        "times over those of `intersect` in the same structure, `par_` forms over those on one thread; medians of {} pairs of random \
         rays, geometric means over scenes; the last column is wide nodes over Embree, where Embree has the query",
        arguments.samples
    );
    run_folder::write_all([arguments.json.clone()], run_folder::json_lines(&rows)?)?;
    Ok(true)
}

fn sources(arguments: &QueriesArgs) -> anyhow::Result<Vec<SceneSource>> {
    let usual: &[&str] = match arguments.scenes {
        Some(_) => &IN_FOLDER,
        None => &GENERATED,
    };
    let names: Vec<String> = if arguments.scene.is_empty() {
        usual.iter().map(|name| (*name).to_owned()).collect()
    } else {
        arguments.scene.clone()
    };
    scenes::choose_from(arguments.scenes.as_deref(), &names, arguments.smoke)
}

/// Rays through random points of the bounding sphere.
fn random_rays(scene: &scenes::Scene, is_smoke: bool) -> Vec<Ray> {
    let amount = Amount {
        side: if is_smoke { 32 } else { 1024 },
        ray_limit: if is_smoke { 1 << 10 } else { 1 << 16 },
        brute_force_tests: 0,
        least_checked: 0,
    };
    let reference = KdTree::build(Arc::clone(&scene.mesh), &BuildOptions::fast());
    let reference = reference.expect("the default options");
    let workloads = workload::all(scene, &[RayKind::Random], amount, &reference);
    workloads
        .into_iter()
        .flat_map(|workload| workload.rays)
        .collect()
}

/// A frame of one part.
fn copied(mesh: &Arc<Mesh>) -> anyhow::Result<Arc<FrameData>> {
    let mut scene = Scene::new(BuildOptions::balanced());
    scene.add_static(Arc::clone(mesh))?;
    scene.commit()?;
    Ok(scene.snapshot())
}

/// A frame of two parts in one place, of which rays see one, that share a tree.
fn shared(mesh: &Arc<Mesh>) -> anyhow::Result<Arc<FrameData>> {
    let mut scene = Scene::new(BuildOptions::balanced());
    scene.set_strategy(Strategy::Instances);
    scene.add_static(Arc::clone(mesh))?;
    let far = mesh.bounds().extent().max_element() * 1e3;
    let other = scene.add_static(Arc::clone(mesh))?;
    let away = kd::glam::Affine3A::from_translation(kd::glam::Vec3::splat(far));
    scene.set_transform(other, away)?;
    scene.commit()?;
    Ok(scene.snapshot())
}

/// How a scene is measured.
struct Measure<'a> {
    samples: usize,
    rays: &'a [Ray],
    head: &'a Row,
}

impl Measure<'_> {
    /// Every query of a structure over the plain one.
    fn structure<Q: RayQuery + Sync>(
        &self,
        [name, test]: [&str; 2],
        structure: &Q,
        rows: &mut Vec<Row>,
    ) {
        // Threads need more rays to share.
        let many: Vec<Ray> = self.rays.repeat(4);
        for query in Query::ALL {
            let rays = if query.is_on_all_threads() {
                &many
            } else {
                self.rays
            };
            let [mut of_plain, mut of_query] = [(); 2].map(|()| Answers::for_rays(rays.len()));
            // Places to search behind, and memory that is there.
            Query::Intersect.run(structure, rays, &mut of_query);
            let pairs = in_sure_pairs(
                Repeats::all(self.samples),
                || query.plain().run(structure, rays, &mut of_plain),
                || query.run(structure, rays, &mut of_query),
            );
            let (query_ns, plain_ns) = pairs.scaled(1e9 / rays.len() as f64);
            rows.push(Row {
                structure: name.to_owned(),
                query: query.name().to_owned(),
                test: test.to_owned(),
                query_ns,
                plain_ns,
                ..self.head.copy()
            });
        }
    }

    /// The queries that Embree has, over Embree.
    fn rival(&self, tree: &KdTree, rival: &Rival, rows: &mut [Row]) {
        let per_ray = 1e9 / self.rays.len() as f64;
        for query in Query::ALL {
            let mut ours = Answers::for_rays(self.rays.len());
            let mut theirs = Answers::for_rays(self.rays.len());
            if !query.run_rival(rival, self.rays, &mut theirs) {
                continue;
            }
            let pairs = in_sure_pairs(
                Repeats::all(self.samples),
                || {
                    query.run_rival(rival, self.rays, &mut theirs);
                },
                || query.run(tree, self.rays, &mut ours),
            );
            let (ours_ns, rival_ns) = pairs.scaled(per_ray);
            let row = rows
                .iter_mut()
                .find(|row| row.scene == self.head.scene && row.query == query.name());
            if let Some(row) = row {
                row.ours_ns = ours_ns;
                row.rival_ns = rival_ns;
                row.library = peers::library_of(&["embree"]);
            }
        }
    }
}

impl Row {
    /// The same scene and machine, without figures.
    fn copy(&self) -> Self {
        Self {
            rev: self.rev.clone(),
            cpu: self.cpu.clone(),
            scene: self.scene.clone(),
            structure: self.structure.clone(),
            query: self.query.clone(),
            test: self.test.clone(),
            library: self.library.clone(),
            query_ns: Vec::new(),
            plain_ns: Vec::new(),
            ours_ns: Vec::new(),
            rival_ns: Vec::new(),
            threads: self.threads,
        }
    }

    fn over_plain(&self) -> f64 {
        median_ratio(&self.query_ns, &self.plain_ns)
    }

    fn over_rival(&self) -> Option<f64> {
        (!self.rival_ns.is_empty()).then(|| median_ratio(&self.ours_ns, &self.rival_ns))
    }
}

fn table(rows: &[Row]) -> String {
    let mut structures: Vec<&str> = Vec::new();
    for row in rows {
        if !structures.contains(&row.structure.as_str()) {
            structures.push(&row.structure);
        }
    }
    let head = ["query"].into_iter().chain(structures.iter().copied());
    let mut table = text::empty_table(head.chain(["wide / Embree"]));
    for query in Query::ALL {
        let of_query = |row: &&Row| row.query == query.name();
        let mut cells = vec![query.name().replace('`', "")];
        for structure in &structures {
            let of_both = rows
                .iter()
                .filter(of_query)
                .filter(|row| row.structure == *structure);
            cells.push(geometric_mean(of_both.map(Row::over_plain)));
        }
        cells.push(geometric_mean(
            rows.iter().filter(of_query).filter_map(Row::over_rival),
        ));
        table.add_row(cells);
    }
    text::align_right(&mut table, 1);
    table.to_string()
}

fn geometric_mean(values: impl Iterator<Item = f64>) -> String {
    let logarithms: Vec<f64> = values.map(f64::ln).collect();
    if logarithms.is_empty() {
        return String::new();
    }
    let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
    format!("{:.2}", mean.exp())
}
