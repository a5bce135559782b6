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
//! triangles ── divide ──▶ binary tree of boxes ─ collapse ─▶ choice of nodes and leaves ─ emit ─▶ nodes, blocks
//!                          │             ▲
//!                          └ bottom-up, ─┘
//!                            reinsertion
//! ```
//!
//! A [`Division`] says how triangles are divided:
//!
//! - **Objects**: by the centers of triangles (*object split*), down to leaves of eight. No triangle is in two leaves. Boxes may overlap.
//! - **Planes**: in cells of more than 1024 triangles ([`PLANES_ABOVE`]) where the boxes of an object split overlap much, by a plane
//!   between bins (*plane split*), if its SAH cost is not much higher. A triangle that the plane cuts goes to both sides with a tight
//!   box for each, or to one side as a whole where that costs less. Smaller cells are divided as objects.
//! - **Both** set a few huge triangles apart from all others, in large cells where that costs less: walls from what is in a room.
//! - **Cheapest**: the cheapest by SAH cost of both, and of two other trees over the leaves of the objects: one made bottom-up, and one
//!   in which subtrees were reinserted at better places.
//!
//! [`WideBoxes`] are such nodes over anything that has boxes, divided as objects.
//!
//! [`WideTree::new`] follows the planes of a kd-tree instead of its own, in the same cells.
//!
//! Planes in large cells make rays 14 % faster in a church, and gain nothing on scans. (`cargo xtask first-ray --scenes DIR` compares
//! presets by scene, in the rows of `fast`, `balanced` and `best`; `benches/records/2026-11-30-first-ray.jsonl`.) Planes in small cells only duplicate triangles: with planes down to
//! the leaves rays visited 0.9 to 1.12 times as many nodes, more blocks, in 1.5 to 2.3 times the memory (a throw-away program, in
//! `divide.rs`).
//!
//! Triangles of zero area are never hit. They are aside, in an empty box, until a refit finds that they have an area.
//!
//! A tree of boxes then collapses: dynamic programming over the surface area heuristic chooses which boxes become wide nodes,
//! and which subtrees become leaves of up to three blocks (`collapse.rs`).
//!
//! # Safety
//!
//! Traversal follows child indices without checks. Each tree checks all of them once, when its arrays are put together. A forest
//! changes its arrays only while rays hit nothing, checks each child that it writes, and keeps the nodes and blocks of removed members
//! until no node refers to them. [`WideTree::node`] and [`WideTree::leaf`] are `unsafe fn`: their callers pass
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
mod boxes;
mod cheapest;
mod chunks;
mod collapse;
mod divide;
mod emit;
mod forest;
mod frame;
mod items;
mod linked;
mod morton;
mod node;
mod object_split;
mod plane_split;
mod reinsert;
mod saved;
mod stats;
mod tree;
mod work;

pub use binary::{BinaryNode, BinaryTree};
pub use block::{Block, LaneCorners};
pub use bottom_up::clusters;
pub use box_tree::Item;
pub use boxes::WideBoxes;
pub use divide::{MAX_LEVELS, PLANES_ABOVE};
pub use forest::{Join, Joined, MemberSize, Refit, WideForest};
pub use frame::{Frame, MOST_USUAL, PER_REACH};
pub use morton::in_morton_order;
pub use node::{Child, WIDTH, WideNode};
pub use object_split::ObjectSplit;
pub use tree::{Division, WideTree};
