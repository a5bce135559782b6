//! A part of a run, for many machines.

use std::ops::Range;
use std::str::FromStr;

use anyhow::{Context, bail};

/// One of some equal parts, as `2/8`: counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shard {
    number: u32,
    count: u32,
}

impl Shard {
    /// All in one part.
    pub(super) const WHOLE: Self = Self {
        number: 1,
        count: 1,
    };

    pub(super) fn is_first(self) -> bool {
        self.number == 1
    }

    /// The rays of the part. Those of all parts follow each other.
    pub(super) fn of(self, rays: u64) -> Range<u64> {
        let end_of = |part: u32| {
            let end = u128::from(rays) * u128::from(part) / u128::from(self.count);
            u64::try_from(end).expect("at most all rays")
        };
        end_of(self.number - 1)..end_of(self.number)
    }
}

impl FromStr for Shard {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let numbers = text.split_once('/').context("expected a part such as 2/8");
        let (number, count) = numbers?;
        let (number, count) = (number.parse()?, count.parse()?);
        if number == 0 || number > count {
            bail!("`{text}`: parts are counted from 1 to their number");
        }
        Ok(Self { number, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_all_rays_in_order() {
        for rays in [0, 1, 7, 1000, u64::MAX] {
            for count in [1, 2, 3, 7, 1000] {
                let parts = (1..=count).map(|number| Shard { number, count }.of(rays));
                let mut end = 0;
                for part in parts {
                    assert_eq!(part.start, end, "{count} parts of {rays}");
                    let most = (rays / u64::from(count)).saturating_add(1);
                    assert!(part.end - part.start <= most, "{count} parts of {rays}");
                    end = part.end;
                }
                assert_eq!(end, rays, "{count} parts");
            }
        }
    }

    #[test]
    fn parts_parse_as_two_numbers() {
        let shard: Shard = "2/8".parse().expect("valid");
        assert_eq!((shard.number, shard.count), (2, 8));
        for bad in ["", "2", "0/8", "9/8", "1/0", "-1/2", "1/x"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
