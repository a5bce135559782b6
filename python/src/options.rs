//! Options of builds, by name.

use kd::{BuildOptions, Layout};
use pyo3::prelude::*;

use crate::errors::wrong_value;

/// A preset and a layout, with the names that they have in Python.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    pub(crate) preset: &'static str,
    pub(crate) layout: &'static str,
}

impl Options {
    /// The names of the options of a file; the preset is "custom" if it is none of those here.
    pub(crate) fn of(options: &BuildOptions) -> Self {
        let (preset, layout) = (options.clone(), options.layout());
        let presets = [
            ("fast", BuildOptions::fast()),
            ("balanced", BuildOptions::balanced()),
            ("best", BuildOptions::best()),
        ];
        let is_same = |known: &BuildOptions| {
            known.clone().with_layout(layout).to_words() == preset.to_words()
        };
        let known = presets.iter().find(|(_, known)| is_same(known));
        Self {
            preset: known.map_or("custom", |(name, _)| *name),
            layout: match layout {
                Layout::Binary => "binary",
                _ => "wide",
            },
        }
    }

    pub(crate) fn new(preset: &str, layout: &str) -> PyResult<Self> {
        let known = |argument, name: &str, all: [&'static str; 3]| {
            all.into_iter()
                .find(|known| *known == name && !known.is_empty())
                .ok_or_else(|| {
                    let all: Vec<String> = all
                        .iter()
                        .filter(|name| !name.is_empty())
                        .map(|name| format!("{name:?}"))
                        .collect();
                    let all = all.join(", ");
                    wrong_value(
                        argument,
                        format_args!("expected one of {all}, got {name:?}"),
                    )
                })
        };
        Ok(Self {
            preset: known("preset", preset, ["fast", "balanced", "best"])?,
            layout: known("layout", layout, ["wide", "binary", ""])?,
        })
    }

    /// The options of the library. They use the threads in scope, or the calling thread.
    pub(crate) fn build(self, is_parallel: bool) -> BuildOptions {
        let options = match self.preset {
            "fast" => BuildOptions::fast(),
            "best" => BuildOptions::best(),
            _ => BuildOptions::balanced(),
        };
        let layout = match self.layout {
            "binary" => Layout::Binary,
            _ => Layout::Wide,
        };
        options
            .with_layout(layout)
            .with_threads(usize::from(!is_parallel))
    }
}
