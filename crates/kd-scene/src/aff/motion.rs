//! Key sets: the animation of nodes, lights and the camera.

use std::sync::Arc;

use glam::DVec3;

use super::Reader;
use super::tokens::Tokens;
use crate::LoadError;
use crate::error::quoted;
use crate::keys::{Curve, Key, Keys, Quaternion, Track};

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
                    keys.translation = Some(Curve::Spline(track(tokens, "transl", vector)?));
                }
                b"scale" => keys.scale = Some(Curve::Spline(track(tokens, "scale", vector)?)),
                b"rot" => keys.rotation = Some(Curve::Spline(track(tokens, "rot", rotation)?)),
                b"visibility" => keys.visibility = visibility(tokens)?,
                other => {
                    let problem = format!("{} is not a track", quoted(other));
                    return Err(tokens.error(problem));
                }
            }
        }
        self.keys.insert(name, Arc::new(keys));
        Ok(())
    }
}

fn track<T>(
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
    Track::new(keys).ok_or_else(|| {
        let least = Track::<T>::MIN_KEYS;
        tokens.error(if count < least {
            format!("`{name}` has {count} keys, at least {least} are needed")
        } else {
            format!("`{name}`: key times must not descend")
        })
    })
}

fn vector(tokens: &mut Tokens<'_>) -> Result<DVec3, LoadError> {
    tokens.numbers("a key").map(DVec3::from_array)
}

fn rotation(tokens: &mut Tokens<'_>) -> Result<Quaternion, LoadError> {
    let [x, y, z, degrees] = tokens.numbers("a rotation")?;
    Ok(Quaternion::about(DVec3::new(x, y, z), degrees))
}

fn visibility(tokens: &mut Tokens<'_>) -> Result<Vec<(f64, bool)>, LoadError> {
    let count = tokens.count("the number of keys")?;
    let mut keys: Vec<(f64, bool)> = Vec::new();
    for _ in 0..count {
        let time = tokens.number("the time of a key")?;
        let is_visible = tokens.number("0 or 1")? != 0.0;
        if keys.last().is_some_and(|(before, _)| *before > time) {
            return Err(tokens.error("`visibility`: key times must not descend"));
        }
        keys.push((time, is_visible));
    }
    Ok(keys)
}
