//! Static and moving parts, traced together: [`Scene`], its strategies, reports and errors.

mod apply;
mod error;
mod forests;
mod frame;
mod frame_parts;
mod frame_points;
mod merged;
mod moving;
mod part;
mod parts;
mod placement;
mod plan;
mod report;
mod saved;
mod shared;
mod sharing;
mod sight;
mod strategy;
mod world;

use std::sync::Arc;

use glam::{Affine3A, DVec3};
use kd_core::{MAX_TRIANGLES, Mesh};
use kd_sah::BuildOptions;
use kd_trace::Joined;

pub use kd_core::{offset_origin_of, surface_point_of};

pub use error::{CommitError, SceneError};
pub use frame::{Frame, FrameData};
pub use part::PartId;
pub use report::{CommitAction, CommitReason, CommitReport, PartChange};
pub use strategy::{MergeMethod, Strategy};

use moving::MovingTree;
use part::{Part, Role, SceneNumber};
use parts::Parts;
use placement::Placement;

/// Static and moving meshes, the *parts* of the scene. A [`commit`](Self::commit) makes a [`Frame`] of them, to trace.
///
/// Static parts are built and laid out once, with the scene's [`BuildOptions`]. Later frames do not visit or copy them: a commit
/// costs in proportion to what has changed since the last one. The [`Strategy`] determines how moving parts are updated; all
/// strategies give the same hits.
///
/// ```
/// use kd::glam::{Affine3A, Vec3};
/// use kd::{BuildOptions, Mesh, Ray, Scene};
///
/// let square = Mesh::new(
///     vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
///     vec![[0, 1, 2], [0, 2, 3]],
/// )?;
/// let mut scene = Scene::new(BuildOptions::best());
/// let wall = scene.add_static(square.clone())?;
/// let door = scene.add_dynamic(square)?;
///
/// let ray = Ray::new([0.75, 0.25, 5.0], [0.0, 0.0, -1.0]);
/// for step in 1..=3 {
///     scene.set_transform(door, Affine3A::from_translation(Vec3::Z * step as f32))?;
///     scene.commit()?;
///     let (part, hit) = scene.frame().intersect(&ray).expect("the door is in front");
///     assert_eq!((part, hit.t), (door, 5.0 - step as f32));
/// }
/// scene.remove(door)?;
/// scene.commit()?;
/// assert_eq!(scene.frame().intersect(&ray).map(|(part, _)| part), Some(wall));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Frames
///
/// A [`Frame`] borrows the scene, so that nothing changes the scene while its frame is traced:
///
/// ```compile_fail
/// # use kd::{BuildOptions, Mesh, Ray, Scene};
/// # let mut scene = Scene::new(BuildOptions::best());
/// # let part = scene.add_dynamic(Mesh::new(vec![], vec![]).unwrap()).unwrap();
/// let frame = scene.frame();
/// scene.remove(part).unwrap();
/// frame.occluded(&Ray::new([0.0; 3], [0.0, 0.0, 1.0]));
/// ```
///
/// A [`snapshot`](Self::snapshot) is owned: it can be traced, also on other threads, while the next frame is made. The first commit
/// with a snapshot of the frame before copies that frame. The scene keeps up to three earlier frames, and makes the next one in the memory
/// of one that no longer has snapshots, where it copies only what has changed since.
#[derive(Debug)]
pub struct Scene {
    options: BuildOptions,
    /// The point of the world at which the coordinates of its frames have their zero.
    origin: DVec3,
    strategy: Strategy,
    ray_budget: u64,
    parts: Parts,
    next_id: u32,
    /// Distinguishes its ids from those of other scenes.
    number: SceneNumber,
    /// The first slot of the next part.
    next_slot: u32,
    /// Whether the slots of all parts were numbered again since the last commit.
    has_new_slots: bool,
    /// Number of commits: identifies what each of them moved.
    commits: u64,
    /// The strategy of the last commit.
    made_by: Option<Strategy>,
    /// What joins the parts of the last frame.
    joined: Joined,
    front: Arc<FrameData>,
    /// Earlier frames, the last one first. Some may still be traced.
    spares: Vec<Arc<FrameData>>,
    /// The kd-trees of parts that are not static, in the order of their ids, for strategies that merge kd-trees.
    moving_trees: Vec<MovingTree>,
}

