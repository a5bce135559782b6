//! kd-trees for ray tracing: build one over a triangle mesh, then ask what rays hit.
//!
//! ```
//! use kd::{BuildOptions, KdTree, Mesh, Ray};
//!
//! // A unit square in the plane z = 0, as two triangles.
//! let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
//! let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]])?;
//! let tree = KdTree::build(mesh, &BuildOptions::balanced())?;
//!
//! let ray = Ray::new([0.75, 0.25, 5.0], [0.0, 0.0, -1.0]);
//! let hit = tree.intersect(&ray).expect("the square is in the way");
//! assert_eq!((hit.triangle, hit.t), (0, 5.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Meshes
//!
//! [`Mesh::new`] takes vertices and three indices per triangle, and checks them once: coordinates are finite, indices
//! in range. The error names the vertex or the triangle. Empty meshes and triangles of zero area are fine.
#![cfg_attr(
    feature = "io",
    doc = "[`load_mesh`] reads OBJ and PLY files, and names the file and the line or element when something is wrong."
)]
//!
//! # Building
//!
//! [`KdTree::build`] takes the mesh (or an `Arc` of it, to share it) and [`BuildOptions`]: one of the presets
//! [`fast`](BuildOptions::fast), [`balanced`](BuildOptions::balanced) and [`best`](BuildOptions::best), changed by
//! `with_…` methods where you know better. All builders clip triangles to the cells they lie in, put triangles that
//! lie in a plane on one side, and lose nothing. The number of threads never shows in the result.
//!
//! ```
//! use kd::{BuildOptions, CostModel, Method};
//!
//! let literature = BuildOptions::best().with_method(Method::Exact).with_cost(CostModel::CLASSIC);
//! let on_one_thread = literature.with_threads(1);
//! # let _ = on_one_thread;
//! ```
//!
//! Where few rays will see little of a large mesh, [`LazyTree`] spares what they do not see: it is built where rays go,
//! and answers the same queries. [`LazyTree::finish`] builds the whole after all.
//!
//! # Rays
//!
//! A [`Ray`] has an origin, a direction of any length, and a closed range of `t`, which counts in multiples of the
//! direction. [`Ray::between`] is the open segment that shadow rays want, and [`offset_origin`] moves its start off
//! the surface.
//!
//! | query | answers |
//! |---|---|
//! | [`KdTree::intersect`] | the closest [`Hit`] |
//! | [`KdTree::occluded`] | whether there is any hit |
//! | [`KdTree::hits`] | the first few hits, in order |
//! | [`KdTree::intersect_batch`], [`KdTree::occluded_batch`] | the same for many rays, faster where neighbours go the same way |
//! | [`KdTree::intersect8`], [`KdTree::occluded8`] | the same for a [`RayPacket8`], whose rays lie side by side |
//!
//! Nothing a ray can hold makes a query panic: NaN, infinities, a zero direction and an inverted range are misses.
//!
//! ```
//! # use kd::{BuildOptions, KdTree, Mesh, Ray};
//! # let mesh = Mesh::new(vec![[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]], vec![[0, 1, 2]])?;
//! # let tree = KdTree::build(mesh, &BuildOptions::default())?;
//! # let (eye, light) = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.5]);
//! let ray = Ray::new(eye, [0.0, 0.0, 1.0]);
//! if let Some(hit) = tree.intersect(&ray) {
//!     let towards_eye = -tree.mesh().normal(hit.triangle);
//!     let point = kd::offset_origin(hit.point(&ray), towards_eye);
//!     let lit = !tree.occluded(&Ray::between(point, light));
//!     assert!(lit);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Things that move
//!
//! A [`Scene`] has parts that stand still and parts that move. A [`commit`](Scene::commit) makes a [`Frame`] of them, which
//! has the same queries and tells the part with each hit. What stands still is laid out once and shared by all frames; how
//! what moves follows is the [`Strategy`]'s choice, and [`CommitReport`] tells what was done. A
//! [`snapshot`](Scene::snapshot) can be traced while the next frame is made.
//!
//! # Looking inside
//!
//! Rays are traced through nodes of eight children that are made from the tree ([`WideTree`]), by AVX2 instructions where
//! the processor has them; [`BuildOptions::with_layout`] chooses the tree's own nodes instead, with the triangles of its
//! leaves packed ([`PackedTree`]). [`KdTree::with_level`] traces without AVX2, to compare.
//!
//! [`KdTree::stats`] counts what there is; its text form is what the benchmarks and snapshots show. The
//! [`nodes`](KdTree::nodes) are plain 8-byte values ([`Node`]), ready to be sent elsewhere, and
//! [`KdTree::intersect_counted`] tells what a ray had to do.
//!
//! # How many rays?
//!
//! A kd-tree pays where rays are many. Where they may be few, [`Accel::auto`] chooses, given how many there will be: a uniform
//! grid, wide nodes of objects, or a kd-tree built with more or less care. It has the same queries and the same answers, and
//! [`Accel::decision`] returns the reason. Grids are in [`grid`], and the basis of the choice in [`select`].
//!
//! # Keeping trees
//!
//! [`KdTree::save`] writes mesh and tree to a file and [`KdTree::load`] reads it back, verified, without building.
//!
//! # Features
//!
//! Both are on by default, and neither changes an answer. `parallel` builds and packs on several threads (rayon); `io`
//! adds `load_mesh`.
#![forbid(unsafe_code)]

mod accel;
#[cfg(feature = "counters")]
mod counters;
mod lazy;
mod scene;
mod traced;
mod tree;

pub use accel::{Accel, AccelError, Decision, DecisionReason, RayBudget};
pub use glam;
pub use kd_core::{
    Aabb, Axis, CostModel, FileError, Hit, Layout, MAX_DEPTH, MAX_TRIANGLES, Mesh, MeshError, Node,
    NodeIndex, NodeView, Ray, RayPacket8, TracedBytes, Tree, TreeError, TreeStats, offset_origin,
};
pub use kd_sah::{BuildError, BuildOptions, Method, ThreadsError, Watch};
#[cfg(feature = "io")]
pub use kd_scene::{LoadError, load_mesh};
#[cfg(feature = "counters")]
pub use kd_trace::TraversalCounts;
pub use kd_trace::{Level, PackedTree, WideTree};
pub use lazy::LazyTree;
pub use scene::{
    Action, CommitError, CommitReport, Frame, FrameData, MergeMethod, PartChange, PartId, Reason,
    Scene, SceneError, Strategy,
};
pub use tree::KdTree;

/// Uniform grids: quick to build, slow for rays where triangles are distributed unevenly.
pub mod grid {
    pub use kd_grid::{GridError, GridOptions, GridStats, Overlap, UniformGrid};
}

/// The basis of choices between structures: calibrations and estimates.
pub mod select {
    pub use kd_select::{
        Calibration, CalibrationError, Choice, Estimator, Features, Machine, MeasuredScene,
        Opening, RayScheme, Structure, Times, break_even, paper,
    };
}

/// For trees over other things than triangles: implement [`PrimSource`](custom::PrimSource), and
/// [`build`](custom::build) gives a [`Tree`] to walk.
pub mod custom {
    pub use kd_core::{PrimSource, Slot};
    pub use kd_sah::build;
}

/// The examples of the project's front page, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
