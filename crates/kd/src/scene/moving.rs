//! The kd-trees of parts that move, kept from frame to frame by strategies that merge kd-trees.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3A};
use kd_core::{BoundsOnly, Mesh, Tree};
use kd_merge::MergeError;
use kd_sah::{BuildOptions, build};

use super::part::{Part, PartVersion};
use super::placement::Placement;

/// The kd-tree of a part, with a tree at rest that later frames can move.
#[derive(Clone, Debug)]
pub(super) struct MovingTree {
    pub(super) version: PartVersion,
    pub(super) tree: Arc<Tree>,
    mesh: Arc<Mesh>,
    /// `None` for a part that is placed in f64, whose trees are always built.
    course: Option<Course>,
    /// The tree before `course.motion`, where the part was found to move on its course.
    at_rest: Option<Arc<Tree>>,
}

/// A transform in two steps: `to_rest`, which needs a new tree, then `motion`, by which a tree can be
/// [moved](Tree::moved).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Course {
    to_rest: Affine3A,
    motion: Affine3A,
}

impl Course {
    /// The two steps round as the whole transform does, since it adds its translation last.
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
    /// The tree of a part whose triangles are at `placed`, and whether the tree at rest was moved there.
    ///
    /// A part that has moved on its course since the last frame gets a tree at rest, over the boxes of its triangles, which later
    /// frames move instead of building.
    pub(super) fn new(
        version: PartVersion,
        part: &Part,
        placed: &Mesh,
        before: Option<&Self>,
        options: &BuildOptions,
    ) -> Result<(Self, bool), MergeError> {
        let course = match &part.placement {
            Placement::Single(transform) => Some(Course::of(transform)),
            Placement::Double(_) => None,
        };
        let to_rest = course.map(|course| course.to_rest);
        let before = before.filter(|before| {
            let before_to_rest = before.course.map(|course| course.to_rest);
            Arc::ptr_eq(&before.mesh, &part.mesh) && before_to_rest == to_rest
        });
        let known = before.and_then(|before| before.at_rest.clone());
        let is_moved = known.is_some();
        let at_rest = match (known, before, to_rest) {
            (Some(known), _, _) => Some(known),
            (None, None, _) | (None, _, None) => None,
            (None, Some(_), Some(to_rest)) => {
                // Positions that are finite after the motion are finite before it.
                let mesh = part.mesh.transformed(&to_rest);
                let mesh = mesh.ok();
                let tree = mesh
                    .map(|mesh| build(&BoundsOnly(&mesh), options))
                    .transpose()?;
                tree.map(Arc::new)
            }
        };
        let tree = match (&at_rest, course) {
            (Some(at_rest), Some(course)) => at_rest.moved(&course.motion)?,
            _ => build(placed, options)?,
        };
        let tree = Self {
            version,
            tree: Arc::new(tree),
            mesh: Arc::clone(&part.mesh),
            course,
            at_rest,
        };
        Ok((tree, is_moved))
    }
}
