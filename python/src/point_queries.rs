//! Queries of points, for any structure.

use kd::Aabb;
use kd::glam::{DVec3, Vec3};
use kd::points::{Feature, Nearest, TriangleLists};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PySlice;

use crate::arrays::{Numbers, Rows, zero_rows, zeros};
use crate::errors::wrong_value;
use crate::rays::rounded;
use crate::threads::Threads;

/// Points that are converted together.
const CHUNK: usize = 1 << 20;

/// The closest points of a mesh: one entry for each point that was asked for.
///
/// Attributes:
///
/// - ``point`` (float64, shape (N, 3)): the closest point of the mesh. NaN where there is none.
/// - ``distance`` (float32, shape (N,)): its distance. Infinite where there is none.
/// - ``triangle`` (int32): the row of ``faces``. -1 where there is none.
/// - ``u``, ``v`` (float32): the weights of the second and the third corner. NaN where there is none.
/// - ``feature`` (int8): where the point is on the triangle. 0 inside; 1, 2, 3 on the edge between the corners 0 and 1, 1 and 2, 2 and 0;
///   4, 5, 6 at the corner 0, 1, 2; -1 where there is none.
/// - ``part`` (int32, or None): the part of a scene. -1 where there is none.
#[pyclass(frozen, get_all, module = "kd")]
#[derive(Debug)]
pub(crate) struct ClosestPoints {
    point: Py<PyArray2<f64>>,
    distance: Py<PyArray1<f32>>,
    triangle: Py<PyArray1<i32>>,
    u: Py<PyArray1<f32>>,
    v: Py<PyArray1<f32>>,
    feature: Py<PyArray1<i8>>,
    part: Option<Py<PyArray1<i32>>>,
}

impl ClosestPoints {
    fn zeros(py: Python<'_>, len: usize, has_parts: bool) -> PyResult<Self> {
        Ok(Self {
            point: zero_rows(py, len)?.unbind(),
            distance: zeros(py, len)?.unbind(),
            triangle: zeros(py, len)?.unbind(),
            u: zeros(py, len)?.unbind(),
            v: zeros(py, len)?.unbind(),
            feature: zeros(py, len)?.unbind(),
            part: match has_parts {
                true => Some(zeros(py, len)?.unbind()),
                false => None,
            },
        })
    }

    fn put(
        &self,
        py: Python<'_>,
        start: usize,
        found: impl Iterator<Item = Option<(Nearest, i32)>>,
        zero: DVec3,
    ) {
        let new = "a new array";
        let mut points = self.point.bind(py).readwrite();
        let (points, _) = points.as_slice_mut().expect(new).as_chunks_mut::<3>();
        let mut distance = self.distance.bind(py).readwrite();
        let mut triangle = self.triangle.bind(py).readwrite();
        let (mut u, mut v) = (self.u.bind(py).readwrite(), self.v.bind(py).readwrite());
        let mut feature = self.feature.bind(py).readwrite();
        let distance = distance.as_slice_mut().expect(new);
        let triangle = triangle.as_slice_mut().expect(new);
        let (u, v) = (u.as_slice_mut().expect(new), v.as_slice_mut().expect(new));
        let feature = feature.as_slice_mut().expect(new);
        let mut part = self.part.as_ref().map(|part| part.bind(py).readwrite());
        let mut part = part.as_mut().map(|part| part.as_slice_mut().expect(new));
        for (i, found) in (start..).zip(found) {
            let (nearest, number) = found.unwrap_or((
                Nearest {
                    point: Vec3::NAN,
                    distance: f32::INFINITY,
                    triangle: u32::MAX,
                    u: f32::NAN,
                    v: f32::NAN,
                    feature: Feature::Face,
                },
                -1,
            ));
            points[i] = (zero + nearest.point.as_dvec3()).to_array();
            distance[i] = nearest.distance;
            triangle[i] = nearest.triangle.cast_signed();
            u[i] = nearest.u;
            v[i] = nearest.v;
            feature[i] = match nearest.feature {
                _ if found.is_none() => -1,
                Feature::Face => 0,
                Feature::Edge(edge) => 1 + edge.cast_signed(),
                Feature::Corner(corner) => 4 + corner.cast_signed(),
            };
            if let Some(part) = &mut part {
                part[i] = number;
            }
        }
    }
}

