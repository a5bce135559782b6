//! Hits, as arrays.

use kd::{Hit, PartId};
use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PySlice;
use rayon::prelude::*;

use crate::arrays::zeros;
use crate::lists::Lists;
use crate::point_queries::place_of;
use crate::threads::Workers;

/// Answers that one task writes.
const RUN: usize = 1 << 14;

/// What a structure says of a hit.
pub(crate) trait Answer: Copy + Send + Sync {
    fn hit(&self) -> Hit;
    /// `None` where there are no parts.
    fn part(&self) -> Option<PartId>;
}

impl Answer for Hit {
    fn hit(&self) -> Hit {
        *self
    }

    fn part(&self) -> Option<PartId> {
        None
    }
}

impl Answer for (PartId, Hit) {
    fn hit(&self) -> Hit {
        self.1
    }

    fn part(&self) -> Option<PartId> {
        Some(self.0)
    }
}

/// The numbers that parts have in Python: those of their order.
pub(crate) struct PartNumbers<'a>(pub(crate) &'a [PartId]);

impl PartNumbers<'_> {
    pub(crate) fn of(&self, part: PartId) -> i32 {
        let place = self.0.binary_search(&part).expect("parts are known");
        i32::try_from(place).expect("a scene has fewer than 2^31 parts")
    }
}

/// The closest hits of rays: one entry for each ray.
///
/// Attributes, all of shape (N,):
///
/// - ``t`` (float32): the distance, in multiples of the ray's direction. Infinite for a miss.
/// - ``triangle`` (int32): the row of ``faces``. -1 for a miss.
/// - ``u``, ``v`` (float32): the weights of the second and the third corner; that of the first is ``1 - u - v``. NaN for a miss.
/// - ``part`` (int32, or None): the part of a scene. -1 for a miss.
/// - ``hit`` (bool): whether the ray hits anything.
#[pyclass(frozen, module = "kd")]
#[derive(Debug)]
pub(crate) struct Hits {
    #[pyo3(get)]
    t: Py<PyArray1<f32>>,
    #[pyo3(get)]
    triangle: Py<PyArray1<i32>>,
    #[pyo3(get)]
    u: Py<PyArray1<f32>>,
    #[pyo3(get)]
    v: Py<PyArray1<f32>>,
    #[pyo3(get)]
    part: Option<Py<PyArray1<i32>>>,
}

/// The slices of the arrays of hits that some answers go to.
struct Columns<'a> {
    t: &'a mut [f32],
    triangle: &'a mut [i32],
    u: &'a mut [f32],
    v: &'a mut [f32],
    /// Empty without parts.
    part: &'a mut [i32],
}

impl Columns<'_> {
    fn put(&mut self, i: usize, hit: Hit) {
        self.t[i] = hit.t;
        self.triangle[i] = hit.triangle.cast_signed();
        self.u[i] = hit.u;
        self.v[i] = hit.v;
    }

    fn put_miss(&mut self, i: usize) {
        self.t[i] = f32::INFINITY;
        self.triangle[i] = -1;
        self.u[i] = f32::NAN;
        self.v[i] = f32::NAN;
    }

    /// Runs of answers with their columns, on all threads if there are several.
    fn fill<A: Sync>(
        self,
        answers: &[A],
        is_parallel: bool,
        put: impl Fn(&mut Columns<'_>, usize, &A) + Sync,
    ) {
        let fill_run = |answers: &[A], mut columns: Columns<'_>| {
            for (i, answer) in answers.iter().enumerate() {
                put(&mut columns, i, answer);
            }
        };
        if !is_parallel || answers.len() <= RUN {
            fill_run(answers, self);
            return;
        }
        let has_parts = !self.part.is_empty();
        let mut no_parts = vec![
            [0_i32; 0];
            if has_parts {
                0
            } else {
                answers.len().div_ceil(RUN)
            }
        ];
        let parts: Vec<&mut [i32]> = if has_parts {
            self.part.chunks_mut(RUN).collect()
        } else {
            no_parts
                .iter_mut()
                .map(|none| none.as_mut_slice())
                .collect()
        };
        (answers.par_chunks(RUN), self.t.par_chunks_mut(RUN))
            .into_par_iter()
            .zip((
                self.triangle.par_chunks_mut(RUN),
                self.u.par_chunks_mut(RUN),
            ))
            .zip((self.v.par_chunks_mut(RUN), parts))
            .for_each(|(((answers, t), (triangle, u)), (v, part))| {
                fill_run(
                    answers,
                    Columns {
                        t,
                        triangle,
                        u,
                        v,
                        part,
                    },
                );
            });
    }
}

