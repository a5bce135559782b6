//! Rivals: ray tracing libraries of others behind one interface. Benches compare kd with them; the library `kd` does not depend
//! on this crate.
//!
//! A [`Rival`] is built from a [`Mesh`]. Its clock starts when the mesh is in the library's own form of input, and stops when
//! the structure is ready to trace. The result answers [`RayQuery`](kd_trace::RayQuery) and lists of rays ([`Queries`]).
//!
//! ```no_run
//! use kd_core::{Mesh, Ray};
//! use kd_rivals::{EmbreeBuild, Options, Purpose, Rival};
//! use kd_trace::RayQuery;
//!
//! // A unit square in the plane z = 2, as two triangles.
//! let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
//! let mesh = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let built = Rival::Embree(EmbreeBuild::Medium, Purpose::Usual).build(&mesh, Options::default())?;
//! println!("{} s, {} bytes", built.seconds, built.bytes.kept);
//!
//! let ray = Ray::new([0.75, 0.25, 0.0], [0.0, 0.0, 1.0]);
//! let hit = built.structure.intersect(&ray).expect("straight ahead");
//! assert_eq!((hit.triangle, hit.t), (0, 2.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//!
//! `embree` opens Embree 3 or 4, a system library, at its first use: the file that the environment variable `KD_EMBREE` names, or
//! else version 3 if it is installed, or else version 4. `crates` compiles the rivals written in Rust. `tinybvh` contains `crates`
//! and compiles the C++ library of that name, which needs a C++20 compiler. Without its feature a rival is an error,
//! [`RivalError::NotCompiled`].
//!
//! # Answers
//!
//! Rivals have triangle tests of their own. Their answers are close to those of kd, not equal.

#[cfg(feature = "crates")]
mod crates;
#[cfg(feature = "embree")]
mod embree;
mod error;
#[cfg(not(all(feature = "crates", feature = "embree", feature = "tinybvh")))]
mod missing;
mod points;
mod queries;

#[cfg(feature = "tinybvh")]
use crates::tinybvh;
use kd_core::Mesh;
use kd_trace::Primitives;
#[cfg(not(feature = "crates"))]
use missing::crates;
#[cfg(not(feature = "embree"))]
use missing::embree;
#[cfg(not(feature = "tinybvh"))]
use missing::tinybvh;

pub use error::RivalError;
pub use points::{PointQueries, PointRival};
pub use queries::{FIRST, Queries, Restarting};

/// The environment variable that names the file of Embree.
pub const EMBREE_VARIABLE: &str = "KD_EMBREE";

/// A library, and how it builds.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Rival {
    /// Embree 3 or 4: see [`embree_name`]
    Embree(EmbreeBuild, Purpose),
    /// The crate `obvhs`
    Obvhs(ObvhsBuild),
    /// The crate `bvh`
    Bvh,
    /// The crate `parry3d`
    Parry3d,
    /// The C++ library tinybvh
    Tinybvh(TinybvhBuild),
}

/// Embree's quality of a build.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum EmbreeBuild {
    /// Morton codes
    Low,
    /// Binned surface area heuristic
    Medium,
    /// The same with spatial splits
    High,
}

/// The purpose of an Embree scene.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Purpose {
    /// Closest and any hits
    Usual,
    /// The same; rays through edges hit. Embree splits no triangles in such a scene
    Robust,
    /// Also the first [`FIRST`] hits of a ray, by a filter of hits
    FirstHits,
}

/// A preset of `obvhs`.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ObvhsBuild {
    /// The fastest build: a binary BVH
    Fastest,
    /// The medium build: a compressed wide BVH
    Medium,
    /// The slow build: a compressed wide BVH
    Slow,
}

/// A build of tinybvh.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum TinybvhBuild {
    /// Binned surface area heuristic
    Medium,
    /// The same with spatial splits
    High,
}

