//! Rays through a placed tree: one that many instances share, each with a transform.
//!
//! A ray traverses the nodes of the tree in the tree's own space. What is a hit is decided in the space of the scene, on the
//! triangles of a block after the transform, which round as those of [`Mesh::transformed`](kd_core::Mesh::transformed). So hits are
//! those of a transformed mesh, to the bit.
//!
//! # The bound
//!
//! Let M and T be the transform, N the matrix that is used for its inverse, as it was rounded, and I the identity. The ray in the
//! space of the tree is L(t) = N (ray(t) - T). A reported hit stands for a point P of a transformed triangle (see
//! [`planes`](crate::planes)). Let Q be the point of the triangle in the tree with the same weights, C the largest coordinates of
//! the tree's box by axis, and Cₛ and W the largest coordinate and the longest side of the placed box. Then, by axis,
//!
//! - |P - (M Q + T)| ≤ ε, the rounding of transformed corners: four operations, at most 2⁻²¹ (|M| C + |T|) and the smallest
//!   normal number;
//! - |P - ray(t)| ≤ δ, the bound of `planes` without the rounding of `t`: 2⁻²⁵ W, and 2⁻⁴⁶ of the largest coordinates of P and the
//!   origin;
//! - so Q - L(t) = (I - N M) Q + N (M Q + T - P) + N (P - ray(t)), at most |I - N M| C + |N| (ε + δ).
//!
//! That is the *extra* bound, beside the one that boxes have for every ray. It also takes 2⁻²² of the largest coordinate of L(0) and
//! of the reach from there, for the rounding of L(0) and of its direction to f32 and of `t`, and 2⁻⁴⁶ |N| of the coordinates of
//! the origin and of T for computing L in f64.

use std::ops::ControlFlow;

use glam::{Affine3A, DMat3, DVec3, Vec3};
use kd_core::{Aabb, Culling, Ray, is_zero_area};
use kd_simd::{F32x8, Simd};
use kd_wide::{Block, Frame, WideTree};

use super::portable::PortableRay;
use super::subtree::Subtree;
use super::walk::{VisitBlocks, walk};
use crate::collect::{Collect, Limited};
use crate::planes::RayPlanes;
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// Where an instance of a tree is.
///
/// About 250 bytes.
#[derive(Clone, Debug)]
pub struct Placement {
    transform: Affine3A,
    /// N.
    inverse: DMat3,
    /// T.
    translation: DVec3,
    /// The part of the extra bound that no ray changes.
    extra: f64,
    /// The largest sum of a row of |N|.
    stretch: f64,
    bounds: Aabb,
    first_slot: u32,
}

impl Placement {
    /// The tree after a transform, with `first_slot` added to the numbers of its triangles, modulo 2³².
    ///
    /// `None` if rays through it would visit most of its nodes or all: if the transform flattens it, or nearly so, or if coordinates
    /// come near the ends of f32. The transformed mesh can have a tree of its own.
    pub fn new(tree: &WideTree, transform: &Affine3A, first_slot: u32) -> Option<Self> {
        /// Corners of boxes that double do not overflow.
        const MOST: f64 = f32::MAX as f64 / 4.0;
        /// The most by which boxes grow on each side, of the side of the tree's box.
        const MOST_EXTRA: f64 = 1.0 / 16.0;
        let matrix = DMat3::from_cols(
            transform.matrix3.x_axis.as_dvec3(),
            transform.matrix3.y_axis.as_dvec3(),
            transform.matrix3.z_axis.as_dvec3(),
        );
        let translation = transform.translation.as_dvec3();
        let [lower, upper] = corners_of(tree.frame());
        let most = lower.abs().max(upper.abs());
        let rounding = 2.0_f64.powi(-21) * (sizes(&matrix) * most + translation.abs())
            + DVec3::splat(f32::MIN_POSITIVE.into());
        let bounds = placed_bounds(tree, &matrix, translation, rounding);
        let (at_least, at_most) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let inverse = matrix.inverse();
        let product = inverse * matrix;
        // What is computed of it errs by far less than this.
        let rest = sizes(&(product - DMat3::IDENTITY))
            + 2.0_f64.powi(-48) * (sizes(&inverse) * sizes(&matrix));
        let side = (at_most - at_least).max_element();
        let coordinate = at_least.abs().max(at_most.abs()).max_element();
        let of_scene =
            rounding + DVec3::splat(2.0_f64.powi(-25) * side + 2.0_f64.powi(-44) * coordinate);
        let extra = (rest * most + sizes(&inverse) * of_scene).max_element();
        let stretch = (sizes(&inverse) * DVec3::ONE).max_element();
        // NaN is no good either.
        let is_good = coordinate < MOST
            && stretch < MOST
            && extra <= MOST_EXTRA * (upper - lower).max_element();
        is_good.then_some(Self {
            transform: *transform,
            inverse,
            translation,
            extra,
            stretch,
            bounds,
            first_slot,
        })
    }

