//! The animation of a glTF file.

use std::collections::HashMap;

use glam::DQuat;

use super::json::{self, Channel, Node, Sampler, Whole};
use super::{Reader, at_rest, rotation, vector};
use crate::keys::sampled::{Interpolate, Sampled, Values};
use crate::keys::{Curve, Keys};
use crate::report::{Place, WarningCode};
use crate::{LoadError, Span};

/// Frames per second; glTF specifies times only.
const FRAMES_PER_SECOND: f64 = 25.0;

const ANIMATION: &str = "/animations/0";

/// What the first animation moves, by index of the node in the file.
#[derive(Default)]
pub(super) struct Motion {
    /// The keys of nodes. Properties without keys are constant.
    pub(super) keys: HashMap<usize, Keys>,
    /// The weight of each morph target.
    pub(super) weights: HashMap<usize, Vec<Sampled<f64>>>,
    /// The time of the last key, in seconds.
    end: f64,
}

impl Motion {
    /// The keys of a node; at first, those of its place at rest.
    fn of(&mut self, number: Whole, node: &Node) -> &mut Keys {
        self.keys.entry(number.0).or_insert_with(|| at_rest(node))
    }
}

impl Reader<'_> {
    pub(super) fn motion(&mut self) -> Result<Motion, LoadError> {
        let mut motion = Motion::default();
        let animations = self.document.all("/animations").len();
        if animations == 0 {
            return Ok(motion);
        }
        if animations > 1 {
            let what = format!("of {animations} animations, only the first is read");
            self.warn("/animations", WarningCode::Unused, what);
        }
        let animation: json::Animation = self.document.get("/animations", Whole(0))?;
        for (number, channel) in animation.channels.iter().enumerate() {
            let pointer = format!("{ANIMATION}/channels/{number}");
            if let Err(error) = self.channel(channel, &animation.samplers, &pointer, &mut motion) {
                let what = format!("a channel cannot be read; it is left out ({error})");
                let place = Some(Place::Pointer(pointer));
                self.report
                    .leave_out(error, place, WarningCode::BadAnimation, &what)?;
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a million frames"
        )]
        let frames = (motion.end * FRAMES_PER_SECOND).ceil().clamp(1.0, 1e6) as usize + 1;
        if !motion.keys.is_empty() || !motion.weights.is_empty() {
            self.scene.span = Some(Span {
                start: 0.0,
                end: motion.end,
                frames,
            });
        }
        Ok(motion)
    }

    fn channel(
        &mut self,
        channel: &Channel,
        samplers: &[Sampler],
        pointer: &str,
        motion: &mut Motion,
    ) -> Result<(), LoadError> {
        let Some(target) = channel.target.node else {
            let what = "a channel moves no node; it is left out";
            self.warn(pointer, WarningCode::BadAnimation, what);
            return Ok(());
        };
        let path = channel.target.path.as_str();
        if !["translation", "rotation", "scale", "weights"].contains(&path) {
            let what = format!("the property `{path}` is not animated");
            self.warn(pointer, WarningCode::Unused, what);
            return Ok(());
        }
        let node: Node = self.document.get("/nodes", target)?;
        let sampler = samplers.get(channel.sampler.0).ok_or_else(|| {
            let problem = format!("does not exist, there are {}", samplers.len());
            self.document
                .bad_value(&format!("{pointer}/sampler"), problem)
        })?;
        let pointer = format!("{ANIMATION}/samplers/{}", channel.sampler.0);
        let times = self.numbers::<1>(sampler.input, false)?;
        let times: Vec<f64> = times.into_iter().map(|[time]| f64::from(time)).collect();
        if times.is_empty() || !times.iter().all(|time| time.is_finite()) {
            let problem = "has no key times, or some that are not finite";
            return Err(self.document.bad_value(&pointer, problem));
        }
        if !times.is_sorted() {
            let what = "key times descend; the keys are sorted";
            self.warn(&pointer, WarningCode::BadAnimation, what);
        }
        let end = times.iter().copied().fold(motion.end, f64::max);
        let curve = CurveOf {
            times,
            sampler,
            pointer,
        };
        if path == "weights" {
            let weights = self.weights(curve)?;
            motion.weights.insert(target.0, weights);
        } else if path == "rotation" {
            let rotations = self.numbers::<4>(sampler.output, true)?;
            let rotations = rotations.into_iter().map(|numbers| numbers.map(f64::from));
            let is_cubic = sampler.interpolation.as_deref() == Some("CUBICSPLINE");
            // Tangents have any length.
            let of = |numbers| {
                if is_cubic {
                    DQuat::from_array(numbers)
                } else {
                    rotation(numbers)
                }
            };
            let sampled = self.sampled(&curve, rotations.map(of).collect())?;
            motion.of(target, &node).rotation = Some(Curve::Sampled(sampled));
        } else {
            let values = self.numbers::<3>(sampler.output, false)?;
            let values = values.into_iter().map(vector);
            let sampled = Some(Curve::Sampled(self.sampled(&curve, values.collect())?));
            let keys = motion.of(target, &node);
            if path == "scale" {
                keys.scale = sampled;
            } else {
                keys.translation = sampled;
            }
        }
        motion.end = end;
        Ok(())
    }

    /// The curve of each morph target: the values of a key are one weight for each target.
    fn weights(&mut self, curve: CurveOf<'_>) -> Result<Vec<Sampled<f64>>, LoadError> {
        let all = self.all_numbers::<f32>(curve.sampler.output, true)?.numbers;
        let is_cubic = curve.sampler.interpolation.as_deref() == Some("CUBICSPLINE");
        let rows = curve.times.len() * if is_cubic { 3 } else { 1 };
        if all.len() % rows != 0 {
            return Err(self.mismatch(&curve, all.len()));
        }
        let targets = all.len() / rows;
        let of_target = |target: usize| {
            let values = all.iter().skip(target).step_by(targets);
            self.sampled(&curve, values.map(|weight| f64::from(*weight)).collect())
        };
        (0..targets).map(of_target).collect()
    }

    fn mismatch(&self, curve: &CurveOf<'_>, values: usize) -> LoadError {
        let problem = format!("has {} key times, but {values} values", curve.times.len());
        self.document.bad_value(&curve.pointer, problem)
    }

    /// The curve through the values of a sampler, in order of their times.
    fn sampled<T: Interpolate>(
        &self,
        curve: &CurveOf<'_>,
        values: Vec<T>,
    ) -> Result<Sampled<T>, LoadError> {
        let count = curve.times.len();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| curve.times[*a].total_cmp(&curve.times[*b]));
        let times = order.iter().map(|key| curve.times[*key]).collect();
        let each = || order.iter().map(|key| values[*key]).collect();
        let values = match curve.sampler.interpolation.as_deref().unwrap_or("LINEAR") {
            "STEP" if values.len() == count => Values::Step(each()),
            "LINEAR" if values.len() == count => Values::Linear(each()),
            "CUBICSPLINE" if values.len() == 3 * count => {
                let keys = values.as_chunks::<3>().0;
                Values::Cubic(order.iter().map(|key| keys[*key]).collect())
            }
            "STEP" | "LINEAR" | "CUBICSPLINE" => return Err(self.mismatch(curve, values.len())),
            other => {
                let problem = format!("has the unknown interpolation `{other}`");
                return Err(self.document.bad_value(&curve.pointer, problem));
            }
        };
        Ok(Sampled { times, values })
    }
}

/// The times of a curve, and the sampler that has its values.
struct CurveOf<'a> {
    times: Vec<f64>,
    sampler: &'a Sampler,
    pointer: String,
}
