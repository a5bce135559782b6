//! What a user can ask of a build.

use kd_core::CostModel;
use kd_tasks::ThreadsError;
use thiserror::Error;

/// The most bins along an axis.
const MOST_BINS: u16 = 256;

/// How triangles become a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BvhMethod {
    /// The division of least SAH cost among all that cut the order of centres along an axis in two (algorithm 1 of
    /// Eleftheriades 2010, which is that of I. Wald, S. Boulos, P. Shirley, *Ray Tracing Deformable Scenes Using Dynamic
    /// Bounding Volume Hierarchies*, 2007). Sorts in each node, in O(N log² N) time: the slow build that others are
    /// measured by.
    Sweep,
    /// The division of least SAH cost between equal parts of each axis, in O(N log N) time: nearly as good, and much
    /// faster (I. Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*, 2007).
    Binned {
        /// Parts of each axis, 2 to 256. Nodes of few triangles have fewer.
        bins: u16,
    },
    /// The middle between the outermost centres, across the axis on which they lie furthest apart (Shi 2011, section
    /// 2.2). Halves the triangles where no plane there parts them.
    Midpoint,
    /// As many triangles on each side, across the same axis (Shi 2011, section 2.2).
    EqualCounts,
    /// From the triangles up: neighbours are put together whose common box is smallest (Eleftheriades 2010, section
    /// 2.2.1). They are looked for along a space-filling curve (D. Meister, J. Bittner, *Parallel Locally-Ordered
    /// Clustering for Bounding Volume Hierarchy Construction*, 2018), in about O(N · radius) time.
    BottomUp {
        /// How far along the curve neighbours are looked for, in both directions. At least 1. With as many as there are
        /// triangles, every two groups are compared, again and again where few find each other: O(N³) at worst. For some
        /// thousands of triangles.
        radius: u16,
    },
}

/// Options of a build. Start from the default and change what you need.
///
/// Options are checked by the build, which names the one that is wrong. The hierarchy depends on the mesh and on the options
/// except [`with_threads`](Self::with_threads), bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhOptions {
    pub(crate) method: BvhMethod,
    pub(crate) cost: CostModel,
    pub(crate) max_leaf: u32,
    pub(crate) threads: usize,
}

impl BvhOptions {
    /// [`Binned`](BvhMethod::Binned) with 32 bins, leaves of at most 8 triangles, and as many threads as there are. A
    /// triangle costs as much as a node: both are tested one by one.
    pub const fn new() -> Self {
        Self {
            method: BvhMethod::Binned { bins: 32 },
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

    /// How to build.
    #[must_use]
    pub const fn with_method(mut self, method: BvhMethod) -> Self {
        self.method = method;
        self
    }

    /// What the steps of a traversal cost. The costs must be positive and finite, and lanes at least 1. There is no empty
    /// space to cut off, so the empty bonus does not count; it must be in (0, 1] all the same.
    #[must_use]
    pub const fn with_cost(mut self, cost: CostModel) -> Self {
        self.cost = cost;
        self
    }

    /// The most triangles of a leaf, at least 1. Fewer become a leaf where dividing them would cost more.
    #[must_use]
    pub const fn with_max_leaf(mut self, triangles: u32) -> Self {
        self.max_leaf = triangles;
        self
    }

    /// How many threads build: 1 builds on the calling thread, 0 uses the thread pool in scope (by default as many as there
    /// are cores). Without feature `parallel` it is always one. The hierarchy does not depend on it.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// How to build: see [`with_method`](Self::with_method).
    pub const fn method(&self) -> BvhMethod {
        self.method
    }

    /// The most triangles of a leaf: see [`with_max_leaf`](Self::with_max_leaf).
    pub const fn max_leaf(&self) -> u32 {
        self.max_leaf
    }

    /// How many threads build: see [`with_threads`](Self::with_threads).
    pub const fn threads(&self) -> usize {
        self.threads
    }

    pub(crate) fn check(&self) -> Result<(), BuildError> {
        let invalid = |name, rule| Err(BuildError::InvalidOption { name, rule });
        if let Some((name, rule)) = self.cost.problem() {
            return invalid(name, rule);
        }
        if self.max_leaf == 0 {
            return invalid("max_leaf", "at least 1");
        }
        match self.method {
            BvhMethod::Binned { bins } if !(2..=MOST_BINS).contains(&bins) => {
                invalid("bins", "from 2 to 256")
            }
            BvhMethod::BottomUp { radius: 0 } => invalid("radius", "at least 1"),
            _ => Ok(()),
        }
    }
}

impl Default for BvhOptions {
    /// [`new`](Self::new).
    fn default() -> Self {
        Self::new()
    }
}

/// Why there is no hierarchy.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// An option has a value that makes no sense.
    #[error("option `{name}` must be {rule}")]
    InvalidOption {
        /// The option.
        name: &'static str,
        /// What it must be.
        rule: &'static str,
    },
    /// The threads asked for could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_options_are_named() {
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
                by(BvhMethod::Binned { bins: 1 }),
                "option `bins` must be from 2 to 256",
            ),
            (
                by(BvhMethod::Binned { bins: 257 }),
                "option `bins` must be from 2 to 256",
            ),
            (
                by(BvhMethod::BottomUp { radius: 0 }),
                "option `radius` must be at least 1",
            ),
        ] {
            let error = options.check().expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the option");
        }
        assert_eq!(default().check(), Ok(()), "nothing wrong");
    }
}
