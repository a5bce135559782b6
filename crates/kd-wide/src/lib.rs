//! Wide nodes: the layout that rays traverse by default, as data, and how it is made.
//!
//! A [`WideTree`] has nodes of up to eight children with their boxes ([`WideNode`], 256 bytes) over blocks of up to eight
//! triangles ([`Block`], 320 bytes). This crate makes, refits and joins such trees. `kd-trace` traces rays through them.
//!
//! ```
//! use kd_core::{Mesh, Ray};
//! use kd_sah::{BuildOptions, build};
//! use kd_trace::RayQuery;
//! use kd_wide::WideTree;
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let tree = build(&mesh, &BuildOptions::default())?;
//!
//! let wide = WideTree::new(&tree, &mesh);
//! let hit = wide.intersect(&Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0])).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! assert_eq!(wide.bytes().blocks, 320);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How wide nodes are made
//!
//! ```text
//! kd-tree ───── divide ────┐
//!                          ├──▶ binary tree of boxes ─ collapse ─▶ choice of nodes and leaves ─ emit ─▶ nodes, blocks
//! triangles ─ object_split ┘
//! ```
//!
//! Two kinds of splits make the binary tree of boxes:
//!
//! - **Cells of more than 1024 triangles** ([`PLANES_ABOVE`]) follow the planes of the kd-tree (*plane split*). A triangle
//!   that a plane cuts goes to both sides with a tight box for each, or to one side as a whole where that costs less.
//!   A cell is divided by the centers of its triangles instead (*object split*) where that costs less than half of the plane.
//! - **Smaller cells** are divided by object splits alone. The planes that the kd-tree has there are not used.
//!
//! So a mesh of at most 1024 triangles gets the same nodes from every kd-tree builder, and the choice of a builder shows in
//! larger cells only. Boxes may overlap where cells of a kd-tree may not, and an object split puts no triangle in two leaves:
//! with planes down to the leaves rays visited 0.9 to 1.12 times as many nodes, more blocks, in 1.5 to 2.3 times the memory.
//! Planes in large cells lower the SAH cost by 3 to 13 % in rooms. (The measurements are in `divide.rs`; `docs/choosing.md`
//! has the times: nodes of objects alone, [`WideTree::from_objects`], take 0.26 of the build time of the preset `balanced`, and
//! trace at 0.99 of its speed.)
//!
//! The rule is decided in one place, `divide.rs`. [`WideTree::with_planes_above`] sets another limit, for measurements.
//!
//! A tree of boxes then collapses: dynamic programming over the surface area heuristic chooses which boxes become wide nodes,
//! and which subtrees become leaves of up to three blocks (`collapse.rs`).
//!
//! # Safety
//!
//! Traversal follows child indices without checks. Each tree checks all of them once, when its arrays are put together, and
//! no public function changes them afterwards. [`WideTree::node`] and [`WideTree::leaf`] are `unsafe fn`: their callers pass
//! only the root or a child that they read from a node of the same tree.
//!
//! # Threads
//!
//! Functions that ask whether they are parallel use the threads of the pool in scope (rayon's), through `kd-tasks`. The result is
//! the same at any number of threads. Without the feature `parallel` everything runs on the calling thread.
#![deny(unsafe_code)]

mod arrays;
mod binary;
mod bins;
mod block;
mod bottom_up;
mod box_tree;
mod chunks;
mod collapse;
mod divide;
mod emit;
mod forest;
mod frame;
mod join;
mod large_pages;
mod linked;
mod morton;
mod node;
mod object_split;
mod plane_split;
mod reinsert;
mod stats;
mod tree;
mod work;

pub use arrays::Refit;
pub use binary::{BinaryNode, BinaryTree};
pub use block::{Block, LaneCorners};
pub use box_tree::Item;
pub use divide::{MAX_LEVELS, PLANES_ABOVE};
pub use forest::WideForest;
pub use frame::{Frame, MOST_USUAL, PER_REACH};
pub use join::{Join, Joined};
pub use morton::in_morton_order;
pub use node::{Child, WIDTH, WideNode};
pub use object_split::ObjectSplit;
pub use tree::{Division, WideTree};