#[pymethods]
impl ClosestPoints {
    fn __len__(&self, py: Python<'_>) -> usize {
        self.distance.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("<kd.ClosestPoints: {} points>", self.__len__(py))
    }
}

/// Points of an argument, relative to a zero, some at a time.
pub(crate) struct Points<'py> {
    rows: Rows<'py>,
    zero: DVec3,
}

impl<'py> Points<'py> {
    pub(crate) fn new(argument: &str, value: &Bound<'py, PyAny>, zero: DVec3) -> PyResult<Self> {
        let rows = Rows::new(argument, value)?;
        Ok(Self { rows, zero })
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Calls `work` with the number of the first point, and some points, until all had their turn.
    pub(crate) fn for_each_chunk(
        &self,
        py: Python<'_>,
        mut work: impl FnMut(usize, &[Vec3]) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut points = Vec::new();
        for start in (0..self.len()).step_by(CHUNK) {
            let count = CHUNK.min(self.len() - start);
            points.clear();
            self.rows.view().for_each(start, count, |_, row| {
                points.push((DVec3::from(row) - self.zero).as_vec3());
            });
            work(start, &points)?;
            py.check_signals()?;
        }
        Ok(())
    }

    /// All points.
    pub(crate) fn all(&self) -> PyResult<Vec<Vec3>> {
        let mut points = crate::arrays::reserved(self.len(), "points")?;
        self.rows.view().for_each(0, self.len(), |_, row| {
            points.push((DVec3::from(row) - self.zero).as_vec3());
        });
        Ok(points)
    }
}

/// Answers of one number each. `answer` gets some points, and whether to use all threads.
pub(crate) fn numbers_of<'py, T: Element, A: Copy + Send>(
    py: Python<'py>,
    points: &Points<'_>,
    threads: Threads,
    none: A,
    answer: impl Fn(&[Vec3], &mut [A], bool) + Sync,
    number: impl Fn(A) -> T,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let workers = threads.for_items(points.len())?;
    let numbers = zeros::<T>(py, points.len())?;
    let mut answers = Vec::new();
    points.for_each_chunk(py, |start, points| {
        answers.clear();
        answers.resize(points.len(), none);
        py.detach(|| workers.run(|| answer(points, &mut answers, workers.are_several())));
        let mut numbers = numbers.readwrite();
        let numbers = &mut numbers.as_slice_mut().expect("a new array")[start..];
        for (place, &answer) in numbers.iter_mut().zip(&answers) {
            *place = number(answer);
        }
        Ok(())
    })?;
    Ok(numbers)
}

/// Closest points. `answer` gets some points, and whether to use all threads.
pub(crate) fn closest_points<A: Copy + Send>(
    py: Python<'_>,
    points: &Points<'_>,
    threads: Threads,
    has_parts: bool,
    answer: impl Fn(&[Vec3], &mut [Option<A>], bool) + Sync,
    found: impl Fn(A) -> (Nearest, i32),
) -> PyResult<ClosestPoints> {
    let workers = threads.for_items(points.len())?;
    let closest = ClosestPoints::zeros(py, points.len(), has_parts)?;
    let mut answers = Vec::new();
    points.for_each_chunk(py, |start, some| {
        answers.clear();
        answers.resize(some.len(), None);
        py.detach(|| workers.run(|| answer(some, &mut answers, workers.are_several())));
        let all = answers.iter().map(|answer| answer.map(&found));
        closest.put(py, start, all, points.zero);
        Ok(())
    })?;
    Ok(closest)
}

/// Lists of triangles, one list for each region: all triangles in one row, and where those of each region begin.
///
/// The triangles of region ``i`` are those from ``offsets[i]`` to ``offsets[i + 1]``, in ascending order; ``lists[i]`` has them.
///
/// - ``offsets`` (int64, shape (N + 1,)).
/// - ``triangle`` (int32): rows of ``faces``.
/// - ``part`` (int32, or None): the parts of a scene.
#[pyclass(frozen, module = "kd", name = "TriangleLists")]
#[derive(Debug)]
pub(crate) struct TriangleArrays {
    #[pyo3(get)]
    offsets: Py<PyArray1<i64>>,
    #[pyo3(get)]
    triangle: Py<PyArray1<i32>>,
    #[pyo3(get)]
    part: Option<Py<PyArray1<i32>>>,
}

