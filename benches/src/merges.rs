//! What merging trees costs and is worth: an object swept from outside into clutter that stands still, each of the methods of
//! `kd-merge` against building everything anew.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use kd::glam::Vec3;
use kd::layout::PackedTree;
use kd::tree::Tree;
use kd::{BuildOptions, CostModel, Mesh, Ray};
use kd_core::{Arena, NodeIndex, Slot};
use kd_merge::{
    Census, MergeOptions, Merged, Placed, bsp_merge, build_clusters, insert, partition_trees,
};
use kd_scene::{Camera, Spd};

use crate::cli::at_least_one;
use crate::goals::{Goal, Row, Table, geometric_mean};
use crate::measure::{self, Repeats};
use crate::rays::{self, RayKind, RaySource};
use crate::record::median_ratio;
use crate::{run_folder, terminal};

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct MergesArgs {
    /// Timed repeats of everything, each after one of what it is compared with
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Small meshes and few rays: a check that everything works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Where the object is, in sizes of what stands still, and how large.
const POSES: [(&str, Vec3, f32); 5] = [
    ("outside", Vec3::new(0.8, 0.05, 0.1), 0.2),
    ("at the wall", Vec3::new(0.55, 0.05, 0.1), 0.2),
    ("half inside", Vec3::new(0.5, 0.05, 0.1), 0.2),
    ("inside", Vec3::new(0.2, 0.05, 0.1), 0.2),
    ("all over it", Vec3::ZERO, 1.0),
];

/// A way to put two trees together.
#[derive(Clone, Copy, Debug)]
enum Method {
    PartitionTrees,
    BspMerge,
    Insert,
    Clusters,
}

/// Triangles to a cluster, at most. (Updates with 64 and 256 took within 3 % of the same time.)
const CLUSTER: usize = 1024;

const METHODS: [(&str, Method); 4] = [
    ("partition trees", Method::PartitionTrees),
    ("BSP merge", Method::BspMerge),
    ("insertion", Method::Insert),
    ("clusters", Method::Clusters),
];

/// How often ours is as fast as building anew with `best` and with `fast`; its SAH cost over that of `best`, and its times for
/// [`KINDS`] of rays.
#[derive(Clone, Copy, Debug)]
struct Figures {
    over_best: f64,
    over_fast: f64,
    cost: f64,
    times: [f64; KINDS.len()],
}

const KINDS: [RayKind; 2] = [RayKind::Primary, RayKind::Random];

/// Measures, prints and writes; false if a merged tree misses something. A goal that is not met is said, and is no failure.
pub(crate) fn run(arguments: &MergesArgs) -> anyhow::Result<bool> {
    let (still_size, moving_size) = if arguments.smoke { (1, 1) } else { (8, 2) };
    let still = Spd::Gears.generate(still_size)?.mesh;
    let moving = Spd::Balls.generate(moving_size)?.mesh;
    println!(
        "{} triangles that stand still (gears), {} that move (balls)",
        still.len(),
        moving.len()
    );
    let mut measured: Vec<[Figures; METHODS.len()]> = Vec::new();
    let mut problems = Vec::new();
    for (pose, place, size) in POSES {
        eprintln!("{pose}");
        let scene = Scene::new(&still, placed(&moving, &still, place, size)?)?;
        let built = scene.build_anew()?;
        let mut of_pose = Vec::new();
        for (name, method) in METHODS {
            let (tree, merged) = scene.merged(method)?;
            eprintln!("  {name}: {merged:?}");
            if let Err(missing) = tree.check_coverage(&scene.both) {
                problems.push(format!("{pose}, {name}: {missing}"));
            }
            of_pose.push(scene.measure(method, &tree, &built, arguments.samples)?);
        }
        let of_pose = <[Figures; METHODS.len()]>::try_from(of_pose)
            .ok()
            .context("one for each method")?;
        measured.push(of_pose);
    }
    let table = table(&measured);
    println!("{table}");
    println!(
        "one thread, medians of {} pairs; an update is the object's tree by `fast`, which insertion does without, and its merge into that of the rest",
        arguments.samples
    );
    if let Some(path) = &arguments.json {
        run_folder::write(path, table.to_lines()?)?;
        println!("wrote {}", path.display());
    }
    Ok(terminal::tell_problems(&problems))
}

fn table(measured: &[[Figures; METHODS.len()]]) -> Table {
    let mut rows = Vec::new();
    for (place, (name, _)) in METHODS.into_iter().enumerate() {
        let mut row = |what: &str, goal: Goal, value: &dyn Fn(&Figures) -> f64| {
            let values = measured.iter().map(|of_pose| Some(value(&of_pose[place])));
            let name = format!("{name}: {what}");
            rows.push(Row::new(name, goal, values.collect(), geometric_mean));
        };
        row("updates in the time of `best`", Goal::AtLeast(25.0), &|f| {
            f.over_best
        });
        row("updates in the time of `fast`", Goal::AtLeast(6.0), &|f| {
            f.over_fast
        });
        row("SAH cost / `best`", Goal::None, &|f| f.cost);
        row("time of primary rays / `best`", Goal::AtMost(1.02), &|f| {
            f.times[0]
        });
        row("time of random rays / `best`", Goal::AtMost(1.02), &|f| {
            f.times[1]
        });
    }
    Table {
        scenes: POSES.map(|(pose, ..)| pose.to_owned()).into(),
        rows,
    }
}

/// The object at a place beside, or in, what stands still.
fn placed(moving: &Mesh, still: &Mesh, place: Vec3, size: f32) -> anyhow::Result<Mesh> {
    let (from, to) = (moving.bounds(), still.bounds());
    let scale = size * to.extent().max_element() / from.extent().max_element();
    let center = to.center() + place * to.extent();
    let moved = |p: &[f32; 3]| (center + scale * (Vec3::from_array(*p) - from.center())).to_array();
    let positions = moving.positions().iter().map(moved).collect();
    Ok(moving.with_positions(positions)?)
}

/// What stands still, with its tree in an arena, and what moves.
struct Scene {
    still: Mesh,
    moving: Mesh,
    both: Mesh,
    arena: Arena,
    census: Census,
    tree: NodeIndex,
    rays: [Vec<Ray>; KINDS.len()],
}

impl Scene {
    fn new(still: &Mesh, moving: Mesh) -> anyhow::Result<Self> {
        let both = Mesh::concatenated([still, &moving])?;
        let mut arena = Arena::new();
        let tree = build(still, &BuildOptions::best())?;
        let tree = arena.append_tree(&tree, 0)?;
        arena.freeze(u32::try_from(still.len())?)?;
        let mut census = Census::new();
        census.extend(arena.nodes());
        let camera = Camera::looking_at_whole(both.bounds(), Vec3::Y);
        let primary = rays::primary(&camera, 512);
        let source = RaySource {
            mesh: &both,
            light: camera.eye,
            primary: &primary,
            points: &[],
            limit: 1 << 16,
        };
        let rays = KINDS.map(|kind| source.rays(kind));
        Ok(Self {
            still: still.clone(),
            moving,
            both,
            arena,
            census,
            tree,
            rays,
        })
    }

    /// The tree of everything, by `best`.
    fn build_anew(&self) -> anyhow::Result<Tree> {
        build(&self.both, &BuildOptions::best())
    }

    /// What a frame takes: the tree of what moves, and the merge. The arena is left as it was found.
    fn update(
        &self,
        method: Method,
        arena: &mut Arena,
        census: &mut Census,
    ) -> anyhow::Result<Merged> {
        let (segments, nodes) = (self.arena.segments(), self.arena.nodes().len());
        arena.truncate(segments);
        census.truncate(nodes);
        let first = u32::try_from(self.still.len())?;
        let end = u32::try_from(self.both.len())?;
        let options = MergeOptions::resplitting(16, BuildOptions::fast());
        let bounds = self.both.bounds();
        let moving = || (first..end).map(Slot).collect::<Vec<Slot>>();
        let still = Placed {
            root: self.tree,
            bounds: self.still.bounds(),
        };
        let merged = match method {
            Method::Insert => {
                let tree = self.tree;
                insert(arena, tree, &moving(), &self.both, bounds, &options)?
            }
            Method::BspMerge => {
                let trees = [self.tree, self.append_moving(arena)?];
                bsp_merge(arena, trees, &self.both, bounds, &options)?
            }
            Method::PartitionTrees => {
                let moving = Placed {
                    root: self.append_moving(arena)?,
                    bounds: self.moving.bounds(),
                };
                census.extend(arena.nodes());
                partition_trees(arena, census, &[still, moving], &self.both, &options)?
            }
            Method::Clusters => {
                let mut trees = build_clusters(arena, &moving(), &self.both, CLUSTER, &options)?;
                arena.freeze(end)?;
                census.extend(arena.nodes());
                trees.push(still);
                partition_trees(arena, census, &trees, &self.both, &options)?
            }
        };
        arena.freeze(end)?;
        Ok(merged)
    }

    /// Builds the tree of what moves.
    fn append_moving(&self, arena: &mut Arena) -> anyhow::Result<NodeIndex> {
        let tree = build(&self.moving, &BuildOptions::fast())?;
        let root = arena.append_tree(&tree, u32::try_from(self.still.len())?)?;
        arena.freeze(u32::try_from(self.both.len())?)?;
        Ok(root)
    }

    fn merged(&self, method: Method) -> anyhow::Result<(Tree, Merged)> {
        let (mut arena, mut census) = (self.arena.clone(), self.census.clone());
        let merged = self.update(method, &mut arena, &mut census)?;
        let tree = Tree::from_arena(arena, merged.root, self.both.bounds(), CostModel::PACKED)?;
        Ok((tree, merged))
    }

    fn measure(
        &self,
        method: Method,
        merged: &Tree,
        built: &Tree,
        samples: usize,
    ) -> anyhow::Result<Figures> {
        let repeats = Repeats {
            pairs: samples,
            until: Duration::MAX,
        };
        let (mut arena, mut census) = (self.arena.clone(), self.census.clone());
        let mut over = |options: BuildOptions| -> anyhow::Result<f64> {
            let pairs = measure::in_pairs(
                repeats,
                || build(&self.both, &options).map(|tree| _ = black_box(tree)),
                || {
                    let merged = self.update(method, &mut arena, &mut census);
                    merged.map(|merged| _ = black_box(merged))
                },
            )?;
            Ok(median_ratio(&pairs.baseline, &pairs.own))
        };
        let (over_best, over_fast) = (over(BuildOptions::best())?, over(BuildOptions::fast())?);
        let packed = [built, merged].map(|tree| PackedTree::new(tree, &self.both));
        let times = self.rays.each_ref().map(|rays| {
            let trace = |tree: &PackedTree| {
                for ray in rays {
                    black_box(tree.intersect(ray));
                }
                Ok::<(), std::convert::Infallible>(())
            };
            let Ok(pairs) = measure::in_pairs(repeats, || trace(&packed[0]), || trace(&packed[1]));
            median_ratio(&pairs.own, &pairs.baseline)
        });
        let model = CostModel::PACKED;
        Ok(Figures {
            over_best,
            over_fast,
            cost: merged.sah_cost(&model) / built.sah_cost(&model),
            times,
        })
    }
}

/// On one thread.
fn build(mesh: &Mesh, options: &BuildOptions) -> anyhow::Result<Tree> {
    Ok(kd::custom::build(mesh, &options.clone().with_threads(1))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_where_it_says() {
        let still = Spd::Gears.generate(1).expect("small").mesh;
        let moving = Spd::Balls.generate(1).expect("small").mesh;
        let [outside, .., inside, _] = POSES.map(|(_, place, size)| {
            let moved = placed(&moving, &still, place, size)
                .expect("valid")
                .bounds();
            moved.intersection(&still.bounds())
        });
        assert!(outside.is_empty(), "{outside:?}");
        let size = inside.extent() / still.bounds().extent();
        assert!(size.max_element() <= 0.21, "all of it is inside: {size}");
    }

    #[test]
    fn every_method_merges_a_small_scene() {
        let still = Spd::Gears.generate(1).expect("small").mesh;
        let moving = Spd::Balls.generate(1).expect("small").mesh;
        let moved = placed(&moving, &still, Vec3::ZERO, 0.5).expect("valid");
        let scene = Scene::new(&still, moved).expect("valid");
        for (name, method) in METHODS {
            let (tree, merged) = scene.merged(method).expect("merged");
            tree.check_coverage(&scene.both)
                .unwrap_or_else(|missing| panic!("{name}: {missing}"));
            assert!(merged.links > 0, "{name}: {merged:?}");
        }
    }
}
