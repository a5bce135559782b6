//! The animation of a glTF file.

use std::collections::HashMap;

use glam::{DQuat, DVec3, Quat, Vec3};
use gltf::animation::util::ReadOutputs;
use gltf::animation::{Interpolation, Property};

use super::Reader;
use crate::keys::sampled::{Sampled, Values};
use crate::keys::{Curve, Keys};
use crate::{LoadError, Span};

/// Frames in a second, where a file only knows times.
const FRAMES: f64 = 25.0;

impl Reader {
    /// How nodes move, by their numbers in the file, in the first animation. What is not moved of them is where it is.
    pub(super) fn motion(
        &mut self,
        document: &gltf::Document,
    ) -> Result<HashMap<usize, Keys>, LoadError> {
        let mut motion: HashMap<usize, Keys> = HashMap::new();
        let Some(animation) = document.animations().next() else {
            return Ok(motion);
        };
        if document.animations().count() > 1 {
            self.warn("only the first of its animations is read".to_owned());
        }
        let mut end = 0.0_f64;
        for channel in animation.channels() {
            let reader = channel.reader(|buffer| self.buffers.get(buffer.index()));
            let node = channel.target().node();
            let (Some(inputs), Some(outputs)) = (reader.read_inputs(), reader.read_outputs())
            else {
                let problem = "a channel has no keys";
                return Err(self.bad("animation", animation.index(), problem));
            };
            if channel.target().property() == Property::MorphTargetWeights {
                self.warn("shapes to blend do not move".to_owned());
                continue;
            }
            let times: Vec<f64> = inputs.map(f64::from).collect();
            let ascends =
                times.is_sorted_by(|a, b| a < b) && times.iter().all(|time| time.is_finite());
            if times.is_empty() || !ascends {
                let problem = "the times of keys do not ascend";
                return Err(self.bad("animation", animation.index(), problem));
            }
            end = end.max(times[times.len() - 1]);
            let keys = motion.entry(node.index()).or_insert_with(|| at_rest(&node));
            let way = channel.sampler().interpolation();
            let wrong = || {
                self.bad(
                    "animation",
                    animation.index(),
                    "there are not as many values as times",
                )
            };
            match outputs {
                ReadOutputs::Translations(values) => {
                    let curve =
                        sampled(times, values.map(vector).collect(), way).ok_or_else(wrong)?;
                    keys.translation = Some(Curve::Sampled(curve));
                }
                ReadOutputs::Scales(values) => {
                    let curve =
                        sampled(times, values.map(vector).collect(), way).ok_or_else(wrong)?;
                    keys.scale = Some(Curve::Sampled(curve));
                }
                ReadOutputs::Rotations(values) => {
                    let values = values
                        .into_f32()
                        .map(|turn| Quat::from_array(turn).as_dquat());
                    let curve = sampled(times, values.collect(), way).ok_or_else(wrong)?;
                    keys.rotation = Some(Curve::Sampled(curve));
                }
                ReadOutputs::MorphTargetWeights(_) => {}
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a million frames are enough"
        )]
        let frames = (end * FRAMES).ceil().clamp(1.0, 1e6) as usize + 1;
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

/// Where a node is that does not move.
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

/// `None` if there are not as many values as there should be.
fn sampled<T: Copy>(times: Vec<f64>, values: Vec<T>, way: Interpolation) -> Option<Sampled<T>> {
    let count = times.len();
    let values = match way {
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
