//! The builds of our structures.

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, bail};
use kd::layout::WideTree;
use kd::{KdTree, Mesh};
use kd_comparators::{
    Bvh, BvhMethod, BvhOptions, BvhStats, CellOptions, CellStats, Octree, PolygonBsp,
};
use kd_grid::{GridOptions, Overlap, UniformGrid};
use rayon::ThreadPoolBuilder;

use crate::memory::bytes_during;
use crate::names::{BuilderName, LayoutName, StructureName, Variant};
use crate::structure::{Built, Queried, Shape};

pub(crate) fn build(variant: Variant, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    match variant.structure {
        StructureName::Kd => kd_tree(variant, mesh, threads),
        StructureName::Grid => grid(variant.builder, mesh, threads),
        StructureName::Bvh => bvh(variant, mesh, threads),
        StructureName::Octree => Ok(Built::queried(
            || Octree::build(Arc::clone(mesh), &CellOptions::default()),
            |octree| shape_of(&octree.stats()),
        )?),
        StructureName::Bsp => Ok(Built::queried(
            || PolygonBsp::build(Arc::clone(mesh), &CellOptions::default()),
            |bsp| shape_of(&bsp.stats()),
        )?),
        _ => bail!("{variant} is a rival"),
    }
}

fn kd_tree(variant: Variant, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    let options = variant.builder.options();
    let options = options.context("not a builder of kd-trees")?;
    let options = options.with_threads(threads);
    let options = options.with_layout(variant.layout.layout());
    let build = || KdTree::build(Arc::clone(mesh), &options);
    Ok(Built::of(build, |tree| tree)?)
}

/// Seconds of tree construction only, without layout.
pub(crate) fn tree_seconds(
    builder: BuilderName,
    mesh: &Mesh,
    threads: usize,
) -> anyhow::Result<f64> {
    let options = builder.options().context("not a builder of kd-trees")?;
    let options = options.with_threads(threads);
    let start = Instant::now();
    let tree = kd::custom::build(mesh, &options)?;
    let seconds = start.elapsed().as_secs_f64();
    drop(tree);
    Ok(seconds)
}

/// The peak of allocated bytes of tree construction, without layout; `None` for a structure that is not a kd-tree.
pub(crate) fn peak_bytes_of_tree(variant: Variant, mesh: &Mesh) -> anyhow::Result<Option<usize>> {
    let is_kd_tree = variant.structure == StructureName::Kd;
    let Some(options) = variant.builder.options().filter(|_| is_kd_tree) else {
        return Ok(None);
    };
    let options = options.with_threads(1);
    let (tree, bytes) = bytes_during(|| kd::custom::build(mesh, &options));
    tree.with_context(|| format!("cannot build {variant}"))?;
    Ok(Some(bytes.peak))
}

fn grid(builder: BuilderName, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    let overlap = match builder {
        BuilderName::Boxes => Overlap::Box,
        _ => Overlap::Exact,
    };
    let options = GridOptions::new()
        .with_overlap(overlap)
        .with_threads(threads);
    let build = || UniformGrid::build(Arc::clone(mesh), &options);
    Ok(Built::queried(build, |grid| {
        let stats = grid.stats().with_zero_area(grid.mesh().zero_area_count());
        Shape {
            leaves: stats.cells,
            empty_leaves: stats.empty_cells,
            refs: stats.references,
            bytes_total: stats.bytes,
            text: stats.to_string(),
            ..Shape::default()
        }
    })?)
}

/// The hierarchy through its own nodes, or through wide nodes that are made of it or directly of objects.
fn bvh(variant: Variant, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    let usual = BvhOptions::new().with_threads(threads);
    let options = match variant.builder {
        BuilderName::Objects => {
            return Built::queried(
                || of_objects(mesh, threads),
                |wide| Shape {
                    bytes_total: bytes_of(wide),
                    ..Shape::default()
                },
            );
        }
        BuilderName::Binned => usual,
        BuilderName::Sweep => usual.with_method(BvhMethod::Sweep),
        BuilderName::BottomUp => usual.with_method(BvhMethod::BottomUp { radius: 16 }),
        BuilderName::Midpoint => usual.with_method(BvhMethod::Midpoint),
        BuilderName::EqualCounts => usual.with_method(BvhMethod::EqualCounts),
        _ => bail!("not a builder of hierarchies"),
    };
    let build = || Bvh::build(Arc::clone(mesh), &options);
    if variant.layout == LayoutName::Binary {
        return Ok(Built::queried(build, |bvh| {
            let stats = bvh.stats();
            shape_of_bvh(&stats, stats.bytes)
        })?);
    }
    let with_wide = || build().map(|bvh| (bvh.wide(), bvh));
    let built = Built::of(with_wide, |(wide, bvh)| {
        // The hierarchy is kept for its statistics.
        Queried::new(wide, move |wide| shape_of_bvh(&bvh.stats(), bytes_of(wide)))
    });
    Ok(built?)
}

fn of_objects(mesh: &Mesh, threads: usize) -> anyhow::Result<WideTree> {
    if threads == 1 {
        return Ok(WideTree::from_objects(mesh));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    Ok(pool.install(|| WideTree::from_objects_parallel(mesh)))
}

fn bytes_of(wide: &WideTree) -> usize {
    let bytes = wide.bytes();
    bytes.nodes + bytes.blocks
}

fn shape_of_bvh(stats: &BvhStats, bytes_total: usize) -> Shape {
    Shape {
        nodes: stats.nodes,
        leaves: stats.leaves,
        refs: stats.references,
        depth: stats.depth,
        sah_cost_15_20: stats.sah_cost_15_20,
        sah_cost_own: stats.sah_cost_own,
        bytes_total,
        text: stats.to_string(),
        ..Shape::default()
    }
}

fn shape_of(stats: &CellStats) -> Shape {
    Shape {
        nodes: stats.nodes,
        leaves: stats.leaves,
        refs: stats.references,
        depth: stats.depth,
        bytes_total: stats.bytes,
        text: format!("{stats:?}"),
        ..Shape::default()
    }
}
