//! Lists of rays that are traced one after another.

use std::time::Instant;

use kd::Ray;

use crate::check::Answers;
use crate::measure;
use crate::rays::RayKind;
use crate::structure::{Manner, Structure};

/// Rays in the order of tracing; the kind of a list says whether any hit is enough.
#[derive(Clone, Debug, Default)]
pub(super) struct Batches(pub(super) Vec<(RayKind, Vec<Ray>)>);

impl Batches {
    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|(_, rays)| rays.len()).sum()
    }

    /// Seconds to trace everything on this thread, and the answers. `by` is the way to trace a list of this number.
    pub(super) fn trace(
        &self,
        structure: &dyn Structure,
        by: impl Fn(usize) -> Manner,
    ) -> (f64, Vec<Answers>) {
        let mut seconds = 0.0;
        let mut all = Vec::new();
        for (number, (kind, rays)) in self.0.iter().enumerate() {
            let mut answers = Answers::none(*kind, rays.len());
            let start = Instant::now();
            measure::trace(structure, by(number), rays, &mut answers, 1);
            seconds += start.elapsed().as_secs_f64();
            all.push(answers);
        }
        (seconds, all)
    }
}
