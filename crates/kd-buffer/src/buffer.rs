//! The array, its two kinds of memory, and its change of kind.
#![allow(
    unsafe_code,
    reason = "rays read an array by one pointer, whichever kind of memory it is in; an enum of the two would cost a branch a node"
)]

use std::fmt;
use std::mem::ManuallyDrop;
use std::ops::{Deref, DerefMut, Range};
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::ptr::NonNull;
use std::sync::Arc;

use bytemuck::Pod;

/// Bytes that outlive the buffers that refer to them.
type Keeper = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// Elements in memory of their own, or in bytes that something else keeps. Reads as a slice in either case.
///
/// A clone of a buffer with memory of its own copies it; a clone of a shared one shares.
pub struct Buffer<T> {
    /// Valid for reads of `len` elements as long as `memory` lives.
    start: NonNull<T>,
    len: usize,
    memory: Memory,
}

/// What keeps the elements of a buffer.
enum Memory {
    /// They are those of a [`Vec`] of this capacity, which the buffer takes the place of.
    Own { capacity: usize },
    /// They are among these bytes, which do not change or move.
    Shared(Keeper),
}

/// The reason why bytes are not elements of a type.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NotElements {
    /// The range is not within the bytes.
    OutOfRange {
        /// The range.
        range: Range<usize>,
        /// The number of bytes.
        bytes: usize,
    },
    /// The address of the first byte is not a multiple of the alignment of an element.
    Misaligned {
        /// The range.
        range: Range<usize>,
        /// The alignment, in bytes.
        alignment: usize,
    },
    /// The length of the range is not a multiple of that of an element.
    PartOfElement {
        /// The range.
        range: Range<usize>,
        /// Bytes of an element.
        element: usize,
    },
}

impl fmt::Display for NotElements {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::OutOfRange { range, .. }
        | Self::Misaligned { range, .. }
        | Self::PartOfElement { range, .. }) = self;
        write!(f, "bytes {} to {} are not ", range.start, range.end)?;
        match self {
            Self::OutOfRange { bytes, .. } => write!(f, "among {bytes} bytes"),
            Self::Misaligned { alignment, .. } => write!(f, "at a multiple of {alignment}"),
            Self::PartOfElement { element, .. } => write!(f, "whole elements of {element} bytes"),
        }
    }
}

impl std::error::Error for NotElements {}

// SAFETY: a buffer is a vector of elements, or a shared slice of them with a keeper that is `Send` and `Sync`.
unsafe impl<T: Send + Sync> Send for Buffer<T> {}
// SAFETY: the same. It has no way to change elements through a shared reference.
unsafe impl<T: Send + Sync> Sync for Buffer<T> {}

// A buffer never calls its keeper again, and shows nothing of it but bytes that do not change.
impl<T: RefUnwindSafe> UnwindSafe for Buffer<T> {}
impl<T: RefUnwindSafe> RefUnwindSafe for Buffer<T> {}

impl<T> Buffer<T> {
    /// No elements.
    pub const fn new() -> Self {
        Self {
            start: NonNull::dangling(),
            len: 0,
            memory: Memory::Own { capacity: 0 },
        }
    }

    /// Whether the elements are in bytes that something else keeps.
    pub fn is_shared(&self) -> bool {
        matches!(self.memory, Memory::Shared(_))
    }
}

impl<T: Pod> Buffer<T> {
    /// The elements whose bytes are at `range` of `bytes`, which are not copied. In the byte order of this machine.
    ///
    /// # Errors
    ///
    /// [`NotElements`] if the range is not within the bytes, or does not consist of whole, aligned elements.
    pub fn shared<K>(bytes: &Arc<K>, range: Range<usize>) -> Result<Self, NotElements>
    where
        K: AsRef<[u8]> + Send + Sync + 'static,
    {
        let all = (**bytes).as_ref();
        let Some(own) = all.get(range.clone()) else {
            let bytes = all.len();
            return Err(NotElements::OutOfRange { range, bytes });
        };
        let elements: &[T] = match bytemuck::try_cast_slice(own) {
            Ok(elements) => elements,
            Err(bytemuck::PodCastError::TargetAlignmentGreaterAndInputNotAligned) => {
                let alignment = align_of::<T>();
                return Err(NotElements::Misaligned { range, alignment });
            }
            Err(_) => {
                let element = size_of::<T>();
                return Err(NotElements::PartOfElement { range, element });
            }
        };
        // The bytes were borrowed from the value in the `Arc`. That value stays where it is, and nobody can get it out or borrow it
        // mutably, while the buffer holds another `Arc` of it. So the borrow may last as long as the buffer.
        Ok(Self {
            start: NonNull::from(elements).cast(),
            len: elements.len(),
            memory: Memory::Shared(Arc::<K>::clone(bytes)),
        })
    }
}

impl<T: Copy> Buffer<T> {
    /// The elements as a vector, to change. Shared elements are copied first.
    pub fn to_mut(&mut self) -> BufferMut<'_, T> {
        let elements = std::mem::take(self).into_vec();
        BufferMut { elements, to: self }
    }

    /// The elements as a vector. Shared elements are copied.
    pub fn into_vec(self) -> Vec<T> {
        let buffer = ManuallyDrop::new(self);
        match &buffer.memory {
            Memory::Own { capacity } => {
                // SAFETY: these are the parts of a vector, by `From`. It is not used or dropped elsewhere.
                unsafe { Vec::from_raw_parts(buffer.start.as_ptr(), buffer.len, *capacity) }
            }
            Memory::Shared(_) => {
                let copy = buffer.to_vec();
                drop(ManuallyDrop::into_inner(buffer));
                copy
            }
        }
    }
}

