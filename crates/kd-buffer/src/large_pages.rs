//! Large pages of memory for large arrays.
//!
//! A ray jumps through all of a tree. With pages of 4 KiB the processor must look up many of the addresses that it loads; it can
//! keep the places of some thousand pages only.
#![allow(unsafe_code, reason = "a call of the system; it changes no contents")]

/// Advises the system to use pages of 2 MiB for the memory of a vector, which is best not touched yet. Linux does so where it is
/// set to; elsewhere this does nothing.
///
/// Only whole pages within the memory are advised, so they take no more of it.
pub fn advise_large_pages<T>(memory: &Vec<T>) {
    #[cfg(all(target_os = "linux", not(miri)))]
    {
        const PAGE: usize = 2 << 20;
        let begin = memory.as_ptr().cast::<u8>();
        let skipped = begin.align_offset(PAGE);
        let bytes = memory.capacity() * size_of::<T>();
        let pages = bytes.saturating_sub(skipped) / PAGE;
        if pages > 0 {
            let first = begin.wrapping_add(skipped);
            // SAFETY: the pages are within the memory of the vector, and the advice changes no contents. It may be refused.
            unsafe { libc::madvise(first.cast_mut().cast(), pages * PAGE, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(all(target_os = "linux", not(miri))))]
    let _ = memory;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_keeps_contents() {
        for bytes in [0, 100, 3 << 20, 9 << 20] {
            let mut memory = vec![7_u8; bytes];
            advise_large_pages(&memory);
            memory.push(8);
            assert!(memory[..bytes].iter().all(|x| *x == 7), "{bytes} bytes");
        }
    }
}
