//! The wide nodes of parts in the forests of a frame: carried over from the frame before, replaced and refitted.

use std::sync::Arc;

use kd_core::Mesh;
use kd_trace::{Join, Joined, MemberSize, Refit, WideForest};

use super::part::{PartNodes, Role};
use super::plan::{Nodes, PartPlan, Planned};
use super::report::{CommitAction, CommitReason, PartChange};
use super::{Scene, Strategy};

/// Nanoseconds of a node visit. Only the ratio to [`BUILD_NS`] decides anything. (`cargo xtask calibrate`: 7 for a node, 11 for a
/// block.)
const NODE_NS: f64 = 10.0;
/// Nanoseconds by which building a triangle exceeds refitting it. (The records in `docs/frames.md`: 200 to 430.)
const BUILD_NS: f64 = 230.0;

/// What becomes of the nodes of a part that has changed.
pub(super) struct Update<'a> {
    /// The index of the part in the scene.
    pub(super) place: usize,
    /// Where its triangles are.
    pub(super) mesh: &'a Arc<Mesh>,
    pub(super) nodes: &'a Nodes,
}

impl<'a> Update<'a> {
    /// `None` if the part has no nodes of its own.
    pub(super) fn of(plan: &'a PartPlan) -> Option<Self> {
        match &plan.planned {
            Planned::Own { mesh, nodes } => Some(Self {
                place: plan.place,
                mesh,
                nodes,
            }),
            Planned::Shared(_) => None,
        }
    }
}

impl Scene {
    /// The number of forests that the strategy traces one after the other.
    fn forest_count(&self) -> usize {
        if self.strategy == Strategy::Dual {
            2
        } else {
            1
        }
    }

    /// The forest of parts of a role.
    fn forest_of(&self, role: Role) -> usize {
        usize::from(self.strategy == Strategy::Dual && role != Role::Static)
    }

    /// Forests for the strategy, with the nodes of all parts that have any in those of the frame before.
    pub(super) fn regroup(&mut self, forests: Vec<WideForest>) -> Vec<WideForest> {
        let count = self.forest_count();
        if forests.len() == count {
            return forests;
        }
        let mut regrouped = vec![WideForest::new(); count];
        for place in self.parts.places() {
            let part = self.parts.at(place);
            let forest = self.forest_of(part.role);
            if let Some(nodes) = part.nodes {
                let member = regrouped[forest].push_copy(&forests[nodes.forest], nodes.member);
                self.parts.at_mut(place).nodes = Some(PartNodes {
                    forest,
                    member,
                    ..nodes
                });
            }
        }
        regrouped
    }

