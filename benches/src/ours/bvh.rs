//! The bounding volume hierarchy, traced by its own nodes or laid out wide.

use std::sync::Arc;

use anyhow::bail;
use kd::layout::WideTree;
use kd::{Hit, Mesh, Ray};
use kd_bvh::{Bvh, BvhMethod, BvhOptions};
use rayon::ThreadPoolBuilder;

use super::{OverMesh, WithMesh};
use crate::record::Steps;
use crate::structure::{BuilderName, Built, LayoutName, Measured, Shape, Structure, Variant};

pub(crate) fn build(variant: Variant, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    if variant.builder == BuilderName::Objects {
        let measured = Measured::try_of(|| of_objects(mesh, threads))?;
        return Ok(measured.into_built(|wide, _| Box::new(Wide { bvh: None, wide })));
    }
    let options = options(variant.builder)?.with_threads(threads);
    let mesh = Arc::clone(mesh);
    if variant.layout == LayoutName::Binary {
        let measured = Measured::try_of(|| Bvh::build(&mesh, &options))?;
        return Ok(measured.into_built(|structure, _| Box::new(WithMesh { structure, mesh })));
    }
    let measured = Measured::try_of(|| {
        let bvh = Bvh::build(&mesh, &options)?;
        let wide = bvh.wide(&mesh);
        anyhow::Ok(Wide {
            bvh: Some(bvh),
            wide,
        })
    })?;
    Ok(measured.into_built(|wide, _| Box::new(wide)))
}

fn of_objects(mesh: &Mesh, threads: usize) -> anyhow::Result<WideTree> {
    if threads == 1 {
        return Ok(WideTree::from_objects(mesh));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
    Ok(pool.install(|| WideTree::from_objects_parallel(mesh)))
}

fn options(builder: BuilderName) -> anyhow::Result<BvhOptions> {
    let usual = BvhOptions::new();
    Ok(match builder {
        BuilderName::Binned => usual,
        BuilderName::Sweep => usual.with_method(BvhMethod::Sweep),
        BuilderName::BottomUp => usual.with_method(BvhMethod::BottomUp { radius: 16 }),
        BuilderName::Midpoint => usual.with_method(BvhMethod::Midpoint),
        BuilderName::EqualCounts => usual.with_method(BvhMethod::EqualCounts),
        _ => bail!("not a way to build a hierarchy"),
    })
}

impl OverMesh for Bvh {
    fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        self.intersect(mesh, ray)
    }

    fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        self.occluded(mesh, ray)
    }

    fn shape(&self, mesh: &Mesh) -> Shape {
        let stats = self.stats().with_zero_area(mesh.zero_area_count());
        Shape {
            nodes: stats.nodes,
            leaves: stats.leaves,
            refs: stats.references,
            depth: stats.depth,
            sah_cost_15_20: stats.sah_cost_15_20,
            sah_cost_own: stats.sah_cost_own,
            bytes_total: stats.bytes,
            text: stats.to_string(),
            ..Shape::unknown()
        }
    }
}

/// A hierarchy laid out for rays. The nodes that it was made from, if there were any, are kept to be looked at.
struct Wide {
    bvh: Option<Bvh>,
    wide: WideTree,
}

impl Structure for Wide {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.wide.intersect(ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.wide.occluded(ray);
        }
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        let bytes = self.wide.bytes();
        let shape = Shape {
            bytes_total: bytes.nodes + bytes.blocks,
            ..Shape::unknown()
        };
        let Some(bvh) = &self.bvh else {
            return shape;
        };
        let stats = bvh.stats();
        Shape {
            nodes: stats.nodes,
            leaves: stats.leaves,
            refs: stats.references,
            depth: stats.depth,
            sah_cost_15_20: stats.sah_cost_15_20,
            sah_cost_own: stats.sah_cost_own,
            text: stats.to_string(),
            ..shape
        }
    }

    fn flaw(&self) -> Option<String> {
        None
    }
}
