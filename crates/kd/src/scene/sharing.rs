//! Which parts share a tree with others of the same mesh: the choice, by memory and by the time of rays.

use std::collections::HashMap;
use std::sync::Arc;

use kd_core::{Aabb, Mesh};

use super::part::{Part, Role};
use super::placement::Placement;
use super::report::CommitReason;
use super::shared::{SharedPart, SharedTree};
use super::{CommitError, Scene, Strategy};
use crate::layout;

/// Bytes of nodes, blocks and the mesh of a copied triangle. (Waved grids, a throw-away program, 2026-12-01: 57 to
/// 67 of nodes and blocks, 18 of the mesh.)
const BYTES: f64 = 80.0;
/// Nanoseconds in which a triangle is copied, transformed and refitted. (The same program, one thread, instances of 968
/// triangles: 110; 9800: 50; 99 458: 42.)
const COPY_NS: f64 = 50.0;
/// Nanoseconds by which a ray takes longer through an instance whose box it meets, if that shares a tree. (The record of
/// `cargo xtask queries`: a ray takes 171 in a scene that shares, 74 in the copy.)
const ENTER_NS: f64 = 100.0;
/// Copies of one mesh may take this much memory, however much time they save.
const MOST_BYTES: f64 = (1_u64 << 30) as f64;

/// The parts that have one mesh.
#[derive(Debug, Default)]
struct Group {
    count: usize,
    /// Once they share it.
    tree: Option<Arc<SharedTree>>,
}

/// The meshes of parts, with the parts that have each.
#[derive(Debug, Default)]
pub(super) struct Meshes(HashMap<MeshKey, Group>);

/// The address of a mesh, which a part keeps alive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct MeshKey(usize);

impl MeshKey {
    fn of(mesh: &Arc<Mesh>) -> Self {
        Self(Arc::as_ptr(mesh).addr())
    }
}

impl Meshes {
    /// Notes that a part has a mesh.
    pub(super) fn add(&mut self, mesh: &Arc<Mesh>) {
        self.0.entry(MeshKey::of(mesh)).or_default().count += 1;
    }

    /// Notes that a part no longer has a mesh.
    pub(super) fn remove(&mut self, mesh: &Arc<Mesh>) {
        let key = MeshKey::of(mesh);
        if let Some(group) = self.0.get_mut(&key) {
            group.count -= 1;
            if group.count == 0 {
                self.0.remove(&key);
            }
        }
    }

    /// The number of parts with this mesh.
    fn count(&self, mesh: &Arc<Mesh>) -> usize {
        self.0
            .get(&MeshKey::of(mesh))
            .map_or(0, |group| group.count)
    }

    /// Whether parts with this mesh share a tree, or did.
    pub(super) fn have_shared(&self, mesh: &Arc<Mesh>) -> bool {
        self.tree(mesh).is_some()
    }

    fn tree(&self, mesh: &Arc<Mesh>) -> Option<&Arc<SharedTree>> {
        self.0.get(&MeshKey::of(mesh))?.tree.as_ref()
    }
}

impl Scene {
    /// Trees for parts that shall share them, of those that a commit plans for: by mesh, with the reason.
    pub(super) fn plan_sharing(&mut self, places: &[usize]) -> Result<Sharing, CommitError> {
        let mut sharing = Sharing::default();
        if !self.may_share() {
            return Ok(sharing);
        }
        let mut groups: Vec<(MeshKey, Vec<usize>)> = Vec::new();
        let mut numbers = HashMap::new();
        for place in places {
            let mesh = &self.parts.at(*place).mesh;
            if self.parts.meshes().count(mesh) < 2 || mesh.is_empty() {
                continue;
            }
            let key = MeshKey::of(mesh);
            let number = *numbers.entry(key).or_insert_with(|| {
                groups.push((key, Vec::new()));
                groups.len() - 1
            });
            groups[number].1.push(*place);
        }
        for (key, members) in groups {
            if let Some(reason) = self.shares(&members) {
                let tree = self.shared_tree(members[0])?;
                sharing.0.insert(key, (tree, reason));
            }
        }
        Ok(sharing)
    }

