//! Children to visit later.
#![allow(
    unsafe_code,
    reason = "memory that is written eight values at a time, and never cleared: that would take as long as a node"
)]
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "to read an entry is two: that it is there, and that it was written"
)]

use std::mem::MaybeUninit;

use kd_wide::{Child, MAX_LEVELS, WIDTH};

/// All but one of the children on each level of a path.
const MOST: usize = MAX_LEVELS * (WIDTH - 1);

/// Memory for [`Pending`].
pub(crate) struct Stack {
    enter: [MaybeUninit<f32>; MOST + WIDTH],
    child: [MaybeUninit<Child>; MOST + WIDTH],
}

/// Children to visit, with where the ray enters their boxes; the next one last.
pub(crate) struct Pending<'a> {
    stack: &'a mut Stack,
    /// Entries below it have been written. Apart from the memory, so that it stays in a register.
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            enter: [const { MaybeUninit::uninit() }; MOST + WIDTH],
            child: [const { MaybeUninit::uninit() }; MOST + WIDTH],
        }
    }

    /// What was pending when it was left.
    ///
    /// # Safety
    ///
    /// So many entries of this stack have been written, or more.
    #[inline(always)]
    pub(crate) unsafe fn resume(&mut self, len: usize) -> Pending<'_> {
        Pending { stack: self, len }
    }

    /// No children.
    #[inline(always)]
    pub(crate) fn pending(&mut self) -> Pending<'_> {
        Pending {
            stack: self,
            len: 0,
        }
    }
}

impl Pending<'_> {
    #[inline(always)]
    pub(crate) fn push(&mut self, enter: f32, child: Child) {
        self.stack.enter[self.len].write(enter);
        self.stack.child[self.len].write(child);
        self.len += 1;
    }

    /// Room for eight more entries.
    ///
    /// # Panics
    ///
    /// If there is none left, in a tree deeper than any.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn room(&mut self) -> (*mut f32, *mut Child) {
        assert!(self.len <= MOST, "a tree has at most {MAX_LEVELS} levels");
        // SAFETY: `len` is within the array.
        let enter = unsafe { self.stack.enter.as_mut_ptr().add(self.len) };
        // SAFETY: the same.
        let child = unsafe { self.stack.child.as_mut_ptr().add(self.len) };
        (enter.cast(), child.cast())
    }

    /// Takes the first entries of the room for pushed.
    ///
    /// # Safety
    ///
    /// So many have been written, at most eight.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The next child, wherever the ray enters its box.
    ///
    /// # Panics
    ///
    /// If there is none.
    #[inline(always)]
    pub(crate) fn pop_last(&mut self) -> Child {
        assert!(self.len > 0, "something is pending");
        self.len -= 1;
        // SAFETY: entries below what was `len` have been written, so there are that many.
        unsafe { self.stack.child.get_unchecked(self.len).assume_init() }
    }

    /// The next child whose box the ray enters no later than at `limit`; others before it are dropped.
    #[inline(always)]
    pub(crate) fn pop(&mut self, limit: f32) -> Option<Child> {
        while self.len > 0 {
            self.len -= 1;
            // SAFETY: entries below `len` have been written, so there are that many.
            let enter = unsafe { self.stack.enter.get_unchecked(self.len).assume_init() };
            if enter <= limit {
                // SAFETY: the same.
                let child = unsafe { self.stack.child.get_unchecked(self.len).assume_init() };
                return Some(child);
            }
        }
        None
    }
}
