//! The second half of a commit: carries out the plan. Nothing here can fail.

use std::mem;
use std::sync::{Arc, OnceLock};

use kd_core::Mesh;
use kd_trace::{Joined, WideForest};

use super::forests::Update;
use super::frame::{FrameData, Shape};
use super::frame_parts::FramePart;
use super::plan::{MergePlan, PartPlan, Plan, Planned};
use super::report::{CommitAction, CommitReason, CommitReport, PartChange};
use super::shared::{PartMesh, SharedParts};
use super::{Scene, Strategy};
use crate::layout::TreeLayout;

/// The most earlier frames that the scene keeps: one for each snapshot that a pipeline of a few stages holds.
const MOST_SPARES: usize = 3;

impl Scene {
    pub(super) fn apply(&mut self, plan: Plan) -> CommitReport {
        self.commits += 1;
        let (changes, joined) = match plan {
            Plan::Parts(plans) => self.apply_parts(&plans),
            Plan::Merged(plan) => self.apply_merge(plan),
            Plan::Whole(meshes, layout) => self.apply_whole(&meshes, layout),
            Plan::Masks => {
                self.apply_masks();
                (Vec::new(), self.joined)
            }
        };
        self.joined = joined;
        self.made_by = Some(self.strategy.clone());
        self.has_new_slots = false;
        // Frames of another strategy are of no use to the next commit.
        let shape = mem::discriminant(&self.front.shape);
        self.spares
            .retain(|spare| mem::discriminant(&spare.shape) == shape);
        CommitReport {
            strategy: self.strategy.clone(),
            parts: self.parts.count(),
            triangles: self.triangles(),
            changes,
            top_nodes: joined.nodes,
            links: joined.links,
            opened: joined.opened,
            bytes: self.front.bytes(),
        }
    }

    fn apply_whole(
        &mut self,
        meshes: &[Arc<Mesh>],
        layout: Box<TreeLayout>,
    ) -> (Vec<PartChange>, Joined) {
        let pairs = self.parts.all().zip(meshes);
        let changes = pairs.map(|(part, mesh)| PartChange {
            part: part.id,
            triangles: mesh.len(),
            action: CommitAction::BuiltWithAll,
            reason: CommitReason::Strategy,
        });
        let changes = changes.collect();
        let mut first_slot = 0;
        let parts = self.parts.all().zip(meshes).map(|(part, mesh)| {
            let first = first_slot;
            first_slot += u32::try_from(mesh.len()).expect("30 bits count triangles");
            FramePart {
                id: part.id,
                first_slot: first,
                mesh: PartMesh::Placed(Arc::clone(mesh)),
                sight: part.sight(),
            }
        });
        let frame = FrameData {
            shape: Shape::Whole(layout),
            shared: Arc::default(),
            parts: parts.collect(),
            winding: OnceLock::new(),
        };
        self.show_without_nodes(frame);
        (changes, Joined::default())
    }

    fn apply_merge(&mut self, plan: MergePlan) -> (Vec<PartChange>, Joined) {
        let parts = self.parts.all().zip(&plan.meshes).zip(plan.done);
        let changes = parts.filter_map(|((part, mesh), done)| {
            let (action, reason) = done?;
            Some(PartChange {
                part: part.id,
                triangles: mesh.len(),
                action,
                reason,
            })
        });
        let changes = changes.collect();
        let parts = self.parts.all().zip(plan.meshes);
        let parts = parts.map(|(part, mesh)| FramePart {
            id: part.id,
            first_slot: part.first_slot,
            mesh: PartMesh::Placed(mesh),
            sight: part.sight(),
        });
        let frame = FrameData {
            shape: Shape::Merged(plan.trees),
            shared: Arc::default(),
            parts: parts.collect(),
            winding: OnceLock::new(),
        };
        self.moving_trees = plan.moving;
        self.show_without_nodes(frame);
        let joined = plan.merged.map_or_else(Joined::default, |merged| Joined {
            nodes: merged.new_nodes,
            links: merged.links,
            opened: merged.cut + merged.dissolved,
        });
        (changes, joined)
    }

