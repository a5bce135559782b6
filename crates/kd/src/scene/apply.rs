//! The second half of a commit: carries out the plan. Nothing here can fail.

use std::sync::Arc;

use kd_core::{Aabb, Mesh};
use kd_trace::{Join, Joined};

use super::frame::{FrameData, FramePart, Shape};
use super::part::Role;
use super::part_group::{Origin, PartGroup, Wanted};
use super::plan::{MergePlan, Nodes, PartPlan, Plan};
use super::report::{CommitAction, CommitReason, CommitReport, PartChange};
use super::{Scene, Strategy};
use crate::layout::TreeLayout;

/// Nanoseconds of a node visit. Only the ratio to [`BUILD_NS`] decides anything. (`cargo xtask calibrate`: 7 for a node, 11 for a
/// block.)
const NODE_NS: f64 = 10.0;
/// Nanoseconds by which building a triangle exceeds refitting it. (The records in `docs/frames.md`: 200 to 430.)
const BUILD_NS: f64 = 230.0;

impl Scene {
    pub(super) fn apply(&mut self, plan: Plan) -> CommitReport {
        self.commits += 1;
        for part in self.parts.iter_mut().filter(|part| part.is_changed) {
            part.moved = self.commits;
            part.is_changed = false;
        }
        let (meshes, changes, joined) = match plan {
            Plan::Parts(plans) => self.apply_parts(plans),
            Plan::Merged(plan) => self.apply_merge(plan),
            Plan::Whole(meshes, layout) => self.apply_whole(meshes, layout),
        };
        self.note_parts(meshes);
        CommitReport {
            strategy: self.strategy.clone(),
            parts: self.parts.len(),
            triangles: self.triangles(),
            changes,
            top_nodes: joined.nodes,
            links: joined.links,
            opened: joined.opened,
            bytes: self.front.bytes(),
        }
    }

    /// Records in the frame which triangles belong to which part.
    fn note_parts(&mut self, meshes: Vec<Arc<Mesh>>) {
        let front = Arc::get_mut(&mut self.front).expect("the new frame has no snapshot yet");
        let are_in_one_mesh = matches!(front.shape, Shape::Whole(_));
        let mut next = 0;
        front.bounds = around(&meshes);
        front.parts.clear();
        for (part, mesh) in self.parts.iter().zip(meshes) {
            let first = if are_in_one_mesh {
                next
            } else {
                part.first_slot
            };
            next += u32::try_from(mesh.len()).expect("30 bits count triangles");
            front.parts.push(FramePart {
                id: part.id,
                first,
                mesh,
            });
        }
    }

    /// Makes `shape` that of the front frame, in memory that no snapshot shares.
    fn show(&mut self, shape: Shape) {
        if let Some(front) = Arc::get_mut(&mut self.front)
            && !matches!(front.shape, Shape::Merged(_))
        {
            front.shape = shape;
            return;
        }
        let frame = FrameData {
            shape,
            ..FrameData::default()
        };
        self.back = Some(std::mem::replace(&mut self.front, Arc::new(frame)));
    }

    fn apply_whole(
        &mut self,
        meshes: Vec<Arc<Mesh>>,
        layout: Box<TreeLayout>,
    ) -> (Vec<Arc<Mesh>>, Vec<PartChange>, Joined) {
        self.show(Shape::Whole(layout));
        let pairs = self.parts.iter().zip(&meshes);
        let changes = pairs.map(|(part, mesh)| PartChange {
            part: part.id,
            triangles: mesh.len(),
            action: CommitAction::BuiltWithAll,
            reason: CommitReason::Strategy,
        });
        let changes = changes.collect();
        (meshes, changes, Joined::default())
    }

    fn apply_merge(&mut self, plan: MergePlan) -> (Vec<Arc<Mesh>>, Vec<PartChange>, Joined) {
        let parts = self.parts.iter().zip(&plan.meshes).zip(plan.done);
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
        self.show(Shape::Merged(plan.trees));
        self.moving_trees = plan.moving;
        let joined = plan.merged.map_or_else(Joined::default, |merged| Joined {
            nodes: merged.new_nodes,
            links: merged.links,
            opened: merged.cut + merged.dissolved,
        });
        (plan.meshes, changes, joined)
    }

    fn apply_parts(&mut self, plans: Vec<PartPlan>) -> (Vec<Arc<Mesh>>, Vec<PartChange>, Joined) {
        let mut meshes = Vec::with_capacity(plans.len());
        let mut nodes = Vec::with_capacity(plans.len());
        let mut changes = Vec::new();
        for (part, plan) in self.parts.iter_mut().zip(plans) {
            if let Some((action, reason)) = plan.done {
                changes.push(PartChange {
                    part: part.id,
                    triangles: plan.mesh.len(),
                    action,
                    reason,
                });
            }
            meshes.push(plan.mesh);
            nodes.push(plan.nodes);
        }
        self.update_groups(&meshes, &nodes);
        if self.strategy == Strategy::Auto {
            let worn = self.build_where_it_pays(&meshes, &mut changes);
            if worn.iter().any(|nodes| matches!(nodes, Nodes::New(_))) {
                self.update_groups(&meshes, &worn);
            }
        }
        let joined = self.join();
        (meshes, changes, joined)
    }

