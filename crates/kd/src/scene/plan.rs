//! The first half of a commit: plans it, with every step that can fail.

use std::sync::Arc;

use kd_core::{Mesh, Tree};
use kd_merge::{MergeError, MergeOptions, Merged};
use kd_sah::BuildOptions;
use kd_trace::WideTree;

use super::frame::Shape;
use super::merged::{MergedPart, MergedTrees};
use super::moving::MovingTree;
use super::part::{Part, PartVersion, Role};
use super::report::{CommitAction, CommitReason};
use super::shared::{PartMesh, SharedPart};
use super::{CommitError, MergeMethod, Scene, Strategy};
use crate::layout::{self, FrameLayout, LayoutPolicy, TreeLayout};

/// What a commit will do.
pub(super) enum Plan {
    /// What to do with the parts that have changed, in the order of their ids.
    Parts(Vec<PartPlan>),
    /// The meshes of all parts, and one tree over their concatenation.
    Whole(Vec<Arc<Mesh>>, Box<TreeLayout>),
    /// One kd-tree, merged from those of the parts.
    Merged(MergePlan),
    /// The frame before, with other masks.
    Masks,
}

/// A merged kd-tree with what later commits reuse of it.
pub(super) struct MergePlan {
    pub(super) meshes: Vec<Arc<Mesh>>,
    pub(super) trees: Box<MergedTrees>,
    /// The kd-trees of the parts that are not static, for the next commit.
    pub(super) moving: Vec<MovingTree>,
    pub(super) merged: Option<Merged>,
    pub(super) done: Vec<Option<(CommitAction, CommitReason)>>,
}

/// What a commit will do with a part.
pub(super) struct PartPlan {
    /// Its index in the scene.
    pub(super) place: usize,
    pub(super) planned: Planned,
    /// What the report says.
    pub(super) done: (CommitAction, CommitReason),
}

/// What rays traverse in a part.
pub(super) enum Planned {
    /// Nodes of its own.
    Own {
        /// Where its triangles are.
        mesh: Arc<Mesh>,
        nodes: Nodes,
    },
    /// A tree that it shares with other parts.
    Shared(Arc<SharedPart>),
}

impl PartPlan {
    /// The triangles of the part in the next frame.
    pub(super) fn mesh(&self) -> PartMesh {
        match &self.planned {
            Planned::Own { mesh, .. } => PartMesh::Placed(Arc::clone(mesh)),
            Planned::Shared(part) => PartMesh::Shared(Arc::clone(part)),
        }
    }
}

/// Where a part's nodes come from.
pub(super) enum Nodes {
    /// The frame before.
    Kept,
    /// A tree that was just built.
    New(WideTree),
    /// A copy of those of the part at that index in the scene, which has the same mesh.
    Copied(usize),
}

impl Scene {
    pub(super) fn plan(&mut self) -> Result<Plan, CommitError> {
        if self.parts.are_unchanged() && self.made_by.as_ref() == Some(&self.strategy) {
            return Ok(Plan::Masks);
        }
        let policy = LayoutPolicy::new(&self.options);
        let frames = policy.frames_of(&self.strategy);
        match frames.ok_or_else(|| CommitError::Layout {
            strategy: self.strategy.clone(),
        })? {
            FrameLayout::WideParts => self.plan_parts().map(Plan::Parts),
            FrameLayout::MergedTrees(method) => {
                self.parts.settle();
                self.plan_merge(method).map(Plan::Merged)
            }
            FrameLayout::OneMesh(options) => {
                let options = options.clone();
                let meshes = self.each_part(self.parts.places(), |_, part| self.placed(part))?;
                let all = Mesh::concatenated(meshes.iter().map(|mesh| &**mesh));
                let mesh = all.expect("parts have no more triangles than one mesh may have");
                let built = layout::build(&mesh, &options, None);
                let (layout, _) = built.map_err(|error| CommitError::Rebuild { error })?;
                Ok(Plan::Whole(meshes, Box::new(layout)))
            }
        }
    }

