//! Merging of kd-trees. Static geometry is built once, and each frame merges its tree with the trees of moving geometry.
//!
//! The methods follow E. Eleftheriades, *Accelerating ray tracing for dynamic scenes using kd-tree merging* (2010), chapter 3. There, merging destroys both trees, and every
//! frame copies the static one. Here trees are stored in an [`Arena`](kd_core::Arena) and never change: a merged tree consists
//! of new nodes and of links to subtrees that it shares with its source trees.
//!
//! ```
//! use kd_core::{Arena, CostModel, Mesh, Tree};
//! use kd_merge::{MergeOptions, bsp_merge};
//! use kd_sah::{BuildOptions, build};
//!
//! // A static triangle with number 0 and a moving triangle with number 1.
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
//! # Methods
//!
//! | function | source | operation |
//! |---|---|---|
//! | [`estimate`] | §3.1 | estimates the number of references on either side of a plane from a few nodes |
//! | [`partition`] | §3.2, Alg. 7 | cuts a tree in two at a plane |
//! | [`bsp_merge`] | §3.3, Alg. 8 | cuts the second tree by the planes of the first |
//! | [`partition_trees`] | §3.4, Alg. 9 | splits a set of trees by the SAH over their boxes and dissolves overlapping trees |
//! | [`build_clusters`] | ch. 5 | builds a tree for each of many clusters, for [`partition_trees`] to merge |
//! | [`insert`] | §3.5 | inserts the primitives of the second tree into the first |
//!
//! One [`PrimSource`](kd_core::PrimSource) holds the primitives of all trees; its numbers are the slots of references.
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
