//! The parts of a description in the scene: a part of the scene for each instance.

use std::sync::Arc;

use kd::glam::Affine3A;
use kd::{PartId, Scene};
use kd_scene::{InstancePlace, Part};

use crate::stage::StageError;

/// The instances of a part in the scene, each with its current transform; none while the part is invisible.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlacedPart(Vec<(PartId, Affine3A)>);

impl PlacedPart {
    /// The part of the scene that is an instance.
    #[inline]
    pub(crate) fn id(&self, instance: u32) -> Option<PartId> {
        self.0.get(instance as usize).map(|(id, _)| *id)
    }

    /// Removes all instances.
    pub(crate) fn hide(&mut self, scene: &mut Scene, part: &Part) -> Result<(), StageError> {
        for (id, _) in self.0.drain(..) {
            scene.remove(id).map_err(StageError::of_scene(part))?;
        }
        Ok(())
    }

    /// Adds the instances or moves them to their places, and deforms them, if the part does. One that did not move is left alone.
    pub(crate) fn show(
        &mut self,
        scene: &mut Scene,
        part: &Part,
        places: &[InstancePlace],
        deformed: Option<Vec<[f32; 3]>>,
        time: f64,
    ) -> Result<(), StageError> {
        let deformed = deformed.map(|positions| part.mesh.with_positions(positions));
        let deformed = deformed.transpose().map_err(|error| StageError::Mesh {
            part: part.name.clone(),
            time,
            error,
        })?;
        let fail = StageError::of_scene(part);
        let first = match self.id(0) {
            Some(first) => {
                if let Some(mesh) = deformed {
                    // The other instances follow.
                    scene
                        .set_positions(first, mesh.positions())
                        .map_err(&fail)?;
                }
                first
            }
            None => {
                let mesh = deformed.map_or_else(|| Arc::clone(&part.mesh), Arc::new);
                let added = if part.may_move() {
                    scene.add_dynamic(mesh)
                } else {
                    scene.add_static(mesh)
                };
                let first = added.map_err(&fail)?;
                self.0.push((first, Affine3A::IDENTITY));
                first
            }
        };
        // An error leaves instances out, which are added when the part is shown again.
        for (number, place) in places.iter().enumerate() {
            let Some((id, before)) = self.0.get_mut(number) else {
                let added = scene.add_instance(first, place.transform);
                self.0.push((added.map_err(&fail)?, place.transform));
                continue;
            };
            if place.transform != *before {
                scene.set_transform(*id, place.transform).map_err(&fail)?;
                *before = place.transform;
            }
        }
        Ok(())
    }
}

/// A visible instance, and its place in the description.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenInstance {
    pub(crate) id: PartId,
    /// The index of the part.
    pub(crate) part: usize,
    /// The index of the instance.
    pub(crate) instance: u32,
}

impl SeenInstance {
    /// All visible instances, in the order of their ids.
    pub(crate) fn all(parts: &[PlacedPart]) -> Vec<Self> {
        let seen = parts.iter().enumerate().flat_map(|(part, placed)| {
            let instances = placed.0.iter().zip(0..);
            instances.map(move |((id, _), instance)| Self {
                id: *id,
                part,
                instance,
            })
        });
        let mut seen: Vec<Self> = seen.collect();
        seen.sort_unstable_by_key(|instance| instance.id);
        seen
    }
}
