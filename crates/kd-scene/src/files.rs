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

/// The bytes of a file that another one names. One that does not fit into memory is an error, and so is a device or a pipe, which may have
/// no end.
pub(crate) fn read_whole(path: &Path) -> io::Result<Vec<u8>> {
    let data = std::fs::metadata(path)?;
    if !data.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a file"));
    }
    check_room(data.len())?;
    std::fs::read(path)
}
