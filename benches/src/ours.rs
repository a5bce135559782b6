//! Structures of ours that are no kd-trees, as the bench asks them.

mod grid;

pub(crate) use grid::build as grid;