impl TriangleArrays {
    /// From the ends of lists, and all triangles with the numbers of their parts.
    pub(crate) fn new(
        py: Python<'_>,
        ends: impl ExactSizeIterator<Item = usize>,
        triangles: impl ExactSizeIterator<Item = (u32, i32)>,
        has_parts: bool,
    ) -> PyResult<Self> {
        let offsets = zeros::<i64>(py, ends.len() + 1)?;
        let triangle = zeros::<i32>(py, triangles.len())?;
        let part = has_parts
            .then(|| zeros::<i32>(py, triangles.len()))
            .transpose()?;
        for (offset, end) in offsets
            .readwrite()
            .as_array_mut()
            .iter_mut()
            .skip(1)
            .zip(ends)
        {
            *offset = i64::try_from(end).expect("memory has fewer");
        }
        let mut numbers = part.as_ref().map(|part| part.readwrite());
        let mut numbers = numbers.as_mut().map(|numbers| numbers.as_array_mut());
        let mut all = triangle.readwrite();
        let mut all = all.as_array_mut();
        for (i, (number, part)) in triangles.enumerate() {
            all[i] = number.cast_signed();
            if let Some(numbers) = &mut numbers {
                numbers[i] = part;
            }
        }
        Ok(Self {
            offsets: offsets.unbind(),
            triangle: triangle.unbind(),
            part: part.map(Bound::unbind),
        })
    }
}

#[pymethods]
impl TriangleArrays {
    /// The number of triangles of each region, as a new array of shape (N,).
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("numpy")?.call_method1("diff", (&self.offsets,))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.offsets.bind(py).len().saturating_sub(1)
    }

    fn __getitem__<'py>(&self, py: Python<'py>, region: isize) -> PyResult<Bound<'py, PyAny>> {
        let len = self.__len__(py);
        let place = place_of(region, len).ok_or_else(|| {
            PyIndexError::new_err(format!("region {region} is out of range for {len} regions"))
        })?;
        let offsets = self.offsets.bind(py);
        let end = |i: usize| offsets.get_item(i)?.extract::<isize>();
        let slice = PySlice::new(py, end(place)?, end(place + 1)?, 1);
        self.triangle.bind(py).get_item(slice)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let triangles = self.triangle.bind(py).len();
        let regions = self.__len__(py);
        format!("<kd.TriangleLists: {triangles} triangles of {regions} regions>")
    }
}

/// The place of an index that may count from the end.
pub(crate) fn place_of(index: isize, len: usize) -> Option<usize> {
    let place = if index < 0 {
        index.checked_add_unsigned(len)?
    } else {
        index
    };
    usize::try_from(place).ok().filter(|place| *place < len)
}

/// Boxes between the rows of two arguments.
pub(crate) fn boxes(
    lower: &Bound<'_, PyAny>,
    upper: &Bound<'_, PyAny>,
    zero: DVec3,
) -> PyResult<Vec<Aabb>> {
    let lower = Points::new("lower", lower, zero)?.all()?;
    let upper = Points::new("upper", upper, zero)?.all()?;
    if lower.len() != upper.len() {
        let problem = format!("{} rows for {} of lower", upper.len(), lower.len());
        return Err(wrong_value("upper", problem));
    }
    let pairs = lower.into_iter().zip(upper);
    Ok(pairs.map(|(min, max)| Aabb { min, max }).collect())
}

/// Spheres around the rows of an argument.
pub(crate) fn spheres(
    centers: &Bound<'_, PyAny>,
    radii: &Bound<'_, PyAny>,
    zero: DVec3,
) -> PyResult<Vec<(Vec3, f32)>> {
    let centers = Points::new("centers", centers, zero)?.all()?;
    let radii = Numbers::new("radii", radii, centers.len())?;
    let radii = radii.view();
    let spheres = centers.into_iter().enumerate();
    Ok(spheres
        .map(|(i, center)| (center, rounded(radii.at(i))))
        .collect())
}

/// The triangles of regions. `name` gives the number of a triangle and that of its part.
pub(crate) fn triangles_of<T: Copy>(
    py: Python<'_>,
    lists: &TriangleLists<T>,
    has_parts: bool,
    name: impl Fn(T) -> (u32, i32),
) -> PyResult<TriangleArrays> {
    let ends: Vec<usize> = lists.starts().iter().skip(1).copied().collect();
    let triangles: Vec<(u32, i32)> = lists.triangles().iter().map(|one| name(*one)).collect();
    TriangleArrays::new(py, ends.into_iter(), triangles.into_iter(), has_parts)
}
