//! Arrays in pages that know when they were written, so that an old copy catches up by copying those pages.

use std::ops::{Deref, Range};
use std::sync::atomic::{AtomicU64, Ordering};

use kd_buffer::{Buffer, BufferMut, advise_large_pages};

/// Elements of a page: 16 KiB of nodes.
const PAGE: usize = 64;

/// The number of a state of a forest. No other state in the process has it; a later state has a larger number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct State(u64);

impl State {
    /// Before every state.
    pub(crate) const NONE: Self = Self(0);

    pub(crate) fn next() -> Self {
        static LAST: AtomicU64 = AtomicU64::new(0);
        Self(LAST.fetch_add(1, Ordering::Relaxed) + 1)
    }
}

/// An array whose changes are recorded by page.
#[derive(Clone, Debug)]
pub(crate) struct Paged<T: Copy> {
    all: Buffer<T>,
    /// The state in which each page was last written. Pages beyond were written before every state.
    written: Vec<State>,
}

impl<T: Copy> Paged<T> {
    pub(crate) const fn new() -> Self {
        Self {
            all: Buffer::new(),
            written: Vec::new(),
        }
    }

    /// Written before every state.
    pub(crate) fn of(all: impl Into<Buffer<T>>) -> Self {
        Self {
            all: all.into(),
            written: Vec::new(),
        }
    }

    fn note(&mut self, range: &Range<usize>, at: State) {
        if range.is_empty() {
            return;
        }
        let pages = range.start / PAGE..range.end.div_ceil(PAGE);
        if self.written.len() < pages.end {
            self.written.resize(pages.end, State::NONE);
        }
        self.written[pages].fill(at);
    }
}

impl<T: Copy> Paged<T> {
    pub(crate) fn truncate(&mut self, len: usize) {
        self.all.to_mut().truncate(len);
    }

    /// Reserves memory for this many more elements.
    pub(crate) fn reserve(&mut self, more: usize) {
        with_room_for(&mut self.all, more);
    }

    /// Some elements, to write.
    ///
    /// # Panics
    ///
    /// If they are not all there.
    pub(crate) fn write(&mut self, range: Range<usize>, at: State) -> &mut [T] {
        self.note(&range, at);
        &mut self.all[range]
    }

    /// Disjoint ranges of elements, to write.
    ///
    /// # Panics
    ///
    /// If two ranges overlap, or elements are not there.
    pub(crate) fn write_each(&mut self, ranges: &[Range<usize>], at: State) -> Vec<&mut [T]> {
        for range in ranges {
            self.note(range, at);
        }
        let mut order: Vec<usize> = (0..ranges.len()).collect();
        // An empty range may begin where another one does.
        order.sort_by_key(|place| (ranges[*place].start, ranges[*place].end));
        let mut parts: Vec<&mut [T]> = Vec::new();
        parts.resize_with(ranges.len(), || &mut []);
        let (mut rest, mut next) = (&mut self.all[..], 0);
        for place in order {
            let range = &ranges[place];
            assert!(range.start >= next, "each member is refitted once");
            rest = &mut rest[range.start - next..];
            (parts[place], rest) = rest.split_at_mut(range.len());
            next = range.end;
        }
        parts
    }

    /// Writes elements from `start` on, in place of others or behind the last one.
    ///
    /// # Panics
    ///
    /// If `start` is beyond the end.
    pub(crate) fn put(&mut self, start: usize, elements: &[T], at: State) {
        self.note(&(start..start + elements.len()), at);
        let replaced = elements.len().min(self.all.len() - start);
        self.all[start..start + replaced].copy_from_slice(&elements[..replaced]);
        let added = &elements[replaced..];
        with_room_for(&mut self.all, added.len()).extend_from_slice(added);
    }

