//! The kd-trees of parts that move, kept from frame to frame where frames are made by merging kd-trees.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3A};
use kd_core::{BoundsOnly, Mesh, Tree};
use kd_merge::MergeError;
use kd_sah::{BuildOptions, build};

use super::grove::Key;
use super::part::Part;

/// The kd-tree of a part, and what it can be made from again once the part has moved on.
#[derive(Clone, Debug)]
pub(super) struct MovingTree {
    pub(super) key: Key,
    pub(super) tree: Arc<Tree>,
    mesh: Arc<Mesh>,
    course: Course,
    /// The tree at rest.
    at_rest: Option<Arc<Tree>>,
}

/// A transform in two steps: first what a tree does not survive, then what it can be [moved](Tree::moved) by.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Course {
    to_rest: Affine3A,
    motion: Affine3A,
}

impl Course {
    /// Both steps round as the transform does in one, since it adds its translation last.
    fn of(transform: &Affine3A) -> Self {
        if Tree::can_be_moved(transform) {
            return Self {
                to_rest: Affine3A::IDENTITY,
                motion: *transform,
            };
        }
        Self {
            to_rest: Affine3A {
                translation: Vec3A::ZERO,
                ..*transform
            },
            motion: Affine3A {
                matrix3: Mat3A::IDENTITY,
                translation: transform.translation,
            },
        }
    }
}

impl MovingTree {
    /// The tree of a part whose triangles are in `placed`, and whether the one from before was moved there.
    ///
    /// A part that only moves along its course, from the last frame to this one, gets a tree that can be moved: over boxes, so
    /// that it need not be built again in the frames to come.
    pub(super) fn new(
        key: Key,
        part: &Part,
        placed: &Mesh,
        before: Option<&Self>,
        options: &BuildOptions,
    ) -> Result<(Self, bool), MergeError> {
        let course = Course::of(&part.transform);
        let is_on_course = |before: &&Self| {
            Arc::ptr_eq(&before.mesh, &part.mesh) && before.course.to_rest == course.to_rest
        };
        let before = before.filter(is_on_course);
        let known = before.and_then(|before| before.at_rest.clone());
        let is_moved = known.is_some();
        let at_rest = match (known, before) {
            (Some(known), _) => Some(known),
            (None, None) => None,
            (None, Some(_)) => {
                // What is finite where it is to be moved to is finite at rest.
                let mesh = part.mesh.transformed(&course.to_rest);
                let mesh = mesh.ok();
                let tree = mesh
                    .map(|mesh| build(&BoundsOnly(&mesh), options))
                    .transpose()?;
                tree.map(Arc::new)
            }
        };
        let tree = match &at_rest {
            Some(at_rest) => at_rest.moved(&course.motion)?,
            None => build(placed, options)?,
        };
        let tree = Self {
            key,
            tree: Arc::new(tree),
            mesh: Arc::clone(&part.mesh),
            course,
            at_rest,
        };
        Ok((tree, is_moved))
    }
}
