//! The options, limits and statistics that the octree and the BSP tree share: both divide space into cells.

mod options;
mod spare;
mod stats;

pub use options::CellOptions;
pub(crate) use spare::Spare;
pub use stats::CellStats;
