//! The hierarchy.

use kd_core::{Aabb, CostModel, Mesh, PrimSource};
use kd_trace::kit::Frame;

use crate::build::{Binned, Divide, Driver, EqualCounts, Midpoint, Output, Sweep};
use crate::item::{Around, Item};
use crate::node::BvhNode;
use crate::options::{BuildError, BvhMethod, BvhOptions};
use crate::{bottom_up, stats};

/// A binary bounding volume hierarchy over the triangles of a mesh.
///
/// It holds no copy of the mesh: queries are given the one that it was built from, or [refitted](Self::refit) to last.
///
/// Memory: 32 bytes a node, of which there are fewer than twice as many as triangles, and 4 bytes a triangle.
#[derive(Clone, Debug)]
pub struct Bvh {
    pub(crate) nodes: Vec<BvhNode>,
    pub(crate) triangles: Vec<u32>,
    /// Of the root's box.
    pub(crate) frame: Frame,
    pub(crate) cost: CostModel,
    /// SAH cost when it was built.
    pub(crate) built_cost: f64,
    /// Whether refitting may use several threads.
    pub(crate) is_parallel: bool,
}

impl Bvh {
    /// Builds a hierarchy over a mesh.
    ///
    /// Time is that of the [`BvhMethod`]; memory, besides the hierarchy, about 48 bytes a triangle, and five times as much
    /// from the bottom up.
    ///
    /// # Errors
    ///
    /// [`BuildError`]: an option out of range, or threads that could not be started.
    pub fn build(mesh: &Mesh, options: &BvhOptions) -> Result<Self, BuildError> {
        options.check()?;
        let is_parallel = options.threads != 1;
        let (nodes, triangles) = kd_tasks::in_pool_of(options.threads, || {
            let items = kd_tasks::collect(mesh.count(), is_parallel, |triangle| {
                Item::of(mesh, triangle)
            });
            nodes_over(items, options, is_parallel)
        })?;
        Ok(Self {
            frame: Frame::new(&stats::bounds_of(&nodes)),
            built_cost: stats::sah_cost(&nodes, &options.cost),
            cost: options.cost,
            nodes,
            triangles,
            is_parallel,
        })
    }

    /// The nodes in depth-first order, the root first; none without triangles.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    /// The list that leaves refer to: every triangle of the mesh once, those of a leaf in order.
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// The box around all triangles; [`Aabb::EMPTY`] without any.
    pub fn bounds(&self) -> Aabb {
        stats::bounds_of(&self.nodes)
    }

    /// The model of costs that it was built for.
    pub fn cost(&self) -> &CostModel {
        &self.cost
    }
}

/// The same nodes and triangles to the bit, whatever the options.
impl PartialEq for Bvh {
    fn eq(&self, other: &Self) -> bool {
        self.nodes == other.nodes && self.triangles == other.triangles
    }
}

/// The nodes over all items, and the list of their triangles.
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
        BvhMethod::Binned { bins } => {
            let bins = usize::from(bins);
            let binned = Binned { model, bins };
            top_down(&binned, &mut items, options, is_parallel)
        }
        BvhMethod::Midpoint => top_down(&Midpoint(model), &mut items, options, is_parallel),
        BvhMethod::EqualCounts => top_down(&EqualCounts(model), &mut items, options, is_parallel),
        BvhMethod::BottomUp { radius } => {
            return bottom_up::build(&items, usize::from(radius), options, is_parallel);
        }
    };
    (nodes, items.iter().map(|item| item.triangle).collect())
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
