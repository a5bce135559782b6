//! Grids against brute force, and against hard input.

mod build;
mod hard_input;
mod oracle;
mod properties;
mod subject;
mod trials;
