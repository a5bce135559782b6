//! Grids compared with brute force, and on hard input.

mod build;
mod grids;
mod hard_input;
mod oracle;
mod properties;
mod trials;
