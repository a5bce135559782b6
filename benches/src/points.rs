//! How fast points are answered: closest points near and far, inside or not, and winding numbers; with rivals, and goals.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use fastrand::Rng;
use kd::glam::Vec3;
use kd::points::Nearest;
use kd::{BuildOptions, KdTree, Mesh};
use kd_rivals::{PointQueries, PointRival};
use serde::Serialize;

use crate::arguments::at_least_one;
use crate::environment::Environment;
use crate::measure::{Repeats, in_chunks, in_sure_pairs};
use crate::record::{median, median_ratio};
use crate::scenes::{self, SceneSource};
use crate::{peers, run_folder, text};

/// The meshes of the goals: two scans and a building.
const SCENES: [&str; 3] = ["bunny", "dragon_res2", "sponza_dabrovic"];
/// Generated scenes, without a folder.
const GENERATED: [&str; 3] = ["balls", "mount", "gears"];
/// Near points are displaced by up to this share of the diagonal from the surface.
const NEAR: f32 = 0.01;
/// Far points are in a box of this size, over that of the scene.
const FAR: f32 = 3.0;
/// Distances differ if they do by this share of the sum of the diagonal and the distance. (Rivals compute in f32, and err on slivers: by up to
/// a thousandth of the diagonal for some triangles of `sponza_dabrovic`, where ours equal those in rational numbers.)
const TOLERANCE: f64 = 1e-4;
/// So many of a million distances may differ.
const MOST_PPM: f64 = 100.0;

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct PointsArgs {
    /// Folder of mesh files
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,

    /// Only these scenes
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Points of each kind
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = at_least_one)]
    count: usize,

    /// Threads of every query
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    threads: usize,

    /// Timed repeats of each measurement, each after one of the rival
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    samples: usize,

    /// Also measure Embree and parry3d
    #[arg(long)]
    peers: bool,

    /// Small scenes and few points: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A row of the table.
#[derive(Debug, Serialize)]
struct Row {
    rev: String,
    cpu: String,
    threads: usize,
    scene: String,
    triangles: usize,
    /// `near`, `far`, `contains` or `winding`.
    kind: String,
    points: usize,
    /// Milliseconds of a batch.
    batch_ms: Vec<f64>,
    /// Milliseconds for the same points one by one, on one thread.
    single_ms: Vec<f64>,
    rivals: Vec<OverRival>,
}

/// Times over those of a rival.
#[derive(Debug, Serialize)]
struct OverRival {
    rival: String,
    batch_ms: Vec<f64>,
    rival_ms: Vec<f64>,
    /// The largest difference of distances, over the sum of the diagonal and the distance.
    worst_difference: f64,
    /// Of a million distances, how many differ.
    differ_ppm: f64,
    /// How many times as fast we want to be.
    goal: f64,
}

/// Measures, prints and writes; false if a goal is missed or too many distances differ.
pub(crate) fn run(arguments: &PointsArgs) -> anyhow::Result<bool> {
    if arguments.peers {
        peers::check_available()?;
    }
    let environment = Environment::detect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .context("threads")?;
    let mut rows = Vec::new();
    for source in sources(arguments)? {
        let mesh = source.load()?.mesh;
        let tree = KdTree::build(mesh, &BuildOptions::balanced())?;
        let scene = Measured {
            arguments,
            tree: &tree,
        };
        for mut row in pool.install(|| scene.rows())? {
            row.rev.clone_from(&environment.rev);
            row.cpu.clone_from(&environment.cpu);
            row.scene.clone_from(&source.name);
            rows.push(row);
        }
    }
    println!("{}", table(&rows));
    println!(
        "near: up to {NEAR} diagonals from the surface; far: in a box of {FAR} times the scene's; medians of {}, over rivals in pairs, on {} threads",
        arguments.samples, arguments.threads
    );
    if let Some(path) = &arguments.json {
        run_folder::write_all([Some(path.clone())], run_folder::json_lines(&rows)?)?;
    }
    let problems: Vec<String> = rows.iter().flat_map(Row::wrong).collect();
    let mut is_well = text::report_problems(&problems);
    if !arguments.smoke {
        let missed: Vec<String> = rows.iter().flat_map(Row::missed).collect();
        is_well &= text::report_problems(&missed);
    }
    Ok(is_well)
}