impl Hits {
    /// Room for the hits of `len` rays, or `len` hits.
    pub(crate) fn zeros(py: Python<'_>, len: usize, has_parts: bool) -> PyResult<Self> {
        Ok(Self {
            t: zeros(py, len)?.unbind(),
            triangle: zeros(py, len)?.unbind(),
            u: zeros(py, len)?.unbind(),
            v: zeros(py, len)?.unbind(),
            part: if has_parts {
                Some(zeros(py, len)?.unbind())
            } else {
                None
            },
        })
    }

    /// Writes the answers of rays from `start` on.
    pub(crate) fn put<A: Answer>(
        &self,
        py: Python<'_>,
        start: usize,
        answers: &[Option<A>],
        numbers: &PartNumbers<'_>,
        workers: &Workers,
    ) {
        self.write(py, start, answers, workers, |columns, i, answer| {
            let Some(answer) = answer else {
                columns.put_miss(i);
                if let Some(part) = columns.part.get_mut(i) {
                    *part = -1;
                }
                return;
            };
            columns.put(i, answer.hit());
            if let Some(part) = answer.part() {
                columns.part[i] = numbers.of(part);
            }
        });
    }

    /// Writes hits from `start` on.
    fn put_hits<A: Answer>(
        &self,
        py: Python<'_>,
        start: usize,
        hits: &[A],
        numbers: &PartNumbers<'_>,
        workers: &Workers,
    ) {
        self.write(py, start, hits, workers, |columns, i, answer| {
            columns.put(i, answer.hit());
            if let Some(part) = answer.part() {
                columns.part[i] = numbers.of(part);
            }
        });
    }

    fn write<A: Sync>(
        &self,
        py: Python<'_>,
        start: usize,
        answers: &[A],
        workers: &Workers,
        put: impl Fn(&mut Columns<'_>, usize, &A) + Sync + Send,
    ) {
        let new = "a new array";
        let (mut t, mut triangle) = (
            self.t.bind(py).readwrite(),
            self.triangle.bind(py).readwrite(),
        );
        let (mut u, mut v) = (self.u.bind(py).readwrite(), self.v.bind(py).readwrite());
        let mut part = self.part.as_ref().map(|part| part.bind(py).readwrite());
        let range = start..start + answers.len();
        let columns = Columns {
            t: &mut t.as_slice_mut().expect(new)[range.clone()],
            triangle: &mut triangle.as_slice_mut().expect(new)[range.clone()],
            u: &mut u.as_slice_mut().expect(new)[range.clone()],
            v: &mut v.as_slice_mut().expect(new)[range.clone()],
            part: match &mut part {
                Some(part) => &mut part.as_slice_mut().expect(new)[range],
                None => &mut [],
            },
        };
        py.detach(|| {
            let is_parallel = workers.are_several();
            workers.run(|| columns.fill(answers, is_parallel, put));
        });
    }
}

#[pymethods]
impl Hits {
    /// Whether each ray hits anything, as a new array of shape (N,).
    #[getter]
    fn hit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.triangle.bind(py).call_method1("__ge__", (0,))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.t.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let hit: usize = self.hit(py)?.call_method0("sum")?.extract()?;
        Ok(format!("<kd.Hits: {hit} of {} rays hit>", self.__len__(py)))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Columnar)> {
        let parts = (
            self.t.clone_ref(py),
            self.triangle.clone_ref(py),
            self.u.clone_ref(py),
            self.v.clone_ref(py),
            self.part.as_ref().map(|part| part.clone_ref(py)),
        );
        Ok((py.import("kd._kd")?.getattr("_hits")?, parts))
    }
}

/// What a pickle of [`Hits`] consists of.
type Columnar = (
    Py<PyArray1<f32>>,
    Py<PyArray1<i32>>,
    Py<PyArray1<f32>>,
    Py<PyArray1<f32>>,
    Option<Py<PyArray1<i32>>>,
);

/// Hits from a pickle.
#[pyfunction]
pub(crate) fn _hits(
    t: Py<PyArray1<f32>>,
    triangle: Py<PyArray1<i32>>,
    u: Py<PyArray1<f32>>,
    v: Py<PyArray1<f32>>,
    part: Option<Py<PyArray1<i32>>>,
) -> Hits {
    Hits {
        t,
        triangle,
        u,
        v,
        part,
    }
}

