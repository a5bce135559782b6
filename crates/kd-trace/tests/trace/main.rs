//! Traversals against brute force, brute force against other mathematics, and both against hard input.

mod adversarial;
mod binary;
mod boxes;
mod cells;
mod check;
mod offset;
mod oracle;
mod packed;
mod packets;
mod placed;
mod properties;
mod random_tree;
mod reference;
mod scattered;
mod slots;
mod tiles;
mod trials;
mod watertight;
mod wide;
mod zero_area;

use kd_oracle::{rng, scenes};
