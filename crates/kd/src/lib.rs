//! kd-trees for ray tracing: builds one over a triangle mesh, and finds what rays hit.
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
//! let hit = tree.intersect(&ray).expect("the ray meets the square");
//! assert_eq!((hit.triangle, hit.t), (0, 5.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Meshes
//!
//! [`Mesh::new`] takes vertices and three indices per triangle, and checks them once: coordinates are finite, indices
//! in range. The error names the vertex or the triangle. Empty meshes and triangles of zero area are valid; the latter are never hit.
#![cfg_attr(
    feature = "io",
    doc = "[`load_mesh`] reads OBJ, PLY, glTF, AFF and NFF files; its errors name the file and the line or element. [`load_mesh_with`](load::load_mesh_with) also returns warnings about what is left out."
)]
//!
//! # Building
//!
//! [`KdTree::build`] takes the mesh (or an `Arc` of it, to share it) and [`BuildOptions`]: one of the presets
//! [`fast`](BuildOptions::fast), [`balanced`](BuildOptions::balanced) and [`best`](BuildOptions::best), changed by
//! `with_…` methods where needed. A preset builds what rays traverse, from the triangles themselves, and no kd-tree. An explicit
//! [`with_method`](BuildOptions::with_method) builds the kd-tree of that method first, and so does [`Layout::Binary`].
//! [`KdTree::kd_tree`] builds the kd-tree of any options on demand. The result does not depend on the number of threads.
//!
//! ```
//! use kd::{BuildOptions, CostModel, Method};
//!
//! let literature = BuildOptions::best().with_method(Method::Exact).with_cost(CostModel::CLASSIC);
//! let on_one_thread = literature.with_threads(1);
//! # let _ = on_one_thread;
//! ```
//!
//! Where few rays see little of a large mesh, a [`LazyTree`] builds only the cells that rays enter, and answers the same
//! queries. [`LazyTree::finish`] builds the whole tree.
//!
//! # What rays traverse
//!
//! Rays traverse a *layout*. By default that is [`Layout::Wide`]: nodes of eight children with boxes. Triangles are divided as
//! objects, and by planes in cells of more than 1024 triangles where boxes of objects overlap. [`Layout::Binary`] holds
//! exactly the nodes of the kd-tree. [`layout`] states which layout each preset, method and strategy makes, and why.
//!
//! # Rays
//!
//! A [`Ray`] has an origin, a direction of any length, and a closed range of `t`, in multiples of the
//! direction. [`Ray::between`] is the open segment between two points, for shadow rays. [`Mesh::offset_origin`] is its start just
//! off the surface: proven not to shadow itself at any scale and from any distance. ([`offset_origin`] is a fixed rule for points
//! of surfaces other than a mesh.)
//!
//! | query | returns |
//! |---|---|
//! | [`KdTree::intersect`] | the closest [`Hit`] |
//! | [`KdTree::occluded`] | whether there is any hit |
//! | [`KdTree::hits`] | the first `max` hits, in order |
//! | [`KdTree::intersect_batch`], [`KdTree::occluded_batch`] | the same for many rays, faster where neighbors are coherent |
//! | [`KdTree::intersect8`], [`KdTree::occluded8`] | the same for a [`RayPacket8`], eight rays in lanes |
//! | [`KdTree::count_hits`], [`KdTree::hits_behind`], [`KdTree::each_hit`] | how many hits there are; the next ones behind a hit; one after another |
//! | [`KdTree::intersect_filtered`], [`KdTree::occluded_filtered`], [`KdTree::hits_filtered`] | only hits that a closure [accepts](Verdict), which gets them in order |
//! | [`KdTree::hits_batch`], [`KdTree::count_hits_batch`] | all hits or counts of many rays, as [`HitLists`] |
//! | [`KdTree::par_intersect_batch`] and other `par_` forms | each batch on all threads |
//!
//! [`Ray::culling`] passes through the backs or the fronts of triangles, and [`Ray::mask`] through parts of a [`Scene`] that share
//! no bit with it ([`Scene::set_mask`]); in every query.
//!
//! The trait [`RayQuery`] has the same queries for every structure here. No ray value causes a panic: NaN, infinities, a zero
//! direction and an inverted range are misses.
//!
//! ```
//! # use kd::{BuildOptions, KdTree, Mesh, Ray};
//! # let mesh = Mesh::new(vec![[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]], vec![[0, 1, 2]])?;
//! # let tree = KdTree::build(mesh, &BuildOptions::default())?;
//! # let (eye, light) = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.5]);
//! let ray = Ray::new(eye, [0.0, 0.0, 1.0]);
//! if let Some(hit) = tree.intersect(&ray) {
//!     let towards_eye = -tree.mesh().normal(hit.triangle);
//!     let point = tree.mesh().offset_origin(&hit, towards_eye);
//!     let lit = !tree.occluded(&Ray::between(point, light));
//!     assert!(lit);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Other primitives
//!
//! A [`PrimitiveTree`](custom::PrimitiveTree) has the queries of [`RayQuery`] over spheres, curves or any other primitives that say where
//! they are and where a ray meets them: see [`custom`].
//!
//! # Points
//!
//! A tree also answers points. [`points`] has the whole list.
//!
//! | query | returns |
//! |---|---|
//! | [`KdTree::closest_point`] | the [`Nearest`](points::Nearest) point of the mesh, within a distance |
//! | [`KdTree::contains`], [`KdTree::signed_distance`] | inside or not, by an exact parity; for closed meshes |
//! | [`KdTree::winding_number`] | how often the surface winds around a point; for open meshes, too |
//! | [`KdTree::triangles_in_box`], [`KdTree::triangles_in_sphere`] | the triangles that meet a box or a sphere |
//!
//! ```
//! # use kd::{BuildOptions, KdTree, Mesh};
//! # let mesh = Mesh::new(vec![[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]], vec![[0, 1, 2]])?;
//! # let tree = KdTree::build(mesh, &BuildOptions::default())?;
//! let nearest = tree.closest_point([0.0, 0.0, 3.0], f32::INFINITY).expect("there is a triangle");
//! assert_eq!((nearest.triangle, nearest.distance), (0, 2.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Moving parts
//!
//! A [`Scene`] has static and moving parts. A [`commit`](Scene::commit) makes a [`Frame`] of them, which has the same queries and
//! returns the part with each hit. Static parts are laid out once and shared by all frames; the [`Strategy`] determines how the
//! others are updated, and the [`CommitReport`](scene::CommitReport) lists what was done. A
//! [`snapshot`](Scene::snapshot) can be traced while the next frame is made.
//!
//! # Large worlds
//!
//! Coordinates are f32. [`Mesh::from_f64`] takes positions in f64, such as UTM coordinates, as offsets from an origin near them, and
//! says by how much they were rounded. [`world`] has rays and scenes with f64 origins, and states what is exact.
//!
//! # Inspecting a tree
//!
//! [`KdTree::stats`] counts nodes, leaves and references; its text form is what benchmarks and snapshots print. The
//! [`nodes`](KdTree::nodes) are plain 8-byte values ([`tree::Node`]), ready to be copied elsewhere.
#![cfg_attr(
    feature = "counters",
    doc = "[`KdTree::intersect_counted`] counts the nodes and triangles that a ray visits."
)]
//! [`KdTree::with_level`] traces without AVX2, to compare.
//!
//! # Choosing by the number of rays
//!
//! A kd-tree pays off over many rays. [`Accel::auto`] takes the expected number of rays and chooses among a uniform grid, wide
//! nodes of objects, and kd-trees of each preset. It has the same queries and the same answers, and [`Accel::decision`] gives
//! the reason. [`select`] has the estimates behind the choice.
//!
//! # Files of trees
//!
//! [`KdTree::save`] writes a mesh and what rays traverse to a file. [`KdTree::load`] reads and verifies it, without a build.
//! [`KdTree::open`] maps it into memory, to trace it as it lies; it is `unsafe`, since the file must not change meanwhile. [`Scene::save`] and
//! [`Scene::load`] do the same for the parts of a scene, whose first commit builds their trees again.
//!
//! # Features
//!
//! | feature | default | effect |
//! |---|---|---|
//! | `parallel` | on | builds, layouts and commits use several threads (rayon) |
//! | `io` | on | `load_mesh`, and calibrations as JSON |
//! | `counters` | on | queries that end in `_counted` |
//! | `serde` | off | `Serialize` and `Deserialize` for public data: meshes, rays, hits, options, statistics, reports |
//!
//! None changes an answer.

