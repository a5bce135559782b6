//! What `kd.trimesh` asks: hits with their rays and places in float64, for rays in float64.

use kd::glam::{DVec3, Vec3};
use kd::{Hit, KdTree, Ray};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Rows, joined, reserved};
use crate::crossings::crossings;
use crate::errors::wrong_value;
use crate::kd_tree::PyKdTree;
use crate::lists::Lists;
use crate::threads::fill;

/// Rays of one task.
const RUN: usize = 4096;
/// Rays that are read together, for each thread.
const CHUNK_OF_A_THREAD: usize = 1 << 16;
/// Components of directions that float32 holds well, with their squares.
const SMALLEST: f64 = 1e-12;
const LARGEST: f64 = 1e12;
/// The sine of the angle to a plane below which its point on a ray is taken from the weights of the hit.
const LEAST_SLOPE: f64 = 1e-6;

/// Rays and hits of a :class:`KdTree` in float64: what :mod:`kd.trimesh` is made of.
///
/// Rays that start far from the mesh are moved towards it in float64 first, so that distance takes no precision.
#[pyclass(frozen, module = "kd._kd")]
#[derive(Debug)]
pub(crate) struct Intersector {
    tree: Py<PyKdTree>,
    /// As they were given, for places of hits.
    vertices: Vec<[f64; 3]>,
    /// The middle of the mesh, and half of its diagonal.
    middle: DVec3,
    reach: f64,
}

/// A ray as it was given.
#[derive(Clone, Copy, Debug)]
struct Given {
    origin: DVec3,
    direction: DVec3,
}

/// Hits of some rays.
#[derive(Debug)]
struct Found {
    triangles: Vec<i64>,
    rays: Vec<i64>,
    places: Vec<[f64; 3]>,
}

impl Intersector {
    /// Threads that copy results.
    fn threads(&self) -> usize {
        self.tree.get().threads.most()
    }

    /// The ray as the tree traces it.
    fn ray(&self, given: &Given, zero: DVec3) -> Ray {
        let Given {
            mut origin,
            mut direction,
        } = *given;
        let size = direction.abs().max_element();
        if !(SMALLEST..=LARGEST).contains(&size) && size > 0.0 && size.is_finite() {
            direction /= size;
        }
        let mut t_min = 0.0;
        let from_middle = origin - self.middle;
        if from_middle.abs().max_element() > 2.0 * self.reach {
            // To the point that is nearest to the middle.
            t_min = from_middle.dot(direction) / direction.length_squared();
            origin -= t_min * direction;
        }
        let ray = Ray::new((origin - zero).as_vec3(), direction.as_vec3());
        // A ray whose start is not finite hits nothing, and neither does one without a direction: its end is NaN.
        ray.with_range(crate::rays::rounded(t_min), f32::INFINITY)
    }

    /// Where a ray meets the plane of a triangle; by the weights of the hit where it runs almost in that plane.
    fn place(&self, tree: &KdTree, given: &Given, hit: &Hit) -> [f64; 3] {
        let corners = tree.mesh().triangles()[hit.triangle as usize];
        let [a, b, c] = corners.map(|i| DVec3::from(self.vertices[i as usize]));
        let normal = (b - a).cross(c - a);
        let slope = normal.dot(given.direction);
        let largest = normal.length_squared() * given.direction.length_squared();
        if slope * slope > LEAST_SLOPE * LEAST_SLOPE * largest {
            let t = normal.dot(a - given.origin) / slope;
            return (given.origin + t * given.direction).to_array();
        }
        let [u, v] = [hit.u, hit.v].map(f64::from);
        (a + u * (b - a) + v * (c - a)).to_array()
    }

    /// Calls `work` with the number of the first ray, and some rays, until all had their turn.
    fn for_each_chunk(
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        threads: usize,
        mut work: impl FnMut(usize, &[Given]),
    ) -> PyResult<usize> {
        let origins = Rows::new("ray_origins", origins)?;
        let directions = Rows::new("ray_directions", directions)?;
        let len = origins.len();
        if directions.len() != len {
            let problem = format!("{} rows for {len} origins", directions.len());
            return Err(wrong_value("ray_directions", problem));
        }
        let mut given = Vec::new();
        let chunk = CHUNK_OF_A_THREAD * threads;
        for start in (0..len).step_by(chunk) {
            let count = chunk.min(len - start);
            let nothing = Given {
                origin: DVec3::ZERO,
                direction: DVec3::ZERO,
            };
            given.resize(count, nothing);
            let (origins, directions) = (origins.view(), directions.view());
            fill(&mut given, threads, |place, given| {
                let (first, count) = (start + place, given.len());
                origins.for_each(first, count, |i, origin| given[i].origin = origin.into());
                directions.for_each(first, count, |i, direction| {
                    given[i].direction = direction.into();
                });
            });
            work(start, &given);
            py.check_signals()?;
        }
        Ok(len)
    }

