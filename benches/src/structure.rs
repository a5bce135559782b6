//! What can be measured: anything that is built over a mesh and answers rays.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context as _;
use clap::ValueEnum;
use kd::{BuildOptions, CostModel, Hit, KdTree, Layout, Mesh, Method, Ray, RayPacket8};

use crate::cli::name_of;
use crate::memory::{Taken, bytes_during};
use crate::ours;
use crate::peers;
use crate::record::Steps;

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum StructureName {
    /// The kd-tree
    Kd,
    /// The uniform grid
    Grid,
    /// The bounding volume hierarchy; with --peers, the crate bvh too
    Bvh,
    /// A comparator: the octree
    Octree,
    /// A comparator: the BSP tree of planes of triangles
    Bsp,
    /// Embree 3, one ray at a time
    Embree,
    /// Embree 3, packets of 8 rays
    Embree8,
    /// Embree 3 with its robust flag, one ray at a time
    EmbreeRobust,
    /// The crate obvhs
    Obvhs,
    /// The crate parry3d
    Parry3d,
}

impl StructureName {
    /// Whether it is nothing but a library that we measure ourselves against.
    pub(crate) const fn is_rival(self) -> bool {
        match self {
            Self::Kd | Self::Grid | Self::Bvh | Self::Octree | Self::Bsp => false,
            Self::Embree | Self::Embree8 | Self::EmbreeRobust | Self::Obvhs | Self::Parry3d => true,
        }
    }

    /// Whether its nodes may lie in memory in several ways.
    pub(crate) const fn has_layouts(self) -> bool {
        matches!(self, Self::Kd | Self::Bvh)
    }

    /// Whether it is compiled with this program, so that it matters what for.
    pub(crate) const fn is_rust_rival(self) -> bool {
        matches!(self, Self::Obvhs | Self::Bvh | Self::Parry3d)
    }