impl Scene {
    /// The expected number of rays of a frame, unless [`set_ray_budget`](Self::set_ray_budget) changes it: those of a picture of
    /// 800 by 600 pixels, with two more from each visible point.
    pub const DEFAULT_RAY_BUDGET: u64 = 1_440_000;

    /// A scene without parts. Static parts are built with `options`; their [layout](crate::layout) applies to
    /// [`Strategy::Auto`], and the number of [threads](BuildOptions::threads) to every commit.
    pub fn new(options: BuildOptions) -> Self {
        Self {
            options,
            origin: DVec3::ZERO,
            strategy: Strategy::Auto,
            ray_budget: Self::DEFAULT_RAY_BUDGET,
            parts: Parts::default(),
            next_id: 0,
            number: SceneNumber::next(),
            next_slot: 0,
            commits: 0,
            made_by: None,
            joined: Joined::default(),
            front: Arc::default(),
            spares: Vec::new(),
            has_new_slots: false,
            moving_trees: Vec::new(),
        }
    }

    /// Whether commits use several threads.
    fn is_parallel(&self) -> bool {
        self.options.threads() != 1
    }

    /// Adds a static mesh, from the next commit on. It may be changed and moved too, and is then rebuilt with the options of the
    /// scene.
    ///
    /// # Errors
    ///
    /// [`SceneError::TooManyTriangles`] if all parts together have more than [`MAX_TRIANGLES`];
    /// [`SceneError::TooManyParts`] after 2³² calls.
    pub fn add_static(&mut self, mesh: impl Into<Arc<Mesh>>) -> Result<PartId, SceneError> {
        self.add(Role::Static, mesh.into(), Placement::IDENTITY)
    }

    /// Adds a mesh that changes or moves, from the next commit on.
    ///
    /// # Errors
    ///
    /// As [`add_static`](Self::add_static).
    pub fn add_dynamic(&mut self, mesh: impl Into<Arc<Mesh>>) -> Result<PartId, SceneError> {
        self.add(Role::Dynamic, mesh.into(), Placement::IDENTITY)
    }

    /// Adds the mesh of a part again, with a transform. The instance is a part of its own, and may move. It follows
    /// [`set_positions`](Self::set_positions) of the part that it was made from, which may be removed.
    ///
    /// Instances [share](Strategy#instances-that-share) a tree, or have copies of it, as the strategy says.
    ///
    /// # Errors
    ///
    /// Those of [`add_static`](Self::add_static), [`SceneError::NoSuchPart`] and [`SceneError::NotFinite`].
    pub fn add_instance(
        &mut self,
        of: PartId,
        transform: impl Into<Affine3A>,
    ) -> Result<PartId, SceneError> {
        self.add_placed_instance(of, Placement::Single(transform.into()))
    }

    fn add_placed_instance(
        &mut self,
        of: PartId,
        placement: Placement,
    ) -> Result<PartId, SceneError> {
        let part = self.part(of)?;
        let original = match part.role {
            Role::Instance(original) => original,
            Role::Static | Role::Dynamic => of,
        };
        let mesh = Arc::clone(&part.mesh);
        if !placement.is_finite() {
            return Err(SceneError::NotFinite { part: of });
        }
        let instance = self.add(Role::Instance(original), mesh, placement)?;
        self.note_instance_of(original);
        Ok(instance)
    }

    /// Notes that an instance was made of a part, which may be removed.
    fn note_instance_of(&mut self, original: PartId) {
        if let Ok(original) = self.place(original) {
            self.parts.at_mut(original).has_instances = true;
        }
    }

