//! What points ask of a frame: of all its parts together.

use std::sync::Arc;

use glam::Vec3;
use kd_core::{Aabb, Mesh};
use kd_points::{Nearest, PointTree, TriangleLists, WindingNumbers};

use super::PartId;
use super::frame::FrameData;
use crate::layout::TreeLayoutRef;

/// Questions of points. Parts that [share](crate::Strategy#instances-that-share) a tree are copied at the first of them, with the memory
/// that copies take.
impl FrameData {
    fn point_trees(&self) -> Vec<PointTree<'_>> {
        let copies = (!self.shared.is_empty()).then(|| self.shared.copies().tree());
        let copies = copies.map(TreeLayoutRef::Wide);
        self.trees().chain(copies).map(PointTree::from).collect()
    }

    /// The part of a triangle, by its slot, and the number of the triangle in that part.
    fn triangle_of_part(&self, slot: u32) -> (PartId, u32) {
        let part = self.parts.of_slot(slot);
        (part.id, slot - part.first_slot)
    }

    fn nearest_of_part(&self, nearest: Nearest) -> (PartId, Nearest) {
        let (part, triangle) = self.triangle_of_part(nearest.triangle);
        (
            part,
            Nearest {
                triangle,
                ..nearest
            },
        )
    }

    /// The closest point of all parts and its part, as [`KdTree::closest_point`](crate::KdTree::closest_point). Equal distances go to the
    /// lower part, then to the lower triangle.
    pub fn closest_point(
        &self,
        point: impl Into<Vec3>,
        max_distance: f32,
    ) -> Option<(PartId, Nearest)> {
        let nearest = kd_points::closest_point(&self.point_trees(), point, max_distance);
        nearest.map(|nearest| self.nearest_of_part(nearest))
    }

    /// [`closest_point`](Self::closest_point) for each point, as
    /// [`KdTree::closest_point_batch`](crate::KdTree::closest_point_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn closest_point_batch(
        &self,
        points: &[Vec3],
        max_distance: f32,
        out: &mut [Option<(PartId, Nearest)>],
    ) {
        self.closest_points(points, max_distance, out, false);
    }

    /// [`closest_point_batch`](Self::closest_point_batch) on the threads of the pool in scope.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn par_closest_point_batch(
        &self,
        points: &[Vec3],
        max_distance: f32,
        out: &mut [Option<(PartId, Nearest)>],
    ) {
        self.closest_points(points, max_distance, out, true);
    }

    fn closest_points(
        &self,
        points: &[Vec3],
        max_distance: f32,
        out: &mut [Option<(PartId, Nearest)>],
        is_parallel: bool,
    ) {
        assert_eq!(points.len(), out.len(), "one answer per point");
        let trees = self.point_trees();
        let mut found = vec![None; points.len()];
        kd_points::closest_point_batch(&trees, points, max_distance, &mut found, is_parallel);
        for (out, nearest) in out.iter_mut().zip(found) {
            *out = nearest.map(|nearest| self.nearest_of_part(nearest));
        }
    }

    /// Whether a point is inside of the surface of all parts together, or on it, as [`KdTree::contains`](crate::KdTree::contains). A point
    /// inside of two closed parts that overlap is outside: the parity counts.
    pub fn contains(&self, point: impl Into<Vec3>) -> bool {
        kd_points::contains(&self.point_trees(), point)
    }

    /// [`contains`](Self::contains) for each point.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn contains_batch(&self, points: &[Vec3], out: &mut [bool]) {
        kd_points::contains_batch(&self.point_trees(), points, out, false);
    }

    /// [`contains_batch`](Self::contains_batch) on the threads of the pool in scope.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn par_contains_batch(&self, points: &[Vec3], out: &mut [bool]) {
        kd_points::contains_batch(&self.point_trees(), points, out, true);
    }

    /// The distance of a point from the surface of all parts together, negative inside, as
    /// [`KdTree::signed_distance`](crate::KdTree::signed_distance).
    pub fn signed_distance(&self, point: impl Into<Vec3>) -> Option<f32> {
        kd_points::signed_distance(&self.point_trees(), point)
    }

    /// [`signed_distance`](Self::signed_distance) for each point.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn signed_distance_batch(&self, points: &[Vec3], out: &mut [Option<f32>]) {
        kd_points::signed_distance_batch(&self.point_trees(), points, out, false);
    }

    /// [`signed_distance_batch`](Self::signed_distance_batch) on the threads of the pool in scope.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn par_signed_distance_batch(&self, points: &[Vec3], out: &mut [Option<f32>]) {
        kd_points::signed_distance_batch(&self.point_trees(), points, out, true);
    }

    /// The sum of the winding numbers of all parts, as [`KdTree::winding_number`](crate::KdTree::winding_number): within
    /// [`WINDING_ERROR`](crate::points::WINDING_ERROR). The sides of a part that is mirrored are those of its mesh.
    ///
    /// The first call makes a hierarchy over all triangles, which the frame keeps. It takes about as long as a build of
    /// [`fast`](crate::BuildOptions::fast), and about 100 bytes a triangle.
    pub fn winding_number(&self, point: impl Into<Vec3>) -> f64 {
        self.winding_numbers().at(point)
    }

    /// [`winding_number`](Self::winding_number) for each point.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn winding_number_batch(&self, points: &[Vec3], out: &mut [f64]) {
        kd_points::winding_number_batch(self.winding_numbers(), points, out, false);
    }

    /// [`winding_number_batch`](Self::winding_number_batch) on the threads of the pool in scope.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn par_winding_number_batch(&self, points: &[Vec3], out: &mut [f64]) {
        kd_points::winding_number_batch(self.winding_numbers(), points, out, true);
    }

    fn winding_numbers(&self) -> &WindingNumbers {
        self.winding
            .get_or_init(|| Arc::new(WindingNumbers::new(&self.mesh_by_sides())))
    }

    /// All parts in one mesh, whose triangles are counter-clockwise on the sides that their own meshes say.
    fn mesh_by_sides(&self) -> Mesh {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for id in self.parts() {
            let Some(slot) = self.parts.slot_of(id, 0) else {
                continue;
            };
            let part = self.parts.of_slot(slot);
            let mesh = part.mesh.mesh();
            let first = u32::try_from(positions.len()).expect("fewer than 2^32 vertices");
            positions.extend_from_slice(mesh.positions());
            triangles.extend(mesh.triangles().iter().map(|corners| {
                let [a, b, c] = corners.map(|corner| first + corner);
                if part.sight.is_mirrored {
                    [a, c, b]
                } else {
                    [a, b, c]
                }
            }));
        }
        Mesh::new(positions, triangles).expect("those of valid meshes")
    }

    /// [`triangles_in_box`](Self::triangles_in_box) for each box.
    pub fn triangles_in_box_batch(&self, boxes: &[Aabb]) -> TriangleLists<(PartId, u32)> {
        let lists = kd_points::triangles_in_box_batch(&self.point_trees(), boxes, false);
        lists.map(|slot| self.triangle_of_part(slot))
    }

    /// [`triangles_in_box_batch`](Self::triangles_in_box_batch) on the threads of the pool in scope.
    pub fn par_triangles_in_box_batch(&self, boxes: &[Aabb]) -> TriangleLists<(PartId, u32)> {
        let lists = kd_points::triangles_in_box_batch(&self.point_trees(), boxes, true);
        lists.map(|slot| self.triangle_of_part(slot))
    }

    /// [`triangles_in_sphere`](Self::triangles_in_sphere) for each center and radius.
    pub fn triangles_in_sphere_batch(
        &self,
        spheres: &[(Vec3, f32)],
    ) -> TriangleLists<(PartId, u32)> {
        let lists = kd_points::triangles_in_sphere_batch(&self.point_trees(), spheres, false);
        lists.map(|slot| self.triangle_of_part(slot))
    }

    /// [`triangles_in_sphere_batch`](Self::triangles_in_sphere_batch) on the threads of the pool in scope.
    pub fn par_triangles_in_sphere_batch(
        &self,
        spheres: &[(Vec3, f32)],
    ) -> TriangleLists<(PartId, u32)> {
        let lists = kd_points::triangles_in_sphere_batch(&self.point_trees(), spheres, true);
        lists.map(|slot| self.triangle_of_part(slot))
    }

    /// The triangles that have a point in a closed box, as [`KdTree::triangles_in_box`](crate::KdTree::triangles_in_box): ordered by part,
    /// then by triangle. Clears `out` first.
    pub fn triangles_in_box(&self, bounds: &Aabb, out: &mut Vec<(PartId, u32)>) {
        let mut slots = Vec::new();
        kd_points::triangles_in_box(&self.point_trees(), bounds, &mut slots);
        self.put_triangles(&slots, out);
    }

    /// The triangles that have a point at most `radius` from `center`, as
    /// [`KdTree::triangles_in_sphere`](crate::KdTree::triangles_in_sphere): ordered by part, then by triangle. Clears `out` first.
    pub fn triangles_in_sphere(
        &self,
        center: impl Into<Vec3>,
        radius: f32,
        out: &mut Vec<(PartId, u32)>,
    ) {
        let mut slots = Vec::new();
        kd_points::triangles_in_sphere(&self.point_trees(), center, radius, &mut slots);
        self.put_triangles(&slots, out);
    }

    /// Slots are in the order of parts.
    fn put_triangles(&self, slots: &[u32], out: &mut Vec<(PartId, u32)>) {
        out.clear();
        out.extend(slots.iter().map(|slot| self.triangle_of_part(*slot)));
    }
}