    /// The ways to build it.
    pub(crate) fn builders(self) -> Vec<BuilderName> {
        let builders: &[BuilderName] = match self {
            Self::Kd => {
                let all = BuilderName::value_variants().iter().copied();
                return all.filter(|name| name.options().is_some()).collect();
            }
            Self::Grid => &[BuilderName::Exact, BuilderName::Boxes],
            Self::Bvh => &[
                BuilderName::Objects,
                BuilderName::Binned,
                BuilderName::Sweep,
                BuilderName::BottomUp,
                BuilderName::Midpoint,
                BuilderName::EqualCounts,
                BuilderName::Default,
            ],
            Self::Octree => &[BuilderName::Median],
            Self::Bsp => &[BuilderName::Polygon],
            Self::Embree | Self::Embree8 => {
                &[BuilderName::Low, BuilderName::Medium, BuilderName::High]
            }
            // Embree splits no triangles in a robust scene: high would be medium again.
            Self::EmbreeRobust => &[BuilderName::Low, BuilderName::Medium],
            Self::Obvhs => &[BuilderName::Fastest, BuilderName::Medium, BuilderName::Slow],
            Self::Parry3d => &[BuilderName::Default],
        };
        builders.to_vec()
    }
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum BuilderName {
    /// The middle of each cell, axes in turn
    Median,
    /// The plane of least SAH cost, O(N²)
    Naive,
    /// The same plane, O(N log² N)
    Resort,
    /// The same plane, O(N log N), from events sorted once; a hierarchy divided by SAH anywhere along an axis
    Sweep,
    /// The same plane, from bins that bound what is in them; in a grid, the cells that triangles meet
    Exact,
    /// Planes at and beside the boundaries of 32 bins; a hierarchy divided by SAH between bins
    Binned,
    /// Planes where a cost sampled at 16 planes an axis is least
    Sampled,
    /// The best preset below one level of medians: a subtree for each of two threads
    MedianTop,
    /// The preset that builds fast
    Fast,
    /// The preset that is the default
    Balanced,
    /// The preset that traces fast
    Best,
    /// In a grid, the cells that boxes of triangles meet
    Boxes,
    /// Wide nodes from triangles divided as objects, with no binary hierarchy between
    Objects,
    /// A hierarchy put together from neighbours
    BottomUp,
    /// A hierarchy divided in the middle of its centres
    Midpoint,
    /// A hierarchy divided into halves of its triangles
    EqualCounts,
    /// Planes of triangles
    Polygon,
    /// Embree's quickest build
    Low,
    /// Embree's default build; the medium build of obvhs, a wide BVH
    Medium,
    /// Embree's build with spatial splits
    High,
    /// The quickest build of obvhs, a binary BVH
    Fastest,
    /// The slow build of obvhs, a wide BVH
    Slow,
    /// The only build of bvh and of parry3d
    Default,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum LayoutName {
    /// The tree's own 8-byte nodes
    Binary,
    /// Nodes of eight children
    Wide,
    /// Of what has only one: whatever it does
    #[value(skip)]
    Own,
}

impl BuilderName {
    /// What it means for the kd-tree, if it is one of its builders.
    pub(crate) fn options(self) -> Option<BuildOptions> {
        let options = match self {
            Self::Median => literature(Method::Median),
            Self::Naive => literature(Method::Naive),
            Self::Resort => literature(Method::Resort),
            Self::Sweep => literature(Method::Sweep),
            Self::Exact => literature(Method::Exact),
            Self::Binned => literature(Method::Binned { bins: 32 }),
            Self::Sampled => literature(Method::Sampled { all_axes: true }),
            Self::MedianTop => BuildOptions::best().with_median_levels(1),
            Self::Fast => BuildOptions::fast(),
            Self::Balanced => BuildOptions::balanced(),
            Self::Best => BuildOptions::best(),
            Self::Low | Self::Medium | Self::High => return None,
            Self::Fastest | Self::Slow | Self::Default => return None,
            Self::Boxes | Self::BottomUp | Self::Midpoint | Self::EqualCounts => return None,
            Self::Polygon | Self::Objects => return None,
        };
        Some(options)
    }

    /// Whether it is a way to build of a library that we measure ourselves against.
    pub(crate) const fn is_of_rival(self) -> bool {
        matches!(
            self,
            Self::Low | Self::Medium | Self::High | Self::Fastest | Self::Slow | Self::Default
        )
    }

    /// Above so many triangles a build takes many seconds, soon minutes, and the sweep leaves it out.
    pub(crate) const fn most_triangles(self) -> usize {
        match self {
            Self::Naive => 20_000,
            _ => usize::MAX,
        }
    }
}

impl LayoutName {
    /// What it means for the kd-tree.
    pub(crate) const fn layout(self) -> Layout {
        match self {
            Self::Binary => Layout::Binary,
            Self::Wide | Self::Own => Layout::Wide,
        }
    }

    /// As records write it, the one that nobody can ask for included.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Own => "own".into(),
            named => name_of(&named),
        }
    }
}

/// The builders of the papers run with the constants of the papers, so that costs can be compared: K_T 15, K_I 20,
/// empty space at 0.9, no more than 6 triangles divided, 3 bad refines. The presets have constants of our own.
fn literature(method: Method) -> BuildOptions {
    BuildOptions::best()
        .with_method(method)
        .with_cost(CostModel::CLASSIC)
        .with_small_leaf(6)
        .with_bad_refines(3)
}

/// What to build, and how.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Variant {
    pub(crate) structure: StructureName,
    pub(crate) builder: BuilderName,
    pub(crate) layout: LayoutName,
}

/// The structure that makes the rays and says what is hit, and what everything of ours is compared with.
pub(crate) const REFERENCE: Variant = Variant {
    structure: StructureName::Kd,
    builder: BuilderName::Balanced,
    layout: LayoutName::Wide,
};

