//! Errors of the library as exceptions of Python.

use std::fmt::Display;

use kd::BuildError;
use kd::MeshError;
use kd::build::ThreadsError;
use kd::scene::{CommitError, SceneError};
use kd::tree::FileError;
use pyo3::PyErr;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyRuntimeError, PyTypeError, PyValueError};

/// An argument of the wrong type, named first.
pub(crate) fn wrong_type(argument: &str, problem: impl Display) -> PyErr {
    PyTypeError::new_err(format!("{argument}: {problem}"))
}

/// An argument with a wrong value, named first.
pub(crate) fn wrong_value(argument: &str, problem: impl Display) -> PyErr {
    PyValueError::new_err(format!("{argument}: {problem}"))
}

/// Memory that the system does not have.
pub(crate) fn no_memory(what: &str) -> PyErr {
    PyMemoryError::new_err(format!("not enough memory for {what}"))
}

/// A mesh that was refused. The names of vertices and triangles are rows of the arguments.
pub(crate) fn of_mesh(error: &MeshError) -> PyErr {
    match error {
        MeshError::NotFinite { vertex } => {
            wrong_value("vertices", format_args!("row {vertex} is not finite"))
        }
        MeshError::TooFar { vertex } => wrong_value(
            "vertices",
            format_args!(
                "row {vertex} is out of the range of float32, seen from the mesh's origin"
            ),
        ),
        MeshError::IndexOutOfRange {
            triangle,
            index,
            vertices,
            ..
        } => wrong_value(
            "faces",
            format_args!(
                "row {triangle} has index {index}, which is out of range for {vertices} vertices"
            ),
        ),
        MeshError::VertexCount { .. } => wrong_value("vertices", error),
        MeshError::TooLarge { .. } => wrong_value("faces", error),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// A build that failed.
pub(crate) fn of_build(error: &BuildError) -> PyErr {
    match error {
        BuildError::Cancelled => PyRuntimeError::new_err("the build was cancelled"),
        BuildError::Threads(error) => of_threads(error),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// Threads that could not be started.
pub(crate) fn of_threads(error: &ThreadsError) -> PyErr {
    PyOSError::new_err(error.to_string())
}

/// A file that could not be read or written. Errors of the system keep their number, so that a missing file is a
/// `FileNotFoundError`.
pub(crate) fn of_file(error: &FileError) -> PyErr {
    match error {
        FileError::Io { file, source } => match source.raw_os_error() {
            Some(number) => {
                let text = source.to_string();
                // Python writes the number itself.
                let text = text.split(" (os error").next().unwrap_or(&text).to_owned();
                PyOSError::new_err((number, text, file.clone()))
            }
            None => PyOSError::new_err(error.to_string()),
        },
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// A scene that was not changed.
pub(crate) fn of_scene(error: &SceneError) -> PyErr {
    match error {
        SceneError::Mesh { error, .. } => of_mesh(error),
        SceneError::NotFinite { .. } => wrong_value("transform", "not finite in float32"),
        SceneError::NoSuchPart { .. } => wrong_value("part", error),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// A frame that was not made.
pub(crate) fn of_commit(error: &CommitError) -> PyErr {
    PyValueError::new_err(error.to_string())
}
