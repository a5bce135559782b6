//! Errors of a scene.

#[cfg(doc)]
use kd_core::Layout;
use kd_core::{MAX_TRIANGLES, MeshError};
use kd_merge::MergeError;
use kd_sah::BuildError;
use thiserror::Error;

use super::{PartId, Strategy};

/// Why a scene was not changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The part was removed, or the id is of another scene.
    #[error("{part} is not in the scene")]
    NoSuchPart {
        /// The id that was passed.
        part: PartId,
    },
    /// The part's mesh cannot have these positions.
    #[error("{part}: {error}")]
    Mesh {
        /// The part that keeps its positions.
        part: PartId,
        /// What is wrong with the new positions.
        error: MeshError,
    },
    /// An element of the transform is NaN or infinite.
    #[error("{part}: the transform is not finite")]
    NotFinite {
        /// The part that keeps its transform.
        part: PartId,
    },
    /// A coordinate of the scene's origin is NaN or infinite.
    #[error("the scene's origin is not finite")]
    Origin,
    /// More than [`MAX_TRIANGLES`] in all parts together.
    #[error("{triangles} triangles in all parts are too many, at most {MAX_TRIANGLES} fit")]
    TooManyTriangles {
        /// How many triangles the scene would have.
        triangles: usize,
    },
    /// 2³² parts were added to the scene before.
    #[error("2^32 parts were added to this scene already; make a new scene")]
    TooManyParts,
}

/// Why there is no new frame.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CommitError {
    /// A part's transform moves a vertex out of the range of f32.
    #[error("{part}, moved: {error}")]
    Mesh {
        /// The part.
        part: PartId,
        /// Names the vertex.
        error: MeshError,
    },
    /// A part cannot be built with the scene's options.
    #[error("{part}: {error}")]
    Build {
        /// The part.
        part: PartId,
        /// What is wrong.
        error: BuildError,
    },
    /// The scene cannot be built with the options of [`Strategy::Rebuild`](super::Strategy::Rebuild).
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
    /// The scene's options ask for [`Layout::Binary`], and the strategy makes frames of wide nodes only: see
    /// [`kd::layout`](crate::layout).
    #[error(
        "the scene's options ask for the binary layout, which this strategy does not have; use `Layout::Wide`, \
         `Strategy::Auto`, `Strategy::Rebuild` or a merge of kd-trees: {strategy:?}"
    )]
    Layout {
        /// The strategy.
        strategy: Strategy,
    },
}