    /// Whether the strategy lets parts share trees.
    pub(super) fn may_share(&self) -> bool {
        matches!(self.strategy, Strategy::Auto | Strategy::Instances)
    }

    /// Why some parts of one mesh, which a commit plans for, shall share a tree; `None` if they shall not.
    fn shares(&self, members: &[usize]) -> Option<CommitReason> {
        let mesh = &self.parts.at(members[0]).mesh;
        if self.strategy == Strategy::Instances || self.parts.meshes().tree(mesh).is_some() {
            return Some(CommitReason::Strategy);
        }
        let triangles = mesh.len() as f64;
        let copied_bytes = BYTES * triangles * self.parts.meshes().count(mesh) as f64;
        let copy_ns = COPY_NS * triangles * members.len() as f64;
        let boxes = members
            .iter()
            .map(|place| placed_box(self.parts.at(*place)));
        let boxes: Vec<Aabb> = boxes.collect();
        let of_frame = self.front.bounds();
        let all = boxes.iter().fold(of_frame, |all, one| all.union(one));
        let area: f64 = boxes.iter().map(Aabb::half_area).sum();
        // The expected number of these boxes that a ray through the scene meets.
        let met = area / all.half_area();
        #[allow(clippy::cast_precision_loss, reason = "an estimate")]
        let ray_loss_ns =
            self.ray_budget as f64 * ENTER_NS * if met.is_finite() { met } else { 0.0 };
        let shares = copied_bytes > MOST_BYTES || copy_ns > ray_loss_ns;
        shares.then_some(CommitReason::Sharing {
            copied_bytes,
            copy_ns,
            ray_loss_ns,
        })
    }

    /// The tree of a part's mesh, before any transform.
    fn shared_tree(&mut self, place: usize) -> Result<Arc<SharedTree>, CommitError> {
        let part = self.parts.at(place);
        if let Some(tree) = self.parts.meshes().tree(&part.mesh) {
            return Ok(Arc::clone(tree));
        }
        let tree = if part.role == Role::Static {
            let built = layout::build_wide(&part.mesh, &self.options);
            built.map_err(|error| CommitError::Build {
                part: part.id,
                error,
            })?
        } else {
            self.build_fast(&part.mesh)
        };
        let mesh = Arc::clone(&part.mesh);
        let shared = Arc::new(SharedTree::new(Arc::clone(&mesh), tree));
        let group = self.parts.meshes_mut().0.get_mut(&MeshKey::of(&mesh));
        if let Some(group) = group {
            group.tree = Some(Arc::clone(&shared));
        }
        Ok(shared)
    }
}

/// The trees that parts share after a commit, by their meshes.
#[derive(Debug, Default)]
pub(super) struct Sharing(HashMap<MeshKey, (Arc<SharedTree>, CommitReason)>);

impl Sharing {
    /// A part that shares a tree, and why; `None` for one that does not, or that cannot.
    pub(super) fn place(&self, part: &Part) -> Option<(Arc<SharedPart>, CommitReason)> {
        let (tree, reason) = self.0.get(&MeshKey::of(&part.mesh))?;
        let Placement::Single(transform) = part.placement else {
            return None;
        };
        let placed = SharedPart::new(Arc::clone(tree), transform, part.first_slot)?;
        Some((Arc::new(placed), reason.clone()))
    }
}

/// The box of a part in the scene, about.
fn placed_box(part: &Part) -> Aabb {
    let bounds = part.mesh.bounds();
    let (min, max) = (bounds.min, bounds.max);
    let corners = (0..8_u32).map(|corner| {
        let at = |axis: usize| {
            if corner >> axis & 1 == 0 {
                min[axis]
            } else {
                max[axis]
            }
        };
        part.placement.place_point([at(0), at(1), at(2)].into())
    });
    corners.fold(Aabb::EMPTY, |around, corner| {
        around.union(&Aabb {
            min: corner,
            max: corner,
        })
    })
}
