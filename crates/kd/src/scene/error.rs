//! What can be wrong with a scene.

use kd_core::{MAX_TRIANGLES, MeshError};
use kd_merge::MergeError;
use kd_sah::BuildError;
use thiserror::Error;

use super::PartId;

/// Why a scene was not changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// It was removed, or is of another scene.
    #[error("{part} is not in the scene")]
    NoSuchPart {
        /// What was asked for.
        part: PartId,
    },
    /// Positions that the part's mesh cannot have.
    #[error("{part}: {error}")]
    Mesh {
        /// The part that keeps its positions.
        part: PartId,
        /// What is wrong with the new ones.
        error: MeshError,
    },
    /// A transform that is NaN or infinite somewhere.
    #[error("{part}: the transform is not finite")]
    NotFinite {
        /// The part that keeps its transform.
        part: PartId,
    },
    /// More than [`MAX_TRIANGLES`] in all parts together.
    #[error("{triangles} triangles in all parts are too many, at most {MAX_TRIANGLES} fit")]
    TooManyTriangles {
        /// How many there would be.
        triangles: usize,
    },
    /// As many parts were added before as can be told apart.
    #[error("a scene has at most 2^32 parts in all its time")]
    TooManyParts,
}

/// Why there is no new frame.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CommitError {
    /// A part's transform moves a vertex to where f32 ends.
    #[error("{part}, moved: {error}")]
    Mesh {
        /// The part.
        part: PartId,
        /// Which vertex.
        error: MeshError,
    },
    /// The scene's options are such that a part cannot be built.
    #[error("{part}: {error}")]
    Build {
        /// The part.
        part: PartId,
        /// What is wrong.
        error: BuildError,
    },
    /// The options of [`Strategy::Rebuild`](super::Strategy::Rebuild) are such that the scene cannot be built.
    #[error("all parts together: {error}")]
    Rebuild {
        /// What is wrong.
        error: BuildError,
    },
    /// The merged kd-tree would have more than 2³⁰ nodes.
    #[error("merging kd-trees: {error}")]
    Merge {
        /// What is wrong.
        error: MergeError,
    },
}
