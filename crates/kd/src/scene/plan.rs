//! What a commit is going to do, and everything in it that can fail.

use std::sync::Arc;

use kd_core::{Mesh, Tree};
use kd_merge::{MergeError, MergeOptions, Merged};
use kd_sah::BuildOptions;
use kd_trace::WideTree;

use super::frame::{FrameData, Shape};
use super::grove::Key;
use super::merged::{MergedPart, MergedTrees};
use super::moving::MovingTree;
use super::part::{Part, Role};
use super::report::{Action, Reason};
use super::{CommitError, MergeMethod, Scene, Strategy};
use crate::traced::Traced;

/// What a commit is going to do.
pub(super) enum Plan {
    /// With each part, in the order of their ids.
    Parts(Vec<PartPlan>),
    /// Everything is in one tree.
    Whole(Vec<Arc<Mesh>>, Box<Traced>),
    /// Everything is in one kd-tree, put together from those of parts.
    Merged(MergePlan),
}

/// A kd-tree that was merged.
pub(super) struct MergePlan {
    pub(super) meshes: Vec<Arc<Mesh>>,
    pub(super) trees: Box<MergedTrees>,
    /// Those of the parts that move, for the next time.
    pub(super) moving: Vec<MovingTree>,
    pub(super) merged: Option<Merged>,
    pub(super) done: Vec<Option<(Action, Reason)>>,
}

/// What is to be done with a part.
pub(super) struct PartPlan {
    /// Where its triangles are.
    pub(super) mesh: Arc<Mesh>,
    pub(super) nodes: Nodes,
    /// What to say about it; nothing if it stays as it is.
    pub(super) done: Option<(Action, Reason)>,
}

/// Where a part's nodes come from.
pub(super) enum Nodes {
    /// The frame before.
    Kept,
    /// They have just been built.
    New(WideTree),
    /// The part of that place in the scene, which has the same mesh.
    Shared(usize),
}

impl Scene {
    pub(super) fn plan(&mut self) -> Result<Plan, CommitError> {
        let meshes = self.each_part(|_, part| self.placed(part))?;
        if let Strategy::Merge(method) = self.strategy
            && method != MergeMethod::Guided
        {
            return self.plan_merge(method, meshes).map(Plan::Merged);
        }
        if let Strategy::Rebuild(options) = &self.strategy {
            let all = Mesh::concatenated(meshes.iter().map(|mesh| &**mesh));
            let mesh = all.expect("parts have no more triangles than one mesh may have");
            let tree = kd_sah::build(&mesh, options);
            let tree = tree.map_err(|error| CommitError::Rebuild { error })?;
            let traced = Traced::of_options(&tree, &mesh, options);
            return Ok(Plan::Whole(meshes, Box::new(traced)));
        }
        let plans = self.each_part(|place, part| {
            let mesh = &meshes[place];
            let (nodes, done) = self.plan_part(part, mesh)?;
            Ok(PartPlan {
                mesh: Arc::clone(mesh),
                nodes,
                done,
            })
        });
        plans.map(Plan::Parts)
    }

