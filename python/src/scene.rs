//! `kd.Scene` and `kd.Frame`: static and moving parts, traced together.
#![allow(
    clippy::too_many_arguments,
    reason = "the arguments of Python's methods"
)]

use std::sync::Arc;

use kd::glam::{DAffine3, DMat3, DVec3, Vec3};
use kd::points::{Nearest, TriangleLists};
use kd::scene::{CommitAction, CommitReason, CommitReport};
use kd::{FrameData, MergeMethod, PartId, Scene, Strategy};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{Matrix, Rows, array_of_rows, reserved, zero_rows};
use crate::errors::{of_commit, of_scene, wrong_value};
use crate::hits::{HitArrays, Hits, PartNumbers};
use crate::mesh::PlacedMesh;
use crate::options::Options;
use crate::point_queries::{
    ClosestPoints, Points, TriangleArrays, boxes, closest_points, numbers_of, spheres, triangles_of,
};
use crate::queries::with_queries;
use crate::ray_queries::Traced;
use crate::rays::{Limits, Rays, rounded};
use crate::threads::Threads;

/// Static and moving meshes, the parts of the scene. A commit makes a frame of them, to trace.
///
/// Parameters
/// ----------
/// preset : {"balanced", "fast", "best"}
///     How static parts are built.
/// strategy : {"auto", "merge", "refit", "instances", "dual", "rebuild"}
///     How a commit updates the others. Answers do not depend on it.
/// origin : (3,) float
///     The point at which the float32 coordinates of frames have their zero, for large worlds: choose it near what is traced.
/// threads : int, optional
///     The number of threads of commits and of queries; all by default.
///
/// Notes
/// -----
/// Parts are numbered from 0 in the order in which they were added; numbers are not used again. Float64 vertices become float32 offsets from a
/// point near them, as in :class:`KdTree`. Transforms are applied in float64 where the scene has an origin or a part has such a point that
/// is not zero, and in float32 elsewhere, where instances can share the memory of a mesh.
///
/// A scene may be changed by one thread at a time. Its frames stay as they are, and may be traced meanwhile.
#[pyclass(module = "kd", name = "Scene")]
#[derive(Debug)]
pub(crate) struct PyScene {
    scene: Scene,
    parts: Vec<Added>,
    /// The ids of all parts that were added, in order.
    ids: Arc<Vec<PartId>>,
    strategy: &'static str,
    preset: &'static str,
    threads: Threads,
}

/// What is known of a part.
#[derive(Clone, Copy, Debug)]
struct Added {
    id: PartId,
    /// The point at which the vertices have their zero.
    zero: DVec3,
}

const STRATEGIES: [(&str, Strategy); 5] = [
    ("auto", Strategy::Auto),
    ("merge", Strategy::Merge(MergeMethod::Guided)),
    ("refit", Strategy::Refit),
    ("instances", Strategy::Instances),
    ("dual", Strategy::Dual),
];

impl PyScene {
    fn part(&self, part: usize) -> PyResult<Added> {
        self.parts
            .get(part)
            .copied()
            .ok_or_else(|| wrong_value("part", format_args!("{part} is not in the scene")))
    }

    fn add(&mut self, id: PartId, zero: DVec3) -> usize {
        self.parts.push(Added { id, zero });
        Arc::make_mut(&mut self.ids).push(id);
        self.parts.len() - 1
    }

    fn add_mesh(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
        is_static: bool,
    ) -> PyResult<usize> {
        // Refused before there is a part.
        let transform = transform.map(transform_of).transpose()?;
        let PlacedMesh { mesh, zero, .. } = PlacedMesh::new(vertices, faces)?;
        let id = match is_static {
            true => self.scene.add_static(mesh),
            false => self.scene.add_dynamic(mesh),
        };
        let part = self.add(id.map_err(|error| of_scene(&error))?, zero);
        if transform.is_some() || zero != DVec3::ZERO || self.scene.origin() != DVec3::ZERO {
            let placed = self.place(part, transform.unwrap_or(DAffine3::IDENTITY));
            if let Err(error) = placed {
                self.remove(part)?;
                return Err(error);
            }
        }
        Ok(part)
    }