    /// A box around all triangles, in the scene.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The same place, with another number added to those of triangles.
    #[must_use]
    pub fn with_first_slot(self, first_slot: u32) -> Self {
        Self { first_slot, ..self }
    }

    /// The ray in the space of the tree, and the frame for its boxes. `None` if f32 cannot hold it.
    fn to_tree(&self, tree: &WideTree, ray: &Ray) -> Option<(Ray, Frame)> {
        let from = self.inverse * (ray.origin.as_dvec3() - self.translation);
        let towards = self.inverse * ray.direction.as_dvec3();
        let local = Ray {
            origin: from.as_vec3(),
            direction: towards.as_vec3(),
            mask: u32::MAX,
            culling: Culling::NONE,
            ..*ray
        };
        // Below, a direction loses bits.
        let is_long = local.direction.abs().max_element() >= f32::MIN_POSITIVE * (1 << 30) as f32;
        if !(local.can_hit() && is_long) {
            return None;
        }
        let [lower, upper] = corners_of(tree.frame());
        let reach = (lower - from).abs().max((upper - from).abs()).max_element();
        let origin =
            ray.origin.as_dvec3().abs().max_element() + self.translation.abs().max_element();
        let extra = self.extra
            + 2.0_f64.powi(-22) * (from.abs().max_element() + reach)
            + 2.0_f64.powi(-44) * self.stretch * origin;
        #[allow(
            clippy::cast_possible_truncation,
            reason = "an infinite bound visits all"
        )]
        let frame = tree.frame().wider_by((1.0 + 1e-6) * extra as f32);
        Some((local, frame))
    }
}

/// Absolute values.
fn sizes(matrix: &DMat3) -> DMat3 {
    DMat3::from_cols(
        matrix.x_axis.abs(),
        matrix.y_axis.abs(),
        matrix.z_axis.abs(),
    )
}

/// The lower and the upper corner of the box of a frame.
fn corners_of(frame: &Frame) -> [DVec3; 2] {
    frame
        .corners
        .map(|[x, y, z, _]| Vec3::new(x, y, z).as_dvec3())
}

/// A box around the transformed boxes of the children of the root, and `rounding`; around the transformed box of the tree where that is
/// larger than all of them, as with triangles of zero area.
fn placed_bounds(tree: &WideTree, matrix: &DMat3, translation: DVec3, rounding: DVec3) -> Aabb {
    let [lower, upper] = corners_of(tree.frame());
    let whole = Aabb {
        min: lower.as_vec3(),
        max: upper.as_vec3(),
    };
    let root = tree.root();
    let mut boxes = Vec::new();
    if !root.is_leaf() {
        let node = &tree.nodes()[root.index()];
        boxes.extend(node.lanes().map(|lane| node.bounds(lane)));
        boxes.retain(|bounds| !bounds.is_empty());
    }
    let around = |boxes: &[Aabb]| boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
    if around(&boxes) != whole && !whole.is_empty() {
        boxes = vec![whole];
    }
    for bounds in &mut boxes {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let center = *matrix * (0.5 * (min + max)) + translation;
        let half = sizes(matrix) * (0.5 * (max - min)) + 2.0 * rounding;
        // The rounding of corners is far more than that of computing them in f64, and of rounding them here.
        *bounds = Aabb {
            min: (center - half).as_vec3(),
            max: (center + half).as_vec3(),
        };
    }
    around(&boxes)
}

