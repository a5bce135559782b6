//! Key sets: the animation of nodes, lights and the camera.

use std::sync::Arc;

use glam::DVec3;

use super::Reader;
use super::tokens::Tokens;
use crate::LoadError;
use crate::error::quoted;
use crate::keys::{Curve, Key, Keys, Quaternion, Track};
use crate::report::WarningCode;

/// The warning of keys that are out of order. As in the player of BART, the first segment counts that ends after a time.
pub(super) const TIMES_DESCEND: &str =
    "key times go back; the first segment that ends after a time is used";

impl Reader<'_> {
    /// `k`: the tracks of all objects of a name. A later key set replaces an earlier one of the same name.
    pub(super) fn key_set(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let name = tokens.text("the name of a key set")?;
        tokens.expect("{")?;
        let mut keys = Keys::default();
        loop {
            match tokens.token("a track or `}`")? {
                b"}" => break,
                b"transl" => {
                    let track = self.track(tokens, "transl", vector)?;
                    keys.translation = Some(Curve::Spline(track));
                }
                b"scale" => {
                    keys.scale = Some(Curve::Spline(self.track(tokens, "scale", vector)?));
                }
                b"rot" => {
                    keys.rotation = Some(Curve::Spline(self.track(tokens, "rot", rotation)?));
                }
                b"visibility" => keys.visibility = self.visibility(tokens)?,
                other => {
                    let problem = format!("{} is not a track", quoted(other));
                    return Err(tokens.error(problem));
                }
            }
        }
        self.keys.insert(name, Arc::new(keys));
        Ok(())
    }

    fn track<T>(
        &mut self,
        tokens: &mut Tokens<'_>,
        name: &str,
        value: fn(&mut Tokens<'_>) -> Result<T, LoadError>,
    ) -> Result<Track<T>, LoadError> {
        let count = tokens.count("the number of keys")?;
        let mut keys = Vec::new();
        for _ in 0..count {
            let time = tokens.number("the time of a key")?;
            let value = value(tokens)?;
            let [tension, continuity, bias] = tokens.numbers("tension, continuity and bias")?;
            keys.push(Key {
                time,
                value,
                tension,
                continuity,
                bias,
            });
        }
        if !keys.is_sorted_by(|a, b| a.time <= b.time) {
            self.warn(tokens, WarningCode::BadAnimation, TIMES_DESCEND);
        }
        let least = Track::<T>::MIN_KEYS;
        Track::new(keys).ok_or_else(|| {
            tokens.error(format!(
                "`{name}` has {count} keys, at least {least} are needed"
            ))
        })
    }

    fn visibility(&mut self, tokens: &mut Tokens<'_>) -> Result<Vec<(f64, bool)>, LoadError> {
        let count = tokens.count("the number of keys")?;
        let mut keys: Vec<(f64, bool)> = Vec::new();
        for _ in 0..count {
            let time = tokens.number("the time of a key")?;
            keys.push((time, tokens.number("0 or 1")? != 0.0));
        }
        if !keys.is_sorted_by(|a, b| a.0 <= b.0) {
            self.warn(tokens, WarningCode::BadAnimation, TIMES_DESCEND);
        }
        Ok(keys)
    }
}

fn vector(tokens: &mut Tokens<'_>) -> Result<DVec3, LoadError> {
    tokens.numbers("a key").map(DVec3::from_array)
}

fn rotation(tokens: &mut Tokens<'_>) -> Result<Quaternion, LoadError> {
    let [x, y, z, degrees] = tokens.numbers("a rotation")?;
    Ok(Quaternion::about(DVec3::new(x, y, z), degrees))
}
