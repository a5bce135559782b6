//! Which instructions a task is compiled for.

use std::fmt;

#[cfg(target_arch = "x86_64")]
use crate::Avx2;
use crate::{Portable, Simd, Task};

/// A set of CPU instructions. All levels give the same answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Level(Instructions);

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Instructions {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
}

impl Level {
    /// The fastest level of this processor: AVX2 on x86-64 processors that have it, otherwise [`portable`](Self::portable).
    ///
    /// Costs one load after the first call.
    #[inline]
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Avx2::detect() {
            return Self(Instructions::Avx2(avx2));
        }
        Self::portable()
    }

    /// The instructions that the whole program was compiled for. For tests and measurements.
    #[inline]
    pub const fn portable() -> Self {
        Self(Instructions::Portable)
    }

    /// The name in records: `portable` or `avx2`.
    pub const fn name(self) -> &'static str {
        match self.0 {
            Instructions::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(_) => "avx2",
        }
    }

    /// Runs a task, compiled for this level. `impl<S: Simd> Task<S>` is a task for every level.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn run<T, O>(self, task: T) -> O
    where
        T: Task<Portable, Output = O> + Task<Avx2, Output = O>,
    {
        match self.0 {
            // A call, so that the portable body does not fill the caller's stack and registers.
            Instructions::Portable => Portable.apart(task),
            Instructions::Avx2(avx2) => avx2.run(task),
        }
    }

    /// Runs a task, compiled for this level. `impl<S: Simd> Task<S>` is a task for every level.
    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    pub fn run<T, O>(self, task: T) -> O
    where
        T: Task<Portable, Output = O>,
    {
        match self.0 {
            Instructions::Portable => Portable.run(task),
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which instructions the task was compiled for, by the type of its lanes.
    struct LanesName;

    impl<S: Simd> Task<S> for LanesName {
        type Output = String;

        #[inline(always)]
        fn run(self, simd: S) -> String {
            format!("{simd:?}")
        }
    }

    #[test]
    fn a_task_runs_at_its_level() {
        assert_eq!(Level::portable().run(LanesName), "Portable", "portable");
        assert_eq!(Level::portable().to_string(), "portable", "its name");
        let fastest = Level::detect();
        assert_eq!(fastest, Level::detect(), "detection is stable");
        let lanes = fastest.run(LanesName).to_lowercase();
        assert!(lanes.starts_with(fastest.name()), "{lanes} at {fastest}");
    }
}