    fn place(&mut self, part: usize, transform: DAffine3) -> PyResult<()> {
        let Added { id, zero } = self.part(part)?;
        let placed = match placement(transform, zero, self.scene.origin()) {
            Place::Single(transform) => self.scene.set_transform(id, transform),
            Place::Double(transform) => self.scene.set_world_transform(id, transform),
        };
        placed.map_err(|error| of_scene(&error))
    }
}

/// A transform as a scene takes it.
enum Place {
    Single(kd::glam::Affine3A),
    Double(DAffine3),
}

fn placement(transform: DAffine3, zero: DVec3, origin: DVec3) -> Place {
    if zero == DVec3::ZERO && origin == DVec3::ZERO {
        return Place::Single(transform.as_affine3a());
    }
    Place::Double(transform * DAffine3::from_translation(zero))
}

#[pymethods]
impl PyScene {
    #[new]
    #[pyo3(signature = (preset = "balanced", strategy = "auto", origin = [0.0; 3], threads = None))]
    fn new(
        preset: &str,
        strategy: &str,
        origin: [f64; 3],
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let options = Options::new(preset, "wide")?;
        let threads = Threads::new(threads)?;
        let is_parallel = threads.for_build()?.are_several();
        let scene = Scene::with_origin(options.build(is_parallel), DVec3::from(origin));
        let scene = scene.map_err(|_| wrong_value("origin", "expected finite numbers"))?;
        let mut scene = Self {
            scene,
            parts: Vec::new(),
            ids: Arc::default(),
            strategy: "auto",
            preset: options.preset,
            threads,
        };
        scene.set_strategy(strategy)?;
        Ok(scene)
    }

    /// Sets how the next commits make frames. Answers do not depend on it.
    fn set_strategy(&mut self, strategy: &str) -> PyResult<()> {
        if let Some((name, strategy)) = STRATEGIES.into_iter().find(|(name, _)| *name == strategy) {
            self.scene.set_strategy(strategy);
            self.strategy = name;
            return Ok(());
        }
        if strategy == "rebuild" {
            let options = Options::new(self.preset, "wide")?;
            let is_parallel = self.threads.for_build()?.are_several();
            self.scene
                .set_strategy(Strategy::Rebuild(options.build(is_parallel)));
            self.strategy = "rebuild";
            return Ok(());
        }
        let problem = format!(
            "expected \"auto\", \"merge\", \"refit\", \"instances\", \"dual\" or \"rebuild\", got {strategy:?}"
        );
        Err(wrong_value("strategy", problem))
    }

