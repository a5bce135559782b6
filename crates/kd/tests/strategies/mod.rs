//! The strategies of scenes that update their nodes, for tests of all of them.

use kd::{MergeMethod, Strategy};

/// All strategies but rebuilds, which have options.
pub(crate) fn updating() -> Vec<Strategy> {
    vec![
        Strategy::Auto,
        Strategy::Merge(MergeMethod::Guided),
        Strategy::Merge(MergeMethod::PartitionTrees),
        Strategy::Merge(MergeMethod::BspMerge),
        Strategy::Merge(MergeMethod::Insertion),
        Strategy::Refit,
        Strategy::Instances,
        Strategy::Dual,
    ]
}
