//! A part of a scene.

use std::cmp;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use kd_core::Mesh;

use super::placement::Placement;
use super::shared::SharedPart;
use super::sight::Sight;

/// The name of a part of a [`Scene`](crate::Scene). An id is never given to another part of the same scene, not even after the
/// part was removed. Ids are ordered as their parts were added.
///
/// An id knows its scene: every other scene and its frames report it as
/// [`NoSuchPart`](crate::scene::SceneError::NoSuchPart). Only such look-ups use that knowledge. `==`, the order, hashes and both
/// text forms compare the number of the part alone, so that they are the same in every run of a program; ids of two scenes may
/// therefore be equal.
#[derive(Clone, Copy)]
pub struct PartId {
    number: u32,
    scene: SceneNumber,
}

/// The number of a scene in this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SceneNumber(NonZeroU32);

impl SceneNumber {
    /// The number of no scene.
    #[cfg(feature = "serde")]
    const NONE: Self = Self(NonZeroU32::MAX);

    /// A number that no other scene of the process has; numbers repeat after about 2³² scenes.
    pub(super) fn next() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        // 1 to u32::MAX - 1.
        let number = NonZeroU32::MIN.saturating_add(count % (u32::MAX - 1));
        Self(number)
    }
}

impl PartId {
    pub(super) fn new(number: u32, scene: SceneNumber) -> Self {
        Self { number, scene }
    }

    pub(super) fn number(self) -> u32 {
        self.number
    }

    pub(super) fn scene(self) -> SceneNumber {
        self.scene
    }
}

/// The number of the part.
#[cfg(feature = "serde")]
impl serde::Serialize for PartId {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.number.serialize(serializer)
    }
}

/// An id that no scene has: equal to the one that was serialized, to compare and to print.
#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for PartId {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = u32::deserialize(deserializer)?;
        Ok(Self::new(number, SceneNumber::NONE))
    }
}

impl PartialEq for PartId {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for PartId {}

impl PartialOrd for PartId {
    fn partial_cmp(&self, other: &Self) -> Option<cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for PartId {
    fn cmp(&self, other: &Self) -> cmp::Ordering {
        self.number.cmp(&other.number)
    }
}

impl Hash for PartId {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.number.hash(state);
    }
}

impl fmt::Debug for PartId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("PartId").field(&self.number).finish()
    }
}

impl fmt::Display for PartId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "part {}", self.number)
    }
}

/// How a part was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Static,
    Dynamic,
    /// Shares the mesh of this part.
    Instance(PartId),
}

/// Where the triangles of a part are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PartVersion {
    pub(super) part: PartId,
    /// The commit that moved them there.
    pub(super) moved: u64,
    /// The slot of the first one.
    pub(super) first_slot: u32,
}

/// The wide nodes of a part in the last frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartNodes {
    /// The forest that they are in.
    pub(super) forest: usize,
    /// Their number there.
    pub(super) member: usize,
    /// The slot of the first triangle.
    pub(super) first_slot: u32,
}

/// A mesh, its placement, and its nodes.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) id: PartId,
    pub(super) role: Role,
    /// Before the transform.
    pub(super) mesh: Arc<Mesh>,
    pub(super) placement: Placement,
    /// A ray sees the part if its mask has one of these bits.
    pub(super) mask: u32,
    /// Whether instances were added of it, which change with its mesh.
    pub(super) has_instances: bool,
    /// Whether its mesh or transform has changed since the last commit.
    pub(super) is_changed: bool,
    /// Whether it was removed since then.
    pub(super) is_removed: bool,
    /// The slot of its first triangle.
    pub(super) first_slot: u32,
    /// The commit that moved its triangles to where they are.
    pub(super) moved: u64,
    /// `None` before the first commit, and after one whose frame has no wide nodes of parts.
    pub(super) nodes: Option<PartNodes>,
    /// Set while it shares a tree in the last frame, in place of nodes of its own.
    pub(super) shared: Option<Arc<SharedPart>>,
    /// The SAH cost of its nodes when they were built ([`WideForest::cost`](kd_trace::WideForest::cost)), for a transform that
    /// scales no lengths.
    pub(super) cost: f64,
}

impl Part {
    pub(super) fn new(
        id: PartId,
        role: Role,
        mesh: Arc<Mesh>,
        placement: Placement,
        first_slot: u32,
    ) -> Self {
        Self {
            id,
            role,
            mesh,
            placement,
            mask: u32::MAX,
            has_instances: false,
            is_changed: true,
            is_removed: false,
            first_slot,
            moved: 0,
            nodes: None,
            shared: None,
            cost: 0.0,
        }
    }

    pub(super) fn sight(&self) -> Sight {
        Sight {
            mask: self.mask,
            is_mirrored: self.placement.is_mirrored(),
            is_shared: self.shared.is_some(),
        }
    }

    pub(super) fn version(&self) -> PartVersion {
        PartVersion {
            part: self.id,
            moved: self.moved,
            first_slot: self.first_slot,
        }
    }
}