/// What a ray does in a placed tree.
pub(crate) struct InPlaced<'a, C> {
    pub(crate) tree: &'a WideTree,
    pub(crate) placement: &'a Placement,
    /// The ray in the scene, and the frame of the scene.
    pub(crate) ray: &'a Ray,
    pub(crate) frame: &'a Frame,
    pub(crate) collector: &'a mut C,
}

impl<C: Collect> InPlaced<'_, C> {
    /// Gives the collector every hit that it may want, on any processor.
    #[inline(always)]
    pub(crate) fn walk<S: Simd, P: Probe>(self, simd: S, probe: &mut P) {
        let Self {
            tree,
            placement,
            ray,
            frame,
            collector,
        } = self;
        if !ray.can_hit() {
            return;
        }
        let test = TriangleTest::new(ray, RayPlanes::new(ray, frame).reach());
        let mut visitor = PlacedTriangles {
            simd,
            placement,
            test: &test,
            collector,
        };
        let local = placement.to_tree(tree, ray);
        let local = local.and_then(|(local, frame)| PortableRay::new(&local, &frame));
        match local {
            Some(local) => walk(Subtree::whole(tree), &local, &mut visitor, probe),
            None => {
                // The visitor may have enough.
                let _ = visitor.test_blocks(tree.blocks(), probe);
            }
        }
    }

    /// The ray in the space of the tree, with the frame for its boxes.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn to_tree(&self) -> Option<(Ray, Frame)> {
        self.placement.to_tree(self.tree, self.ray)
    }
}

/// Gives a collector the hits of transformed triangles.
struct PlacedTriangles<'a, S, C> {
    simd: S,
    placement: &'a Placement,
    test: &'a TriangleTest,
    collector: &'a mut C,
}

impl<S, C: Collect> Limited for PlacedTriangles<'_, S, C> {
    #[inline(always)]
    fn farthest(&self) -> f32 {
        self.collector.limit()
    }
}

impl<S: Simd, C: Collect> VisitBlocks for PlacedTriangles<'_, S, C> {
    const ANY: bool = C::ANY;

    #[inline(always)]
    fn visit<P: Probe>(
        &mut self,
        _: &PortableRay,
        blocks: &[Block],
        probe: &mut P,
    ) -> ControlFlow<()> {
        self.test_blocks(blocks, probe)
    }
}

impl<S: Simd, C: Collect> PlacedTriangles<'_, S, C> {
    #[inline(always)]
    fn test_blocks<P: Probe>(&mut self, blocks: &[Block], probe: &mut P) -> ControlFlow<()> {
        for block in blocks {
            probe.block();
            let count = block.count() as usize;
            let block = self.placement.placed_block(self.simd, block);
            for lane in self.test.may_hit(&block.corners, count) {
                probe.decision();
                let corners = block.corners_of(lane);
                if let Some(hit) = self.test.decide(corners, block.triangles[lane])
                    && !is_zero_area(corners)
                {
                    self.collector.take(hit)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

impl Placement {
    /// The triangles of a block in the scene: rounded as by [`transformed_point`](kd_core::transformed_point), and with the slots of
    /// the instance. Some may have no area.
    #[inline(always)]
    pub(crate) fn placed_block<S: Simd>(&self, simd: S, block: &Block) -> Block {
        let mut placed = Block::EMPTY;
        let by = &self.transform;
        let columns = [
            by.matrix3.x_axis,
            by.matrix3.y_axis,
            by.matrix3.z_axis,
            by.translation,
        ]
        .map(|column| column.to_array());
        for (rows, corner) in placed.corners.iter_mut().zip(&block.corners) {
            let [p, q, r] = [
                simd.load(&corner[0]),
                simd.load(&corner[1]),
                simd.load(&corner[2]),
            ];
            for (axis, row) in rows.iter_mut().enumerate() {
                let [x, y, z, translation] = [
                    simd.splat(columns[0][axis]),
                    simd.splat(columns[1][axis]),
                    simd.splat(columns[2][axis]),
                    simd.splat(columns[3][axis]),
                ];
                (((x * p + y * q) + z * r) + translation).store(row);
            }
        }
        for (slot, triangle) in placed.triangles.iter_mut().zip(block.triangles) {
            *slot = triangle.wrapping_add(self.first_slot);
        }
        placed
    }
}
