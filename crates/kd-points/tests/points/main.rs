//! Every query of points equals a test of every triangle, to the bit: in every layout, at every level, alone and in batches.

mod answers;
mod closed;
mod hard;
mod properties;
mod winding;
