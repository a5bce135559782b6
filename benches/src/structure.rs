//! What can be measured: anything that is built over a mesh and answers rays.

use std::fmt;
use std::sync::Arc;

use anyhow::Context as _;
use clap::ValueEnum;
use kd::{BuildOptions, CostModel, Hit, KdTree, Mesh, Method, Ray};

use crate::cli::name_of;
use crate::record::Steps;

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum StructureName {
    /// The kd-tree
    Kd,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum BuilderName {
    /// The middle of each cell, axes in turn
    Median,
    /// The plane of least SAH cost, O(N²)
    Naive,
    /// The same plane, O(N log² N)
    Resort,
    /// The same plane, O(N log N)
    Exact,
    /// The preset that builds fast
    Fast,
    /// The preset that is the default
    Balanced,
    /// The preset that traces fast
    Best,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum LayoutName {
    /// The tree's own 8-byte nodes
    Binary,
}

impl BuilderName {
    fn options(self) -> BuildOptions {
        match self {
            Self::Median => literature(Method::Median),
            Self::Naive => literature(Method::Naive),
            Self::Resort => literature(Method::Resort),
            Self::Exact => literature(Method::Exact),
            Self::Fast => BuildOptions::fast(),
            Self::Balanced => BuildOptions::balanced(),
            Self::Best => BuildOptions::best(),
        }
    }

    /// Above so many triangles a build takes many seconds, soon minutes, and the sweep leaves it out.
    pub(crate) const fn most_triangles(self) -> usize {
        match self {
            Self::Naive => 20_000,
            _ => usize::MAX,
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

/// What everything is compared with.
pub(crate) const BASELINE: Variant = Variant {
    structure: StructureName::Kd,
    builder: BuilderName::Balanced,
    layout: LayoutName::Binary,
};

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (structure, builder, layout) = (
            name_of(&self.structure),
            name_of(&self.builder),
            name_of(&self.layout),
        );
        write!(f, "{structure}/{builder}/{layout}")
    }
}

impl Variant {
    pub(crate) fn build(
        self,
        mesh: &Arc<Mesh>,
        threads: usize,
    ) -> anyhow::Result<Box<dyn Structure>> {
        let options = self.builder.options().with_threads(threads);
        let tree = KdTree::build(Arc::clone(mesh), &options)
            .with_context(|| format!("cannot build {self}"))?;
        Ok(Box::new(tree))
    }
}

impl Variant {
    /// The tree alone, without what is derived from it to trace faster: what `peak_build_bytes` is about.
    pub(crate) fn build_bare(self, mesh: &Mesh) -> anyhow::Result<kd::Tree> {
        let options = self.builder.options().with_threads(1);
        kd::custom::build(mesh, &options).with_context(|| format!("cannot build {self}"))
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

impl Structure for KdTree {
    fn flaw(&self) -> Option<String> {
        let covered = self.tree().check_coverage(self.mesh());
        covered.err().map(|missing| missing.to_string())
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.intersect_batch(rays, hits);
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        self.occluded_batch(rays, hits);
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
            bytes_total: stats.bytes_total(),
            text: stats.to_string(),
        }
    }
}