    /// Plans for the parts that have changed; for all parts where the frame before has no wide nodes of them.
    fn plan_parts(&mut self) -> Result<Vec<PartPlan>, CommitError> {
        let places = match &self.front.shape {
            Shape::Forests(_) => self.changed_or_no_longer_sharing(),
            Shape::Whole(_) | Shape::Merged(_) => self.parts.places(),
        };
        let sharing = self.plan_sharing(&places)?;
        self.each_part(places, |place, part| {
            if let Some((shared, reason)) = sharing.place(part) {
                return Ok(PartPlan {
                    place,
                    planned: Planned::Shared(shared),
                    done: (CommitAction::Shared, reason),
                });
            }
            let mesh = self.placed(part)?;
            let (nodes, done) = self.plan_part(part, &mesh)?;
            Ok(PartPlan {
                place,
                planned: Planned::Own { mesh, nodes },
                done,
            })
        })
    }

    /// The places of the parts that have changed, and of those that share a tree where the strategy has none.
    fn changed_or_no_longer_sharing(&self) -> Vec<usize> {
        let mut places = self.parts.changed();
        if !self.may_share() && !self.front.shared.is_empty() {
            let all = self.parts.places().into_iter();
            places.extend(all.filter(|place| self.parts.at(*place).shared.is_some()));
            places.sort_unstable();
            places.dedup();
        }
        places
    }