    /// Updates the nodes of some parts, in ascending order of their indices, fitted to where their triangles are.
    pub(super) fn update_forests(&mut self, forests: &mut [WideForest], updates: &[Update<'_>]) {
        for update in updates {
            let nodes = self.parts.at(update.place).nodes;
            if let (Nodes::New(_) | Nodes::Copied(_), Some(nodes)) = (update.nodes, nodes) {
                forests[nodes.forest].remove(nodes.member);
            }
        }
        let sizes = updates.iter().map(|update| {
            let forest = self.forest_of(self.parts.at(update.place).role);
            (forest, self.added_size(forests, updates, update.nodes))
        });
        let sizes: Vec<(usize, MemberSize)> = sizes.collect();
        for (number, forest) in forests.iter_mut().enumerate() {
            let of_forest = sizes.iter().filter(|size| size.0 == number);
            forest.reserve(of_forest.map(|size| size.1));
        }
        let mut refits: Vec<Vec<Refit<'_>>> = vec![Vec::new(); forests.len()];
        for update in updates {
            let part = self.parts.at(update.place);
            let forest = self.forest_of(part.role);
            let first_slot = part.first_slot;
            let nodes = match update.nodes {
                Nodes::Kept => part.nodes.expect("nodes that were planned with are there"),
                Nodes::New(tree) => PartNodes {
                    forest,
                    member: forests[forest].push(tree, first_slot),
                    first_slot,
                },
                Nodes::Copied(original) => {
                    let original = self.parts.at(*original).nodes;
                    let original = original.expect("an original precedes its instances");
                    PartNodes {
                        forest,
                        member: push_copy(forests, forest, &original),
                        ..original
                    }
                }
            };
            let slots = first_slot.wrapping_sub(nodes.first_slot);
            forests[nodes.forest].add_to_slots(nodes.member, slots);
            self.parts.at_mut(update.place).nodes = Some(PartNodes {
                first_slot,
                ..nodes
            });
            if !matches!(update.nodes, Nodes::New(_)) {
                refits[nodes.forest].push(Refit {
                    number: nodes.member,
                    mesh: update.mesh,
                    first_slot,
                });
            }
        }
        for (forest, refits) in forests.iter_mut().zip(refits) {
            forest.refit_all(&refits, self.is_parallel());
        }
        for update in updates {
            let part = self.parts.at(update.place);
            let cost = match update.nodes {
                Nodes::Kept => continue,
                Nodes::Copied(original) => self.parts.at(*original).cost,
                Nodes::New(_) => {
                    let nodes = part.nodes.expect("just pushed");
                    let cost = forests[nodes.forest].cost(nodes.member);
                    let scale = part.placement.area_scale();
                    if scale > 0.0 { cost / scale } else { cost }
                }
            };
            self.parts.at_mut(update.place).cost = cost;
        }
    }

    /// How much `nodes` of one of the updates add to a forest. An original precedes its instances.
    fn added_size(
        &self,
        forests: &[WideForest],
        updates: &[Update<'_>],
        nodes: &Nodes,
    ) -> MemberSize {
        match nodes {
            Nodes::Kept => MemberSize::default(),
            Nodes::New(tree) => MemberSize::of(tree),
            Nodes::Copied(original) => {
                let update = updates.binary_search_by_key(original, |update| update.place);
                match update.map(|update| updates[update].nodes) {
                    Ok(nodes @ (Nodes::New(_) | Nodes::Copied(_))) => {
                        self.added_size(forests, updates, nodes)
                    }
                    Ok(Nodes::Kept) | Err(_) => {
                        let nodes = self.parts.at(*original).nodes;
                        let nodes = nodes.expect("it is in the frame");
                        forests[nodes.forest].size(nodes.member)
                    }
                }
            }
        }
    }

    /// Gives the nodes of all parts the slots that their parts have now.
    pub(super) fn renumber_slots(&mut self, forests: &mut [WideForest]) {
        for part in self.parts.all_mut() {
            if let Some(nodes) = &mut part.nodes {
                let slots = part.first_slot.wrapping_sub(nodes.first_slot);
                forests[nodes.forest].add_to_slots(nodes.member, slots);
                nodes.first_slot = part.first_slot;
            }
        }
    }

    /// New nodes for the refitted parts whose boxes cost rays more time than a build takes; records that in `changes`, which are those of
    /// `plans`. `area` is half that of the box around all parts.
    pub(super) fn build_where_it_pays(
        &self,
        forests: &[WideForest],
        area: f64,
        plans: &[PartPlan],
        changes: &mut [PartChange],
    ) -> Vec<(usize, Nodes)> {
        let mut built = Vec::new();
        for (number, (plan, change)) in plans.iter().zip(changes).enumerate() {
            let Planned::Own { mesh, .. } = &plan.planned else {
                continue;
            };
            if change.action != CommitAction::Refitted {
                continue;
            }
            let part = self.parts.at(plan.place);
            let nodes = part.nodes.expect("it is in the frame");
            let now = forests[nodes.forest].cost(nodes.member);
            let more = (now - part.cost * part.placement.area_scale()).max(0.0);
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
                built.push((number, Nodes::New(self.build_fast(mesh))));
            }
        }
        built
    }

    /// Joins the parts of each forest.
    pub(super) fn join(&self, forests: &mut [WideForest]) -> Joined {
        let mut options = Join {
            is_parallel: self.is_parallel(),
            ..Join::default()
        };
        if let Strategy::Dual | Strategy::Instances = self.strategy {
            options.open_above = f64::INFINITY;
        }
        let mut all = Joined::default();
        for forest in forests {
            let joined = forest.join(options);
            all.nodes += joined.nodes;
            all.links += joined.links;
            all.opened += joined.opened;
        }
        all
    }
}

/// Adds a copy of nodes to a forest.
fn push_copy(forests: &mut [WideForest], forest: usize, of: &PartNodes) -> usize {
    if forest == of.forest {
        return forests[forest].push_again(of.member);
    }
    let [first, second] = forests else {
        unreachable!("parts of one forest share its nodes");
    };
    let (to, from) = if forest == 0 {
        (first, second)
    } else {
        (second, first)
    };
    to.push_copy(from, of.member)
}
