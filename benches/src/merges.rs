//! What merges of trees cost and are worth: an object that moves from outside into static clutter, by each method of
//! `kd-merge`, over rebuilds.

use std::hint::black_box;
use std::path::PathBuf;

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

use crate::arguments::{at_least_one, name_of};
use crate::environment::Environment;
use crate::measure::{in_pairs, in_sure_pairs};
use crate::rays::{self, RayKind, RaySource};
use crate::session::Session;
use crate::view::View;
use crate::{run_folder, text};

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct MergesArgs {
    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Small meshes and few rays: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The place of the object in sizes of the static mesh, and its size.
const POSES: [(&str, Vec3, f32); 5] = [
    ("outside", Vec3::new(0.8, 0.05, 0.1), 0.2),
    ("at the wall", Vec3::new(0.55, 0.05, 0.1), 0.2),
    ("half inside", Vec3::new(0.5, 0.05, 0.1), 0.2),
    ("inside", Vec3::new(0.2, 0.05, 0.1), 0.2),
    ("all over it", Vec3::ZERO, 1.0),
];

/// A method to merge two trees.
#[derive(Clone, Copy, Debug)]
enum Method {
    PartitionTrees,
    BspMerge,
    Insert,
    Clusters,
}

/// Upper limit of triangles in a cluster. (Updates with 64 and 256 take the same time within 3 %.)
const CLUSTER: usize = 1024;

const METHODS: [(&str, Method); 4] = [
    ("partition trees", Method::PartitionTrees),
    ("BSP merge", Method::BspMerge),
    ("insertion", Method::Insert),
    ("clusters", Method::Clusters),
];

const KINDS: [RayKind; 2] = [RayKind::Primary, RayKind::Random];

/// The rebuilds that merges are compared with, by tree construction only.
const REBUILT: [&str; 2] = ["kd/best/tree", "kd/fast/tree"];

/// The name of a method in cells.
fn subject(method: &str) -> String {
    format!("merge/{method}/tree")
}

/// Measures, prints and writes; false if a merged tree misses a triangle.
pub(crate) fn run(arguments: &MergesArgs) -> anyhow::Result<bool> {
    let (static_size, moving_size) = if arguments.smoke { (1, 1) } else { (8, 2) };
    let fixed = Spd::Gears.generate(static_size)?.mesh;
    let moving = Spd::Balls.generate(moving_size)?.mesh;
    println!(
        "{} static triangles (gears), {} moving (balls)",
        fixed.len(),
        moving.len()
    );
    let environment = Environment::detect();
    let (mut cells, mut problems) = (Vec::new(), Vec::new());
    for (pose, place, size) in POSES {
        eprintln!("{pose}");
        let scene = Scene::new(&fixed, placed(&moving, &fixed, place, size)?)?;
        let rebuilt = build(&scene.both, &BuildOptions::best())?;
        let mut session = Session::new(&environment, pose, scene.both.len(), arguments.samples);
        for (name, method) in METHODS {
            let (tree, merged) = scene.merged(method)?;
            eprintln!("  {name}: {merged:?}");
            if let Err(missing) = tree.check_coverage(&scene.both) {
                problems.push(format!("{pose}, {name}: {missing}"));
            }
            scene.measure(&mut session, (name, method), [&rebuilt, &tree])?;
        }
        cells.extend(session.cells);
    }
    let table = View::named(&["merges"], ("", ""))?.of(&cells);
    println!("{table}");
    println!(
        "one thread, medians of {} pairs; an update builds the object's tree by `fast`, except for insertion, and merges it into \
         the static tree",
        arguments.samples
    );
    run_folder::write_all([arguments.json.clone()], table.to_lines()?)?;
    Ok(text::report_problems(&problems))
}

/// The object at a place beside or inside the static mesh.
fn placed(moving: &Mesh, fixed: &Mesh, place: Vec3, size: f32) -> anyhow::Result<Mesh> {
    let (from, to) = (moving.bounds(), fixed.bounds());
    let scale = size * to.extent().max_element() / from.extent().max_element();
    let center = to.center() + place * to.extent();
    let moved = |p: &[f32; 3]| (center + scale * (Vec3::from_array(*p) - from.center())).to_array();
    let positions = moving.positions().iter().map(moved).collect();
    Ok(moving.with_positions(positions)?)
}

/// The static mesh, with its tree in an arena, and the moving one.
struct Scene {
    fixed: Mesh,
    moving: Mesh,
    both: Mesh,
    arena: Arena,
    census: Census,
    tree: NodeIndex,
    rays: [Vec<Ray>; KINDS.len()],
}

impl Scene {
    fn new(fixed: &Mesh, moving: Mesh) -> anyhow::Result<Self> {
        let both = Mesh::concatenated([fixed, &moving])?;
        let mut arena = Arena::new();
        let tree = build(fixed, &BuildOptions::best())?;
        let tree = arena.append_tree(&tree, 0)?;
        arena.freeze(u32::try_from(fixed.len())?)?;
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
            fixed: fixed.clone(),
            moving,
            both,
            arena,
            census,
            tree,
            rays,
        })
    }

    /// The work of a frame: the tree of the moving mesh, and the merge. The arena first returns to its static state.
    fn update(
        &self,
        method: Method,
        arena: &mut Arena,
        census: &mut Census,
    ) -> anyhow::Result<Merged> {
        let (segments, nodes) = (self.arena.segments(), self.arena.nodes().len());
        arena.truncate(segments);
        census.truncate(nodes);
        let first = u32::try_from(self.fixed.len())?;
        let end = u32::try_from(self.both.len())?;
        let options = MergeOptions::resplitting(16, BuildOptions::fast());
        let bounds = self.both.bounds();
        let moving = || (first..end).map(Slot).collect::<Vec<Slot>>();
        let fixed = Placed {
            root: self.tree,
            bounds: self.fixed.bounds(),
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
                partition_trees(arena, census, &[fixed, moving], &self.both, &options)?
            }
            Method::Clusters => {
                let mut trees = build_clusters(arena, &moving(), &self.both, CLUSTER, &options)?;
                arena.freeze(end)?;
                census.extend(arena.nodes());
                trees.push(fixed);
                partition_trees(arena, census, &trees, &self.both, &options)?
            }
        };
        arena.freeze(end)?;
        Ok(merged)
    }

    /// Builds the tree of the moving mesh.
    fn append_moving(&self, arena: &mut Arena) -> anyhow::Result<NodeIndex> {
        let tree = build(&self.moving, &BuildOptions::fast())?;
        let root = arena.append_tree(&tree, u32::try_from(self.fixed.len())?)?;
        arena.freeze(u32::try_from(self.both.len())?)?;
        Ok(root)
    }

    fn merged(&self, method: Method) -> anyhow::Result<(Tree, Merged)> {
        let (mut arena, mut census) = (self.arena.clone(), self.census.clone());
        let merged = self.update(method, &mut arena, &mut census)?;
        let tree = Tree::from_arena(arena, merged.root, self.both.bounds(), CostModel::PACKED)?;
        Ok((tree, merged))
    }

    /// Adds the cells of a method; trees are the rebuilt and the merged one.
    fn measure(
        &self,
        session: &mut Session<'_>,
        (name, method): (&str, Method),
        [rebuilt, merged]: [&Tree; 2],
    ) -> anyhow::Result<()> {
        let subject = subject(name);
        let (mut arena, mut census) = (self.arena.clone(), self.census.clone());
        for (over, options) in REBUILT
            .into_iter()
            .zip([BuildOptions::best(), BuildOptions::fast()])
        {
            let pairs = in_pairs(
                session.repeats,
                || build(&self.both, &options).map(|tree| _ = black_box(tree)),
                || {
                    let merged = self.update(method, &mut arena, &mut census);
                    merged.map(|merged| _ = black_box(merged))
                },
            )?;
            session.add_build(&subject, over, &pairs);
        }
        let packed = [rebuilt, merged].map(|tree| PackedTree::new(tree, &self.both));
        for (kind, rays) in KINDS.into_iter().zip(&self.rays) {
            let trace = |tree: &PackedTree| {
                for ray in rays {
                    black_box(tree.intersect(ray));
                }
            };
            let pairs = in_sure_pairs(session.repeats, || trace(&packed[0]), || trace(&packed[1]));
            session.add_rays(&subject, &name_of(&kind), REBUILT[0], &pairs, rays.len());
        }
        for (subject, tree) in [(subject.as_str(), merged), (REBUILT[0], rebuilt)] {
            let mut cell = session.blank(subject, "", 1, "");
            cell.exact.sah_cost_own = tree.sah_cost(&CostModel::PACKED);
            session.add(cell);
        }
        Ok(())
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
        let fixed = Spd::Gears.generate(1).expect("small").mesh;
        let moving = Spd::Balls.generate(1).expect("small").mesh;
        let [outside, .., inside, _] = POSES.map(|(_, place, size)| {
            let moved = placed(&moving, &fixed, place, size)
                .expect("valid")
                .bounds();
            moved.intersection(&fixed.bounds())
        });
        assert!(outside.is_empty(), "{outside:?}");
        let size = inside.extent() / fixed.bounds().extent();
        assert!(size.max_element() <= 0.21, "all of it is inside: {size}");
    }

    #[test]
    fn every_method_merges_a_small_scene() {
        let fixed = Spd::Gears.generate(1).expect("small").mesh;
        let moving = Spd::Balls.generate(1).expect("small").mesh;
        let moved = placed(&moving, &fixed, Vec3::ZERO, 0.5).expect("valid");
        let scene = Scene::new(&fixed, moved).expect("valid");
        for (name, method) in METHODS {
            let (tree, merged) = scene.merged(method).expect("merged");
            tree.check_coverage(&scene.both)
                .unwrap_or_else(|missing| panic!("{name}: {missing}"));
            assert!(merged.links > 0, "{name}: {merged:?}");
        }
    }
}
