//! A binary bounding volume hierarchy: five builders, single rays and packets.
//!
//! A hierarchy divides triangles where a kd-tree divides space: each triangle is in one leaf, and boxes may overlap.

mod bottom_up;
mod bounds;
mod build;
mod counts;
mod node;
mod options;
mod packet;
mod query;
mod stats;
mod walk;
mod wide;

use std::sync::Arc;

use kd_core::{Aabb, CostModel, Mesh, PrimSource as _};
use kd_trace::kit::{Frame, Item};

use crate::ComparatorError;
use bounds::Around;
use build::{Binned, Divide, Driver, EqualCounts, Midpoint, Output, Sweep};

pub use counts::BvhCounts;
pub use node::{BvhNode, BvhNodeView};
pub use options::{BvhMethod, BvhOptions};
pub use stats::BvhStats;

/// A binary bounding volume hierarchy over the triangles of a mesh.
///
/// Queries are those of [`RayQuery`](kd_trace::RayQuery). Batches are traced in packets of up to 256 rays (see
/// [`intersect_batch_counted`](Self::intersect_batch_counted)).
///
/// Every triangle of the mesh is in exactly one leaf, and the box of a node is the smallest around its triangles. At most
/// [`MAX_DEPTH`](kd_core::MAX_DEPTH) nodes are above a leaf: a builder that would go deeper halves triangles instead.
///
/// Memory: 32 bytes a node, with fewer than twice as many nodes as triangles, and 4 bytes a triangle, beside the mesh.
#[derive(Clone, Debug)]
pub struct Bvh {
    mesh: Arc<Mesh>,
    nodes: Vec<BvhNode>,
    triangles: Vec<u32>,
    /// Of the root's box.
    frame: Frame,
    cost: CostModel,
}

impl Bvh {
    /// Builds a hierarchy over a mesh.
    ///
    /// Time is that of the [`BvhMethod`]. Memory, beside the hierarchy, is about 48 bytes a triangle, and five times as much for
    /// the bottom-up method.
    ///
    /// # Errors
    ///
    /// [`ComparatorError`] if an option is out of range or threads cannot be started.
    pub fn build(
        mesh: impl Into<Arc<Mesh>>,
        options: &BvhOptions,
    ) -> Result<Self, ComparatorError> {
        options.check()?;
        let mesh = mesh.into();
        let is_parallel = options.threads != 1;
        let threads = kd_tasks::useful_threads(options.threads, mesh.len());
        let (nodes, triangles) = kd_tasks::in_pool_of(threads, || {
            let items = kd_tasks::collect(mesh.count(), is_parallel, |triangle| {
                Item::whole(triangle, &mesh)
            });
            nodes_over(items, options, is_parallel)
        })?;
        Ok(Self {
            frame: Frame::new(&stats::bounds_of(&nodes)),
            cost: options.cost,
            mesh,
            nodes,
            triangles,
        })
    }

    /// The mesh that the hierarchy is over.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// The nodes in depth-first order, the root first; empty without triangles.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    /// The list that leaves refer to: every triangle of the mesh once, the triangles of a leaf in order.
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// The box around all triangles; [`Aabb::EMPTY`] without triangles.
    pub fn bounds(&self) -> Aabb {
        stats::bounds_of(&self.nodes)
    }

    /// The cost model of the build.
    pub fn cost(&self) -> &CostModel {
        &self.cost
    }
}

/// Equal nodes and triangles to the bit; options and meshes are not compared.
impl PartialEq for Bvh {
    fn eq(&self, other: &Self) -> bool {
        self.nodes == other.nodes && self.triangles == other.triangles
    }
}

/// The nodes over all items, and the triangle list.
fn nodes_over(
    mut items: Vec<Item>,
    options: &BvhOptions,
    is_parallel: bool,
) -> (Vec<BvhNode>, Vec<u32>) {
    if items.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let model = options.cost;
    let nodes = match options.method {
        BvhMethod::Sweep => top_down(&Sweep(model), &mut items, options, is_parallel),
        BvhMethod::Binned => top_down(&Binned(model), &mut items, options, is_parallel),
        BvhMethod::Midpoint => top_down(&Midpoint(model), &mut items, options, is_parallel),
        BvhMethod::EqualCounts => top_down(&EqualCounts(model), &mut items, options, is_parallel),
        BvhMethod::BottomUp { radius } => {
            return bottom_up::build(&items, usize::from(radius), options, is_parallel);
        }
    };
    (nodes, items.iter().map(|item| item.number()).collect())
}

fn top_down<D: Divide>(
    divide: &D,
    items: &mut [Item],
    options: &BvhOptions,
    is_parallel: bool,
) -> Vec<BvhNode> {
    let driver = Driver {
        divide,
        model: options.cost,
        max_leaf: options.max_leaf as usize,
        is_parallel,
    };
    let mut output = Output::default();
    driver.add(items, &Around::of(items), 0, 0, &mut output);
    output.nodes
}