fn sources(arguments: &PointsArgs) -> anyhow::Result<Vec<SceneSource>> {
    let PointsArgs {
        scenes,
        scene: names,
        smoke,
        ..
    } = arguments;
    if !names.is_empty() {
        return scenes::choose_from(scenes.as_deref(), names, *smoke);
    }
    let Some(folder) = scenes else {
        return scenes::choose_from(None, &GENERATED.map(String::from), *smoke);
    };
    let all = scenes::in_folder(folder)?;
    let of_goals = |source: &SceneSource| SCENES.contains(&source.name.as_str());
    let has_goals = all.iter().any(of_goals);
    Ok(all
        .into_iter()
        .filter(|source| !has_goals || of_goals(source))
        .collect())
}

/// A scene under measurement.
struct Measured<'a> {
    arguments: &'a PointsArgs,
    tree: &'a KdTree,
}

impl Measured<'_> {
    fn rows(&self) -> anyhow::Result<Vec<Row>> {
        let mesh = self.tree.mesh();
        if mesh.is_empty() {
            return Ok(Vec::new());
        }
        let count = if self.arguments.smoke {
            self.arguments.count.min(200)
        } else {
            self.arguments.count
        };
        let (near, far) = (near_points(mesh, count), far_points(mesh, count));
        let rivals = self.rivals()?;
        Ok(vec![
            self.closest("near", &near, &rivals, [1.5, 3.0]),
            self.closest("far", &far, &rivals, [3.0, 3.0]),
            self.inside(&near),
            self.winding(&near),
        ])
    }

    fn rivals(&self) -> anyhow::Result<Vec<Box<dyn PointQueries>>> {
        if !self.arguments.peers {
            return Ok(Vec::new());
        }
        let both = [PointRival::Embree, PointRival::Parry3d];
        let built = both.map(|rival| rival.build(self.tree.mesh(), self.arguments.threads));
        Ok(built.into_iter().collect::<Result<_, _>>()?)
    }

    fn closest(
        &self,
        kind: &str,
        points: &[Vec3],
        rivals: &[Box<dyn PointQueries>],
        goals: [f64; 2],
    ) -> Row {
        let mut nearest: Vec<Option<Nearest>> = vec![None; points.len()];
        let batch = |nearest: &mut [Option<Nearest>]| {
            if self.arguments.threads == 1 {
                self.tree
                    .closest_point_batch(points, f32::INFINITY, nearest);
            } else {
                self.tree
                    .par_closest_point_batch(points, f32::INFINITY, nearest);
            }
        };
        let mut row = self.row(
            kind,
            points,
            || batch(&mut nearest),
            |point| {
                self.tree.closest_point(point, f32::INFINITY);
            },
        );
        let arrays: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
        let mut distances = vec![0.0; points.len()];
        let named = [
            kd_rivals::embree_name().unwrap_or_default(),
            "parry3d".into(),
        ];
        for ((rival, name), goal) in rivals.iter().zip(named).zip(goals) {
            let theirs = || {
                in_chunks(
                    &arrays,
                    &mut distances,
                    self.arguments.threads,
                    |points, out| {
                        rival.distances(points, out);
                    },
                );
            };
            let pairs = in_sure_pairs(self.repeats(), theirs, || batch(&mut nearest));
            let (batch_ms, rival_ms) = pairs.scaled(1e3);
            let differences = self.differences(&nearest, &distances);
            let differing = differences
                .iter()
                .filter(|difference| **difference > TOLERANCE);
            row.rivals.push(OverRival {
                rival: name,
                batch_ms,
                rival_ms,
                differ_ppm: 1e6 * differing.count() as f64 / points.len() as f64,
                worst_difference: differences.into_iter().fold(0.0, f64::max),
                goal,
            });
        }
        row
    }

    /// Of distances, over the sum of the diagonal and the distance.
    fn differences(&self, nearest: &[Option<Nearest>], distances: &[f32]) -> Vec<f64> {
        let diagonal = f64::from(self.tree.mesh().bounds().diagonal());
        let pairs = nearest.iter().zip(distances);
        let differences = pairs.map(|(nearest, theirs)| {
            let ours = nearest.map_or(f64::INFINITY, |nearest| f64::from(nearest.distance));
            (ours - f64::from(*theirs)).abs() / (diagonal + ours)
        });
        differences.collect()
    }

    fn inside(&self, points: &[Vec3]) -> Row {
        let mut inside = vec![false; points.len()];
        let batch = || {
            if self.arguments.threads == 1 {
                self.tree.contains_batch(points, &mut inside);
            } else {
                self.tree.par_contains_batch(points, &mut inside);
            }
        };
        self.row("contains", points, batch, |point| {
            self.tree.contains(point);
        })
    }

    /// The hierarchy is made before.
    fn winding(&self, points: &[Vec3]) -> Row {
        // A winding number takes as long as tens of closest points.
        let points = &points[..points.len().div_ceil(10)];
        self.tree.winding_number(Vec3::ZERO);
        let mut numbers = vec![0.0; points.len()];
        let batch = || {
            if self.arguments.threads == 1 {
                self.tree.winding_number_batch(points, &mut numbers);
            } else {
                self.tree.par_winding_number_batch(points, &mut numbers);
            }
        };
        self.row("winding", points, batch, |point| {
            self.tree.winding_number(point);
        })
    }

    /// The times of a batch, each after one of single points.
    fn row(&self, kind: &str, points: &[Vec3], batch: impl FnMut(), single: impl Fn(Vec3)) -> Row {
        let one_by_one = || points.iter().for_each(|point| single(*point));
        let pairs = in_sure_pairs(self.repeats(), one_by_one, batch);
        let (batch_ms, single_ms) = pairs.scaled(1e3);
        Row {
            rev: String::new(),
            cpu: String::new(),
            threads: self.arguments.threads,
            scene: String::new(),
            triangles: self.tree.mesh().len(),
            kind: kind.into(),
            points: points.len(),
            batch_ms,
            single_ms,
            rivals: Vec::new(),
        }
    }

    fn repeats(&self) -> Repeats {
        Repeats::all(self.arguments.samples)
    }
}

