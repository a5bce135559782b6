//! Rays of arrays, as rays of the library, some at a time.

use std::ops::Range;

use kd::glam::{DVec3, Vec3};
use kd::{Culling, Ray};
use numpy::ndarray::ArrayView2;
use pyo3::prelude::*;

use crate::arrays::{Bits, Numbers, Rows, RowsView};
use crate::errors::wrong_value;
use crate::threads::{Workers, fill};

/// Rays that are converted together: few enough to stay in a cache, and many enough for all threads. Signals are looked at between.
const CHUNK_OF_A_THREAD: usize = 1 << 16;
const MOST_OF_A_CHUNK: usize = 1 << 20;

/// The arguments of a query of rays, checked.
pub(crate) struct Rays<'py> {
    origins: Rows<'py>,
    directions: Rows<'py>,
    t_min: Numbers<'py>,
    t_max: Numbers<'py>,
    mask: Bits,
    culling: Culling,
    /// The point at which the structure has its zero.
    zero: DVec3,
    len: usize,
}

/// The arguments that say which hits of a ray count, as they came. `None` is the default of each.
pub(crate) struct Limits<'a, 'py> {
    pub(crate) t_min: Option<&'a Bound<'py, PyAny>>,
    pub(crate) t_max: Option<&'a Bound<'py, PyAny>>,
    pub(crate) culling: Option<&'a str>,
    pub(crate) mask: Option<&'a Bound<'py, PyAny>>,
}

impl<'py> Rays<'py> {
    pub(crate) fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        limits: &Limits<'_, 'py>,
        zero: DVec3,
    ) -> PyResult<Self> {
        let origins = Rows::new("origins", origins)?;
        let directions = Rows::new("directions", directions)?;
        let len = match (origins.len(), directions.len()) {
            (a, b) if a == b => a,
            (1, rows) | (rows, 1) => rows,
            (a, b) => {
                return Err(wrong_value(
                    "directions",
                    format_args!("{b} rows for {a} origins"),
                ));
            }
        };
        let end = |argument, value: Option<_>, default| match value {
            Some(value) => Numbers::new(argument, value, len),
            None => Ok(Numbers::One(default)),
        };
        Ok(Self {
            origins,
            directions,
            t_min: end("t_min", limits.t_min, 0.0)?,
            t_max: end("t_max", limits.t_max, f64::INFINITY)?,
            mask: match limits.mask {
                Some(mask) => Bits::new("mask", mask, len)?,
                None => Bits::One(u32::MAX),
            },
            culling: culling_of(limits.culling)?,
            zero,
            len,
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Calls `work` with the number of the first ray, and some rays, until all had their turn. Signals are looked at between.
    pub(crate) fn for_each_chunk(
        &self,
        py: Python<'_>,
        workers: &Workers,
        mut work: impl FnMut(usize, &[Ray]) -> PyResult<()>,
    ) -> PyResult<()> {
        let any = Ray::new(Vec3::ZERO, Vec3::ZERO);
        let mut rays = Vec::new();
        let chunk = (workers.number() * CHUNK_OF_A_THREAD).min(MOST_OF_A_CHUNK);
        for start in (0..self.len).step_by(chunk) {
            rays.resize(chunk.min(self.len - start), any);
            self.put(start, &mut rays, workers.number());
            work(start, &rays)?;
            py.check_signals()?;
        }
        Ok(())
    }

    /// Writes the rays from `start` on, in one pass over the arrays.
    fn put(&self, start: usize, rays: &mut [Ray], threads: usize) {
        match self.origins.view() {
            RowsView::Single(origins) => self.put_from(&origins, start, rays, threads),
            RowsView::Double(origins) => self.put_from(&origins, start, rays, threads),
        }
    }

    fn put_from<O: Number>(
        &self,
        origins: &ArrayView2<'_, O>,
        start: usize,
        rays: &mut [Ray],
        threads: usize,
    ) {
        match self.directions.view() {
            RowsView::Single(directions) => {
                self.put_both(origins, &directions, start, rays, threads);
            }
            RowsView::Double(directions) => {
                self.put_both(origins, &directions, start, rays, threads);
            }
        }
    }

    fn put_both<O: Number, D: Number>(
        &self,
        origins: &ArrayView2<'_, O>,
        directions: &ArrayView2<'_, D>,
        start: usize,
        rays: &mut [Ray],
        threads: usize,
    ) {
        let (zero, culling, mask) = (self.zero, self.culling, &self.mask);
        let (t_min, t_max) = (self.t_min.view(), self.t_max.view());
        let ray = |i: usize, origin: [f64; 3], direction: [f64; 3]| Ray {
            origin: (DVec3::from(origin) - zero).as_vec3(),
            direction: DVec3::from(direction).as_vec3(),
            t_min: rounded(t_min.at(i)),
            t_max: rounded(t_max.at(i)),
            mask: mask.at(i),
            culling,
        };
        fill(rays, threads, |place, rays| {
            let range = start + place..start + place + rays.len();
            if let Some(origins) = whole_rows(origins, &range)
                && let Some(directions) = whole_rows(directions, &range)
            {
                let rows = range.zip(origins.iter().zip(directions));
                for (place, (i, (origin, direction))) in rays.iter_mut().zip(rows) {
                    *place = ray(i, origin.map(Into::into), direction.map(Into::into));
                }
                return;
            }
            for (place, i) in rays.iter_mut().zip(range) {
                *place = ray(i, row(origins, i), row(directions, i));
            }
        });
    }
}

/// A float of an array.
trait Number: Copy + Into<f64> + Sync {}

impl Number for f32 {}

impl Number for f64 {}

/// Rows without gaps between them; `None` also where one row serves all.
fn whole_rows<'a, T>(rows: &'a ArrayView2<'_, T>, range: &Range<usize>) -> Option<&'a [[T; 3]]> {
    let (rows, _) = rows.as_slice()?.as_chunks::<3>();
    rows.get(range.clone())
}

/// A row; the only one, if there is only one.
fn row<T: Copy + Into<f64>>(rows: &ArrayView2<'_, T>, i: usize) -> [f64; 3] {
    let i = if rows.nrows() == 1 { 0 } else { i };
    [0, 1, 2].map(|k| rows[[i, k]].into())
}

/// The nearest f32.
#[allow(
    clippy::cast_possible_truncation,
    reason = "documented: numbers are rounded to f32"
)]
pub(crate) fn rounded(number: f64) -> f32 {
    number as f32
}

fn culling_of(name: Option<&str>) -> PyResult<Culling> {
    match name {
        None => Ok(Culling::NONE),
        Some("back") => Ok(Culling::BACK),
        Some("front") => Ok(Culling::FRONT),
        Some(name) => Err(wrong_value(
            "culling",
            format_args!("expected None, \"back\" or \"front\", got {name:?}"),
        )),
    }
}
