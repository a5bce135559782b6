//! What a thread keeps of one batch for the next: memory, and what races have learned.
//!
//! A batch of a few thousand rays takes less time than the system needs to provide its memory, and ends before a race is decided.

use std::any::Any;
use std::cell::RefCell;

use kd_wide::WideTree;

thread_local! {
    /// One value of a type.
    static KEPT: RefCell<Vec<Box<dyn Any>>> = const { RefCell::new(Vec::new()) };
}

/// Takes what this thread keeps of a type.
pub(super) fn take<T: Any>() -> Option<Box<T>> {
    let taken = KEPT.try_with(|kept| {
        let mut kept = kept.borrow_mut();
        let place = kept.iter().position(|value| value.is::<T>())?;
        kept.swap_remove(place).downcast().ok()
    });
    taken.ok().flatten()
}

/// Keeps a value until it is [taken](take); unless the thread is about to end.
pub(super) fn keep<T: Any>(value: Box<T>) {
    // A value that is kept already would be found first.
    drop(take::<T>());
    let _ = KEPT.try_with(|kept| kept.borrow_mut().push(value));
}

/// Which tree a batch was traced through. Another tree may have the same identity later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    arrays: [usize; 2],
    lengths: [usize; 2],
}

impl Identity {
    pub(super) fn of(tree: &WideTree) -> Self {
        let (nodes, blocks) = (tree.nodes(), tree.blocks());
        Self {
            arrays: [nodes.as_ptr().addr(), blocks.as_ptr().addr()],
            lengths: [nodes.len(), blocks.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_value_of_a_type_is_kept() {
        assert_eq!(take::<u8>(), None);
        keep(Box::new(1_u8));
        keep(Box::new("other"));
        keep(Box::new(2_u8));
        assert_eq!(take::<u8>(), Some(Box::new(2)));
        assert_eq!(take::<u8>(), None);
        assert_eq!(take::<&str>(), Some(Box::new("other")));
    }
}