#![deny(unsafe_code)]

mod accel;
#[cfg(feature = "counters")]
mod counters;
pub mod custom;
mod kd_tree;
pub mod layout;
mod lazy_tree;
pub mod points;
mod queries;
mod saved;
pub mod scene;
pub mod world;

pub use accel::{Accel, RayBudget};
pub use glam;
pub use kd_core::{
    Aabb, CostModel, Culling, Hit, Layout, Mesh, MeshError, Ray, RayPacket8, TreeStats,
    offset_origin,
};
pub use kd_sah::{BuildError, BuildOptions, Method, WideNodes};
#[cfg(feature = "io")]
pub use kd_scene::{LoadError, load_mesh};
pub use kd_trace::{HitLists, RayQuery, Verdict};
pub use kd_tree::KdTree;
pub use lazy_tree::LazyTree;
#[doc(inline)]
pub use scene::{Frame, FrameData, MergeMethod, PartId, Scene, Strategy};

/// Builds: progress and threads.
pub mod build {
    pub use kd_sah::{BuildProgress, ThreadsError};
}

/// Queries of any structure: what they know of hits, and hits one after another.
pub mod query {
    pub use kd_trace::{EachHit, RayHit};
}

/// Files: how strictly they are read, and what was left out.
#[cfg(feature = "io")]
pub mod load {
    pub use kd_scene::{
        LoadOptions, Loaded, Place, Strictness, Warning, WarningCode, load_mesh_with,
    };
}

/// The kd-tree and its file: nodes, references, limits.
pub mod tree {
    pub use kd_core::{
        Axis, LayoutError, MAX_DEPTH, MAX_TRIANGLES, Node, NodeIndex, NodeView, Slot, StatsOf,
        Tree, TreeError,
    };
    pub use kd_file::{FileError, Section};
}

/// Uniform grids: the fastest to build, slow for each ray where triangles are spread unevenly.
pub mod grid {
    pub use kd_grid::{GridError, GridOptions, GridStats, Overlap, UniformGrid};
}

/// The choice of a structure by the number of rays: decisions, calibrations and estimates.
pub mod select {
    pub use kd_select::{
        Calibration, CalibrationError, Choice, Estimator, Features, Machine, MeasuredScene,
        Opening, RayScheme, Structure, Times, break_even, paper,
    };

    pub use crate::accel::{AccelError, Decision, DecisionReason};
}

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

/// The example of the page on large worlds, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/large-worlds.md")]
struct LargeWorlds;
