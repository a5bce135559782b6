//! Scenes in large worlds: an origin in f64, and parts that are placed by transforms in f64.

use glam::{DAffine3, DVec3};
use kd_sah::BuildOptions;

use super::placement::Placement;
use super::{Frame, PartId, Scene, SceneError};
use crate::world::World;

/// Large worlds: see [`world`](crate::world).
impl Scene {
    /// [`new`](Self::new) with an origin in f64: the point of the world at which the coordinates of its frames have their zero. Choose
    /// it near what is traced. It does not change later.
    ///
    /// ```
    /// use kd::glam::{DAffine3, DVec3};
    /// use kd::world::WorldRay;
    /// use kd::{BuildOptions, Mesh, Scene};
    ///
    /// let ground = DVec3::new(5e5, 5.2e6, 0.0);
    /// let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, 0.0]);
    /// let square = Mesh::new(square.to_vec(), vec![[0, 1, 2], [0, 2, 3]])?;
    /// let mut scene = Scene::with_origin(BuildOptions::balanced(), ground)?;
    /// let lift = scene.add_dynamic(square)?;
    ///
    /// let ray = WorldRay::new(ground + DVec3::new(0.75, 0.25, 80.0), [0.0, 0.0, -1.0]);
    /// for height in [10.0, 20.5] {
    ///     let place = DAffine3::from_translation(ground + DVec3::Z * height);
    ///     scene.set_world_transform(lift, place)?;
    ///     scene.commit()?;
    ///     let (part, hit) = scene.world().intersect(&ray).expect("below");
    ///     assert_eq!((part, f64::from(hit.t)), (lift, 80.0 - height));
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SceneError::Origin`] if a coordinate of the origin is not finite.
    pub fn with_origin(
        options: BuildOptions,
        origin: impl Into<DVec3>,
    ) -> Result<Self, SceneError> {
        let origin = origin.into();
        if !origin.is_finite() {
            return Err(SceneError::Origin);
        }
        Ok(Self {
            origin,
            ..Self::new(options)
        })
    }

    /// The point of the world at which the coordinates of frames have their zero; zero unless the scene was made
    /// [`with_origin`](Self::with_origin).
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Replaces the transform of a part, from the next commit on: `transform` maps the coordinates of its mesh to those of the world.
    /// For the mesh of a [`WorldMesh`](crate::world::WorldMesh) at its place, that is
    /// [`from_translation`](DAffine3::from_translation) of its origin.
    ///
    /// Frames hold positions relative to the scene's [`origin`](Self::origin). They are computed in f64, and each coordinate is rounded
    /// once, by at most 2⁻²⁴ of itself; with a mere translation, exact results stay exact. The mesh of a part that is not moved, such as
    /// one from [`Mesh::from_f64_at`](crate::Mesh::from_f64_at) with the scene's origin, is shared instead of copied.
    ///
    /// This and [`set_transform`](Self::set_transform) replace each other's transform. That of `set_transform` is in f32, and maps to
    /// coordinates relative to the origin. [Merges of kd-trees](crate::MergeMethod::PartitionTrees) reuse the kd-tree of a part that
    /// moves in f32, and rebuild that of a part that moves in f64.
    ///
    /// # Errors
    ///
    /// [`SceneError::NoSuchPart`]; [`SceneError::NotFinite`].
    pub fn set_world_transform(
        &mut self,
        part: PartId,
        transform: impl Into<DAffine3>,
    ) -> Result<(), SceneError> {
        let placement = self.placement(transform.into());
        self.set_placement(part, placement)
    }

    /// [`add_instance`](Self::add_instance) with a transform as in [`set_world_transform`](Self::set_world_transform).
    ///
    /// # Errors
    ///
    /// As [`add_instance`](Self::add_instance).
    pub fn add_world_instance(
        &mut self,
        of: PartId,
        transform: impl Into<DAffine3>,
    ) -> Result<PartId, SceneError> {
        let placement = self.placement(transform.into());
        self.add_placed_instance(of, placement)
    }

    /// The [`frame`](Self::frame) of the last commit, to be traced by rays with f64 origins. A [`snapshot`](Self::snapshot) has the
    /// same origin: `World::new(&*snapshot, scene.origin())`.
    pub fn world(&self) -> World<Frame<'_>> {
        World::new(self.frame(), self.origin)
    }

    fn placement(&self, mut transform: DAffine3) -> Placement {
        transform.translation -= self.origin;
        Placement::Double(transform)
    }
}
