//! Triangles that have moved.

use kd_core::Mesh;
use kd_trace::kit::Frame;
use thiserror::Error;

use crate::bvh::Bvh;
use crate::item::{Bounds, Item};
use crate::node::{BvhNode, BvhNodeView};
use crate::stats;

/// Subtrees of so many nodes are worth a task: some tens of microseconds.
const TASK: usize = 1 << 12;

/// Why a hierarchy was not refitted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum RefitError {
    /// The mesh has another number of triangles.
    #[error("{given} triangles for a hierarchy over {triangles}")]
    TriangleCount {
        /// How many were given.
        given: usize,
        /// How many there are.
        triangles: usize,
    },
}

impl Bvh {
    /// Moves the hierarchy with its triangles: it keeps its nodes, with boxes around where triangles are in `mesh` now
    /// (`UPDATEBBOXES`, algorithm 3 of Eleftheriades 2010).
    ///
    /// Answers are those of a hierarchy that is built anew. Where triangles that were neighbours part, boxes overlap, and
    /// rays become slow: see [`quality`](Self::quality).
    ///
    /// Linear in the number of triangles; on the threads of the pool in scope where there are many, unless it was built on
    /// one thread. The outcome does not depend on them.
    ///
    /// # Errors
    ///
    /// [`RefitError::TriangleCount`]; the hierarchy is as it was then.
    pub fn refit(&mut self, mesh: &Mesh) -> Result<(), RefitError> {
        if mesh.len() != self.triangles.len() {
            return Err(RefitError::TriangleCount {
                given: mesh.len(),
                triangles: self.triangles.len(),
            });
        }
        let fit = Fit {
            mesh,
            triangles: &self.triangles,
            task: if self.is_parallel { TASK } else { usize::MAX },
        };
        if !self.nodes.is_empty() {
            fit.subtree(&mut self.nodes, 0);
        }
        self.frame = Frame::new(&stats::bounds_of(&self.nodes));
        Ok(())
    }

    /// SAH cost now over SAH cost when it was built, under the model it was built for: 1 for a new hierarchy, more where
    /// refitting has made it worse. Linear in the number of nodes.
    ///
    /// This is the number by which to decide when to build anew. A ray takes about so many times as long as it did, so that
    /// building pays once the rays of a frame take longer, by more than a build, than they would at 1. (C. Lauterbach,
    /// S. Yoon, D. Tuft, D. Manocha, *RT-DEFORM*, 2006, decide by a number of this kind.)
    ///
    /// Costs are for rays that meet the root's box. If one triangle flies far away, few of those meet the others, and the
    /// number may even fall.
    pub fn quality(&self) -> f64 {
        if self.nodes.is_empty() {
            return 1.0;
        }
        stats::sah_cost(&self.nodes, &self.cost) / self.built_cost
    }
}

/// Triangles where they are now.
struct Fit<'a> {
    mesh: &'a Mesh,
    triangles: &'a [u32],
    /// Subtrees of so many nodes are a task.
    task: usize,
}

impl Fit<'_> {
    /// Fits the nodes of a subtree, of which the first has the index `start`.
    fn subtree(&self, nodes: &mut [BvhNode], start: usize) {
        if let Some((root, below)) = nodes.split_first_mut()
            && let BvhNodeView::Interior { second, .. } = root.view()
            && below.len() >= self.task
        {
            let second = second as usize;
            let (lower, upper) = below.split_at_mut(second - start - 1);
            kd_tasks::join(
                || self.subtree(lower, start + 1),
                |_| self.subtree(upper, second),
            );
            root.set_bounds(&lower[0].bounds().union(&upper[0].bounds()));
            return;
        }
        // Children come after their parents, so that their boxes are known before.
        for place in (0..nodes.len()).rev() {
            let bounds = match nodes[place].view() {
                BvhNodeView::Leaf { first, count } => {
                    let triangles = &self.triangles[first as usize..][..count as usize];
                    let items = triangles.iter().map(|t| Item::of(self.mesh, *t).bounds);
                    let around = items.fold(Bounds::NOTHING, |all, one| all.union(&one));
                    around.aabb()
                }
                BvhNodeView::Interior { second, .. } => {
                    let children = [place + 1, second as usize - start];
                    let [a, b] = children.map(|child| nodes[child].bounds());
                    a.union(&b)
                }
            };
            nodes[place].set_bounds(&bounds);
        }
    }
}