    /// How commits make frames.
    #[getter]
    fn strategy(&self) -> &'static str {
        self.strategy
    }

    /// Sets the expected number of rays of a frame: the strategy "auto" rebuilds more where more rays gain from it.
    fn set_ray_budget(&mut self, rays: u64) {
        self.scene.set_ray_budget(rays);
    }

    /// Adds a mesh that stays as it is, from the next commit on, and returns the number of the part. It may be changed all the same,
    /// and is then built again.
    ///
    /// Parameters
    /// ----------
    /// vertices : (V, 3) float
    /// faces : (M, 3) int
    /// transform : (4, 4) or (3, 4) float, optional
    ///     Maps the coordinates of the vertices to those of the scene: ``p -> transform[:3, :3] @ p + transform[:3, 3]``.
    #[pyo3(signature = (vertices, faces, transform = None))]
    fn add_static(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        self.add_mesh(vertices, faces, transform, true)
    }

    /// Adds a mesh that changes or moves, from the next commit on, and returns the number of the part. Parameters are those of
    /// :meth:`add_static`.
    #[pyo3(signature = (vertices, faces, transform = None))]
    fn add_dynamic(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        self.add_mesh(vertices, faces, transform, false)
    }

    /// Adds the mesh of a part again with a transform of its own, and returns the number of the new part. It follows
    /// :meth:`set_vertices` of the part that it was made from.
    fn add_instance(&mut self, of: usize, transform: &Bound<'_, PyAny>) -> PyResult<usize> {
        let Added { id, zero } = self.part(of)?;
        let instance = match placement(transform_of(transform)?, zero, self.scene.origin()) {
            Place::Single(transform) => self.scene.add_instance(id, transform),
            Place::Double(transform) => self.scene.add_world_instance(id, transform),
        };
        Ok(self.add(instance.map_err(|error| of_scene(&error))?, zero))
    }

    /// Replaces the transform of a part, from the next commit on. Any finite transform will do, also one that mirrors or flattens.
    fn set_transform(&mut self, part: usize, transform: &Bound<'_, PyAny>) -> PyResult<()> {
        let transform = transform_of(transform)?;
        self.place(part, transform)
    }

    /// Replaces the vertices of a part and of its instances, as many as it has, from the next commit on. Float64 is rounded to float32
    /// after the point near the first vertices was subtracted.
    fn set_vertices(&mut self, part: usize, vertices: &Bound<'_, PyAny>) -> PyResult<()> {
        let Added { id, zero } = self.part(part)?;
        let rows = Rows::new("vertices", vertices)?;
        let mut positions = reserved(rows.len(), "vertices")?;
        rows.view().for_each(0, rows.len(), |_, row| {
            positions.push((DVec3::from(row) - zero).as_vec3().to_array());
        });
        let set = self.scene.set_positions(id, &positions);
        set.map_err(|error| of_scene(&error))
    }

    /// Sets the mask of a part, from the next commit on: a ray sees the part if its own mask has one of these bits. All bits by default.
    fn set_mask(&mut self, part: usize, mask: u32) -> PyResult<()> {
        let id = self.part(part)?.id;
        self.scene
            .set_mask(id, mask)
            .map_err(|error| of_scene(&error))
    }

    /// Removes a part, from the next commit on.
    fn remove(&mut self, part: usize) -> PyResult<()> {
        let id = self.part(part)?.id;
        self.scene.remove(id).map_err(|error| of_scene(&error))
    }

    /// Makes a frame of the current parts, and returns a report of what was done.
    ///
    /// The report is a dict: ``parts``, ``triangles``, ``top_nodes``, ``links``, ``opened``, ``bytes``, and ``changes``, a list of dicts of
    /// the parts that were built, refitted or moved (``part``, ``triangles``, ``action``, ``reason``), and ``text``, all of it in words. On
    /// an error the frame before and the parts stay.
    fn commit<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let workers = self.threads.for_build()?;
        let scene = &mut self.scene;
        let report = py.detach(|| workers.run(|| scene.commit()));
        report_of(py, &report.map_err(|error| of_commit(&error))?, &self.ids)
    }

    /// The frame of the last commit; one without parts before the first.
    #[getter]
    fn frame(&self) -> PyFrame {
        PyFrame {
            data: self.scene.snapshot(),
            ids: Arc::clone(&self.ids),
            zero: self.scene.origin(),
            threads: self.threads,
        }
    }

    /// The numbers of the parts that are in the scene.
    #[getter]
    fn parts(&self) -> Vec<i32> {
        let numbers = PartNumbers(&self.ids);
        self.scene.parts().map(|part| numbers.of(part)).collect()
    }

    /// The point at which float32 coordinates of frames have their zero: (x, y, z).
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.scene.origin().to_array()
    }

    fn __repr__(&self) -> String {
        let (parts, strategy) = (self.scene.parts().len(), self.strategy);
        format!("<kd.Scene: {parts} parts, strategy {strategy:?}>")
    }
}

/// All parts of a scene as they were at one commit. It has the queries of :class:`KdTree`, and names the part of each answer.
///
/// Hits are ordered by ``t``, then by part, then by triangle; a triangle is a row of the faces of its own part. :meth:`contains` counts the
/// surfaces of all parts together.
#[pyclass(frozen, module = "kd", name = "Frame")]
#[derive(Debug)]
pub(crate) struct PyFrame {
    data: Arc<FrameData>,
    ids: Arc<Vec<PartId>>,
    zero: DVec3,
    threads: Threads,
}

impl PyFrame {
    fn traced(&self) -> Traced<'_, FrameData> {
        Traced {
            structure: &self.data,
            threads: self.threads,
            parts: Some(&self.ids),
        }
    }

    fn answers(&self) -> &FrameData {
        &self.data
    }

    fn closest_points_of(
        &self,
        py: Python<'_>,
        points: &Points<'_>,
        max_distance: f32,
    ) -> PyResult<ClosestPoints> {
        let numbers = PartNumbers(&self.ids);
        let answer = |points: &[Vec3], found: &mut [Option<(PartId, Nearest)>], is_parallel| {
            match is_parallel {
                true => self
                    .data
                    .par_closest_point_batch(points, max_distance, found),
                false => self.data.closest_point_batch(points, max_distance, found),
            }
        };
        closest_points(py, points, self.threads, true, answer, |(part, nearest)| {
            (nearest, numbers.of(part))
        })
    }

    fn triangles_of_lists(
        &self,
        py: Python<'_>,
        lists: &TriangleLists<(PartId, u32)>,
    ) -> PyResult<TriangleArrays> {
        let numbers = PartNumbers(&self.ids);
        triangles_of(py, lists, true, |(part, triangle)| {
            (triangle, numbers.of(part))
        })
    }
}

