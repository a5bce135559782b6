//! The octree and the BSP tree, compared with brute force, on generated scenes and on hard input.

mod adversarial;
mod caps;
mod check;
mod oracle;
mod properties;
mod trials;

use kd_oracle::{rng, scenes};