    /// Moves the nodes of all parts into the groups of the frame, fitted to where their triangles are.
    fn update_groups(&mut self, meshes: &[Arc<Mesh>], nodes: &[Nodes]) {
        for (place, nodes) in nodes.iter().enumerate() {
            if !matches!(nodes, Nodes::Kept) {
                self.parts[place].built = self.commits;
            }
        }
        let count = if self.strategy == Strategy::Dual {
            2
        } else {
            1
        };
        let mut wanted: Vec<Vec<Wanted<'_>>> = (0..count).map(|_| Vec::new()).collect();
        for ((part, mesh), nodes) in self.parts.iter().zip(meshes).zip(nodes) {
            let is_second = self.strategy == Strategy::Dual && part.role != Role::Static;
            wanted[usize::from(is_second)].push(Wanted {
                version: part.version(),
                mesh,
                origin: match nodes {
                    Nodes::Kept => Origin::Before,
                    Nodes::New(tree) => Origin::New(tree),
                    Nodes::Shared(original) => Origin::Other(self.parts[*original].version()),
                },
            });
        }
        for wanted in &mut wanted {
            wanted.sort_by_key(|wanted| wanted.version.nodes_id());
        }
        let own = Arc::get_mut(&mut self.front).map(|front| std::mem::take(&mut front.shape));
        let (mut groups, before) = match own {
            Some(Shape::PartGroups(groups)) if groups.len() == count => (groups, Vec::new()),
            Some(Shape::PartGroups(groups)) => (new_groups(count), groups),
            Some(Shape::Whole(_) | Shape::Merged(_)) => (new_groups(count), Vec::new()),
            None => (self.take_back(count), Vec::new()),
        };
        let front = match &self.front.shape {
            Shape::PartGroups(groups) => groups.as_slice(),
            Shape::Whole(_) | Shape::Merged(_) => &[],
        };
        for (number, wanted) in wanted.iter().enumerate() {
            let (earlier, rest) = groups.split_at_mut(number);
            let others: [&[PartGroup]; 3] = [earlier, &before, front];
            rest[0].update(wanted, &others, self.is_parallel());
        }
        for (place, nodes) in nodes.iter().enumerate() {
            let part = &self.parts[place];
            let cost = match nodes {
                Nodes::Kept => continue,
                Nodes::Shared(original) => self.parts[*original].cost,
                Nodes::New(_) => {
                    let version = part.version();
                    let cost = groups.iter().find_map(|group| group.cost(&version));
                    let cost = cost.expect("the group holds it now");
                    let scale = part.area_scale();
                    if scale > 0.0 { cost / scale } else { cost }
                }
            };
            self.parts[place].cost = cost;
        }
        self.show(Shape::PartGroups(groups));
    }

    /// `count` groups of a frame without snapshots, to reuse, or new ones.
    fn take_back(&mut self, count: usize) -> Vec<PartGroup> {
        let back = self.back.take().and_then(|back| Arc::try_unwrap(back).ok());
        match back.map(|back| back.shape) {
            Some(Shape::PartGroups(groups)) if groups.len() == count => groups,
            _ => new_groups(count),
        }
    }

    /// Joins the parts of each group.
    fn join(&mut self) -> Joined {
        let mut options = Join {
            is_parallel: self.is_parallel(),
            ..Join::default()
        };
        if let Strategy::Dual | Strategy::Instances = self.strategy {
            options.open_above = f64::INFINITY;
        }
        let front = Arc::get_mut(&mut self.front).expect("the new frame has no snapshot yet");
        let mut all = Joined::default();
        if let Shape::PartGroups(groups) = &mut front.shape {
            for group in groups {
                let joined = group.forest.join(options);
                all.nodes += joined.nodes;
                all.links += joined.links;
                all.opened += joined.opened;
            }
        }
        all
    }

    /// Rebuilds the refitted parts whose boxes cost rays more time than a build takes; records that in `changes`.
    fn build_where_it_pays(&self, meshes: &[Arc<Mesh>], changes: &mut [PartChange]) -> Vec<Nodes> {
        let mut nodes: Vec<Nodes> = meshes.iter().map(|_| Nodes::Kept).collect();
        let Shape::PartGroups(groups) = &self.front.shape else {
            return nodes;
        };
        let area = around(meshes).half_area();
        let refitted = changes.iter_mut();
        for change in refitted.filter(|change| change.action == CommitAction::Refitted) {
            let place = self.place(change.part).expect("it is in the scene");
            let part = &self.parts[place];
            let version = part.version();
            let now = groups.iter().find_map(|group| group.cost(&version));
            let now = now.expect("it is in the frame");
            let more = (now - part.cost * part.area_scale()).max(0.0);
            let visits = if area > 0.0 { more / area } else { 0.0 };
            #[allow(clippy::cast_precision_loss, reason = "an estimate")]
            let ray_loss_ns = self.ray_budget as f64 * visits * NODE_NS;
            let build_ns = BUILD_NS * change.triangles as f64;
            change.reason = CommitReason::Estimate {
                ray_loss_ns,
                build_ns,
            };
            if ray_loss_ns > build_ns {
                change.action = CommitAction::BuiltFast;
                nodes[place] = Nodes::New(self.build_fast(&meshes[place]));
            }
        }
        nodes
    }
}

fn new_groups(count: usize) -> Vec<PartGroup> {
    std::iter::repeat_with(PartGroup::default)
        .take(count)
        .collect()
}

fn around(meshes: &[Arc<Mesh>]) -> Aabb {
    let boxes = meshes.iter().map(|mesh| mesh.bounds());
    boxes.fold(Aabb::EMPTY, |around, bounds| around.union(&bounds))
}