/// Points of the surface, each displaced in some direction.
fn near_points(mesh: &Mesh, count: usize) -> Vec<Vec3> {
    let mut rng = Rng::with_seed(1);
    let size = NEAR * mesh.bounds().diagonal();
    let triangles = u32::try_from(mesh.len()).unwrap_or(u32::MAX);
    let mut point = || {
        let [a, b, c] = mesh.corners(rng.u32(0..triangles));
        let (u, v) = (rng.f32().sqrt(), rng.f32());
        let on_face = (1.0 - u) * a + u * (1.0 - v) * b + u * v * c;
        on_face + size * rng.f32() * direction(&mut rng)
    };
    (0..count).map(|_| point()).collect()
}

/// Points in a box around the scene.
fn far_points(mesh: &Mesh, count: usize) -> Vec<Vec3> {
    let mut rng = Rng::with_seed(2);
    let bounds = mesh.bounds();
    let mut point = || {
        let place = Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5;
        bounds.center() + FAR * place * bounds.extent()
    };
    (0..count).map(|_| point()).collect()
}

fn direction(rng: &mut Rng) -> Vec3 {
    loop {
        let place = 2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 1.0;
        if (0.01..1.0).contains(&place.length_squared()) {
            return place.normalize();
        }
    }
}

impl Row {
    /// The rivals that differ too often.
    fn wrong(&self) -> Vec<String> {
        let rivals = self.rivals.iter().filter(|over| over.differ_ppm > MOST_PPM);
        let wrong = rivals.map(|over| {
            let (rival, ppm) = (&over.rival, over.differ_ppm);
            let (scene, kind) = (&self.scene, &self.kind);
            format!("{scene} {kind}: {rival} differs in {ppm:.0} of a million")
        });
        wrong.collect()
    }

