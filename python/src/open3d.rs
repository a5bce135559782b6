//! What `kd.open3d` asks: answers in the columns of Open3D's `RaycastingScene`, for several meshes in one tree.

use kd::glam::Vec3;
use kd::{Hit, Ray};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{SixColumns, joined, zeros};
use crate::crossings::crossings;
use crate::errors::wrong_value;
use crate::kd_tree::PyKdTree;
use crate::point_queries::Points;
use crate::rays::rounded;
use crate::threads::{Threads, fill};

/// Rays or points of one task.
const RUN: usize = 4096;
/// Rays that are read together, for each thread.
const CHUNK_OF_A_THREAD: usize = 1 << 16;
/// The number of no geometry and of no triangle.
const NONE: u32 = u32::MAX;

/// Several meshes in one :class:`KdTree`, one after the other: what :mod:`kd.open3d` is made of.
#[pyclass(frozen, module = "kd._kd")]
#[derive(Debug)]
pub(crate) struct Geometries {
    tree: Py<PyKdTree>,
    /// The first triangle of each mesh.
    starts: Vec<u32>,
}

/// A mesh and a triangle of it.
#[derive(Clone, Copy)]
struct Names {
    geometry: u32,
    triangle: u32,
}

/// What is known of places on triangles, by columns.
#[derive(Debug)]
struct Columns {
    geometries: Vec<u32>,
    triangles: Vec<u32>,
    weights: Vec<f32>,
    normals: Vec<f32>,
}

impl Columns {
    fn with_room_for(places: usize, with_normals: bool) -> Self {
        Self {
            geometries: Vec::with_capacity(places),
            triangles: Vec::with_capacity(places),
            weights: Vec::with_capacity(2 * places),
            normals: Vec::with_capacity(if with_normals { 3 * places } else { 0 }),
        }
    }
}

impl Geometries {
    #[inline]
    fn names(&self, triangle: u32) -> Names {
        // Most scenes have one mesh.
        let after = match self.starts.len() {
            1 => 1,
            _ => self.starts.partition_point(|start| *start <= triangle),
        };
        let geometry = after - 1;
        Names {
            geometry: u32::try_from(geometry).expect("as many as triangles at most"),
            triangle: triangle - self.starts[geometry],
        }
    }

    fn push(&self, columns: &mut Columns, place: Option<(u32, [f32; 2])>, with_normals: bool) {
        let (names, weights, normal) = match place {
            Some((triangle, weights)) => {
                let normal = match with_normals {
                    true => self.tree.get().tree.mesh().normal(triangle),
                    false => Vec3::ZERO,
                };
                (self.names(triangle), weights, normal)
            }
            None => {
                let none = Names {
                    geometry: NONE,
                    triangle: NONE,
                };
                (none, [0.0; 2], Vec3::ZERO)
            }
        };
        columns.geometries.push(names.geometry);
        columns.triangles.push(names.triangle);
        columns.weights.extend(weights);
        if with_normals {
            columns.normals.extend(normal.to_array());
        }
    }

    /// The answers of runs of rays, in order. `answer` gets the number of the first ray of a run.
    fn of_rays<A: Send>(
        py: Python<'_>,
        rays: &Bound<'_, PyAny>,
        [t_min, t_max]: [f64; 2],
        threads: usize,
        answer: impl Fn(usize, &[Ray]) -> A + Sync,
    ) -> PyResult<Vec<A>> {
        let rays = SixColumns::new("rays", rays)?;
        let workers = threads_of(threads)?.for_items(rays.len())?;
        let chunk = CHUNK_OF_A_THREAD * workers.number();
        let any = Ray::new(Vec3::ZERO, Vec3::ZERO);
        let [t_min, t_max] = [t_min, t_max].map(rounded);
        let (mut some, mut answers) = (Vec::new(), Vec::new());
        for start in (0..rays.len()).step_by(chunk) {
            some.resize(chunk.min(rays.len() - start), any);
            let view = rays.view();
            fill(&mut some, workers.number(), |place, some| {
                let mut places = some.iter_mut();
                view.for_each(start + place, places.len(), |[a, b, c, x, y, z]| {
                    let ray = Ray::new([a, b, c], [x, y, z]).with_range(t_min, t_max);
                    places.next().into_iter().for_each(|place| *place = ray);
                });
            });
            let run = |(i, rays): (usize, &[Ray])| answer(start + i * RUN, rays);
            answers.extend(py.detach(|| match workers.are_several() {
                true => workers.run(|| {
                    some.par_chunks(RUN)
                        .enumerate()
                        .map(run)
                        .collect::<Vec<A>>()
                }),
                false => some.chunks(RUN).enumerate().map(run).collect(),
            }));
            py.check_signals()?;
        }
        Ok(answers)
    }
}