/// What everything is compared with where rivals are measured.
pub(crate) const RIVAL: Variant = Variant {
    structure: StructureName::Embree,
    builder: BuilderName::Medium,
    layout: LayoutName::Own,
};

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (structure, builder) = (name_of(&self.structure), name_of(&self.builder));
        let layout = self.layout.name();
        write!(f, "{structure}/{builder}/{layout}")
    }
}

impl Variant {
    /// Whether it is of a library that we measure ourselves against. Those answer as they please: see
    /// [`Answers::disagreements`](crate::check::Answers::disagreements).
    pub(crate) const fn is_rival(self) -> bool {
        self.builder.is_of_rival()
    }

    pub(crate) fn build(self, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
        let built = match self.structure {
            StructureName::Kd => self.kd_tree(mesh, threads),
            _ if self.is_rival() => peers::build(self, mesh, threads),
            StructureName::Grid => ours::grid(self.builder, mesh, threads),
            StructureName::Bvh => ours::bvh(self, mesh, threads),
            StructureName::Octree => ours::octree(mesh),
            StructureName::Bsp => ours::bsp(mesh),
            _ => peers::build(self, mesh, threads),
        };
        built.with_context(|| format!("cannot build {self}"))
    }

    fn kd_tree(self, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
        let options = self.builder.options().context("not a way to build it")?;
        let options = options
            .with_threads(threads)
            .with_layout(self.layout.layout());
        let measured = Measured::try_of(|| KdTree::build(Arc::clone(mesh), &options))?;
        Ok(measured.into_built(|tree, _| Box::new(tree)))
    }

    /// The most that was allocated at a time until our tree was there, without what is derived from it to trace faster;
    /// `None` for what is no kd-tree.
    pub(crate) fn peak_bytes_of_tree(self, mesh: &Mesh) -> anyhow::Result<Option<usize>> {
        let is_kd_tree = self.structure == StructureName::Kd;
        let Some(options) = self.builder.options().filter(|_| is_kd_tree) else {
            return Ok(None);
        };
        let options = options.with_threads(1);
        let measured = Measured::try_of(|| kd::custom::build(mesh, &options))
            .with_context(|| format!("cannot build {self}"))?;
        Ok(Some(measured.bytes.peak))
    }
}

/// A structure, and what its build took.
pub(crate) struct Built {
    pub(crate) structure: Box<dyn Structure>,
    pub(crate) seconds: f64,
    /// The most that was allocated at a time, above the input; means something for a build on one thread.
    pub(crate) peak_bytes: usize,
}

/// What a build returned and took.
#[derive(Debug)]
pub(crate) struct Measured<T> {
    value: T,
    seconds: f64,
    bytes: Taken,
}

impl<T> Measured<T> {
    pub(crate) fn try_of<E>(build: impl FnOnce() -> Result<T, E>) -> Result<Self, E> {
        let start = Instant::now();
        let (value, bytes) = bytes_during(build);
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            value: value?,
            seconds,
            bytes,
        })
    }

    /// With the structure made of the value and the bytes that are left of the build.
    pub(crate) fn into_built(
        self,
        structure: impl FnOnce(T, usize) -> Box<dyn Structure>,
    ) -> Built {
        Built {
            structure: structure(self.value, self.bytes.kept),
            seconds: self.seconds,
            peak_bytes: self.bytes.peak,
        }
    }
}

/// What every structure can do. Queries take whole lists, so that one virtual call serves many rays.
pub(crate) trait Structure: Send + Sync {
    /// The closest hit of each ray.
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]);
    /// Whether each ray hits anything.
    fn any(&self, rays: &[Ray], hits: &mut [bool]);
    /// The closest hit of one ray and the steps it took, if the structure counts them.
    fn counted(&self, ray: &Ray) -> Option<(Option<Hit>, Steps)>;
    fn shape(&self) -> Shape;
    /// What is wrong with it, as far as can be told without rays.
    fn flaw(&self) -> Option<String>;
}

