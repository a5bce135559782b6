//! The animation of a glTF file.

use std::collections::HashMap;

use glam::{DQuat, DVec3, Quat, Vec3};
use gltf::animation::{Interpolation, Property};
use gltf::json::validation::Checked;

use super::Reader;
use crate::keys::sampled::{Sampled, Values};
use crate::keys::{Curve, Keys};
use crate::{LoadError, Span};

/// Frames per second; glTF specifies times only.
const FRAMES_PER_SECOND: f64 = 25.0;

impl Reader {
    /// The keys of the animated nodes in the first animation, by node index in the file. Properties without keys are constant.
    pub(super) fn motion(
        &mut self,
        document: &gltf::Document,
    ) -> Result<HashMap<usize, Keys>, LoadError> {
        let mut motion: HashMap<usize, Keys> = HashMap::new();
        let Some(animation) = document.animations().next() else {
            return Ok(motion);
        };
        if document.animations().count() > 1 {
            self.warn("only the first animation is read");
        }
        let number = animation.index();
        let json = self.json.animations.get(number).cloned();
        let json = json.ok_or_else(|| self.bad_element("animation", number, "does not exist"))?;
        let mut end = 0.0_f64;
        for channel in &json.channels {
            let node = document.nodes().nth(channel.target.node.value());
            let sampler = json.samplers.get(channel.sampler.value());
            let (Some(node), Some(sampler)) = (node, sampler) else {
                return Err(self.bad_element(
                    "animation",
                    number,
                    "a channel refers to a node or sampler that does not exist",
                ));
            };
            let (Checked::Valid(property), Checked::Valid(interpolation)) =
                (channel.target.path, sampler.interpolation)
            else {
                return Err(self.bad_element(
                    "animation",
                    number,
                    "a channel has an unknown target path or interpolation",
                ));
            };
            if property == Property::MorphTargetWeights {
                self.warn("animated morph targets are ignored");
                continue;
            }
            let times = self.numbers::<1>(sampler.input, false)?;
            let times: Vec<f64> = times.into_iter().map(|[time]| time).collect();
            let is_finite = times.iter().all(|time| time.is_finite());
            if times.is_empty() || !is_finite || !times.is_sorted_by(|a, b| a < b) {
                return Err(self.bad_element("animation", number, "key times do not ascend"));
            }
            end = end.max(times[times.len() - 1]);
            let wrong = || {
                self.bad_element(
                    "animation",
                    number,
                    "the number of values does not match the number of key times",
                )
            };
            let keys = motion.entry(node.index()).or_insert_with(|| at_rest(&node));
            if property == Property::Rotation {
                let rotations = self.numbers::<4>(sampler.output, true)?;
                let rotations = rotations.into_iter().map(DQuat::from_array).collect();
                let curve = sampled(times, rotations, interpolation).ok_or_else(wrong)?;
                keys.rotation = Some(Curve::Sampled(curve));
                continue;
            }
            let values = self.numbers::<3>(sampler.output, false)?;
            let values = values.into_iter().map(DVec3::from).collect();
            let curve = Some(Curve::Sampled(
                sampled(times, values, interpolation).ok_or_else(wrong)?,
            ));
            if property == Property::Scale {
                keys.scale = curve;
            } else {
                keys.translation = curve;
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a million frames"
        )]
        let frames = (end * FRAMES_PER_SECOND).ceil().clamp(1.0, 1e6) as usize + 1;
        if !motion.is_empty() {
            self.scene.span = Some(Span {
                start: 0.0,
                end,
                frames,
            });
        }
        Ok(motion)
    }
}

/// The static transform of a node as constant curves.
fn at_rest(node: &gltf::Node<'_>) -> Keys {
    let (translation, rotation, scale) = node.transform().decomposed();
    let turn: DQuat = Quat::from_array(rotation).as_dquat();
    Keys {
        translation: Some(Curve::Sampled(Sampled::constant(vector(translation)))),
        rotation: Some(Curve::Sampled(Sampled::constant(turn))),
        scale: Some(Curve::Sampled(Sampled::constant(vector(scale)))),
        visibility: Vec::new(),
    }
}

/// The keys of a sampler; `None` if the number of values does not match the number of times.
fn sampled<T: Copy>(
    times: Vec<f64>,
    values: Vec<T>,
    interpolation: Interpolation,
) -> Option<Sampled<T>> {
    let count = times.len();
    let values = match interpolation {
        Interpolation::Step if values.len() == count => Values::Step(values),
        Interpolation::Linear if values.len() == count => Values::Linear(values),
        Interpolation::CubicSpline if values.len() == 3 * count => {
            Values::Cubic(values.as_chunks::<3>().0.to_vec())
        }
        _ => return None,
    };
    Some(Sampled { times, values })
}

fn vector(numbers: [f32; 3]) -> DVec3 {
    Vec3::from(numbers).as_dvec3()
}
