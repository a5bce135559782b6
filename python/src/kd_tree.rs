//! `kd.KdTree`: a mesh and what rays through it traverse.
#![allow(
    clippy::too_many_arguments,
    reason = "the arguments of Python's methods"
)]

use std::path::PathBuf;
use std::sync::Arc;

use kd::glam::{DVec3, Vec3};
use kd::points::{Nearest, TriangleLists};
use kd::{BuildOptions, KdTree, Mesh};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Rows, array_of_rows, faces, zero_rows};
use crate::crossings::crossings;
use crate::errors::{of_build, of_file, of_mesh};
use crate::files;
use crate::hits::{HitArrays, Hits};
use crate::mesh::{PlacedMesh, single};
use crate::options::Options;
use crate::point_queries::{
    ClosestPoints, Points, TriangleArrays, boxes, closest_points, numbers_of, spheres, triangles_of,
};
use crate::queries::with_queries;
use crate::ray_queries::Traced;
use crate::rays::{Limits, Rays, rounded};
use crate::threads::{Threads, interruptible};

/// A kd-tree over a triangle mesh, with queries for whole arrays of rays and points.
///
/// Parameters
/// ----------
/// vertices : (V, 3) float
///     Float32 is taken as it is. Float64 (also integers and lists) becomes float32 offsets from :attr:`origin`, a point near the vertices
///     that is chosen so that offsets are exact where they can be; :attr:`rounding` has the largest error. Rays and points are always
///     given, and positions returned, in the coordinates of ``vertices``; they are rounded to float32 after ``origin`` was subtracted.
/// faces : (M, 3) int
///     Three rows of ``vertices`` for each triangle, of any integer type.
/// preset : {"balanced", "fast", "best"}
///     "fast" builds fastest, "best" traces fastest. Answers do not depend on it.
/// layout : {"wide", "binary"}
///     What rays traverse: nodes of eight boxes, or those of the kd-tree. Answers do not depend on it.
/// threads : int, optional
///     The number of threads of the build and of queries; all by default. Answers do not depend on it.
/// progress : callable, optional
///     Called with the fraction of the build that is done, from 0.0 to 1.0, on the calling thread. An exception that it raises ends the
///     build. So does ``Ctrl-C``, with or without it.
///
/// Notes
/// -----
/// Answers equal those of a test of every triangle, to the bit. The test is watertight: no ray passes between triangles that share an edge
/// or a vertex. Queries release the interpreter's lock, and may run on several threads of Python at a time. The arrays are copied: later
/// changes do not reach the tree.
#[pyclass(frozen, module = "kd", name = "KdTree")]
#[derive(Debug)]
pub(crate) struct PyKdTree {
    pub(crate) tree: Arc<KdTree>,
    pub(crate) zero: DVec3,
    pub(crate) threads: Threads,
    /// `None` if the tree is from a file.
    rounding: Option<DVec3>,
    /// The file that is mapped, and whether it was verified.
    file: Option<(PathBuf, bool)>,
}

impl PyKdTree {
    pub(crate) fn traced(&self) -> Traced<'_, KdTree> {
        Traced {
            structure: &self.tree,
            threads: self.threads,
            parts: None,
        }
    }

    fn answers(&self) -> &KdTree {
        &self.tree
    }

    fn built(
        py: Python<'_>,
        placed: PlacedMesh,
        options: &BuildOptions,
        threads: Threads,
        progress: Option<&Py<PyAny>>,
    ) -> PyResult<Self> {
        let workers = threads.for_build()?;
        let build = options
            .clone()
            .with_threads(usize::from(!workers.are_several()));
        let mesh = placed.mesh;
        let tree = interruptible(py, progress, |progress| {
            workers.run(|| KdTree::build_with_progress(mesh, &build, progress))
        })?;
        let tree = tree.map_err(|error| of_build(&error))?;
        Ok(Self {
            tree: Arc::new(tree.with_origin(placed.zero)),
            zero: placed.zero,
            threads,
            rounding: placed.rounding,
            file: None,
        })
    }

    fn of_file(tree: KdTree, threads: Threads, file: Option<(PathBuf, bool)>) -> Self {
        Self {
            zero: tree.origin(),
            tree: Arc::new(tree),
            threads,
            rounding: None,
            file,
        }
    }

    fn options(&self) -> Options {
        Options::of(self.tree.options())
    }

    fn closest_points_of(
        &self,
        py: Python<'_>,
        points: &Points<'_>,
        max_distance: f32,
    ) -> PyResult<ClosestPoints> {
        let answer = |points: &[Vec3], found: &mut [Option<Nearest>], is_parallel| match is_parallel
        {
            true => self
                .tree
                .par_closest_point_batch(points, max_distance, found),
            false => self.tree.closest_point_batch(points, max_distance, found),
        };
        closest_points(py, points, self.threads, false, answer, |nearest| {
            (nearest, 0)
        })
    }

    fn triangles_of_lists(
        &self,
        py: Python<'_>,
        lists: &TriangleLists,
    ) -> PyResult<TriangleArrays> {
        triangles_of(py, lists, false, |triangle| (triangle, 0))
    }
}