with_queries! {
    PyFrame {
        /// The vertices and faces of a part as in this frame: new arrays of float64, shape (V, 3), and uint32, shape (M, 3).
        fn mesh<'py>(&self, py: Python<'py>, part: usize) -> PyResult<PartMesh<'py>> {
            let id = self.ids.get(part).copied();
            let mesh = id.and_then(|id| self.data.mesh(id));
            let mesh = mesh.ok_or_else(|| wrong_value("part", format_args!("{part} is not in the frame")))?;
            let vertices = zero_rows::<f64>(py, mesh.positions().len())?;
            {
                let mut rows = vertices.readwrite();
                let (rows, _) = rows.as_slice_mut().expect("a new array").as_chunks_mut::<3>();
                for (row, position) in rows.iter_mut().zip(mesh.positions()) {
                    *row = (self.zero + Vec3::from(*position).as_dvec3()).to_array();
                }
            }
            Ok((vertices, array_of_rows(py, mesh.triangles())?))
        }

        /// The numbers of the parts.
        #[getter]
        fn parts(&self) -> Vec<i32> {
            let numbers = PartNumbers(&self.ids);
            self.data.parts().map(|part| numbers.of(part)).collect()
        }

        fn __repr__(&self) -> String {
            format!("<kd.Frame: {} parts>", self.data.parts().len())
        }
    }
}

type PartMesh<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>);

/// A matrix of 4 by 4 or 3 by 4.
fn transform_of(value: &Bound<'_, PyAny>) -> PyResult<DAffine3> {
    let argument = "transform";
    let matrix = Matrix::new(argument, value)?;
    let rows = matrix.rows();
    let is_affine = rows.get(3).is_none_or(|row| *row == [0.0, 0.0, 0.0, 1.0]);
    if !matches!(rows.len(), 3 | 4) || !is_affine {
        return Err(wrong_value(
            argument,
            "expected a matrix of shape (4, 4) with the last row 0 0 0 1, or of shape (3, 4)",
        ));
    }
    let column = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    let transform = DAffine3::from_mat3_translation(linear, column(3));
    if !transform.is_finite() {
        return Err(wrong_value(argument, "not finite"));
    }
    Ok(transform)
}

fn report_of<'py>(
    py: Python<'py>,
    report: &CommitReport,
    ids: &[PartId],
) -> PyResult<Bound<'py, PyDict>> {
    let numbers = PartNumbers(ids);
    let changes = PyList::empty(py);
    for change in &report.changes {
        let entry = PyDict::new(py);
        entry.set_item("part", numbers.of(change.part))?;
        entry.set_item("triangles", change.triangles)?;
        entry.set_item("action", action(change.action))?;
        entry.set_item("reason", reason(&change.reason))?;
        changes.append(entry)?;
    }
    let dict = PyDict::new(py);
    dict.set_item("parts", report.parts)?;
    dict.set_item("triangles", report.triangles)?;
    dict.set_item("top_nodes", report.top_nodes)?;
    dict.set_item("links", report.links)?;
    dict.set_item("opened", report.opened)?;
    dict.set_item("bytes", report.bytes.total())?;
    dict.set_item("changes", changes)?;
    dict.set_item("text", report.to_string())?;
    Ok(dict)
}

fn action(action: CommitAction) -> &'static str {
    match action {
        CommitAction::Built => "built",
        CommitAction::BuiltFast => "built fast",
        CommitAction::Refitted => "refitted",
        CommitAction::Moved => "moved",
        CommitAction::Inserted => "inserted",
        CommitAction::BuiltWithAll => "built with all",
        CommitAction::Shared => "shared",
        _ => "other",
    }
}

fn reason(reason: &CommitReason) -> &'static str {
    match reason {
        CommitReason::New => "new",
        CommitReason::Strategy => "strategy",
        CommitReason::Estimate { .. } => "estimate",
        CommitReason::Sharing { .. } => "sharing",
        _ => "other",
    }
}
