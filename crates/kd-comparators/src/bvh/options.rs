//! Options of a hierarchy.

use kd_core::CostModel;

use crate::ComparatorError;

/// How a hierarchy is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BvhMethod {
    /// The division of least SAH cost among all that cut the order of centers along an axis in two (algorithm 1 of
    /// Eleftheriades 2010, after I. Wald, S. Boulos, P. Shirley, *Ray Tracing Deformable Scenes Using Dynamic Bounding Volume
    /// Hierarchies*, 2007). Sorts in each node, in O(N log² N) time: the slow build that others are measured by.
    Sweep,
    /// The object split of wide nodes ([`ObjectSplit`](kd_trace::kit::ObjectSplit)): the division of least SAH cost between 32
    /// bins of each axis, 16 for few triangles, in O(N log N) time. Nearly as good as a sweep, and much faster (I. Wald, *On fast
    /// Construction of SAH-based Bounding Volume Hierarchies*, 2007).
    Binned,
    /// The middle of the largest extent of centers (Shi 2011, section 2.2). Halves triangles that the middle does not
    /// separate.
    Midpoint,
    /// Equal counts on both sides of the same axis (Shi 2011, section 2.2).
    EqualCounts,
    /// Merges the neighbors with the smallest common box, from the triangles up (Eleftheriades 2010, section 2.2.1).
    /// Neighbors are searched along a space-filling curve (D. Meister, J. Bittner, *Parallel Locally-Ordered Clustering for
    /// Bounding Volume Hierarchy Construction*, 2018), in about O(N · radius) time.
    BottomUp {
        /// The range of the search along the curve, in both directions, at least 1. A radius of the number of triangles
        /// compares all pairs of clusters in each round: O(N³) at worst, for some thousands of triangles.
        radius: u16,
    },
}

/// Options of a hierarchy. Start from the default and change single options.
///
/// The build checks options and names the one that is out of range. The hierarchy depends on the mesh and on all options but
/// [`with_threads`](Self::with_threads), bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhOptions {
    pub(super) method: BvhMethod,
    pub(super) cost: CostModel,
    pub(super) max_leaf: u32,
    pub(super) threads: usize,
}

impl BvhOptions {
    /// [`Binned`](BvhMethod::Binned), leaves of at most 8 triangles, and the thread pool in scope. A triangle costs as much as a
    /// node: both are tested one by one.
    pub const fn new() -> Self {
        Self {
            method: BvhMethod::Binned,
            cost: CostModel {
                traverse: 1.0,
                intersect: 1.0,
                lanes: 1,
                empty_bonus: 1.0,
            },
            max_leaf: 8,
            threads: 0,
        }
    }

    /// The method of the build.
    #[must_use]
    pub const fn with_method(mut self, method: BvhMethod) -> Self {
        self.method = method;
        self
    }

    /// The costs of the steps of a traversal: positive and finite, with at least 1 lane. The empty bonus has no effect, as
    /// hierarchies have no empty cells; it must be in (0, 1] nevertheless.
    #[must_use]
    pub const fn with_cost(mut self, cost: CostModel) -> Self {
        self.cost = cost;
        self
    }

    /// The largest number of triangles of a leaf, at least 1. Smaller groups become a leaf where dividing costs more.
    #[must_use]
    pub const fn with_max_leaf(mut self, triangles: u32) -> Self {
        self.max_leaf = triangles;
        self
    }

    /// The number of threads that build: 1 builds on the calling thread, 0 uses the thread pool in scope (by default, one thread
    /// per core). Without the feature `parallel` one thread builds. The hierarchy does not depend on it.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// See [`with_method`](Self::with_method).
    pub const fn method(&self) -> BvhMethod {
        self.method
    }

    /// See [`with_cost`](Self::with_cost).
    pub const fn cost(&self) -> &CostModel {
        &self.cost
    }

    /// See [`with_max_leaf`](Self::with_max_leaf).
    pub const fn max_leaf(&self) -> u32 {
        self.max_leaf
    }

    /// See [`with_threads`](Self::with_threads).
    pub const fn threads(&self) -> usize {
        self.threads
    }

    pub(super) fn check(&self) -> Result<(), ComparatorError> {
        let invalid = |name, rule| Err(ComparatorError::InvalidOption { name, rule });
        if let Some((name, rule)) = self.cost.problem() {
            return invalid(name, rule);
        }
        if self.max_leaf == 0 {
            return invalid("max_leaf", "at least 1");
        }
        if self.method == (BvhMethod::BottomUp { radius: 0 }) {
            return invalid("radius", "at least 1");
        }
        Ok(())
    }
}

impl Default for BvhOptions {
    /// [`new`](Self::new).
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_range_are_named() {
        let default = BvhOptions::new;
        let by = |method| default().with_method(method);
        let free = CostModel {
            traverse: 0.0,
            ..CostModel::CLASSIC
        };
        for (options, message) in [
            (
                default().with_cost(free),
                "option `cost.traverse` must be positive and finite",
            ),
            (
                default().with_max_leaf(0),
                "option `max_leaf` must be at least 1",
            ),
            (
                by(BvhMethod::BottomUp { radius: 0 }),
                "option `radius` must be at least 1",
            ),
        ] {
            let error = options.check().expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the option");
        }
        assert_eq!(default().check(), Ok(()), "the default");
    }
}