    /// Merges kd-trees, apart from the frame before.
    fn plan_merge(
        &mut self,
        method: MergeMethod,
        meshes: Vec<Arc<Mesh>>,
    ) -> Result<MergePlan, CommitError> {
        let fail = |error| CommitError::Merge { error };
        let end = self.next_slot;
        let merge_options = self.merge_options();
        let mut done = vec![None; meshes.len()];
        let pairs = self.parts.iter().zip(&meshes);
        let parts: Vec<MergedPart<'_>> = pairs
            .map(|(part, mesh)| MergedPart {
                key: self.key_of_kd_tree(part),
                mesh,
                is_still: part.role == Role::Static,
            })
            .collect();
        let mut trees = match self.spare_trees(&parts) {
            Some(trees) => trees,
            None => {
                let trees = self.each_part(|place, part| {
                    let is_still = part.role == Role::Static;
                    let mesh = &*meshes[place];
                    is_still
                        .then(|| self.build_kd(part, mesh, &self.options))
                        .transpose()
                })?;
                for (done, tree) in done.iter_mut().zip(&trees) {
                    *done = tree.as_ref().map(|_| (Action::Built, Reason::New));
                }
                let trees: Vec<Tree> = trees.into_iter().flatten().collect();
                let mut all = Box::<MergedTrees>::default();
                all.set_still(&parts, &trees, end, &merge_options)
                    .map_err(fail)?;
                all
            }
        };
        // Triangles that are inserted one by one need no tree of their own, where there is one to insert them into.
        let inserts = method == MergeMethod::Insertion && trees.has_still_tree();
        let fast = BuildOptions::fast().with_threads(self.options.threads());
        let moving = self.each_part(|place, part| {
            if part.role == Role::Static || inserts {
                return Ok(None);
            }
            let key = parts[place].key;
            let known = &self.moving_trees;
            let known = known.binary_search_by_key(&key.part, |known| known.key.part);
            let known = known.ok().map(|place| &self.moving_trees[place]);
            if let Some(known) = known.filter(|known| known.key == key) {
                return Ok(Some((known.clone(), None)));
            }
            let made = MovingTree::new(key, part, &meshes[place], known, &fast);
            let (tree, is_moved) = made.map_err(|error| match error {
                MergeError::Build(error) => CommitError::Build {
                    part: part.id,
                    error,
                },
                error => CommitError::Merge { error },
            })?;
            let action = if is_moved {
                Action::Moved
            } else {
                Action::BuiltFast
            };
            Ok(Some((tree, Some((action, Reason::Strategy)))))
        })?;
        for (done, tree) in done.iter_mut().zip(&moving) {
            if let Some((_, Some(action))) = tree {
                *done = Some(action.clone());
            }
        }
        if inserts {
            for (done, part) in done.iter_mut().zip(&self.parts) {
                if part.role != Role::Static && part.is_changed {
                    *done = Some((Action::Inserted, Reason::Strategy));
                }
            }
        }
        let moving = moving.into_iter().flatten();
        let moving: Vec<MovingTree> = moving.map(|(tree, _)| tree).collect();
        let of_parts = moving.iter().map(|moving| &*moving.tree);
        let merged = trees.merge(method, &parts, of_parts, end, &merge_options);
        let merged = merged.map_err(fail)?;
        Ok(MergePlan {
            meshes,
            trees,
            moving,
            merged,
            done,
        })
    }

    /// Leaves that become larger than two blocks are divided again.
    fn merge_options(&self) -> MergeOptions {
        let options = MergeOptions::resplitting(16, BuildOptions::fast());
        options.with_parallel(self.is_parallel())
    }

    /// Where the kd-tree of a part is made for, as it will be after this commit.
    fn key_of_kd_tree(&self, part: &Part) -> Key {
        Key {
            built: 0,
            moved: if part.is_changed {
                self.commits + 1
            } else {
                part.moved
            },
            ..part.key()
        }
    }

