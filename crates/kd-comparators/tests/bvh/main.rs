//! Hierarchies compared with brute force, with slow builders, and on hard input.

mod bottom_up;
mod check;
mod hard_input;
mod oracle;
mod packets;
mod properties;
mod scenes;
mod snapshots;
mod sweep;
mod threads;
mod trials;

use kd_oracle::rng;
