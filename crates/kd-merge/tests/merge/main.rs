//! Merges through the public interface. One program, so that the generic builders are compiled once.

mod estimates;
mod merging;
mod moving;
