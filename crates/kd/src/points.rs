//! What points ask of a mesh: the closest point, inside or outside, the signed distance, the winding number, and the triangles of a box or a
//! sphere.
//!
//! | query of [`KdTree`] | returns | suits |
//! |---|---|---|
//! | [`closest_point`](KdTree::closest_point) | the [`Nearest`] point within a distance | any mesh |
//! | [`contains`](KdTree::contains) | whether a point is inside, or on the surface | closed meshes |
//! | [`signed_distance`](KdTree::signed_distance) | the distance to the surface, negative inside | closed meshes |
//! | [`winding_number`](KdTree::winding_number) | how often the surface winds around a point | open and dirty meshes, too |
//! | [`triangles_in_box`](KdTree::triangles_in_box), [`triangles_in_sphere`](KdTree::triangles_in_sphere) | the triangles that have a point there | any mesh |
//!
//! Each query has a form for many points, whose name ends in `_batch`, and one on several threads, whose name begins with `par_`: those of the
//! pool in scope (rayon's). [`FrameData`](crate::FrameData) has the same queries for all parts of a scene together, and names the part; a
//! winding number there is that of a part's own mesh, by [`WindingNumbers`].
//!
//! All answers but winding numbers equal those of a test of every triangle ([`brute_force`]), to the bit, in every layout and on any number of
//! threads. Winding numbers are within [`WINDING_ERROR`] of it.
//!
//! [`Mesh::is_closed`](crate::Mesh::is_closed) says whether a mesh is closed. Triangles of zero area do not count, as for rays.
//!
//! ```
//! use kd::glam::Vec3;
//! use kd::{BuildOptions, KdTree, Mesh};
//!
//! // A tetrahedron.
//! let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
//! assert!(mesh.is_closed());
//! let tree = KdTree::build(mesh, &BuildOptions::balanced())?;
//!
//! assert!(tree.contains([0.2, 0.2, 0.2]));
//! assert_eq!(tree.signed_distance([0.25, 0.25, -2.0]), Some(2.0));
//!
//! let points = [Vec3::new(0.125, 0.25, 0.25), Vec3::splat(9.0)];
//! let mut distances = [None; 2];
//! tree.par_signed_distance_batch(&points, &mut distances);
//! assert_eq!(distances[0], Some(-0.125));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::sync::Arc;

use glam::Vec3;
use kd_core::Aabb;
use kd_points::PointTree;
pub use kd_points::{Feature, Nearest, TriangleLists, WINDING_ERROR, WindingNumbers, brute_force};

use crate::KdTree;

impl KdTree {
    fn point_trees(&self) -> [PointTree<'_>; 1] {
        [self.layout.borrowed().into()]
    }

    /// The point of the mesh that is closest to `point`, and at most `max_distance` away, in scene units.
    ///
    /// Equal distances go to the lower triangle. Distances are decided in f64, by one function of point and triangle; a point closest to an
    /// edge or a corner has the same distance, to the bit, from all triangles around it.
    ///
    /// A `max_distance` of 0 finds only triangles that the point is on, exactly; infinity is no limit. `None` if nothing is that close, if the
    /// point is not finite, and for a limit that is negative or NaN.
    ///
    /// Expected time is logarithmic in the number of triangles; it grows with the distance, since many triangles are then nearly as close.
    /// Allocates nothing.
    pub fn closest_point(&self, point: impl Into<Vec3>, max_distance: f32) -> Option<Nearest> {
        kd_points::closest_point(&self.point_trees(), point, max_distance)
    }

