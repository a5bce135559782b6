//! Structures that the papers describe, here to be compared with.

use std::sync::Arc;

use kd::{Hit, Mesh, Ray};
use kd_comparators::{Octree, Options, PolygonBsp, Stats};

use super::{OverMesh, WithMesh};
use crate::structure::{Built, Measured, Shape};

pub(crate) fn octree(mesh: &Arc<Mesh>) -> anyhow::Result<Built> {
    let measured = Measured::try_of(|| Octree::build(mesh, &Options::default()))?;
    let mesh = Arc::clone(mesh);
    Ok(measured.into_built(|structure, _| Box::new(WithMesh { structure, mesh })))
}

pub(crate) fn bsp(mesh: &Arc<Mesh>) -> anyhow::Result<Built> {
    let measured = Measured::try_of(|| PolygonBsp::build(mesh, &Options::default()))?;
    let mesh = Arc::clone(mesh);
    Ok(measured.into_built(|structure, _| Box::new(WithMesh { structure, mesh })))
}

impl OverMesh for Octree {
    fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        self.intersect(mesh, ray)
    }

    fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        self.occluded(mesh, ray)
    }

    fn shape(&self, _: &Mesh) -> Shape {
        shape_of(&self.stats())
    }
}

impl OverMesh for PolygonBsp {
    fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        self.intersect(mesh, ray)
    }

    fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        self.occluded(mesh, ray)
    }

    fn shape(&self, _: &Mesh) -> Shape {
        shape_of(&self.stats())
    }
}

fn shape_of(stats: &Stats) -> Shape {
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
