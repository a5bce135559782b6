//! Room: places in an array that nothing uses.

use std::collections::{BTreeMap, BTreeSet};

/// Ranges that are free, apart from each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Room {
    /// The length of each, by its start.
    lengths: BTreeMap<usize, usize>,
    /// The lengths and starts.
    by_length: BTreeSet<(usize, usize)>,
    /// The sum of all lengths.
    free: usize,
}

impl Room {
    /// The number of free places.
    pub(crate) fn free(&self) -> usize {
        self.free
    }

    /// The number of ranges.
    pub(crate) fn ranges(&self) -> usize {
        self.lengths.len()
    }

    /// Frees a range, which unites with those beside it.
    pub(crate) fn give(&mut self, start: usize, length: usize) {
        if length == 0 {
            return;
        }
        let (mut start, mut length) = (start, length);
        let before = self.lengths.range(..start).next_back();
        let before = before.map(|(start, length)| (*start, *length));
        if let Some((first, count)) = before.filter(|(first, count)| first + count == start) {
            self.remove(first, count);
            (start, length) = (first, count + length);
        }
        if let Some(count) = self.lengths.get(&(start + length)).copied() {
            self.remove(start + length, count);
            length += count;
        }
        self.add(start, length);
    }

    /// Takes `length` places of the shortest range that has as many. Returns the first one.
    pub(crate) fn take(&mut self, length: usize) -> Option<usize> {
        if length == 0 {
            return None;
        }
        let (count, start) = *self.by_length.range((length, 0)..).next()?;
        self.remove(start, count);
        if count > length {
            self.add(start + length, count - length);
        }
        Some(start)
    }

    /// Drops the range that ends at `end`, if there is one. Returns its start, or `end`.
    pub(crate) fn trim(&mut self, end: usize) -> usize {
        let last = self.lengths.last_key_value();
        let last = last.map(|(start, length)| (*start, *length));
        match last.filter(|(start, length)| start + length == end) {
            Some((start, length)) => {
                self.remove(start, length);
                start
            }
            None => end,
        }
    }

    fn add(&mut self, start: usize, length: usize) {
        self.lengths.insert(start, length);
        self.by_length.insert((length, start));
        self.free += length;
    }

    fn remove(&mut self, start: usize, length: usize) {
        self.lengths.remove(&start);
        self.by_length.remove(&(length, start));
        self.free -= length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_unite_and_divide() {
        let mut room = Room::default();
        for (start, length) in [(10, 5), (20, 5), (15, 5), (40, 2)] {
            room.give(start, length);
        }
        assert_eq!((room.free(), room.ranges()), (17, 2), "10..25 and 40..42");
        assert_eq!(room.take(2), Some(40), "the shortest that is long enough");
        assert_eq!(room.take(4), Some(10), "the other one");
        assert_eq!(room.take(12), None, "11 are left");
        assert_eq!(room.trim(30), 30, "14..25 does not end there");
        assert_eq!(
            (room.trim(25), room.free(), room.ranges()),
            (14, 0, 0),
            "all"
        );
    }

    #[test]
    fn no_place_is_given_twice() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut room = Room::default();
        let mut end = 0;
        let mut used: Vec<(usize, usize)> = Vec::new();
        for _ in 0..5000 {
            if rng.bool() || used.is_empty() {
                let length = rng.usize(1..9);
                let start = room.take(length).unwrap_or_else(|| {
                    end += length;
                    end - length
                });
                let mut others = used.iter();
                assert!(
                    others.all(|(first, count)| start + length <= *first || first + count <= start),
                    "{start}, {length}"
                );
                used.push((start, length));
            } else {
                let (start, length) = used.swap_remove(rng.usize(0..used.len()));
                room.give(start, length);
                if rng.u32(0..8) == 0 {
                    end = room.trim(end);
                }
            }
            let in_use: usize = used.iter().map(|(_, length)| length).sum();
            assert_eq!(in_use + room.free(), end, "every place is used or free");
        }
    }
}
