//! The bounding volume hierarchy, traced by its own nodes or in the wide layout, and wide nodes of objects.

use std::sync::Arc;

use anyhow::bail;
use kd::layout::WideTree;
use kd::{Hit, Mesh, Ray};
use kd_comparators::{Bvh, BvhMethod, BvhOptions};
use kd_trace::RayQuery;
use rayon::ThreadPoolBuilder;

use super::{Ours, Single};
use crate::structure::{BuilderName, Built, LayoutName, Measured, Shape, Variant};

pub(crate) fn build(variant: Variant, mesh: &Arc<Mesh>, threads: usize) -> anyhow::Result<Built> {
    if variant.builder == BuilderName::Objects {
        let measured = Measured::try_of(|| of_objects(mesh, threads))?;
        return Ok(measured.into_built(|wide, _| Box::new(Single(Wide { bvh: None, wide }))));
    }
    let options = options(variant.builder)?.with_threads(threads);
    if variant.layout == LayoutName::Binary {
        let measured = Measured::try_of(|| Bvh::build(Arc::clone(mesh), &options))?;
        return Ok(measured.into_built(|bvh, _| Box::new(Single(bvh))));
    }
    let measured = Measured::try_of(|| {
        let bvh = Bvh::build(Arc::clone(mesh), &options)?;
        let wide = bvh.wide();
        anyhow::Ok(Wide {
            bvh: Some(bvh),
            wide,
        })
    })?;
    Ok(measured.into_built(|wide, _| Box::new(Single(wide))))
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
        _ => bail!("no builder of a hierarchy"),
    })
}

impl Ours for Bvh {
    fn shape(&self) -> Shape {
        let stats = self.stats();
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

/// Wide nodes, with the hierarchy that they are made from, if there is one, for its statistics.
struct Wide {
    bvh: Option<Bvh>,
    wide: WideTree,
}

impl RayQuery for Wide {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.wide.intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.wide.occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.wide.hits(ray, max, out);
    }
}

impl Ours for Wide {
    fn shape(&self) -> Shape {
        let bytes = self.wide.bytes();
        let of_bvh = self.bvh.as_ref().map_or_else(Shape::unknown, Ours::shape);
        Shape {
            bytes_total: bytes.nodes + bytes.blocks,
            ..of_bvh
        }
    }
}