    /// Trees of what stands still, that no frame needs, or a copy of those of the frame.
    fn spare_trees(&mut self, parts: &[MergedPart<'_>]) -> Option<Box<MergedTrees>> {
        let back = self.back.take().and_then(|back| Arc::try_unwrap(back).ok());
        let back = match back.map(|back| back.shape) {
            Some(Shape::Merged(trees)) => Some(trees),
            _ => None,
        };
        let front = match &self.front.shape {
            Shape::Merged(trees) => Some(trees),
            _ => None,
        };
        let end = self.next_slot;
        let spare = back.filter(|trees| trees.has_still(parts, end));
        spare.or_else(|| front.filter(|trees| trees.has_still(parts, end)).cloned())
    }

    fn build_kd(
        &self,
        part: &Part,
        mesh: &Mesh,
        options: &BuildOptions,
    ) -> Result<Tree, CommitError> {
        kd_sah::build(mesh, options).map_err(|error| CommitError::Build {
            part: part.id,
            error,
        })
    }

    /// Calls a function with every part, on the threads that the scene may use.
    fn each_part<T: Send>(
        &self,
        call: impl Fn(usize, &Part) -> Result<T, CommitError> + Sync + Send,
    ) -> Result<Vec<T>, CommitError> {
        #[cfg(feature = "parallel")]
        if self.is_parallel() && self.parts.len() > 1 {
            use rayon::prelude::*;
            let parts = self.parts.par_iter().enumerate();
            let results: Vec<_> = parts.map(|(place, part)| call(place, part)).collect();
            // The first error, whichever was there first.
            return results.into_iter().collect();
        }
        let parts = self.parts.iter().enumerate();
        parts.map(|(place, part)| call(place, part)).collect()
    }

    /// A part's mesh where it is now.
    fn placed(&self, part: &Part) -> Result<Arc<Mesh>, CommitError> {
        if !part.is_changed {
            let mesh = self.front.mesh(part.id);
            return Ok(Arc::clone(mesh.expect("was in the last frame")));
        }
        if part.transform == glam::Affine3A::IDENTITY {
            return Ok(Arc::clone(&part.mesh));
        }
        let mesh = part.mesh.transformed(&part.transform);
        mesh.map(Arc::new).map_err(|error| CommitError::Mesh {
            part: part.id,
            error,
        })
    }

    fn plan_part(
        &self,
        part: &Part,
        mesh: &Mesh,
    ) -> Result<(Nodes, Option<(Action, Reason)>), CommitError> {
        let is_here = self.front.has_nodes(&part.key());
        if is_here && !part.is_changed {
            return Ok((Nodes::Kept, None));
        }
        if is_here && self.refits(part) {
            return Ok((Nodes::Kept, Some((Action::Refitted, Reason::Strategy))));
        }
        let reason = if is_here {
            Reason::Strategy
        } else {
            Reason::New
        };
        if let (false, Some(original)) = (is_here, self.shares_with(part)) {
            let done = (Action::Refitted, reason);
            return Ok((Nodes::Shared(original), Some(done)));
        }
        let (nodes, action) = self.build(part, mesh)?;
        Ok((nodes, Some((action, reason))))
    }

    /// Whether a part that has changed keeps its nodes, for now at least: whether that is good enough is known only when it
    /// is done.
    fn refits(&self, part: &Part) -> bool {
        match self.strategy {
            Strategy::Refit | Strategy::Instances => true,
            Strategy::Auto => part.role != Role::Static,
            Strategy::Merge(_) | Strategy::Dual | Strategy::Rebuild(_) => false,
        }
    }

    fn build(&self, part: &Part, mesh: &Mesh) -> Result<(Nodes, Action), CommitError> {
        if part.role != Role::Static {
            return Ok((Nodes::New(self.build_fast(mesh)), Action::BuiltFast));
        }
        let tree = self.build_kd(part, mesh, &self.options)?;
        let tree = WideTree::best(&tree, mesh, self.is_parallel());
        Ok((Nodes::New(tree), Action::Built))
    }

    /// A tree that is good enough for some frames.
    pub(super) fn build_fast(&self, mesh: &Mesh) -> WideTree {
        #[cfg(feature = "parallel")]
        if self.is_parallel() {
            return WideTree::from_objects_parallel(mesh);
        }
        WideTree::from_objects(mesh)
    }

    /// The place of the part that an instance was made from, if they have the same mesh.
    fn shares_with(&self, part: &Part) -> Option<usize> {
        let Role::Instance(original) = part.role else {
            return None;
        };
        let place = self.place(original).ok()?;
        Arc::ptr_eq(&self.parts[place].mesh, &part.mesh).then_some(place)
    }
}

impl FrameData {
    /// Whether it has nodes of a part, wherever its triangles were.
    fn has_nodes(&self, key: &Key) -> bool {
        match &self.shape {
            Shape::Groves(groves) => groves.iter().any(|grove| grove.position(key).is_some()),
            Shape::Whole(_) | Shape::Merged(_) => false,
        }
    }
}