    /// Replaces the positions of a part and of its instances, one for each vertex of its mesh and before its transform, from the
    /// next commit on. On an error, the part keeps its positions.
    ///
    /// # Errors
    ///
    /// [`SceneError::NoSuchPart`]; [`SceneError::Mesh`] for another number of vertices or a position that is not finite.
    pub fn set_positions(
        &mut self,
        part: PartId,
        positions: &[[f32; 3]],
    ) -> Result<(), SceneError> {
        let place = self.place(part)?;
        let changed = self.parts.at(place);
        let mesh = changed.mesh.with_positions(positions.to_vec());
        let mesh = Arc::new(mesh.map_err(|error| SceneError::Mesh { part, error })?);
        let mut places = vec![place];
        if changed.has_instances {
            places.extend(
                self.parts
                    .places()
                    .into_iter()
                    .filter(|place| self.parts.at(*place).role == Role::Instance(part)),
            );
        }
        for place in places {
            self.parts.set_mesh(place, &mesh);
        }
        Ok(())
    }

    /// Replaces the transform of a part, from the next commit on: `transform` maps the coordinates of its mesh to those of the
    /// scene. It may be any finite transform, also one that mirrors or flattens.
    ///
    /// # Errors
    ///
    /// [`SceneError::NoSuchPart`]; [`SceneError::NotFinite`].
    pub fn set_transform(
        &mut self,
        part: PartId,
        transform: impl Into<Affine3A>,
    ) -> Result<(), SceneError> {
        self.set_placement(part, Placement::Single(transform.into()))
    }

    fn set_placement(&mut self, part: PartId, placement: Placement) -> Result<(), SceneError> {
        let place = self.place(part)?;
        if !placement.is_finite() {
            return Err(SceneError::NotFinite { part });
        }
        self.parts.change(place).placement = placement;
        Ok(())
    }

    /// Sets the mask of a part, from the next commit on: a ray sees the part if its own [mask](kd_core::Ray::mask) has one of these
    /// bits. All bits, unless it is set; with none, no ray sees the part. Instances have masks of their own.
    ///
    /// A commit builds and refits nothing for a mask.
    ///
    /// ```
    /// use kd::{BuildOptions, Mesh, Ray, Scene};
    ///
    /// let square = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let mut scene = Scene::new(BuildOptions::default());
    /// let glass = scene.add_static(square)?;
    /// const FOR_SHADOWS: u32 = 2;
    /// scene.set_mask(glass, !FOR_SHADOWS)?;
    /// scene.commit()?;
    /// let ray = Ray::new([0.2, 0.2, 5.0], [0.0, 0.0, -1.0]);
    /// assert!(scene.frame().intersect(&ray).is_some());
    /// assert!(!scene.frame().occluded(&ray.with_mask(FOR_SHADOWS)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SceneError::NoSuchPart`].
    pub fn set_mask(&mut self, part: PartId, mask: u32) -> Result<(), SceneError> {
        let place = self.place(part)?;
        self.parts.set_mask(place, mask);
        Ok(())
    }

    /// Removes a part, from the next commit on. Its id is not given to another part.
    ///
    /// # Errors
    ///
    /// [`SceneError::NoSuchPart`].
    pub fn remove(&mut self, part: PartId) -> Result<(), SceneError> {
        let place = self.place(part)?;
        self.parts.remove(place);
        Ok(())
    }

    /// Sets how the next commits make frames. Answers do not depend on it.
    pub fn set_strategy(&mut self, strategy: Strategy) {
        self.strategy = strategy;
    }

    /// Sets the expected number of rays per frame: [`Strategy::Auto`] rebuilds more where more rays gain from it.
    pub fn set_ray_budget(&mut self, rays: u64) {
        self.ray_budget = rays;
    }

