//! Timing in pairs.

use std::convert::Infallible;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use kd::Ray;

use crate::check::Answers;
use crate::structure::{Manner, Structure};

/// Seconds of each repeat, and of the baseline just before it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pairs {
    pub(crate) own: Vec<f64>,
    pub(crate) baseline: Vec<f64>,
}

impl Pairs {
    /// Times without a baseline.
    pub(crate) const fn alone(own: Vec<f64>) -> Self {
        Self {
            own,
            baseline: Vec::new(),
        }
    }

    /// Both lists in another unit.
    pub(crate) fn scaled(&self, units_per_second: f64) -> (Vec<f64>, Vec<f64>) {
        let scale = |seconds: &[f64]| seconds.iter().map(|s| s * units_per_second).collect();
        (scale(&self.own), scale(&self.baseline))
    }
}

/// The number of pairs, at least one; no further pair begins after `until`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Repeats {
    pub(crate) pairs: usize,
    pub(crate) until: Duration,
}

impl Repeats {
    /// All pairs, however long they take.
    pub(crate) const fn all(pairs: usize) -> Self {
        Self {
            pairs,
            until: Duration::MAX,
        }
    }
}

/// Runs the baseline and then `own`, in turns. A machine that other programs slow down slows both of a pair, so their ratio is
/// stable where plain times are not. Results are dropped after the clock has stopped.
pub(crate) fn in_pairs<T, E>(
    repeats: Repeats,
    mut baseline: impl FnMut() -> Result<T, E>,
    mut own: impl FnMut() -> Result<T, E>,
) -> Result<Pairs, E> {
    timed_in_pairs(repeats, || seconds(&mut baseline), || seconds(&mut own))
}

/// [`in_pairs`] for work that cannot fail.
pub(crate) fn in_sure_pairs(
    repeats: Repeats,
    mut baseline: impl FnMut(),
    mut own: impl FnMut(),
) -> Pairs {
    let sure = |work: &mut dyn FnMut()| {
        work();
        Ok::<(), Infallible>(())
    };
    let Ok(pairs) = in_pairs(repeats, || sure(&mut baseline), || sure(&mut own));
    pairs
}

/// [`in_pairs`] for work that takes its own time and returns the seconds.
pub(crate) fn timed_in_pairs<E>(
    repeats: Repeats,
    mut baseline: impl FnMut() -> Result<f64, E>,
    mut own: impl FnMut() -> Result<f64, E>,
) -> Result<Pairs, E> {
    let mut pairs = Pairs::default();
    let start = Instant::now();
    while pairs.own.len() < repeats.pairs
        && (pairs.own.is_empty() || start.elapsed() < repeats.until)
    {
        pairs.baseline.push(baseline()?);
        pairs.own.push(own()?);
    }
    Ok(pairs)
}

/// Seconds of one run of `work`, without the drop of its result.
pub(crate) fn seconds<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<f64, E> {
    let start = Instant::now();
    let result = work()?;
    let seconds = start.elapsed().as_secs_f64();
    drop(result);
    Ok(seconds)
}

/// Rays that a thread takes at a time, if there are several threads.
const CHUNK: usize = 4096;

/// Traces all rays on `threads` threads.
pub(crate) fn trace(
    structure: &dyn Structure,
    by: Manner,
    rays: &[Ray],
    answers: &mut Answers,
    threads: usize,
) {
    match answers {
        Answers::Closest(hits) => in_chunks(rays, hits, threads, |rays, hits| {
            structure.closest(by, rays, hits);
        }),
        Answers::Any(hits) => in_chunks(rays, hits, threads, |rays, hits| {
            structure.any(by, rays, hits);
        }),
    }
}

/// Answers all questions on `threads` threads, some thousands at a time.
pub(crate) fn in_chunks<Q: Sync, T: Send>(
    questions: &[Q],
    answers: &mut [T],
    threads: usize,
    answer: impl Fn(&[Q], &mut [T]) + Sync,
) {
    if threads == 1 {
        return answer(questions, answers);
    }
    let queue = Mutex::new(questions.chunks(CHUNK).zip(answers.chunks_mut(CHUNK)));
    let next = || {
        queue
            .lock()
            .expect("no thread panics while it takes a chunk")
            .next()
    };
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((questions, answers)) = next() {
                    answer(questions, answers);
                }
            });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_baseline_runs_before_each_repeat() {
        let order = std::cell::RefCell::new(String::new());
        let note = |what| {
            order.borrow_mut().push(what);
            Ok::<(), ()>(())
        };
        let three = Repeats {
            pairs: 3,
            until: Duration::MAX,
        };
        let pairs = in_pairs(three, || note('b'), || note('o')).expect("neither fails");
        assert_eq!(*order.borrow(), "bobobo", "in pairs");
        assert_eq!(
            (pairs.own.len(), pairs.baseline.len()),
            (3, 3),
            "one time for each"
        );
        let no_time = Repeats {
            until: Duration::ZERO,
            ..three
        };
        let pairs = in_pairs(no_time, || note('b'), || note('o')).expect("neither fails");
        assert_eq!(pairs.own.len(), 1, "at least one pair");
    }

    #[test]
    fn chunks_cover_every_ray_once() {
        let rays: Vec<Ray> = (0..3 * CHUNK + 5)
            .map(|i| Ray::new([i as f32, 0.0, 0.0], [1.0, 0.0, 0.0]))
            .collect();
        for threads in [1, 2, 5] {
            let mut seen = vec![0.0; rays.len()];
            in_chunks(&rays, &mut seen, threads, |rays, seen| {
                for (ray, seen) in rays.iter().zip(seen) {
                    *seen += ray.origin.x + 1.0;
                }
            });
            let in_place = seen.iter().enumerate().all(|(i, x)| *x == i as f32 + 1.0);
            assert!(in_place, "with {threads} threads");
        }
    }
}