/// How Embree follows a mesh that moves beside a static one.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Following {
    /// Everything is rebuilt
    Rebuild,
    /// The moving mesh is rebuilt
    RebuildMoving,
    /// The boxes of the moving mesh are refitted
    Refit,
}

/// Options of a build.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Threads of the build, at least 1. Embree's threads belong to the process and do not become fewer: it builds on the
    /// greatest number so far.
    pub threads: usize,
    /// Runs work and returns the bytes that it allocates. Rivals written in Rust allocate through the program's allocator, so
    /// only the program can count. Embree counts its own bytes.
    pub count: Count,
}

/// See [`Options::count`].
pub type Count = fn(&mut dyn FnMut()) -> Bytes;

/// Bytes that a build allocates, above its input.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Bytes {
    /// Their peak.
    pub peak: usize,
    /// The bytes of the structure.
    pub kept: usize,
}

/// One thread, and no bytes of rivals written in Rust.
impl Default for Options {
    fn default() -> Self {
        Self {
            threads: 1,
            count: |work| {
                work();
                Bytes::default()
            },
        }
    }
}

/// A structure that is ready to trace, with the costs of its build.
pub struct Built {
    /// The structure.
    pub structure: Box<dyn Queries>,
    /// Seconds of the build.
    pub seconds: f64,
    /// Bytes of the build.
    pub bytes: Bytes,
}

impl std::fmt::Debug for Built {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut all = f.debug_struct("Built");
        all.field("seconds", &self.seconds)
            .field("bytes", &self.bytes);
        all.finish_non_exhaustive()
    }
}

impl Rival {
    /// Builds the structure over a copy of the mesh. The copy is not timed.
    ///
    /// # Errors
    ///
    /// If the rival is not compiled in or not installed, or if its library refuses the mesh.
    pub fn build(self, mesh: &Mesh, options: Options) -> Result<Built, RivalError> {
        match self {
            Self::Embree(build, purpose) => embree::build(build, purpose, mesh, options.threads),
            Self::Obvhs(build) => crates::obvhs(build, mesh, options),
            Self::Bvh => crates::bvh(mesh, options),
            Self::Parry3d => crates::parry3d(mesh, options),
            Self::Tinybvh(build) => tinybvh::build(build, mesh, options),
        }
    }
}

/// Builds an Embree scene of primitives (*user geometry*) by its medium quality: Embree calls their functions in Rust. Rays are traced
/// one at a time.
///
/// # Errors
///
/// If Embree is not compiled in or not installed, or if it fails.
pub fn embree_of_primitives<P: Primitives + Send + 'static>(
    primitives: P,
    threads: usize,
) -> Result<Built, RivalError> {
    embree::build_primitives(primitives, threads)
}

/// An Embree scene of a static and a moving mesh.
pub trait Moving {
    /// Moves the vertices of the moving mesh to these positions and updates the scene: the timed part.
    ///
    /// # Errors
    ///
    /// If the number of positions is not that of the vertices, or if Embree fails.
    fn update(&mut self, positions: &[[f32; 3]]) -> Result<(), RivalError>;

    /// The scene.
    fn structure(&self) -> &dyn Queries;
}

impl Following {
    /// Builds a scene of both meshes, on one thread. Triangles have the numbers of their meshes.
    ///
    /// # Errors
    ///
    /// If Embree is not compiled in or not installed, or if it fails.
    pub fn build(self, fixed: &Mesh, moving: &Mesh) -> Result<Box<dyn Moving>, RivalError> {
        embree::follow(self, fixed, moving)
    }
}

/// The name of Embree with the version that is in use, such as `Embree 3.13.5`.
///
/// # Errors
///
/// If Embree is not compiled in or not installed.
pub fn embree_name() -> Result<String, RivalError> {
    embree::name()
}

/// Checks that all rivals can be built but tinybvh, which few programs contain.
///
/// # Errors
///
/// If rivals are not compiled in, or Embree is not installed. The error says how to install it.
pub fn check_available() -> Result<(), RivalError> {
    crates::check()?;
    embree::name().map(|_| ())
}
