//! Access to the file of a scene.

use std::io;
use std::path::Path;

use crate::LoadError;
use crate::memory::check_room;

/// The bytes of the file at `path`, from the caller's file access `files`.
pub(crate) fn read_file(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<Vec<u8>, LoadError> {
    files(path).map_err(|source| LoadError::Open {
        file: path.display().to_string(),
        source,
    })
}

/// The files of the system, with the bytes of `path` that were read already.
pub(crate) fn files_with(path: &Path, bytes: Vec<u8>) -> impl FnMut(&Path) -> io::Result<Vec<u8>> {
    let mut own = Some((path.to_owned(), bytes));
    move |asked| match own.take_if(|(path, _)| path == asked) {
        Some((_, bytes)) => Ok(bytes),
        None => read_whole(asked),
    }
}

/// The bytes of a file. One that does not fit into memory is an error.
pub(crate) fn read_whole(path: &Path) -> io::Result<Vec<u8>> {
    check_room(std::fs::metadata(path)?.len())?;
    std::fs::read(path)
}
