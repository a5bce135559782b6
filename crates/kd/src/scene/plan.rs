//! What a commit is going to do, and everything in it that can fail.

use std::sync::Arc;

use kd_core::Mesh;
use kd_trace::WideTree;

use super::frame::{FrameData, Shape};
use super::grove::Key;
use super::part::{Part, Role};
use super::report::{Action, Reason};
use super::{CommitError, Scene, Strategy};
use crate::traced::Traced;

/// What a commit is going to do.
pub(super) enum Plan {
    /// With each part, in the order of their ids.
    Parts(Vec<PartPlan>),
    /// Everything is in one tree.
    Whole(Vec<Arc<Mesh>>, Box<Traced>),
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
    pub(super) fn plan(&self) -> Result<Plan, CommitError> {
        let meshes = self.each_part(|_, part| self.placed(part))?;
        if let Strategy::Rebuild(options) = &self.strategy {
            let mesh = concatenated(&meshes);
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

    /// Calls a function with every part, on the threads that the scene may use.
    fn each_part<T: Send>(
        &self,
        call: impl Fn(usize, &Part) -> Result<T, CommitError> + Sync + Send,
    ) -> Result<Vec<T>, CommitError> {
        #[cfg(feature = "parallel")]
        if self.options.threads() != 1 && self.parts.len() > 1 {
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
        let tree = kd_sah::build(mesh, &self.options).map_err(|error| CommitError::Build {
            part: part.id,
            error,
        })?;
        let is_parallel = self.options.threads() != 1;
        let tree = WideTree::best(&tree, mesh, is_parallel);
        Ok((Nodes::New(tree), Action::Built))
    }

    /// A tree that is good enough for some frames.
    pub(super) fn build_fast(&self, mesh: &Mesh) -> WideTree {
        #[cfg(feature = "parallel")]
        if self.options.threads() != 1 {
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
            Shape::Whole(_) => false,
        }
    }
}

/// One mesh of all triangles, one part after the other.
fn concatenated(meshes: &[Arc<Mesh>]) -> Mesh {
    let mut positions = Vec::with_capacity(meshes.iter().map(|mesh| mesh.positions().len()).sum());
    let mut triangles = Vec::with_capacity(meshes.iter().map(|mesh| mesh.len()).sum());
    for mesh in meshes {
        let first = u32::try_from(positions.len()).expect("32 bits count vertices");
        positions.extend_from_slice(mesh.positions());
        let own = mesh.triangles().iter();
        triangles.extend(own.map(|corners| corners.map(|corner| first + corner)));
    }
    Mesh::new(positions, triangles).expect("all of it has been checked")
}