#[pymethods]
impl Geometries {
    /// Over a tree, and the first triangle of each mesh in it, in ascending order from 0.
    #[new]
    fn new(tree: Py<PyKdTree>, starts: Vec<u32>) -> PyResult<Self> {
        if !starts.is_sorted() || starts.first().is_some_and(|start| *start != 0) {
            return Err(wrong_value(
                "starts",
                "expected numbers in ascending order from 0",
            ));
        }
        if starts.is_empty() && !tree.get().tree.mesh().is_empty() {
            return Err(wrong_value("starts", "expected one number for each mesh"));
        }
        Ok(Self { tree, starts })
    }

    /// Closest hits: t, geometries, triangles, weights (N, 2) and normals (N, 3).
    fn cast<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Cast<'py>> {
        let tree = &self.tree.get().tree;
        let found = Self::of_rays(py, rays, [0.0, f64::INFINITY], threads, |_, rays| {
            let mut hits = vec![None; rays.len()];
            tree.intersect_batch(rays, &mut hits);
            let mut columns = Columns::with_room_for(hits.len(), true);
            for hit in &hits {
                self.push(
                    &mut columns,
                    hit.map(|hit| (hit.triangle, [hit.u, hit.v])),
                    true,
                );
            }
            let t = |hit: &Option<Hit>| hit.map_or(f32::INFINITY, |hit| hit.t);
            (hits.iter().map(t).collect::<Vec<f32>>(), columns)
        })?;
        let (t, columns): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        let [geometries, triangles] = names_of(py, &columns, threads)?;
        let (weights, normals) = (
            weights_of(py, &columns, threads)?,
            normals_of(py, &columns, threads)?,
        );
        Ok((
            joined(py, &t, threads_of(threads)?.most())?,
            geometries,
            triangles,
            weights,
            normals,
        ))
    }

    /// Whether there is any hit between the ends.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        t_near: f64,
        t_far: f64,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let tree = &self.tree.get().tree;
        let found = Self::of_rays(py, rays, [t_near, t_far], threads, |_, rays| {
            let mut occluded = vec![false; rays.len()];
            tree.occluded_batch(rays, &mut occluded);
            occluded
        })?;
        joined(py, &found, threads_of(threads)?.most())
    }

    /// Numbers of crossings.
    fn count<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let tree = &self.tree.get().tree;
        let found = Self::of_rays(py, rays, [0.0, f64::INFINITY], threads, |_, rays| {
            let lists = crossings(tree, rays, usize::MAX, false);
            let mut start = 0;
            let counts = lists.ends.iter().map(|&end| {
                let count = end - start;
                start = end;
                i32::try_from(count).expect("at most as many as triangles")
            });
            counts.collect::<Vec<i32>>()
        })?;
        joined(py, &found, threads_of(threads)?.most())
    }

    /// Crossings: where those of each ray begin, and in the end their number; rays, t, geometries, triangles, weights (M, 2).
    fn list<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Listed<'py>> {
        let tree = &self.tree.get().tree;
        let found = Self::of_rays(py, rays, [0.0, f64::INFINITY], threads, |first, rays| {
            let lists = crossings(tree, rays, usize::MAX, false);
            let mut columns = Columns::with_room_for(lists.hits.len(), false);
            let mut owners = Vec::with_capacity(lists.hits.len());
            let mut start = 0;
            for (ray, &end) in lists.ends.iter().enumerate() {
                let ray = u32::try_from(first + ray).unwrap_or(u32::MAX);
                owners.extend((start..end).map(|_| ray));
                start = end;
            }
            for hit in &lists.hits {
                self.push(&mut columns, Some((hit.triangle, [hit.u, hit.v])), false);
            }
            let t: Vec<f32> = lists.hits.iter().map(|hit| hit.t).collect();
            (lists.ends, owners, t, columns)
        })?;
        let rays = found.iter().map(|(ends, ..)| ends.len()).sum::<usize>();
        let splits = zeros::<u32>(py, rays + 1)?;
        {
            let mut splits = splits.readwrite();
            let mut places = splits.as_slice_mut().expect("a new array")[1..].iter_mut();
            let mut before = 0;
            for (ends, ..) in &found {
                for (place, end) in places.by_ref().zip(ends) {
                    *place = u32::try_from(before + end).map_err(|_| {
                        PyValueError::new_err(
                            "rays: more than 2^32 - 1 hits, ask for fewer rays at a time",
                        )
                    })?;
                }
                before += ends.last().copied().unwrap_or(0);
            }
        }
        let (mut owners, mut t, mut columns) = (Vec::new(), Vec::new(), Vec::new());
        for (_, own, at, column) in found {
            owners.push(own);
            t.push(at);
            columns.push(column);
        }
        let [geometries, triangles] = names_of(py, &columns, threads)?;
        let weights = weights_of(py, &columns, threads)?;
        Ok((
            splits,
            joined(py, &owners, threads_of(threads)?.most())?,
            joined(py, &t, threads_of(threads)?.most())?,
            geometries,
            triangles,
            weights,
        ))
    }

    /// Closest points: points (N, 3), geometries, triangles, weights (N, 2) and normals (N, 3).
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Closest<'py>> {
        let tree = self.tree.get();
        let points = Points::new("query_points", points, tree.zero)?;
        let workers = threads_of(threads)?.for_items(points.len())?;
        let mut all = Vec::new();
        points.for_each_chunk(py, |_, points| {
            let mut found = vec![None; points.len()];
            all.push(py.detach(|| {
                workers.run(|| match workers.are_several() {
                    true => tree
                        .tree
                        .par_closest_point_batch(points, f32::INFINITY, &mut found),
                    false => tree
                        .tree
                        .closest_point_batch(points, f32::INFINITY, &mut found),
                });
                let mut places = Vec::with_capacity(3 * found.len());
                let mut columns = Columns::with_room_for(found.len(), true);
                for nearest in &found {
                    let point = nearest.map_or(Vec3::NAN, |nearest| nearest.point);
                    places.extend(point.to_array());
                    let place = nearest.map(|nearest| (nearest.triangle, [nearest.u, nearest.v]));
                    self.push(&mut columns, place, true);
                }
                (places, columns)
            }));
            Ok(())
        })?;
        let (places, columns): (Vec<Vec<f32>>, Vec<_>) = all.into_iter().unzip();
        let [geometries, triangles] = names_of(py, &columns, threads)?;
        let rows = places.iter().map(Vec::len).sum::<usize>() / 3;
        let places = joined(py, &places, threads_of(threads)?.most())?.reshape([rows, 3])?;
        let (weights, normals) = (
            weights_of(py, &columns, threads)?,
            normals_of(py, &columns, threads)?,
        );
        Ok((places, geometries, triangles, weights, normals))
    }
}

