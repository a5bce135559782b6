//! The stack of children that a ray visits later.
#![allow(
    unsafe_code,
    reason = "the memory is written eight values at a time and never cleared, which would take as long as a node"
)]
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "a read of an entry needs two: it is within the array, and it was written"
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

/// Children to visit, each with the distance at which the ray enters its box. The next one is last.
pub(crate) struct Pending<'a> {
    stack: &'a mut Stack,
    /// The entries below it are written. Not in the memory of the stack, so that it stays in a register.
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

    /// The first `len` entries, as an earlier [`Pending`] left them.
    ///
    /// # Safety
    ///
    /// At least `len` entries of this stack have been written.
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
    /// If the stack is full: in a tree that is deeper than [`MAX_LEVELS`].
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

    /// Pushes the first `count` entries of the room.
    ///
    /// # Safety
    ///
    /// `count` entries have been written, at most eight.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The next child, at any distance, which stays.
    ///
    /// # Panics
    ///
    /// If nothing is pending.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn last(&self) -> Child {
        assert!(self.len > 0, "something is pending");
        // SAFETY: entries below `len` are written, so it is within the array.
        unsafe { self.stack.child.get_unchecked(self.len - 1).assume_init() }
    }

    /// The next child, at any distance.
    ///
    /// # Panics
    ///
    /// If nothing is pending.
    #[inline(always)]
    pub(crate) fn pop_last(&mut self) -> Child {
        assert!(self.len > 0, "something is pending");
        self.len -= 1;
        // SAFETY: entries below the old `len` are written, so it is within the array.
        unsafe { self.stack.child.get_unchecked(self.len).assume_init() }
    }

    /// The next child, at any distance; `None` if nothing is pending.
    #[inline(always)]
    pub(crate) fn pop_any(&mut self) -> Option<Child> {
        (self.len > 0).then(|| self.pop_last())
    }

    /// The next child whose box the ray enters at `limit` or before. Drops those above it.
    #[inline(always)]
    pub(crate) fn pop(&mut self, limit: f32) -> Option<Child> {
        while self.len > 0 {
            self.len -= 1;
            // SAFETY: entries below the old `len` are written, so it is within the array.
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