/// How many hits of a ray [`OrderedHits`] tells.
pub(crate) const FIRST: usize = 4;

/// Where a ray meets its first hits, in order; ∞ for each that there is not.
pub(crate) type Distances = [f32; FIRST];

/// What can tell several hits of a ray.
pub(crate) trait OrderedHits: Send + Sync {
    /// The first hits of each ray.
    fn first(&self, rays: &[Ray], distances: &mut [Distances]);
}

/// Those of at most [`FIRST`] hits.
#[inline]
pub(crate) fn distances_of(hits: &[Hit]) -> Distances {
    let mut distances = [f32::INFINITY; FIRST];
    for (distance, hit) in distances.iter_mut().zip(hits) {
        *distance = hit.t;
    }
    distances
}

/// What a structure looks like.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(crate) nodes: usize,
    pub(crate) leaves: usize,
    pub(crate) empty_leaves: usize,
    pub(crate) refs: usize,
    pub(crate) depth: usize,
    pub(crate) sah_cost_15_20: f64,
    pub(crate) sah_cost_own: f64,
    pub(crate) bytes_total: usize,
    /// All of it in words, for the report.
    pub(crate) text: String,
}

impl Shape {
    /// Of a structure that does not show what it is like.
    pub(crate) fn unknown() -> Self {
        Self {
            nodes: 0,
            leaves: 0,
            empty_leaves: 0,
            refs: 0,
            depth: 0,
            sah_cost_15_20: 0.0,
            sah_cost_own: 0.0,
            bytes_total: 0,
            text: String::new(),
        }
    }
}

/// Our tree, asked about many rays at once.
pub(crate) struct Asked<'a> {
    pub(crate) tree: &'a KdTree,
    pub(crate) by: Manner,
}

/// How rays are put together.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Manner {
    /// All of a list.
    Batch,
    /// Eight at a time, as they lie in the list.
    Packets,
}

impl Structure for Asked<'_> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match self.by {
            Manner::Batch => self.tree.intersect_batch(rays, hits),
            Manner::Packets => {
                for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
                    let found = self.tree.intersect8(&RayPacket8::new(rays));
                    hits.copy_from_slice(&found[..hits.len()]);
                }
            }
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        match self.by {
            Manner::Batch => self.tree.occluded_batch(rays, hits),
            Manner::Packets => {
                for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
                    let found = self.tree.occluded8(&RayPacket8::new(rays));
                    hits.copy_from_slice(&found[..hits.len()]);
                }
            }
        }
    }

    fn counted(&self, ray: &Ray) -> Option<(Option<Hit>, Steps)> {
        self.tree.counted(ray)
    }

    fn shape(&self) -> Shape {
        self.tree.shape()
    }

    fn flaw(&self) -> Option<String> {
        self.tree.flaw()
    }
}

impl Structure for KdTree {
    fn flaw(&self) -> Option<String> {
        let covered = self.tree().check_coverage(self.mesh());
        covered.err().map(|missing| missing.to_string())
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.occluded(ray);
        }
    }

    fn counted(&self, ray: &Ray) -> Option<(Option<Hit>, Steps)> {
        let (hit, counts) = self.intersect_counted(ray);
        let steps = Steps {
            node_steps: counts.nodes.into(),
            leaf_steps: counts.leaves.into(),
            triangle_tests: counts.triangles.into(),
        };
        Some((hit, steps))
    }

    fn shape(&self) -> Shape {
        let stats = self.stats();
        Shape {
            nodes: stats.nodes,
            leaves: stats.leaves,
            empty_leaves: stats.empty_leaves,
            refs: stats.references,
            depth: stats.depth,
            sah_cost_15_20: stats.sah_cost_15_20,
            sah_cost_own: stats.sah_cost_own,
            bytes_total: stats.bytes_kept(),
            text: stats.to_string(),
        }
    }
}