    /// Merges kd-trees, in memory that the frame before does not share. The parts are settled.
    fn plan_merge(&mut self, method: MergeMethod) -> Result<MergePlan, CommitError> {
        let fail = |error| CommitError::Merge { error };
        let places = self.parts.places();
        let meshes = self.each_part(places.clone(), |_, part| self.placed(part))?;
        let end = self.next_slot;
        let merge_options = self.merge_options();
        let mut done = vec![None; meshes.len()];
        let pairs = self.parts.all().zip(&meshes);
        let parts: Vec<MergedPart<'_>> = pairs
            .map(|(part, mesh)| MergedPart {
                version: self.version_of_kd_tree(part),
                mesh,
                is_static: part.role == Role::Static,
            })
            .collect();
        let mut trees = match self.spare_trees(&parts) {
            Some(trees) => trees,
            None => {
                let trees = self.each_part(places.clone(), |place, part| {
                    let mesh = &*meshes[place];
                    (part.role == Role::Static)
                        .then(|| self.build_kd(part, mesh, &self.options))
                        .transpose()
                })?;
                for (done, tree) in done.iter_mut().zip(&trees) {
                    *done = tree
                        .as_ref()
                        .map(|_| (CommitAction::Built, CommitReason::New));
                }
                let trees: Vec<Tree> = trees.into_iter().flatten().collect();
                let mut all = Box::<MergedTrees>::default();
                all.set_static(&parts, &trees, end, &merge_options)
                    .map_err(fail)?;
                all
            }
        };
        // Triangles that are inserted one by one into the static tree need no tree of their own.
        let inserts = method == MergeMethod::Insertion && trees.has_static_tree();
        let fast = BuildOptions::fast().with_threads(self.options.threads());
        let moving = self.each_part(places, |place, part| {
            if part.role == Role::Static || inserts {
                return Ok(None);
            }
            let version = parts[place].version;
            let known = &self.moving_trees;
            let known = known.binary_search_by_key(&version.part, |known| known.version.part);
            let known = known.ok().map(|place| &self.moving_trees[place]);
            if let Some(known) = known.filter(|known| known.version == version) {
                return Ok(Some((known.clone(), None)));
            }
            let made = MovingTree::new(version, part, &meshes[place], known, &fast);
            let (tree, is_moved) = made.map_err(|error| match error {
                MergeError::Build(error) => CommitError::Build {
                    part: part.id,
                    error,
                },
                error => CommitError::Merge { error },
            })?;
            let action = if is_moved {
                CommitAction::Moved
            } else {
                CommitAction::BuiltFast
            };
            Ok(Some((tree, Some((action, CommitReason::Strategy)))))
        })?;
        for (done, tree) in done.iter_mut().zip(&moving) {
            if let Some((_, Some(action))) = tree {
                *done = Some(action.clone());
            }
        }
        if inserts {
            for (done, part) in done.iter_mut().zip(self.parts.all()) {
                if part.role != Role::Static && part.is_changed {
                    *done = Some((CommitAction::Inserted, CommitReason::Strategy));
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

    /// The version that the kd-tree of a part has after this commit.
    fn version_of_kd_tree(&self, part: &Part) -> PartVersion {
        PartVersion {
            moved: if part.is_changed {
                self.commits + 1
            } else {
                part.moved
            },
            ..part.version()
        }
    }

    /// The trees of the static parts: those of a frame without snapshots, or a copy of those of the front frame.
    fn spare_trees(&mut self, parts: &[MergedPart<'_>]) -> Option<Box<MergedTrees>> {
        let end = self.next_slot;
        let of = |shape: Shape| match shape {
            Shape::Merged(trees) => Some(trees),
            Shape::Forests(_) | Shape::Whole(_) => None,
        };
        let spare = self.take_spare().and_then(|spare| of(spare.shape));
        spare
            .filter(|trees| trees.has_static(parts, end))
            .or_else(|| match &self.front.shape {
                Shape::Merged(trees) if trees.has_static(parts, end) => Some(trees.clone()),
                _ => None,
            })
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

    /// Calls a function with each index and its part, on the threads that the scene may use. The error is that of the first part that
    /// fails, not the one that occurred first.
    fn each_part<T: Send>(
        &self,
        places: Vec<usize>,
        call: impl Fn(usize, &Part) -> Result<T, CommitError> + Sync + Send,
    ) -> Result<Vec<T>, CommitError> {
        let is_parallel = self.is_parallel() && places.len() > 1;
        let call = |place| call(place, self.parts.at(place));
        let results = kd_tasks::map(places, is_parallel, call);
        results.into_iter().collect()
    }

    /// A part's mesh after its transform.
    fn placed(&self, part: &Part) -> Result<Arc<Mesh>, CommitError> {
        if !part.is_changed {
            let mesh = self.front.mesh(part.id);
            return Ok(Arc::clone(
                mesh.expect("a part that has not changed is in the last frame"),
            ));
        }
        if part.placement.is_identity() {
            return Ok(Arc::clone(&part.mesh));
        }
        let mesh = part.placement.place(&part.mesh);
        mesh.map(Arc::new).map_err(|error| CommitError::Mesh {
            part: part.id,
            error,
        })
    }

    fn plan_part(
        &self,
        part: &Part,
        mesh: &Mesh,
    ) -> Result<(Nodes, (CommitAction, CommitReason)), CommitError> {
        let reason = if part.nodes.is_some() {
            CommitReason::Strategy
        } else {
            CommitReason::New
        };
        if part.nodes.is_some() && self.refits(part) {
            return Ok((Nodes::Kept, (CommitAction::Refitted, reason)));
        }
        if let (None, Some(original)) = (part.nodes, self.shares_with(part)) {
            let done = (CommitAction::Refitted, reason);
            return Ok((Nodes::Copied(original), done));
        }
        let (nodes, action) = self.build(part, mesh)?;
        Ok((nodes, (action, reason)))
    }

    /// Whether the nodes of a part that has changed are refitted first; [`Strategy::Auto`] may rebuild the part once the
    /// refitted boxes are known.
    fn refits(&self, part: &Part) -> bool {
        match self.strategy {
            Strategy::Refit | Strategy::Instances => true,
            Strategy::Auto => part.role != Role::Static,
            Strategy::Merge(_) | Strategy::Dual | Strategy::Rebuild(_) => false,
        }
    }

    fn build(&self, part: &Part, mesh: &Mesh) -> Result<(Nodes, CommitAction), CommitError> {
        if part.role != Role::Static {
            return Ok((Nodes::New(self.build_fast(mesh)), CommitAction::BuiltFast));
        }
        let tree = layout::build_wide(mesh, &self.options);
        let tree = tree.map_err(|error| CommitError::Build {
            part: part.id,
            error,
        })?;
        Ok((Nodes::New(tree), CommitAction::Built))
    }

    /// Wide nodes that are fast to build.
    pub(super) fn build_fast(&self, mesh: &Mesh) -> WideTree {
        LayoutPolicy::new(&self.options).wide_tree_of_objects(mesh)
    }

    /// The index of the part that an instance was made from, if they have the same mesh, and each has nodes of its own.
    fn shares_with(&self, part: &Part) -> Option<usize> {
        let Role::Instance(original) = part.role else {
            return None;
        };
        if self.parts.meshes().have_shared(&part.mesh) {
            return None;
        }
        let place = self.place(original).ok()?;
        Arc::ptr_eq(&self.parts.at(place).mesh, &part.mesh).then_some(place)
    }
}
