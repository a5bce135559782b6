//! Builds through the public interface. One program, so that the generic builders are compiled once.

mod common;
mod hard_input;
mod max_refs;
mod progress;
mod quality;
mod same_tree;
