//! The octree and the BSP tree.

use std::sync::Arc;

use kd::Mesh;
use kd_comparators::{CellOptions, CellStats, Octree, PolygonBsp};

use super::{Ours, Single};
use crate::structure::{Built, Measured, Shape};

pub(crate) fn octree(mesh: &Arc<Mesh>) -> anyhow::Result<Built> {
    let build = || Octree::build(Arc::clone(mesh), &CellOptions::default());
    Ok(Measured::try_of(build)?.into_built(|octree, _| Box::new(Single(octree))))
}

pub(crate) fn bsp(mesh: &Arc<Mesh>) -> anyhow::Result<Built> {
    let build = || PolygonBsp::build(Arc::clone(mesh), &CellOptions::default());
    Ok(Measured::try_of(build)?.into_built(|bsp, _| Box::new(Single(bsp))))
}

impl Ours for Octree {
    fn shape(&self) -> Shape {
        shape_of(&self.stats())
    }
}

impl Ours for PolygonBsp {
    fn shape(&self) -> Shape {
        shape_of(&self.stats())
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
        ..Shape::unknown()
    }
}