/// The elements of a [`Buffer`] as a vector; becomes the buffer again when it is dropped.
#[derive(Debug)]
pub struct BufferMut<'a, T> {
    elements: Vec<T>,
    to: &'a mut Buffer<T>,
}

impl<T> Deref for BufferMut<'_, T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.elements
    }
}

impl<T> DerefMut for BufferMut<'_, T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.elements
    }
}

impl<T> Drop for BufferMut<'_, T> {
    fn drop(&mut self) {
        *self.to = std::mem::take(&mut self.elements).into();
    }
}

impl<T> From<Vec<T>> for Buffer<T> {
    fn from(elements: Vec<T>) -> Self {
        let mut elements = ManuallyDrop::new(elements);
        Self {
            len: elements.len(),
            memory: Memory::Own {
                capacity: elements.capacity(),
            },
            start: NonNull::new(elements.as_mut_ptr()).expect("a vector has an address"),
        }
    }
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        if let Memory::Own { capacity } = self.memory {
            // SAFETY: these are the parts of a vector, by `From`. Nothing uses them after this.
            drop(unsafe { Vec::from_raw_parts(self.start.as_ptr(), self.len, capacity) });
        }
    }
}

impl<T> Deref for Buffer<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: by the invariant of `start`.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Buffer<T>
where
    T: Copy,
{
    /// Copies shared elements first.
    fn deref_mut(&mut self) -> &mut [T] {
        if self.is_shared() {
            *self = self.to_vec().into();
        }
        // SAFETY: the elements are those of a vector of this buffer alone.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl<T: Copy> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        match &self.memory {
            Memory::Own { .. } => self.to_vec().into(),
            Memory::Shared(keeper) => Self {
                memory: Memory::Shared(Arc::clone(keeper)),
                ..*self
            },
        }
    }

    /// Reuses memory of its own.
    fn clone_from(&mut self, from: &Self) {
        if from.is_shared() {
            *self = from.clone();
        } else {
            let mut own = self.to_mut();
            own.clear();
            own.extend_from_slice(from);
        }
    }
}

impl<T> Default for Buffer<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: fmt::Debug> fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<T: PartialEq> PartialEq for Buffer<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Eq> Eq for Buffer<T> {}

impl<T> FromIterator<T> for Buffer<T> {
    fn from_iter<I: IntoIterator<Item = T>>(elements: I) -> Self {
        Vec::from_iter(elements).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes at a multiple of eight, which count who keeps them.
    struct Bytes(Vec<u64>);

    impl AsRef<[u8]> for Bytes {
        fn as_ref(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
    }

    fn bytes() -> Arc<Bytes> {
        Arc::new(Bytes(vec![1 | 2 << 32, 3 | 4 << 32]))
    }

    #[test]
    fn shared_elements_are_those_of_the_bytes() {
        let bytes = bytes();
        let words = Buffer::<u32>::shared(&bytes, 4..16).expect("aligned");
        let second = words.clone();
        let address = bytes.as_ref().as_ref()[4..].as_ptr();
        assert!(words.is_shared() && words.as_ptr().cast() == address);
        assert_eq!(Arc::strong_count(&bytes), 3, "two buffers keep the bytes");
        drop(bytes);
        let expected: &[u32] = if cfg!(target_endian = "little") {
            &[2, 3, 4]
        } else {
            &[1, 4, 3]
        };
        assert_eq!((&*words, &*second), (expected, expected), "they live on");
    }

    #[test]
    fn bytes_that_are_not_elements_are_refused() {
        let bytes = bytes();
        for (range, message) in [
            (8..20, "bytes 8 to 20 are not among 16 bytes"),
            (2..6, "bytes 2 to 6 are not at a multiple of 4"),
            (4..10, "bytes 4 to 10 are not whole elements of 4 bytes"),
        ] {
            let error = Buffer::<u32>::shared(&bytes, range).expect_err(message);
            assert_eq!(error.to_string(), message);
        }
        #[allow(clippy::reversed_empty_ranges, reason = "of a damaged file")]
        let backwards = Buffer::<u32>::shared(&bytes, 8..4);
        assert!(backwards.is_err(), "it ends before it begins");
    }

    #[test]
    fn a_change_of_shared_elements_changes_a_copy() {
        let bytes = bytes();
        let words = Buffer::<u32>::shared(&bytes, 0..16).expect("aligned");
        let mut pushed = words.clone();
        pushed.to_mut().push(9);
        let mut written = words.clone();
        written[0] = 7;
        assert_eq!((pushed.len(), pushed[4]), (5, 9));
        assert_eq!(written[0], 7);
        assert!(!pushed.is_shared() && !written.is_shared() && words.is_shared());
        assert_eq!(bytes.0[1], 3 | 4 << 32, "the bytes stay");
    }

    #[test]
    fn own_elements_keep_their_memory() {
        let mut buffer = Buffer::from(Vec::<u32>::with_capacity(100));
        let address = buffer.as_ptr();
        buffer.to_mut().extend(0..100);
        let copy = Buffer::from(vec![5, 6]);
        buffer.clone_from(&copy);
        assert_eq!((buffer.as_ptr(), &buffer[..]), (address, &[5, 6][..]));
        buffer[1] = 8;
        assert_eq!(buffer.into_vec(), [5, 8]);
        assert_eq!(Buffer::<u32>::new().into_vec(), []);
    }

    #[test]
    fn a_change_that_panics_keeps_what_was_done() {
        let mut buffer = Buffer::from(vec![1, 2]);
        let change = std::panic::AssertUnwindSafe(|| {
            let mut elements = buffer.to_mut();
            elements.push(3);
            panic!("in the middle of a change");
        });
        std::panic::catch_unwind(change).expect_err("it panics");
        assert_eq!(buffer[..], [1, 2, 3]);
    }
}