    /// Answers of `answer` for some rays of each task, which gets the number of its first ray.
    fn in_runs<A: Send>(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        answer: impl Fn(usize, &[Given], &[Ray]) -> A + Sync,
    ) -> PyResult<Vec<A>> {
        let tree = self.tree.get();
        let workers = tree.threads.for_build()?;
        let mut answers = Vec::new();
        Self::for_each_chunk(py, origins, directions, workers.number(), |start, given| {
            let run = |(i, given): (usize, &[Given])| {
                let rays: Vec<Ray> = given
                    .iter()
                    .map(|given| self.ray(given, tree.zero))
                    .collect();
                answer(start + i * RUN, given, &rays)
            };
            let is_parallel = workers.are_several() && given.len() > RUN;
            answers.extend(py.detach(|| match is_parallel {
                true => workers.run(|| {
                    given
                        .par_chunks(RUN)
                        .enumerate()
                        .map(run)
                        .collect::<Vec<A>>()
                }),
                false => given.chunks(RUN).enumerate().map(run).collect(),
            }));
        })?;
        Ok(answers)
    }
}

#[pymethods]
impl Intersector {
    /// Over a tree, and the float64 vertices that it was built from.
    #[new]
    fn new(tree: Py<PyKdTree>, vertices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let rows = Rows::new("vertices", vertices)?;
        let of_tree = tree.get().tree.mesh().positions().len();
        if rows.len() != of_tree {
            let problem = format!("{} rows for a tree of {of_tree} vertices", rows.len());
            return Err(wrong_value("vertices", problem));
        }
        let mut vertices = reserved(rows.len(), "vertices")?;
        rows.view()
            .for_each(0, rows.len(), |_, row| vertices.push(row));
        let bounds = tree.get().tree.mesh().bounds();
        let [min, max] = [bounds.min, bounds.max].map(|corner: Vec3| corner.as_dvec3());
        Ok(Self {
            vertices,
            middle: tree.get().zero + 0.5 * (min + max),
            reach: 0.5 * (max - min).length(),
            tree,
        })
    }

    /// The row of ``faces`` that each ray hits first, -1 for a miss: an int32 array of shape (N,).
    fn first<'py>(
        &self,
        py: Python<'py>,
        ray_origins: &Bound<'py, PyAny>,
        ray_directions: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let tree = &self.tree.get().tree;
        let found = self.in_runs(py, ray_origins, ray_directions, |_, _, rays| {
            let mut hits = vec![None; rays.len()];
            tree.intersect_batch(rays, &mut hits);
            let triangle = |hit: Option<Hit>| hit.map_or(-1, |hit| hit.triangle.cast_signed());
            hits.into_iter().map(triangle).collect::<Vec<i32>>()
        })?;
        joined(py, &found, self.threads())
    }

    /// Whether each ray hits anything: a bool array of shape (N,).
    fn any<'py>(
        &self,
        py: Python<'py>,
        ray_origins: &Bound<'py, PyAny>,
        ray_directions: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let tree = &self.tree.get().tree;
        let found = self.in_runs(py, ray_origins, ray_directions, |_, _, rays| {
            let mut occluded = vec![false; rays.len()];
            tree.occluded_batch(rays, &mut occluded);
            occluded
        })?;
        joined(py, &found, self.threads())
    }

    /// The closest hits, or the first ``max`` crossings if ``multiple``: rows of ``faces``, rays, and places if they are asked for.
    fn all<'py>(
        &self,
        py: Python<'py>,
        ray_origins: &Bound<'py, PyAny>,
        ray_directions: &Bound<'py, PyAny>,
        multiple: bool,
        max: usize,
        with_places: bool,
    ) -> PyResult<Hits<'py>> {
        let tree = &self.tree.get().tree;
        let found = self.in_runs(py, ray_origins, ray_directions, |first, given, rays| {
            let lists = if multiple {
                crossings(tree, rays, max, false)
            } else {
                closest(tree, rays, max)
            };
            let hits = lists.hits.len();
            let mut found = Found {
                triangles: Vec::with_capacity(hits),
                rays: Vec::with_capacity(hits),
                places: Vec::with_capacity(if with_places { hits } else { 0 }),
            };
            let mut start = 0;
            for (i, &end) in lists.ends.iter().enumerate() {
                let ray = i64::try_from(first + i).expect("arrays have fewer rows");
                for hit in &lists.hits[start..end] {
                    found.triangles.push(i64::from(hit.triangle));
                    found.rays.push(ray);
                    if with_places {
                        found.places.push(self.place(tree, &given[i], hit));
                    }
                }
                start = end;
            }
            found
        })?;
        let triangles: Vec<&[i64]> = found.iter().map(|found| &found.triangles[..]).collect();
        let rays: Vec<&[i64]> = found.iter().map(|found| &found.rays[..]).collect();
        let places: Vec<&[f64]> = found
            .iter()
            .map(|found| found.places.as_flattened())
            .collect();
        let places = joined(py, &places, self.threads())?;
        let rows = if with_places {
            found.iter().map(|found| found.places.len()).sum()
        } else {
            0
        };
        Ok((
            joined(py, &triangles, self.threads())?,
            joined(py, &rays, self.threads())?,
            places.reshape([rows, 3])?,
        ))
    }
}

/// Rows of faces, rays, and places.
type Hits<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
);

fn closest(tree: &KdTree, rays: &[Ray], max: usize) -> Lists<Hit> {
    let mut hits = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut hits);
    let mut lists = Lists::with_room_for(rays.len());
    for hit in &hits {
        lists.push(&hit.as_slice()[..max.min(usize::from(hit.is_some()))]);
    }
    lists
}
