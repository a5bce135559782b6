//! Instances that share one tree: each is a transform, and rays traverse the tree in its own space.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::{Arc, OnceLock};

use glam::{Affine3A, Vec3};
use kd_core::{Aabb, LayoutBytes, Mesh, Ray, is_zero_area, transformed_point};
use kd_trace::kit::{Collect, Frame, Placement, VisitItem, WideBoxes, collect_placed, walk_boxes};
use kd_trace::{Join, WideForest, WideTree};

/// The wide nodes of a mesh before the transforms of its instances.
#[derive(Debug)]
pub(super) struct SharedTree {
    mesh: Arc<Mesh>,
    tree: WideTree,
    /// Triangles of zero area, which are not in the tree, and may have an area once a transform has rounded their corners.
    slivers: Vec<u32>,
}

impl SharedTree {
    pub(super) fn new(mesh: Arc<Mesh>, tree: WideTree) -> Self {
        let is_sliver = |triangle: &u32| {
            let corners = mesh.corners(*triangle);
            let [a, b, c] = corners;
            is_zero_area(corners) && a != b && b != c && c != a
        };
        let slivers = (0..).take(mesh.len()).filter(is_sliver).collect();
        Self {
            mesh,
            tree,
            slivers,
        }
    }
}

/// An instance that shares a tree.
#[derive(Debug)]
pub(super) struct SharedPart {
    of: Arc<SharedTree>,
    transform: Affine3A,
    placement: Placement,
    first_slot: u32,
    /// The transformed mesh, once it was asked for.
    placed: OnceLock<Arc<Mesh>>,
}

impl SharedPart {
    /// `None` where rays through the tree would not answer as through the transformed mesh, or far slower.
    pub(super) fn new(of: Arc<SharedTree>, transform: Affine3A, first_slot: u32) -> Option<Self> {
        let placement = Placement::new(&of.tree, &transform, first_slot)?;
        let part = Self {
            of,
            transform,
            placement,
            first_slot,
            placed: OnceLock::new(),
        };
        let has_area = |triangle: &u32| !is_zero_area(part.corners(*triangle));
        let is_right = !part.of.slivers.iter().any(has_area);
        is_right.then_some(part)
    }

    /// The same part with another first slot.
    pub(super) fn with_first_slot(&self, first_slot: u32) -> Self {
        Self {
            of: Arc::clone(&self.of),
            transform: self.transform,
            placement: self.placement.clone().with_first_slot(first_slot),
            first_slot,
            placed: self.placed.clone(),
        }
    }

    /// The corners of a triangle after the transform.
    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        let corners = self.of.mesh.corners(triangle);
        corners.map(|corner| transformed_point(&self.transform, corner.to_array()).into())
    }

    fn mesh(&self) -> &Arc<Mesh> {
        self.placed.get_or_init(|| Arc::new(self.transformed()))
    }

    fn transformed(&self) -> Mesh {
        let mesh = self.of.mesh.transformed(&self.transform);
        mesh.expect("coordinates of placed trees are finite")
    }
}

/// The triangles of a part in a frame.
#[derive(Clone, Debug)]
pub(super) enum PartMesh {
    /// As they are in the scene.
    Placed(Arc<Mesh>),
    /// Those of a mesh that instances share.
    Shared(Arc<SharedPart>),
}

impl PartMesh {
    /// The number of triangles.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Placed(mesh) => mesh.len(),
            Self::Shared(part) => part.of.mesh.len(),
        }
    }

    /// The corners of a triangle in the scene.
    pub(super) fn corners(&self, triangle: u32) -> [Vec3; 3] {
        match self {
            Self::Placed(mesh) => mesh.corners(triangle),
            Self::Shared(part) => part.corners(triangle),
        }
    }

    /// The mesh in the scene. Of a part that shares, made when it is first asked for.
    pub(super) fn mesh(&self) -> &Arc<Mesh> {
        match self {
            Self::Placed(mesh) => mesh,
            Self::Shared(part) => part.mesh(),
        }
    }

    /// A box around all triangles in the scene, the smallest one if the part does not share.
    pub(super) fn bounds(&self) -> Aabb {
        match self {
            Self::Placed(mesh) => mesh.bounds(),
            Self::Shared(part) => part.placement.bounds(),
        }
    }
}

/// All parts of a frame that share trees, and nodes over their boxes.
#[derive(Debug)]
pub(super) struct SharedParts {
    parts: Vec<Arc<SharedPart>>,
    boxes: WideBoxes,
    /// Of the box around all.
    frame: Frame,
    bytes: LayoutBytes,
    /// Trees of their own for all parts, once points have asked.
    copies: OnceLock<WideForest>,
}

impl SharedParts {
    pub(super) fn new(parts: Vec<Arc<SharedPart>>, is_parallel: bool) -> Self {
        let boxes: Vec<Aabb> = parts.iter().map(|part| part.placement.bounds()).collect();
        let around = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
        let boxes = WideBoxes::new(&boxes, is_parallel, None).expect("nothing cancels it");
        let mut trees = BTreeSet::new();
        let first_uses = parts
            .iter()
            .filter(|part| trees.insert(Arc::as_ptr(&part.of)));
        let of_trees: LayoutBytes = first_uses.map(|part| part.of.tree.bytes()).sum();
        let of_parts = LayoutBytes {
            nodes: parts.len() * size_of::<SharedPart>(),
            blocks: 0,
        };
        Self {
            bytes: of_trees + of_parts + boxes.bytes(),
            frame: Frame::new(&around),
            boxes,
            parts,
            copies: OnceLock::new(),
        }
    }

    /// The triangles of all parts as if none shared a tree: made at the first call, and kept.
    pub(super) fn copies(&self) -> &WideForest {
        self.copies.get_or_init(|| {
            let mut forest = WideForest::new();
            for part in &self.parts {
                forest.push(
                    &WideTree::from_objects(&part.transformed()),
                    part.first_slot,
                );
            }
            forest.join(Join::default());
            forest
        })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Bytes of trees, each once, of what places them, and of the nodes over them.
    pub(super) fn bytes(&self) -> LayoutBytes {
        self.bytes
    }

    /// Gives the collector every hit of the ray that it may want, with slots for triangles.
    pub(super) fn collect<C: Collect>(&self, ray: &Ray, collector: &mut C) {
        let mut visitor = InParts {
            shared: self,
            ray,
            collector,
        };
        walk_boxes(&self.boxes, &self.frame, ray, &mut visitor);
    }
}

impl Default for SharedParts {
    fn default() -> Self {
        Self::new(Vec::new(), false)
    }
}

/// Looks for hits in the parts whose boxes a ray meets.
struct InParts<'a, C> {
    shared: &'a SharedParts,
    ray: &'a Ray,
    collector: &'a mut C,
}

impl<C: Collect> VisitItem for InParts<'_, C> {
    const ANY: bool = C::ANY;

    fn limit(&self) -> f32 {
        self.collector.limit()
    }

    fn visit(&mut self, item: u32) -> ControlFlow<()> {
        let part = &self.shared.parts[item as usize];
        let ray = self
            .ray
            .with_range(self.ray.t_min, self.ray.t_max.min(self.limit()));
        let frame = &self.shared.frame;
        collect_placed(&part.of.tree, &part.placement, frame, &ray, self.collector);
        if self.collector.is_done() {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}