    /// [`put`](Self::put) with elements of this array, which are not among those that it replaces.
    pub(crate) fn put_again(&mut self, start: usize, elements: Range<usize>, at: State) {
        self.note(&(start..start + elements.len()), at);
        let replaced = elements.start..elements.end.min(elements.start + self.all.len() - start);
        let added = replaced.end..elements.end;
        self.all.copy_within(replaced, start);
        with_room_for(&mut self.all, added.len()).extend_from_within(added);
    }

    /// Moves elements down to `start`, over others.
    pub(crate) fn move_down(&mut self, range: Range<usize>, start: usize, at: State) {
        if start < range.start {
            self.note(&(start..start + range.len()), at);
            self.all.copy_within(range, start);
        }
    }

    /// Makes this array, which was equal to `with` in the state `since`, equal to `with` again.
    pub(crate) fn catch_up(&mut self, with: &Self, since: State) {
        let len = with.all.len();
        self.truncate(len);
        let kept = self.all.len();
        for (page, written) in with.written.iter().enumerate() {
            let range = page * PAGE..kept.min((page + 1) * PAGE);
            if *written > since && range.start < range.end {
                self.all[range.clone()].copy_from_slice(&with.all[range]);
            }
        }
        with_room_for(&mut self.all, len - kept).extend_from_slice(&with.all[kept..]);
        self.written.clone_from(&with.written);
    }
}

impl<T: Copy> Deref for Paged<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.all
    }
}

/// The elements, with memory for more: an eighth more than needed. (Doubling would waste as much memory as a large static scene takes.)
fn with_room_for<T: Copy>(all: &mut Buffer<T>, more: usize) -> BufferMut<'_, T> {
    let mut all = all.to_mut();
    let len = all.len() + more;
    if len > all.capacity() {
        all.reserve_exact(more + len / 8);
        advise_large_pages(&all);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_copy_catches_up() {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut array = Paged::<u32>::new();
        let mut since = State::next();
        let mut old = array.clone();
        let (mut copied, mut pages) = (0, 0);
        for round in 0..2000 {
            let at = State::next();
            for _ in 0..rng.usize(0..4) {
                let start = rng.usize(0..=array.len());
                let numbers: Vec<u32> = (0..rng.usize(0..100)).map(|_| rng.u32(..)).collect();
                match rng.u32(0..7) {
                    0 if start + 200 > array.len() && array.len() > 5000 => array.truncate(start),
                    1 => {
                        let end = rng.usize(start..=array.len().min(start + 100));
                        array.write(start..end, at).fill(round);
                    }
                    2 => array.move_down(start..array.len().min(start + 50), start / 2, at),
                    _ => array.put(start, &numbers, at),
                }
            }
            if rng.u32(0..3) == 0 {
                copied += array.written.iter().filter(|page| **page > since).count();
                pages += array.written.len();
                old.catch_up(&array, since);
                assert_eq!(old.all, array.all, "round {round}");
                since = at;
            }
        }
        assert!(copied < pages / 2, "{copied} of {pages} pages copied");
    }

    #[test]
    fn elements_are_put_again_in_place_and_behind() {
        let mut array = Paged::of(Vec::from_iter(0..10));
        array.put_again(8, 1..4, State::next());
        assert_eq!(array[..], [0, 1, 2, 3, 4, 5, 6, 7, 1, 2, 3]);
        array.put_again(0, 9..11, State::next());
        assert_eq!(array[..], [2, 3, 2, 3, 4, 5, 6, 7, 1, 2, 3]);
        array.put_again(11, 0..2, State::next());
        assert_eq!(array[11..], [2, 3]);
    }

    #[test]
    fn ranges_in_any_order_are_disjoint() {
        let mut array = Paged::of(Vec::from_iter(0..10));
        let parts = array.write_each(&[7..9, 2..2, 2..5], State::next());
        assert_eq!(parts, [&mut [7, 8][..], &mut [], &mut [2, 3, 4]]);
    }

    #[test]
    #[should_panic(expected = "each member is refitted once")]
    fn overlapping_ranges_are_refused() {
        Paged::of(vec![0; 10]).write_each(&[2..5, 4..6], State::next());
    }
}