    fn apply_parts(&mut self, plans: &[PartPlan]) -> (Vec<PartChange>, Joined) {
        let mut frame = self.next_frame();
        let mut forests = match mem::take(&mut frame.shape) {
            Shape::Forests(forests) => forests,
            Shape::Whole(_) | Shape::Merged(_) => Vec::new(),
        };
        let gone = self.parts.take_changes(self.commits);
        let shares_change = self.share(&mut forests, plans) || gone.iter().any(|gone| gone.shared);
        for gone in gone {
            frame.parts.remove(gone.id);
            if let Some(nodes) = gone.nodes {
                forests[nodes.forest].remove(nodes.member);
            }
        }
        let mut forests = self.regroup(forests);
        let updates: Vec<Update<'_>> = plans.iter().filter_map(Update::of).collect();
        self.update_forests(&mut forests, &updates);
        for plan in plans {
            let part = self.parts.at(plan.place);
            frame.parts.set(FramePart {
                id: part.id,
                first_slot: part.first_slot,
                mesh: plan.mesh(),
                sight: part.sight(),
            });
        }
        self.set_masks(&mut frame);
        if self.has_new_slots {
            self.renumber_slots(&mut forests);
            for part in self.parts.all_mut() {
                let first_slot = part.first_slot;
                let shared = part.shared.as_deref();
                part.shared = shared.map(|shared| Arc::new(shared.with_first_slot(first_slot)));
            }
            let parts = self.parts.all().map(|part| FramePart {
                id: part.id,
                first_slot: part.first_slot,
                mesh: match &part.shared {
                    Some(shared) => PartMesh::Shared(Arc::clone(shared)),
                    None => frame
                        .parts
                        .mesh(part.id)
                        .expect("set now or before")
                        .clone(),
                },
                sight: part.sight(),
            });
            frame.parts = parts.collect();
        }
        frame.parts.fit();
        let changes = plans.iter().map(|plan| PartChange {
            part: self.parts.at(plan.place).id,
            triangles: self.parts.at(plan.place).mesh.len(),
            action: plan.done.0,
            reason: plan.done.1.clone(),
        });
        let mut changes: Vec<PartChange> = changes.collect();
        if self.strategy == Strategy::Auto {
            let area = frame.parts.bounds().half_area();
            let built = self.build_where_it_pays(&forests, area, plans, &mut changes);
            let updates = built.iter().filter_map(|(number, nodes)| {
                Some(Update {
                    nodes,
                    ..Update::of(&plans[*number])?
                })
            });
            let updates: Vec<Update<'_>> = updates.collect();
            self.update_forests(&mut forests, &updates);
        }
        if shares_change || self.has_new_slots {
            let parts = self.parts.all().filter_map(|part| part.shared.clone());
            let parts = SharedParts::new(parts.collect(), self.is_parallel());
            frame.shared = Arc::new(parts);
        }
        let joined = self.join(&mut forests);
        frame.shape = Shape::Forests(forests);
        self.front = Arc::new(frame);
        (changes, joined)
    }

    /// Notes which of the planned parts share trees, and removes the nodes of their own that they had. Returns whether a part shares a
    /// tree, or no longer does.
    fn share(&mut self, forests: &mut [WideForest], plans: &[PartPlan]) -> bool {
        let mut is_change = false;
        for plan in plans {
            let part = self.parts.at_mut(plan.place);
            let before = part.shared.take();
            if let Planned::Shared(shared) = &plan.planned {
                part.shared = Some(Arc::clone(shared));
                if let Some(nodes) = part.nodes.take() {
                    forests[nodes.forest].remove(nodes.member);
                }
            }
            is_change |= before.is_some() || part.shared.is_some();
        }
        is_change
    }

    /// Shows the frame before, with the masks that were set since.
    fn apply_masks(&mut self) {
        let mut frame = self.next_frame();
        self.set_masks(&mut frame);
        frame.parts.fit();
        self.front = Arc::new(frame);
    }

    /// Gives the parts of a frame the masks that were set since the last commit.
    fn set_masks(&mut self, frame: &mut FrameData) {
        for id in self.parts.take_masked() {
            if let Some(place) = self.parts.place(id) {
                frame.parts.set_sight(id, self.parts.at(place).sight());
            }
        }
    }

    /// A frame equal to the front frame, to change: the front frame itself if it has no snapshots, else in the memory of an earlier frame
    /// without any.
    fn next_frame(&mut self) -> FrameData {
        let mut frame = self.memory_of_next_frame();
        frame.winding = OnceLock::new();
        frame
    }

    fn memory_of_next_frame(&mut self) -> FrameData {
        if let Some(front) = Arc::get_mut(&mut self.front) {
            return mem::take(front);
        }
        let frame = match self.take_spare() {
            Some(mut spare) => {
                spare.catch_up(&self.front);
                spare
            }
            None => FrameData::clone(&self.front),
        };
        let front = Arc::clone(&self.front);
        self.keep(front);
        frame
    }

    /// An earlier frame without snapshots.
    pub(super) fn take_spare(&mut self) -> Option<FrameData> {
        let mut spares = self.spares.iter();
        let place = spares.position(|spare| Arc::strong_count(spare) == 1)?;
        Arc::try_unwrap(self.spares.remove(place)).ok()
    }

    fn keep(&mut self, frame: Arc<FrameData>) {
        self.spares.insert(0, frame);
        self.spares.truncate(MOST_SPARES);
    }

    /// Shows a frame that has no wide nodes of parts.
    fn show_without_nodes(&mut self, frame: FrameData) {
        self.parts.take_changes(self.commits);
        // The parts of the frame have them.
        self.parts.take_masked();
        for part in self.parts.all_mut() {
            part.nodes = None;
            part.shared = None;
        }
        let before = mem::replace(&mut self.front, Arc::new(frame));
        // Of its trees the next merge makes use.
        if matches!(before.shape, Shape::Merged(_)) {
            self.keep(before);
        }
    }
}