/// Lists of hits, one list for each ray: all hits in one row, and where those of each ray begin.
///
/// The hits of ray ``i`` are those from ``offsets[i]`` to ``offsets[i + 1]``, ordered by ``t``, then by part, then by triangle.
/// ``lists[i]`` has them as :class:`Hits`.
///
/// - ``offsets`` (int64, shape (N + 1,)).
/// - ``t``, ``triangle``, ``u``, ``v``, ``part``: as in :class:`Hits`, of shape (number of hits,).
/// - ``ray`` (int64): the ray of each hit.
/// - ``counts`` (int64, shape (N,)): the number of hits of each ray.
#[pyclass(frozen, module = "kd", name = "HitLists")]
#[derive(Debug)]
pub(crate) struct HitArrays {
    #[pyo3(get)]
    offsets: Py<PyArray1<i64>>,
    hits: Py<Hits>,
}

impl HitArrays {
    /// The lists of all rays, from those of chunks of rays.
    pub(crate) fn new<A: Answer>(
        py: Python<'_>,
        rays: usize,
        chunks: &[Lists<A>],
        numbers: &PartNumbers<'_>,
        has_parts: bool,
        workers: &Workers,
    ) -> PyResult<Self> {
        let count = chunks.iter().map(|lists| lists.hits.len()).sum();
        let offsets = zeros::<i64>(py, rays + 1)?;
        let hits = Hits::zeros(py, count, has_parts)?;
        let mut all = offsets.readwrite();
        let ends = &mut all.as_slice_mut().expect("a new array")[1..];
        let (mut ray, mut start) = (0, 0);
        for lists in chunks {
            for (end, own) in ends[ray..].iter_mut().zip(&lists.ends) {
                *end = i64::try_from(start + own).expect("memory has fewer");
            }
            hits.put_hits(py, start, &lists.hits, numbers, workers);
            ray += lists.ends.len();
            start += lists.hits.len();
        }
        drop(all);
        Ok(Self {
            offsets: offsets.unbind(),
            hits: Py::new(py, hits)?,
        })
    }
}

#[pymethods]
impl HitArrays {
    #[getter]
    fn t(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.hits.get().t.clone_ref(py)
    }

    #[getter]
    fn triangle(&self, py: Python<'_>) -> Py<PyArray1<i32>> {
        self.hits.get().triangle.clone_ref(py)
    }

    #[getter]
    fn u(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.hits.get().u.clone_ref(py)
    }

    #[getter]
    fn v(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.hits.get().v.clone_ref(py)
    }

    #[getter]
    fn part(&self, py: Python<'_>) -> Option<Py<PyArray1<i32>>> {
        let part = self.hits.get().part.as_ref();
        part.map(|part| part.clone_ref(py))
    }

    /// The number of hits of each ray, as a new array of shape (N,).
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("numpy")?.call_method1("diff", (&self.offsets,))
    }

    /// The ray of each hit, as a new array.
    #[getter]
    fn ray<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numpy = py.import("numpy")?;
        let rays = numpy.call_method1("arange", (self.__len__(py),))?;
        numpy.call_method1("repeat", (rays, self.counts(py)?))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.offsets.bind(py).len().saturating_sub(1)
    }

    fn __getitem__(&self, py: Python<'_>, ray: isize) -> PyResult<Hits> {
        let len = self.__len__(py);
        let place = place_of(ray, len).ok_or_else(|| {
            PyIndexError::new_err(format!("ray {ray} is out of range for {len} rays"))
        })?;
        let offsets = self.offsets.bind(py);
        let end = |i: usize| offsets.get_item(i)?.extract::<isize>();
        let slice = PySlice::new(py, end(place)?, end(place + 1)?, 1);
        let hits = self.hits.get();
        let floats = |array: &Py<PyArray1<f32>>| -> PyResult<Py<PyArray1<f32>>> {
            Ok(array.bind(py).get_item(&slice)?.cast_into()?.unbind())
        };
        let numbers = |array: &Py<PyArray1<i32>>| -> PyResult<Py<PyArray1<i32>>> {
            Ok(array.bind(py).get_item(&slice)?.cast_into()?.unbind())
        };
        Ok(Hits {
            t: floats(&hits.t)?,
            triangle: numbers(&hits.triangle)?,
            u: floats(&hits.u)?,
            v: floats(&hits.v)?,
            part: hits.part.as_ref().map(numbers).transpose()?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, ListColumns)> {
        let parts = (self.offsets.clone_ref(py), self.hits.clone_ref(py));
        Ok((py.import("kd._kd")?.getattr("_hit_lists")?, parts))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let hits = self.hits.get().__len__(py);
        format!("<kd.HitLists: {hits} hits of {} rays>", self.__len__(py))
    }
}

/// What a pickle of [`HitArrays`] consists of.
type ListColumns = (Py<PyArray1<i64>>, Py<Hits>);

/// Lists of hits from a pickle.
#[pyfunction]
pub(crate) fn _hit_lists(offsets: Py<PyArray1<i64>>, hits: Py<Hits>) -> HitArrays {
    HitArrays { offsets, hits }
}