    /// [`closest_point`](Self::closest_point) for each point, with equal answers. Faster: neighbors are answered one after the other, and
    /// start from the triangle of the last. Points may be in any order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn closest_point_batch(
        &self,
        points: &[Vec3],
        max_distance: f32,
        out: &mut [Option<Nearest>],
    ) {
        let trees = self.point_trees();
        kd_points::closest_point_batch(&trees, points, max_distance, out, false);
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
        out: &mut [Option<Nearest>],
    ) {
        let trees = self.point_trees();
        kd_points::closest_point_batch(&trees, points, max_distance, out, true);
    }

    /// Whether a point is inside of the surface, or on it.
    ///
    /// The surface should be closed ([`Mesh::is_closed`](crate::Mesh::is_closed)). Then the answer is exact for every point: the parity of the
    /// triangles that a ray along the x axis crosses, each decided exactly, with a consistent choice at edges and corners. The winding of
    /// triangles does not matter.
    ///
    /// On an open mesh the answer is that of the same ray: right where it does not pass through a hole.
    /// [`winding_number`](Self::winding_number) suits such meshes better.
    ///
    /// False if the point is not finite. Expected time is that of a ray that counts all hits.
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

    /// The distance of a point from the surface: that of [`closest_point`](Self::closest_point), negative where [`contains`](Self::contains)
    /// is true, and 0 on the surface.
    ///
    /// The sign is that of most signed distance fields, and of Open3D. trimesh has it the other way round: positive inside.
    ///
    /// `None` if the point is not finite, and if no triangle has an area.
    pub fn signed_distance(&self, point: impl Into<Vec3>) -> Option<f32> {
        kd_points::signed_distance(&self.point_trees(), point)
    }

    /// [`signed_distance`](Self::signed_distance) for each point; faster, as [`closest_point_batch`](Self::closest_point_batch).
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

    /// The generalized winding number of a point, within [`WINDING_ERROR`]: 1 inside of a closed surface whose triangles are
    /// counter-clockwise from outside, 0 outside. Where the surface has holes it changes smoothly, so that `> 0.5` is a robust *inside* for open
    /// and dirty meshes. 0 for a point that is not finite.
    ///
    /// The first call makes a hierarchy ([`WindingNumbers`]), which takes about as long as a build of [`fast`](crate::BuildOptions::fast), and
    /// about 100 bytes a triangle.
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
            .get_or_init(|| Arc::new(WindingNumbers::new(self.mesh())))
    }

    /// The triangles that have a point in a closed box, in ascending order, each once. Clears `out` first.
    ///
    /// Exact: a triangle that only touches the box counts, and one beside it by any amount does not. None for an empty box and for one with
    /// NaN; faces may be infinite.
    pub fn triangles_in_box(&self, bounds: &Aabb, out: &mut Vec<u32>) {
        kd_points::triangles_in_box(&self.point_trees(), bounds, out);
    }

    /// [`triangles_in_box`](Self::triangles_in_box) for each box.
    pub fn triangles_in_box_batch(&self, boxes: &[Aabb]) -> TriangleLists {
        kd_points::triangles_in_box_batch(&self.point_trees(), boxes, false)
    }

    /// [`triangles_in_box_batch`](Self::triangles_in_box_batch) on the threads of the pool in scope.
    pub fn par_triangles_in_box_batch(&self, boxes: &[Aabb]) -> TriangleLists {
        kd_points::triangles_in_box_batch(&self.point_trees(), boxes, true)
    }

    /// The triangles that have a point at most `radius` from `center`, in ascending order, each once. Clears `out` first.
    ///
    /// Decided as by [`closest_point`](Self::closest_point). None if the center is not finite, or the radius negative or NaN.
    pub fn triangles_in_sphere(&self, center: impl Into<Vec3>, radius: f32, out: &mut Vec<u32>) {
        kd_points::triangles_in_sphere(&self.point_trees(), center, radius, out);
    }

    /// [`triangles_in_sphere`](Self::triangles_in_sphere) for each center and radius.
    pub fn triangles_in_sphere_batch(&self, spheres: &[(Vec3, f32)]) -> TriangleLists {
        kd_points::triangles_in_sphere_batch(&self.point_trees(), spheres, false)
    }

    /// [`triangles_in_sphere_batch`](Self::triangles_in_sphere_batch) on the threads of the pool in scope.
    pub fn par_triangles_in_sphere_batch(&self, spheres: &[(Vec3, f32)]) -> TriangleLists {
        kd_points::triangles_in_sphere_batch(&self.point_trees(), spheres, true)
    }
}
