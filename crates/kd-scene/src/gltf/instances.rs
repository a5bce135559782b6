//! The instances of the mesh of a node (`EXT_mesh_gpu_instancing`).

use glam::{DAffine3, DQuat, DVec3};

use super::json::{Attributes, Node};
use super::{Reader, rotation, vector};
use crate::LoadError;

/// The name of the extension.
pub(super) const NAME: &str = "EXT_mesh_gpu_instancing";

impl Reader<'_> {
    /// The transform of each instance to the coordinates of the node: the identity alone without the extension.
    pub(super) fn instances(
        &mut self,
        node: &Node,
        pointer: &str,
    ) -> Result<Vec<DAffine3>, LoadError> {
        let Some(attributes) = node
            .extensions
            .get(NAME)
            .and_then(|of| of.get("attributes"))
        else {
            return Ok(vec![DAffine3::IDENTITY]);
        };
        let pointer = format!("{pointer}/extensions/{NAME}/attributes");
        let attributes: Attributes = self.document.read(attributes, &pointer)?;
        let translations = attributes
            .get("TRANSLATION")
            .map(|it| self.numbers::<3>(*it, false));
        let translations = translations.transpose()?;
        let rotations = attributes
            .get("ROTATION")
            .map(|it| self.numbers::<4>(*it, true));
        let rotations = rotations.transpose()?;
        let scales = attributes
            .get("SCALE")
            .map(|it| self.numbers::<3>(*it, false));
        let scales = scales.transpose()?;
        let counts = [
            translations.as_ref().map(Vec::len),
            rotations.as_ref().map(Vec::len),
            scales.as_ref().map(Vec::len),
        ];
        let mut counts = counts.into_iter().flatten();
        let Some(count) = counts.next() else {
            // Attributes of an application only: their number is that of the instances.
            let first = attributes.values().next();
            let count = first
                .map(|it| self.all_numbers::<f32>(*it, false))
                .transpose()?;
            return Ok(vec![DAffine3::IDENTITY; count.map_or(1, |all| all.count())]);
        };
        if counts.any(|other| other != count) {
            let problem = "the accessors have different counts";
            return Err(self.document.bad_value(&pointer, problem));
        }
        let instance = |number: usize| {
            let scale = scales
                .as_ref()
                .map_or(DVec3::ONE, |all| vector(all[number]));
            let turn = rotations.as_ref();
            let turn = turn.map_or(DQuat::IDENTITY, |all| rotation(all[number].map(f64::from)));
            let at = translations
                .as_ref()
                .map_or(DVec3::ZERO, |all| vector(all[number]));
            DAffine3::from_scale_rotation_translation(scale, turn, at)
        };
        Ok((0..count).map(instance).collect())
    }
}
