//! A part of a scene.

use std::fmt;
use std::sync::Arc;

use glam::Affine3A;
use kd_core::Mesh;

use super::grove::Key;

/// A part of a [`Scene`](crate::Scene). No two parts of a scene have the same id, not even after one was removed; the one that
/// was added first is the lower.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartId(pub(super) u32);

impl fmt::Display for PartId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "part {}", self.0)
    }
}

/// What a part was added as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Static,
    Dynamic,
    /// Of this part.
    Instance(PartId),
}

/// A mesh, where it is, and what was made of it.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) id: PartId,
    pub(super) role: Role,
    /// Before the transform.
    pub(super) mesh: Arc<Mesh>,
    pub(super) transform: Affine3A,
    /// Whether it was made an instance of, so that others may have to change with it.
    pub(super) has_instances: bool,
    /// Whether the mesh or the transform is another one than at the last commit.
    pub(super) is_changed: bool,
    /// The number of its first triangle.
    pub(super) first_slot: u32,
    /// The commits that made its nodes, and that put its triangles where they are.
    pub(super) built: u64,
    pub(super) moved: u64,
    /// What the nodes cost when they were made ([`WideForest::cost`](kd_trace::WideForest::cost)), if the transform scaled no
    /// lengths.
    pub(super) cost: f64,
}

impl Part {
    pub(super) fn new(
        id: PartId,
        role: Role,
        mesh: Arc<Mesh>,
        transform: Affine3A,
        first_slot: u32,
    ) -> Self {
        Self {
            id,
            role,
            mesh,
            transform,
            has_instances: false,
            is_changed: true,
            first_slot,
            built: 0,
            moved: 0,
            cost: 0.0,
        }
    }

    /// How much the transform scales areas.
    pub(super) fn area_scale(&self) -> f64 {
        let volume = f64::from(self.transform.matrix3.determinant().abs());
        volume.powf(2.0 / 3.0)
    }

    /// Which nodes it has.
    pub(super) fn key(&self) -> Key {
        Key {
            part: self.id,
            built: self.built,
            moved: self.moved,
            first_slot: self.first_slot,
        }
    }

    pub(super) fn set_mesh(&mut self, mesh: &Arc<Mesh>) {
        self.mesh = Arc::clone(mesh);
        self.is_changed = true;
    }
}
