//! Trees in mapped files.
#![allow(
    unsafe_code,
    reason = "whoever opens a file promises that nothing changes it meanwhile, as for `numpy.memmap`"
)]

use std::path::Path;

use kd::KdTree;
use kd::tree::FileError;

/// Maps a file, and verifies all of it or its header.
pub(crate) fn open(path: &Path, verify: bool) -> Result<KdTree, FileError> {
    if verify {
        // SAFETY: the documentation of `kd.KdTree.open` asks for it: nothing changes the file.
        unsafe { KdTree::open_verified(path) }
    } else {
        // SAFETY: the same, and that `save` wrote the file.
        unsafe { KdTree::open(path) }
    }
}
