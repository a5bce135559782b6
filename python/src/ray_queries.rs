//! Queries of rays, for any structure.

use kd::{PartId, Ray, RayQuery};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::zeros;
use crate::errors::no_memory;
use crate::hits::{Answer, HitArrays, Hits, PartNumbers};
use crate::lists::Lists;
use crate::rays::Rays;
use crate::threads::Threads;

/// A structure that answers rays, and what answers need to become arrays.
#[derive(Clone, Copy)]
pub(crate) struct Traced<'a, Q> {
    pub(crate) structure: &'a Q,
    pub(crate) threads: Threads,
    /// The parts of a scene in order; `None` for one mesh.
    pub(crate) parts: Option<&'a [PartId]>,
}

impl<Q> Traced<'_, Q>
where
    Q: RayQuery + Sync,
    Q::Hit: Answer,
{
    fn numbers(&self) -> PartNumbers<'_> {
        PartNumbers(self.parts.unwrap_or_default())
    }

    pub(crate) fn intersect(&self, py: Python<'_>, rays: &Rays<'_>) -> PyResult<Hits> {
        let workers = self.threads.for_items(rays.len())?;
        let found = Hits::zeros(py, rays.len(), self.parts.is_some())?;
        let mut answers = Vec::new();
        rays.for_each_chunk(py, &workers, |start, rays| {
            answers.clear();
            answers.resize(rays.len(), None);
            py.detach(|| {
                workers.run(|| match workers.are_several() {
                    true => self.structure.par_intersect_batch(rays, &mut answers),
                    false => self.structure.intersect_batch(rays, &mut answers),
                });
            });
            found.put(py, start, &answers, &self.numbers(), &workers);
            Ok(())
        })?;
        Ok(found)
    }

    pub(crate) fn occluded<'py>(
        &self,
        py: Python<'py>,
        rays: &Rays<'_>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let workers = self.threads.for_items(rays.len())?;
        let found = zeros::<bool>(py, rays.len())?;
        rays.for_each_chunk(py, &workers, |start, rays| {
            let mut found = found.readwrite();
            let found = &mut found.as_slice_mut().expect("a new array")[start..start + rays.len()];
            py.detach(|| {
                workers.run(|| match workers.are_several() {
                    true => self.structure.par_occluded_batch(rays, found),
                    false => self.structure.occluded_batch(rays, found),
                });
            });
            Ok(())
        })?;
        Ok(found)
    }

    pub(crate) fn count_hits<'py>(
        &self,
        py: Python<'py>,
        rays: &Rays<'_>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let workers = self.threads.for_items(rays.len())?;
        let found = zeros::<i64>(py, rays.len())?;
        let mut counts = Vec::new();
        rays.for_each_chunk(py, &workers, |start, rays| {
            counts.clear();
            counts.resize(rays.len(), 0);
            py.detach(|| {
                workers.run(|| match workers.are_several() {
                    true => self.structure.par_count_hits_batch(rays, &mut counts),
                    false => self.structure.count_hits_batch(rays, &mut counts),
                });
            });
            let mut found = found.readwrite();
            let found = &mut found.as_slice_mut().expect("a new array")[start..];
            for (found, count) in found.iter_mut().zip(&counts) {
                *found = i64::try_from(*count).expect("memory has fewer");
            }
            Ok(())
        })?;
        Ok(found)
    }

    pub(crate) fn hits(
        &self,
        py: Python<'_>,
        rays: &Rays<'_>,
        max: Option<usize>,
    ) -> PyResult<HitArrays> {
        let max = max.unwrap_or(usize::MAX);
        self.lists(py, rays, |rays, is_parallel| match is_parallel {
            true => self.structure.par_hits_batch(rays, max).into(),
            false => self.structure.hits_batch(rays, max).into(),
        })
    }

    /// Lists that `list` makes of rays, on all threads or one.
    pub(crate) fn lists(
        &self,
        py: Python<'_>,
        rays: &Rays<'_>,
        list: impl Fn(&[Ray], bool) -> Lists<Q::Hit> + Sync,
    ) -> PyResult<HitArrays> {
        let workers = self.threads.for_items(rays.len())?;
        let mut chunks = Vec::new();
        rays.for_each_chunk(py, &workers, |_, rays| {
            chunks.try_reserve(1).map_err(|_| no_memory("hits"))?;
            chunks.push(py.detach(|| workers.run(|| list(rays, workers.are_several()))));
            Ok(())
        })?;
        let has_parts = self.parts.is_some();
        HitArrays::new(
            py,
            rays.len(),
            &chunks,
            &self.numbers(),
            has_parts,
            &workers,
        )
    }
}
