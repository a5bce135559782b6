//! Trees made of trees: what stands still is built once, and a frame puts it together with what moved.
//!
//! After G. Eleftheriades, *Kd-tree merging* (2010), chapter 3. There, merging destroys both trees, and a copy of the one that
//! stands still is part of every frame. Here trees lie in an [`Arena`](kd_core::Arena) and never change: a merged tree consists
//! of new nodes, and of links to subtrees that it shares with the trees it was made from.
//!
//! ```
//! use kd_core::{Arena, CostModel, Mesh, Tree};
//! use kd_merge::{MergeOptions, bsp_merge};
//! use kd_sah::{BuildOptions, build};
//!
//! // A triangle that stands still, and one that will move, numbered on.
//! let still = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
//! let moving = Mesh::new(vec![[0.5, 0.0, 2.0], [1.5, 0.0, 2.0], [0.5, 1.0, 2.0]], vec![[0, 1, 2]])?;
//! let both = Mesh::new(
//!     [still.positions(), moving.positions()].concat(),
//!     vec![[0, 1, 2], [3, 4, 5]],
//! )?;
//!
//! let options = BuildOptions::default();
//! let mut arena = Arena::new();
//! let a = arena.append_tree(&build(&still, &options)?, 0)?;
//! arena.freeze(1)?;
//! let b = arena.append_tree(&build(&moving, &options)?, 1)?;
//! arena.freeze(2)?;
//!
//! let merged = bsp_merge(&mut arena, [a, b], &both, both.bounds(), &MergeOptions::default())?;
//! arena.freeze(2)?;
//! let tree = Tree::from_arena(arena, merged.root, both.bounds(), CostModel::PACKED)?;
//! tree.check_coverage(&both)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Which method
//!
//! | function | from | does |
//! |---|---|---|
//! | [`estimate`] | §3.1 | how many primitives lie on either side of a plane, from a few nodes |
//! | [`partition`] | §3.2, Alg. 7 | cuts a tree in two at a plane |
//! | [`bsp_merge`] | §3.3, Alg. 8 | cuts the second tree by the planes of the first |
//! | [`partition_trees`] | §3.4, Alg. 9 | sweeps over boxes of trees, dissolves those that overlap |
//! | [`build_clusters`] | ch. 5 | a tree for each of many clusters, for [`partition_trees`] to merge |
//! | [`insert`] | §3.5 | sends the primitives of the second tree down the first |
//!
//! Primitives are told by one [`PrimSource`](kd_core::PrimSource) whose numbers are the slots of references: those of all trees.
#![forbid(unsafe_code)]

mod census;
mod clusters;
mod draft;
mod estimate;
mod insert;
mod merge;
mod options;
mod partition;
mod partition_trees;
mod resplit;

pub use census::Census;
pub use estimate::{Sides, estimate};
pub use merge::{
    MergeError, Merged, Placed, bsp_merge, build_clusters, insert, partition, partition_trees,
};
pub use options::MergeOptions;