    /// The parts, in the order in which they were added.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = PartId> + '_ {
        let ids: Vec<PartId> = self.parts.all().map(|part| part.id).collect();
        ids.into_iter()
    }

    /// Makes a frame of the current parts.
    ///
    /// The same parts and the same changes give the same frame at any number of threads.
    ///
    /// # Errors
    ///
    /// [`CommitError`] names the part. The frame before and the parts remain unchanged: correct or remove the part, and commit
    /// again.
    pub fn commit(&mut self) -> Result<CommitReport, CommitError> {
        let plan = self.plan()?;
        Ok(self.apply(plan))
    }

    /// The frame of the last successful commit; a frame without parts before the first.
    pub fn frame(&self) -> Frame<'_> {
        Frame::new(&self.front)
    }

    /// The same as [`frame`](Self::frame), owned: to keep while the scene changes.
    pub fn snapshot(&self) -> Arc<FrameData> {
        Arc::clone(&self.front)
    }

    fn add(
        &mut self,
        role: Role,
        mesh: Arc<Mesh>,
        placement: Placement,
    ) -> Result<PartId, SceneError> {
        let triangles = self.triangles() + mesh.len();
        if triangles > MAX_TRIANGLES {
            return Err(SceneError::TooManyTriangles { triangles });
        }
        let id = PartId::new(self.next_id, self.number);
        self.next_id = self
            .next_id
            .checked_add(1)
            .ok_or(SceneError::TooManyParts)?;
        let first_slot = self.take_slots(mesh.len());
        self.parts
            .push(Part::new(id, role, mesh, placement, first_slot));
        Ok(id)
    }

    /// Slots for the triangles of a part. Slots of removed parts are reused only once the others run out.
    fn take_slots(&mut self, triangles: usize) -> u32 {
        let count = |mesh: &Mesh| u32::try_from(mesh.len()).expect("30 bits count triangles");
        let triangles = u32::try_from(triangles).expect("30 bits count triangles");
        if self.next_slot.checked_add(triangles).is_none() {
            self.next_slot = 0;
            self.has_new_slots = true;
            for part in self.parts.all_mut() {
                part.first_slot = self.next_slot;
                self.next_slot += count(&part.mesh);
            }
        }
        let first = self.next_slot;
        self.next_slot += triangles;
        first
    }

    fn triangles(&self) -> usize {
        self.parts.triangles()
    }

    /// The index of a part.
    fn place(&self, part: PartId) -> Result<usize, SceneError> {
        let place = self.parts.place(part);
        place
            .filter(|_| part.scene() == self.number)
            .ok_or(SceneError::NoSuchPart { part })
    }

    fn part(&self, part: PartId) -> Result<&Part, SceneError> {
        self.place(part).map(|place| self.parts.at(place))
    }
}

#[cfg(test)]
mod tests {
    use kd_core::Ray;

    use super::*;

    #[test]
    fn slots_that_run_out_are_numbered_again() {
        let at = |z: f32| {
            let corners = vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
            Mesh::new(corners, vec![[0, 1, 2], [0, 1, 2]]).expect("valid")
        };
        // Two triangles fit, with the largest slot that a scene uses or the one before.
        for (strategy, left) in [
            (Strategy::Auto, 2),
            (Strategy::Auto, 3),
            (Strategy::Merge(MergeMethod::PartitionTrees), 2),
            (Strategy::Merge(MergeMethod::PartitionTrees), 3),
            (Strategy::Merge(MergeMethod::Insertion), 3),
        ] {
            let mut scene = Scene::new(BuildOptions::fast());
            scene.set_strategy(strategy.clone());
            let mut parts = vec![scene.add_static(at(0.0)).expect("fits")];
            scene.commit().expect("a frame");
            // As after four thousand million triangles that were added and removed.
            scene.next_slot = u32::MAX - left;
            for z in [1.0, 2.0] {
                parts.push(scene.add_dynamic(at(z)).expect("fits"));
                scene.commit().expect("a frame");
            }
            let slots: Vec<u32> = scene.parts.all().map(|part| part.first_slot).collect();
            assert_eq!(slots, [0, 2, 4], "{strategy:?}: from the first on");
            let mut hits = Vec::new();
            let ray = Ray::new([0.2, 0.2, 9.0], [0.0, 0.0, -1.0]);
            scene.frame().hits(&ray, usize::MAX, &mut hits);
            let met: Vec<_> = hits
                .iter()
                .map(|(part, hit)| (*part, hit.triangle))
                .collect();
            let parts = parts.iter().rev();
            let expected: Vec<_> = parts.flat_map(|part| [(*part, 0), (*part, 1)]).collect();
            assert_eq!(met, expected, "{strategy:?}");
        }
    }
}
