//! Hierarchies against brute force, slow builders against fast ones, and all of them against hard input.

mod bottom_up;
mod check;
mod hard_input;
mod oracle;
mod packets;
mod properties;
mod refit;
mod scenes;
mod snapshots;
mod sweep;
mod threads;
mod trials;
mod watertight;

use kd_oracle::rng;
