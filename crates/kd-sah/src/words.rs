//! Build options as words, for files.

use kd_core::{CostModel, Layout};

use crate::options::{BuildError, BuildOptions, Method, WideNodes};

impl BuildOptions {
    /// The number of words of [`to_words`](Self::to_words).
    pub const WORDS: usize = 24;

    /// All options but the number of threads, which is that of a machine.
    pub fn to_words(&self) -> [u32; Self::WORDS] {
        let (method, [first, second]) = match self.method {
            Method::Median => (0, [0, 0]),
            Method::Naive => (1, [0, 0]),
            Method::Resort => (2, [0, 0]),
            Method::Sweep => (3, [0, 0]),
            Method::Exact => (4, [0, 0]),
            Method::Binned { bins } => (5, [bins.into(), 0]),
            Method::Sampled { all_axes } => (6, [all_axes.into(), 0]),
            Method::Hybrid { bins, exact_below } => (7, [bins.into(), exact_below]),
        };
        let wide_nodes = match self.wide_nodes() {
            WideNodes::Objects => 0,
            WideNodes::Planes => 1,
            WideNodes::Cheapest => 2,
            WideNodes::KdTree => 3,
        };
        let max_refs = self.max_refs.unwrap_or(0);
        let mut words = [0; Self::WORDS];
        words[..20].copy_from_slice(&[
            method,
            first,
            second,
            u32::from(self.layout() == Layout::Binary),
            wide_nodes,
            self.cost.traverse.to_bits(),
            self.cost.intersect.to_bits(),
            self.cost.lanes,
            self.cost.empty_bonus.to_bits(),
            self.max_depth.is_some().into(),
            self.max_depth.unwrap_or(0),
            self.max_refs.is_some().into(),
            low(max_refs),
            low(max_refs >> 32),
            self.small_leaf,
            self.bad_refines,
            self.retraction.into(),
            self.median_levels,
            self.longest_axis.into(),
            self.plane_adjustment.to_bits(),
        ]);
        words
    }

    /// The options of [`to_words`](Self::to_words), with the default number of threads.
    ///
    /// # Errors
    ///
    /// [`BuildError::InvalidOption`] names the first option that is out of range.
    pub fn from_words(words: &[u32; Self::WORDS]) -> Result<Self, BuildError> {
        let invalid = |name| BuildError::InvalidOption {
            name,
            rule: "one that this version has",
        };
        let is = |place: usize, name| match words[place] {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(invalid(name)),
        };
        let number = |place: usize| f32::from_bits(words[place]);
        let bins = u16::try_from(words[1]).map_err(|_| invalid("bins"));
        let method = match words[0] {
            0 => Method::Median,
            1 => Method::Naive,
            2 => Method::Resort,
            3 => Method::Sweep,
            4 => Method::Exact,
            5 => Method::Binned { bins: bins? },
            6 => Method::Sampled {
                all_axes: is(1, "all_axes")?,
            },
            7 => Method::Hybrid {
                bins: bins?,
                exact_below: words[2],
            },
            _ => return Err(invalid("method")),
        };
        let wide_nodes = match words[4] {
            0 => WideNodes::Objects,
            1 => WideNodes::Planes,
            2 => WideNodes::Cheapest,
            3 => WideNodes::KdTree,
            _ => return Err(invalid("wide_nodes")),
        };
        let layout = if is(3, "layout")? {
            Layout::Binary
        } else {
            Layout::Wide
        };
        let options = Self {
            method,
            layout,
            wide_nodes,
            cost: CostModel {
                traverse: number(5),
                intersect: number(6),
                lanes: words[7],
                empty_bonus: number(8),
            },
            max_depth: is(9, "max_depth")?.then_some(words[10]),
            max_refs: is(11, "max_refs")?
                .then_some(u64::from(words[12]) | u64::from(words[13]) << 32),
            small_leaf: words[14],
            bad_refines: words[15],
            retraction: is(16, "retraction")?,
            median_levels: words[17],
            longest_axis: is(18, "longest_axis")?,
            plane_adjustment: number(19),
            threads: Self::balanced().threads,
        };
        options.check()?;
        Ok(options)
    }
}

/// The lower half.
#[allow(clippy::cast_possible_truncation, reason = "the upper half is apart")]
fn low(number: u64) -> u32 {
    number as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_survive_as_words() {
        let bases = [
            BuildOptions::fast(),
            BuildOptions::balanced(),
            BuildOptions::best(),
        ];
        let methods = [
            Method::Median,
            Method::Naive,
            Method::Resort,
            Method::Sweep,
            Method::Exact,
            Method::Binned { bins: 17 },
            Method::Sampled { all_axes: true },
            Method::Sampled { all_axes: false },
            Method::Hybrid {
                bins: 33,
                exact_below: 5,
            },
        ];
        let all = bases.iter().cloned().chain(methods.map(|method| {
            BuildOptions::best()
                .with_method(method)
                .with_cost(CostModel::CLASSIC)
                .with_layout(Layout::Binary)
                .with_max_depth(7)
                .with_max_refs(5_000_000_000)
                .with_small_leaf(3)
                .with_bad_refines(2)
                .with_retraction(false)
                .with_median_levels(4)
                .with_longest_axis(true)
                .with_plane_adjustment(0.25)
        }));
        for options in all {
            let words = options.to_words();
            assert_eq!(BuildOptions::from_words(&words), Ok(options.clone()));
            let on_threads = options.clone().with_threads(3).to_words();
            assert_eq!(on_threads, words, "threads are those of a machine");
        }
    }

    #[test]
    fn words_of_no_options_are_refused() {
        let words = BuildOptions::balanced().to_words();
        for (place, word, name) in [
            (0, 8, "method"),
            (1, 70_000, "bins"),
            (1, 1, "bins"),
            (3, 2, "layout"),
            (4, 4, "wide_nodes"),
            (6, f32::NAN.to_bits(), "cost.intersect"),
            (9, 2, "max_depth"),
            (16, 2, "retraction"),
            (19, 2.0_f32.to_bits(), "plane_adjustment"),
        ] {
            let mut words = words;
            words[place] = word;
            match BuildOptions::from_words(&words) {
                Err(BuildError::InvalidOption { name: found, .. }) => assert_eq!(found, name),
                other => panic!("word {place}: {other:?}"),
            }
        }
    }
}