type Floats<'py> = Bound<'py, PyArray1<f32>>;
type FloatRows<'py> = Bound<'py, PyArray2<f32>>;
type Indices<'py> = Bound<'py, PyArray1<u32>>;
type Cast<'py> = (
    Floats<'py>,
    Indices<'py>,
    Indices<'py>,
    FloatRows<'py>,
    FloatRows<'py>,
);
type Listed<'py> = (
    Indices<'py>,
    Indices<'py>,
    Floats<'py>,
    Indices<'py>,
    Indices<'py>,
    FloatRows<'py>,
);
type Closest<'py> = (
    FloatRows<'py>,
    Indices<'py>,
    Indices<'py>,
    FloatRows<'py>,
    FloatRows<'py>,
);

/// 0 is all threads.
fn threads_of(threads: usize) -> PyResult<Threads> {
    Threads::new((threads > 0).then_some(threads))
}

fn names_of<'py>(
    py: Python<'py>,
    columns: &[Columns],
    threads: usize,
) -> PyResult<[Indices<'py>; 2]> {
    let geometries: Vec<&[u32]> = columns.iter().map(|own| &own.geometries[..]).collect();
    let triangles: Vec<&[u32]> = columns.iter().map(|own| &own.triangles[..]).collect();
    Ok([
        joined(py, &geometries, threads_of(threads)?.most())?,
        joined(py, &triangles, threads_of(threads)?.most())?,
    ])
}

fn weights_of<'py>(
    py: Python<'py>,
    columns: &[Columns],
    threads: usize,
) -> PyResult<FloatRows<'py>> {
    let weights: Vec<&[f32]> = columns.iter().map(|own| &own.weights[..]).collect();
    let rows = weights.iter().map(|own| own.len()).sum::<usize>() / 2;
    joined(py, &weights, threads_of(threads)?.most())?.reshape([rows, 2])
}

fn normals_of<'py>(
    py: Python<'py>,
    columns: &[Columns],
    threads: usize,
) -> PyResult<FloatRows<'py>> {
    let normals: Vec<&[f32]> = columns.iter().map(|own| &own.normals[..]).collect();
    let rows = normals.iter().map(|own| own.len()).sum::<usize>() / 3;
    joined(py, &normals, threads_of(threads)?.most())?.reshape([rows, 3])
}
