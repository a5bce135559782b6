//! The queries that trees and frames of scenes have in common, as methods of Python.

/// An `impl` block of Python's methods: those that are given, and the queries.
///
/// The type has `traced()` for rays, `zero` and `threads`, and answers points by functions that end in `_of`.
macro_rules! with_queries {
    ($type:ty { $($own:tt)* }) => {
        #[pymethods]
        impl $type {
            $($own)*

            /// The closest hit of each ray, as :class:`Hits`.
            ///
            /// Parameters
            /// ----------
            /// origins : (N, 3) float
            ///     The points at ``t = 0``. One row serves all rays.
            /// directions : (N, 3) float
            ///     Of any length: ``t`` is measured in multiples of it. One row serves all rays. Rounded to float32.
            /// t_min, t_max : float or (N,) float, default 0 and infinity
            ///     The range of ``t`` in which hits count, both ends included. Rounded to float32.
            /// culling : {None, "back", "front"}
            ///     Rays pass through triangles whose back, or front, they meet. The front is the side from which the corners of a triangle
            ///     are counter-clockwise.
            /// mask : int or (N,) int, default all bits
            ///     A ray sees the parts of a scene whose mask has one of these bits. A single mesh has all bits.
            ///
            /// Among equal ``t`` the lower part, then the lower triangle is returned. A ray that is not finite, or has no direction or
            /// no range, is a miss.
            #[pyo3(signature = (origins, directions, t_min = None, t_max = None, culling = None, mask = None))]
            fn intersect<'py>(
                &self,
                py: Python<'py>,
                origins: &Bound<'py, PyAny>,
                directions: &Bound<'py, PyAny>,
                t_min: Option<&Bound<'py, PyAny>>,
                t_max: Option<&Bound<'py, PyAny>>,
                culling: Option<&str>,
                mask: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Hits> {
                let limits = Limits { t_min, t_max, culling, mask };
                let rays = Rays::new(origins, directions, &limits, self.zero)?;
                self.traced().intersect(py, &rays)
            }

            /// Whether each ray hits anything in its range: a bool array of shape (N,). Equal to ``intersect(...).hit``, and faster.
            ///
            /// Parameters are those of :meth:`intersect`.
            #[pyo3(signature = (origins, directions, t_min = None, t_max = None, culling = None, mask = None))]
            fn occluded<'py>(
                &self,
                py: Python<'py>,
                origins: &Bound<'py, PyAny>,
                directions: &Bound<'py, PyAny>,
                t_min: Option<&Bound<'py, PyAny>>,
                t_max: Option<&Bound<'py, PyAny>>,
                culling: Option<&str>,
                mask: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyArray1<bool>>> {
                let limits = Limits { t_min, t_max, culling, mask };
                let rays = Rays::new(origins, directions, &limits, self.zero)?;
                self.traced().occluded(py, &rays)
            }

            /// The first ``max`` hits of each ray in order, all by default, as :class:`HitLists`. Each triangle counts once; a ray
            /// through an edge hits all triangles around it.
            ///
            /// Other parameters are those of :meth:`intersect`.
            #[pyo3(signature = (origins, directions, max = None, t_min = None, t_max = None, culling = None, mask = None))]
            fn hits<'py>(
                &self,
                py: Python<'py>,
                origins: &Bound<'py, PyAny>,
                directions: &Bound<'py, PyAny>,
                max: Option<usize>,
                t_min: Option<&Bound<'py, PyAny>>,
                t_max: Option<&Bound<'py, PyAny>>,
                culling: Option<&str>,
                mask: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<HitArrays> {
                let limits = Limits { t_min, t_max, culling, mask };
                let rays = Rays::new(origins, directions, &limits, self.zero)?;
                self.traced().hits(py, &rays, max)
            }

            /// The number of hits of each ray: an int64 array of shape (N,).
            ///
            /// Parameters are those of :meth:`intersect`.
            #[pyo3(signature = (origins, directions, t_min = None, t_max = None, culling = None, mask = None))]
            fn count_hits<'py>(
                &self,
                py: Python<'py>,
                origins: &Bound<'py, PyAny>,
                directions: &Bound<'py, PyAny>,
                t_min: Option<&Bound<'py, PyAny>>,
                t_max: Option<&Bound<'py, PyAny>>,
                culling: Option<&str>,
                mask: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyArray1<i64>>> {
                let limits = Limits { t_min, t_max, culling, mask };
                let rays = Rays::new(origins, directions, &limits, self.zero)?;
                self.traced().count_hits(py, &rays)
            }

            /// The point of the surface that is closest to each point, as :class:`ClosestPoints`.
            ///
            /// Parameters
            /// ----------
            /// points : (N, 3) float
            /// max_distance : float
            ///     Points further away than this do not count.
            ///
            /// Among equal distances the lower part, then the lower triangle is returned.
            #[pyo3(signature = (points, max_distance = f64::INFINITY))]
            fn closest_point<'py>(
                &self,
                py: Python<'py>,
                points: &Bound<'py, PyAny>,
                max_distance: f64,
            ) -> PyResult<ClosestPoints> {
                let points = Points::new("points", points, self.zero)?;
                self.closest_points_of(py, &points, rounded(max_distance))
            }

            /// Whether each point is inside of the surface, or on it: a bool array of shape (N,).
            ///
            /// Exact where the surface is closed: the parity of the triangles that a ray along the x axis crosses. The order of corners
            /// does not matter. False for points that are not finite.
            fn contains<'py>(
                &self,
                py: Python<'py>,
                points: &Bound<'py, PyAny>,
            ) -> PyResult<Bound<'py, PyArray1<bool>>> {
                let points = Points::new("points", points, self.zero)?;
                let answer = |points: &[Vec3], inside: &mut [bool], is_parallel| match is_parallel {
                    true => self.answers().par_contains_batch(points, inside),
                    false => self.answers().contains_batch(points, inside),
                };
                numbers_of(py, &points, self.threads, false, answer, |inside| inside)
            }

            /// The distance of each point from the surface, negative inside: a float32 array of shape (N,). NaN for points that are not
            /// finite, and where there is no surface.
            ///
            /// The sign is that of :meth:`contains`. trimesh has it the other way round: positive inside.
            fn signed_distance<'py>(
                &self,
                py: Python<'py>,
                points: &Bound<'py, PyAny>,
            ) -> PyResult<Bound<'py, PyArray1<f32>>> {
                let points = Points::new("points", points, self.zero)?;
                let answer = |points: &[Vec3], distances: &mut [Option<f32>], is_parallel| match is_parallel {
                    true => self.answers().par_signed_distance_batch(points, distances),
                    false => self.answers().signed_distance_batch(points, distances),
                };
                let number = |distance: Option<f32>| distance.unwrap_or(f32::NAN);
                numbers_of(py, &points, self.threads, None, answer, number)
            }

            /// The generalized winding number of each point: a float64 array of shape (N,). 1 inside of a closed surface whose triangles are
            /// counter-clockwise from outside, 0 outside; ``> 0.5`` is a robust *inside* for meshes with holes. Within 0.01.
            ///
            /// The first call prepares a hierarchy, which takes about as long as a fast build.
            fn winding_number<'py>(
                &self,
                py: Python<'py>,
                points: &Bound<'py, PyAny>,
            ) -> PyResult<Bound<'py, PyArray1<f64>>> {
                let points = Points::new("points", points, self.zero)?;
                let answer = |points: &[Vec3], numbers: &mut [f64], is_parallel| match is_parallel {
                    true => self.answers().par_winding_number_batch(points, numbers),
                    false => self.answers().winding_number_batch(points, numbers),
                };
                numbers_of(py, &points, self.threads, 0.0, answer, |number| number)
            }

            /// The triangles that have a point in each closed box, as :class:`TriangleLists`.
            ///
            /// Parameters
            /// ----------
            /// lower, upper : (N, 3) float
            ///     Corners of the boxes. Infinite faces are fine.
            fn triangles_in_box<'py>(
                &self,
                py: Python<'py>,
                lower: &Bound<'py, PyAny>,
                upper: &Bound<'py, PyAny>,
            ) -> PyResult<TriangleArrays> {
                let boxes = boxes(lower, upper, self.zero)?;
                let workers = self.threads.for_items(boxes.len())?;
                let lists = py.detach(|| {
                    workers.run(|| match workers.are_several() {
                        true => self.answers().par_triangles_in_box_batch(&boxes),
                        false => self.answers().triangles_in_box_batch(&boxes),
                    })
                });
                self.triangles_of_lists(py, &lists)
            }

            /// The triangles that have a point at most a radius from each center, as :class:`TriangleLists`.
            ///
            /// Parameters
            /// ----------
            /// centers : (N, 3) float
            /// radii : float or (N,) float
            fn triangles_in_sphere<'py>(
                &self,
                py: Python<'py>,
                centers: &Bound<'py, PyAny>,
                radii: &Bound<'py, PyAny>,
            ) -> PyResult<TriangleArrays> {
                let spheres = spheres(centers, radii, self.zero)?;
                let workers = self.threads.for_items(spheres.len())?;
                let lists = py.detach(|| {
                    workers.run(|| match workers.are_several() {
                        true => self.answers().par_triangles_in_sphere_batch(&spheres),
                        false => self.answers().triangles_in_sphere_batch(&spheres),
                    })
                });
                self.triangles_of_lists(py, &lists)
            }
        }
    };
}

pub(crate) use with_queries;