    /// The goals that are missed.
    fn missed(&self) -> Vec<String> {
        let missed = self.rivals.iter().filter(|over| over.speed() < over.goal);
        let texts = missed.map(|over| {
            let (speed, goal, rival) = (over.speed(), over.goal, &over.rival);
            format!(
                "{} {}: {speed:.2} times as fast as {rival}, and not {goal}",
                self.scene, self.kind
            )
        });
        texts.collect()
    }

    /// Millions of points a second.
    fn speed(&self, milliseconds: &[f64]) -> String {
        format!("{:.3}", self.points as f64 / median(milliseconds) * 1e-3)
    }
}

impl OverRival {
    /// How many times as fast we are.
    fn speed(&self) -> f64 {
        median_ratio(&self.rival_ms, &self.batch_ms)
    }
}

fn table(rows: &[Row]) -> String {
    let head = [
        "scene",
        "points",
        "M/s",
        "one by one",
        "over Embree (goal)",
        "over parry3d (goal)",
        "differ by",
        "ppm",
    ];
    let mut table = text::empty_table(head);
    for row in rows {
        let over = |number: usize| {
            row.rivals.get(number).map_or_else(String::new, |over| {
                format!("×{:.2} ({})", over.speed(), over.goal)
            })
        };
        let worst = row.rivals.iter().map(|over| over.worst_difference);
        let worst = worst.reduce(f64::max);
        let ppm = row.rivals.iter().map(|over| over.differ_ppm);
        let ppm = ppm.reduce(f64::max);
        table.add_row([
            row.scene.clone(),
            row.kind.clone(),
            row.speed(&row.batch_ms),
            row.speed(&row.single_ms),
            over(0),
            over(1),
            worst.map_or_else(String::new, |worst| format!("{worst:.1e}")),
            ppm.map_or_else(String::new, |ppm| format!("{ppm:.0}")),
        ]);
    }
    text::align_right(&mut table, 2);
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(speed: f64, differ_ppm: f64) -> Row {
        Row {
            rev: String::new(),
            cpu: String::new(),
            threads: 1,
            scene: "a".into(),
            triangles: 1,
            kind: "near".into(),
            points: 1000,
            batch_ms: vec![2.0],
            single_ms: vec![4.0],
            rivals: vec![OverRival {
                rival: "Embree 3".into(),
                batch_ms: vec![1.0],
                rival_ms: vec![speed],
                worst_difference: 1e-6,
                differ_ppm,
                goal: 1.5,
            }],
        }
    }

    #[test]
    fn goals_and_differences_are_reported() {
        let good = row(2.0, 20.0);
        assert_eq!((good.missed(), good.wrong()), (vec![], vec![]), "as wanted");
        assert_eq!(row(1.0, 0.0).missed().len(), 1, "too slow");
        assert_eq!(row(2.0, 200.0).wrong().len(), 1, "too different");
        let text = table(&[good]);
        for part in ["near", "0.500", "0.250", "×2.00 (1.5)", "1.0e-6", "20"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn points_are_where_they_should_be() {
        let mesh = Mesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vec![[0, 1, 2]],
        );
        let mesh = mesh.expect("valid");
        let diagonal = mesh.bounds().diagonal();
        for point in near_points(&mesh, 100) {
            assert!(point.z.abs() <= NEAR * diagonal, "{point}");
        }
        let far = far_points(&mesh, 100);
        assert!(far.iter().any(|point| point.x < -0.5), "around the scene");
    }
}