with_queries! {
    PyKdTree {
        #[new]
        #[pyo3(signature = (vertices, faces, preset = "balanced", layout = "wide", threads = None, progress = None))]
        fn new(
            py: Python<'_>,
            vertices: &Bound<'_, PyAny>,
            faces: &Bound<'_, PyAny>,
            preset: &str,
            layout: &str,
            threads: Option<usize>,
            progress: Option<Py<PyAny>>,
        ) -> PyResult<Self> {
            let options = Options::new(preset, layout)?.build(true);
            let threads = Threads::new(threads)?;
            let mesh = PlacedMesh::new(vertices, faces)?;
            Self::built(py, mesh, &options, threads, progress.as_ref())
        }

        /// The same tree, whose queries use this number of threads; all if it is None. Shares the memory of this one.
        #[pyo3(signature = (threads = None))]
        fn with_threads(&self, threads: Option<usize>) -> PyResult<Self> {
            Ok(Self {
                tree: Arc::clone(&self.tree),
                threads: Threads::new(threads)?,
                file: self.file.clone(),
                ..*self
            })
        }

        /// Writes the tree, as it is traced, to a file that :meth:`load` reads and :meth:`open` maps.
        ///
        /// An existing file is replaced as a whole, or stays as it is; a tree that was opened from it is not changed.
        fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
            py.detach(|| self.tree.save(path)).map_err(|error| of_file(&error))
        }

        /// Reads a file that :meth:`save` wrote into memory, and verifies it.
        #[staticmethod]
        #[pyo3(signature = (path, threads = None))]
        fn load(py: Python<'_>, path: PathBuf, threads: Option<usize>) -> PyResult<Self> {
            let threads = Threads::new(threads)?;
            let tree = py.detach(|| KdTree::load(path));
            Ok(Self::of_file(tree.map_err(|error| of_file(&error))?, threads, None))
        }

        /// Maps a file that :meth:`save` wrote into memory, and traces it as it lies.
        ///
        /// Memory is taken by what rays touch, and is shared by all processes that open the file. A pickle of the tree is the path, so
        /// that workers open the file, too.
        ///
        /// As with ``numpy.memmap``, nothing may change the file or make it shorter while the tree is in use; :meth:`save` replaces a file
        /// and is allowed. Otherwise answers are wrong or the process ends. :meth:`load` needs no such promise.
        ///
        /// Parameters
        /// ----------
        /// path : str or path
        ///     A file of :meth:`save`.
        /// verify : bool
        ///     Read and check all of the file once, as :meth:`load` does, which takes about as long as reading it. Pass False only for a
        ///     file that is known to be one of :meth:`save`: the tree is then ready at once, whatever its size.
        /// threads : int, optional
        ///     The number of threads of queries; all by default.
        #[staticmethod]
        #[pyo3(signature = (path, verify = true, threads = None))]
        fn open(py: Python<'_>, path: PathBuf, verify: bool, threads: Option<usize>) -> PyResult<Self> {
            let threads = Threads::new(threads)?;
            let path = std::path::absolute(&path).unwrap_or(path);
            let tree = py.detach(|| files::open(&path, verify));
            let tree = tree.map_err(|error| of_file(&error))?;
            Ok(Self::of_file(tree, threads, Some((path, verify))))
        }

        /// The crossings of each ray with the surface, in order, as :class:`HitLists`.
        ///
        /// As :meth:`hits`, but a ray exactly through an edge or a vertex crosses the surface there as often as a ray beside it: once
        /// through a vertex of a sphere, where :meth:`hits` has all triangles around it. So from outside to outside of a closed mesh there
        /// is an even number, unless the ray runs in the plane of a triangle. Where the ray beside it would miss, at the rim of an open
        /// mesh or on a ridge that it touches, one hit of each side counts. Coincident triangles count one by one.
        ///
        /// In detail: hits of triangles that share the edge or the vertex, by its coordinates, are a group; of a group as many hits of
        /// each side count as a ray would have that is moved aside by less than every number. The first hits stand for them.
        #[pyo3(signature = (origins, directions, max = None, t_min = None, t_max = None, culling = None, mask = None))]
        fn crossings<'py>(
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
            let max = max.unwrap_or(usize::MAX);
            self.traced().lists(py, &rays, |rays, is_parallel| {
                crossings(&self.tree, rays, max, is_parallel)
            })
        }

        /// Whether the surface is closed, where :meth:`contains` is exact: each edge is used as often in one direction as in the other.
        /// Vertices at equal positions are one vertex.
        #[getter]
        fn is_closed(&self, py: Python<'_>) -> bool {
            py.detach(|| self.tree.mesh().is_closed())
        }

        /// The vertices as they are traced, in the coordinates that they were given in: a new float64 array of shape (V, 3).
        #[getter]
        fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
            let positions = self.tree.mesh().positions();
            let array = zero_rows::<f64>(py, positions.len())?;
            let mut rows = array.readwrite();
            let (rows, _) = rows.as_slice_mut().expect("a new array").as_chunks_mut::<3>();
            for (row, position) in rows.iter_mut().zip(positions) {
                *row = (self.zero + Vec3::from(*position).as_dvec3()).to_array();
            }
            Ok(array)
        }

        /// The faces: a new uint32 array of shape (M, 3).
        #[getter]
        fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
            array_of_rows(py, self.tree.mesh().triangles())
        }

        /// The point of the coordinates of ``vertices`` at which float32 coordinates have their zero: (x, y, z).
        #[getter]
        fn origin(&self) -> [f64; 3] {
            self.zero.to_array()
        }

        /// The largest error of a vertex on each axis, from the rounding to float32: (x, y, z); None for a tree from a file, which does not
        /// have it.
        #[getter]
        fn rounding(&self) -> Option<[f64; 3]> {
            self.rounding.map(|rounding| rounding.to_array())
        }

        /// The number of threads of queries; None for all.
        #[getter]
        fn threads(&self) -> Option<usize> {
            self.threads.number()
        }

        /// The preset of the build; "custom" for a tree from a file that was built with other options.
        #[getter]
        fn preset(&self) -> &'static str {
            self.options().preset
        }

        /// What rays traverse: "wide" or "binary".
        #[getter]
        fn layout(&self) -> &'static str {
            self.options().layout
        }

        /// The number of triangles.
        fn __len__(&self) -> usize {
            self.tree.mesh().len()
        }

        fn __repr__(&self) -> String {
            let mesh = self.tree.mesh();
            format!(
                "<kd.KdTree: {} triangles, {} vertices, preset {:?}, layout {:?}>",
                mesh.len(),
                mesh.positions().len(),
                self.options().preset,
                self.options().layout,
            )
        }

        /// A tree that was opened: its path, and the file is opened again. Another one: its mesh and its options, and it is built again.
        fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
            if let Some((path, verify)) = &self.file {
                let arguments = (path, *verify, self.threads.number());
                let open = py.get_type::<Self>().getattr("open")?;
                return Ok((open, arguments.into_pyobject(py)?.into_any()));
            }
            let mesh = self.tree.mesh();
            let arrays = (array_of_rows(py, mesh.positions())?, array_of_rows(py, mesh.triangles())?);
            let rounding = self.rounding.map(|rounding| rounding.to_array());
            let places = (self.zero.to_array(), rounding);
            let options = (self.tree.options().to_words(), self.threads.number());
            let arguments = (arrays, places, options).into_pyobject(py)?;
            Ok((py.import("kd._kd")?.getattr("_kd_tree")?, arguments.into_any()))
        }
    }
}

/// A tree from a pickle.
#[pyfunction]
pub(crate) fn _kd_tree(
    py: Python<'_>,
    arrays: (Bound<'_, PyAny>, Bound<'_, PyAny>),
    places: ([f64; 3], Option<[f64; 3]>),
    options: ([u32; BuildOptions::WORDS], Option<usize>),
) -> PyResult<PyKdTree> {
    let vertices = Rows::new("vertices", &arrays.0)?;
    let mesh = Mesh::new(single("vertices", &vertices)?, faces("faces", &arrays.1)?);
    let placed = PlacedMesh {
        mesh: mesh.map_err(|error| of_mesh(&error))?,
        zero: DVec3::from(places.0),
        rounding: places.1.map(DVec3::from),
    };
    let (words, threads) = options;
    let options = BuildOptions::from_words(&words).map_err(|error| of_build(&error))?;
    PyKdTree::built(py, placed, &options, Threads::new(threads)?, None)
}
