//! Large worlds: positions, rays and transforms in f64.
//!
//! Coordinates of f32 are 1/16 apart at 10⁶ and 1 apart at 10⁷. A world of that size is traced with coordinates *relative to an origin* in
//! f64 near what is traced. Each of these types holds something in f32, and the f64 origin of its coordinates:
//!
//! | type | holds | made by |
//! |---|---|---|
//! | [`WorldMesh`] | a [`Mesh`] | [`Mesh::from_f64`], which chooses the origin and returns the rounding |
//! | [`WorldRay`] | a [`Ray`] | [`WorldRay::new`], [`WorldRay::between`] |
//! | [`World`] | a structure that rays can be traced through | [`World::new`], [`Scene::world`](crate::Scene::world) |
//!
//! ```
//! use kd::glam::DVec3;
//! use kd::world::{World, WorldRay};
//! use kd::{BuildOptions, KdTree, Mesh};
//!
//! // A roof at UTM coordinates, 12.25 above the ground.
//! let corner = DVec3::new(500_000.125, 5_200_000.125, 12.25);
//! let roof = [[0.0, 0.0, 0.0], [9.5, 0.0, 0.0], [9.5, 7.0, 0.0], [0.0, 7.0, 0.0]];
//! let roof = roof.map(|offset| (corner + DVec3::from(offset)).to_array());
//! let mesh = Mesh::from_f64(&roof, vec![[0, 1, 2], [0, 2, 3]])?;
//! assert_eq!(mesh.rounding, DVec3::ZERO); // the offsets are exact
//!
//! let tree = KdTree::build(mesh.mesh, &BuildOptions::balanced())?;
//! let world = World::new(tree, mesh.origin);
//! let ray = WorldRay::new(corner + DVec3::new(2.0, 1.0, 100.0), [0.0, 0.0, -1.0]);
//! let hit = world.intersect(&ray).expect("straight down");
//! assert_eq!(hit.t, 100.0);
//! let point = world.point(world.structure.mesh(), &hit);
//! assert_eq!(point.z, 12.25);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What is exact, and what is rounded
//!
//! Everything is decided in f64 from the differences of corners and the start of the ray. So if a mesh and its rays move by the same vector,
//! and offsets and starts are exact in f32 before and after, hits are equal to the bit. The roundings are:
//!
//! - **Offsets** of a mesh: [`WorldMesh::rounding`], zero where they are exact.
//! - **The start of a ray**: [`WorldRay::rounding_from`], at most 2⁻²⁴ of its distance from the origin on each axis. Rays that start far
//!   from what they meet can be [advanced](WorldRay::advanced).
//! - **A part's transform**: [`Scene::set_world_transform`](crate::Scene::set_world_transform) rounds each coordinate once, by at most 2⁻²⁴
//!   of its distance from the scene's origin.
//!
//! Hits are those of a mesh and a ray that were moved by these roundings, which add up.

use glam::{DVec3, Vec3};
use kd_core::{Hit, Mesh, Ray};
use kd_trace::RayQuery;

pub use kd_core::{WorldMesh, WorldRay};

/// A structure whose coordinates are relative to an origin in f64: a [`KdTree`](crate::KdTree) or another structure over the mesh of a
/// [`WorldMesh`], or a [`Frame`](crate::Frame).
///
/// Its queries take [`WorldRay`]s, and answer as those of the structure do for the rays [relative to](WorldRay::relative_to) the
/// origin: same `t`, same ties. An origin that is not finite makes every ray a miss.
///
/// Rays that leave a surface start at [`Mesh::offset_origin`], which is relative to the origin already. Pass them to
/// [`structure`](Self::structure) itself, so that their start is not rounded again: `world.structure.occluded(&Ray::between(start,
/// world.relative(light)))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World<Q> {
    /// What is traced.
    pub structure: Q,
    /// The point of the world at which `structure` has its zero.
    pub origin: DVec3,
}

impl<Q: RayQuery> World<Q> {
    /// A structure with the origin of its coordinates.
    pub fn new(structure: Q, origin: impl Into<DVec3>) -> Self {
        Self {
            structure,
            origin: origin.into(),
        }
    }

    /// The closest hit, as [`RayQuery::intersect`].
    pub fn intersect(&self, ray: &WorldRay) -> Option<Q::Hit> {
        self.structure.intersect(&ray.relative_to(self.origin))
    }

    /// Whether there is any hit, as [`RayQuery::occluded`].
    pub fn occluded(&self, ray: &WorldRay) -> bool {
        self.structure.occluded(&ray.relative_to(self.origin))
    }

    /// The first `max` hits in order, as [`RayQuery::hits`]. Clears `out` first.
    pub fn hits(&self, ray: &WorldRay, max: usize, out: &mut Vec<Q::Hit>) {
        let ray = ray.relative_to(self.origin);
        self.structure.hits(&ray, max, out);
    }

    /// The closest hit of each ray, as [`RayQuery::intersect_batch`]. The rays in f32 take the memory of a [`Ray`] each during the
    /// call.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[WorldRay], hits: &mut [Option<Q::Hit>]) {
        self.structure
            .intersect_batch(&self.relative_rays(rays), hits);
    }

    /// Whether each ray hits anything, as [`RayQuery::occluded_batch`]. The rays in f32 take the memory of a [`Ray`] each during the
    /// call.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[WorldRay], occluded: &mut [bool]) {
        self.structure
            .occluded_batch(&self.relative_rays(rays), occluded);
    }

    /// The point of a hit in the world: the [surface point](Mesh::surface_point_f64) plus the origin, in f64. `mesh` is the one of the
    /// hit in the structure, such as [`KdTree::mesh`](crate::KdTree::mesh) or [`FrameData::mesh`](crate::FrameData::mesh).
    ///
    /// # Panics
    ///
    /// If the mesh lacks the triangle.
    pub fn point(&self, mesh: &Mesh, hit: &Hit) -> DVec3 {
        self.origin + mesh.surface_point_f64(hit)
    }

    /// A point of the world in the structure's coordinates: relative to the origin, rounded once by at most 2⁻²⁴ of the distance from
    /// it on each axis.
    pub fn relative(&self, point: impl Into<DVec3>) -> Vec3 {
        (point.into() - self.origin).as_vec3()
    }

    fn relative_rays(&self, rays: &[WorldRay]) -> Vec<Ray> {
        let rays = rays.iter();
        rays.map(|ray| ray.relative_to(self.origin)).collect()
    }
}
