//! Key sets.

use std::sync::Arc;

use glam::DVec3;

use super::Reader;
use super::words::Words;
use crate::LoadError;
use crate::error::quoted;
use crate::keys::{Curve, Key, Keys, Quaternion, Track};

impl Reader<'_> {
    /// `k`: the tracks of everything that has this name. A later one of the same name takes the place of an earlier one.
    pub(super) fn key_set(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let name = words.text("the name of a key set")?;
        words.expect("{")?;
        let mut keys = Keys::default();
        loop {
            match words.word("a track or `}`")? {
                b"}" => break,
                b"transl" => {
                    keys.translation = Some(Curve::Spline(track(words, "transl", vector)?));
                }
                b"scale" => keys.scale = Some(Curve::Spline(track(words, "scale", vector)?)),
                b"rot" => keys.rotation = Some(Curve::Spline(track(words, "rot", rotation)?)),
                b"visibility" => keys.visibility = visibility(words)?,
                other => {
                    let problem = format!("{} is not a track", quoted(other));
                    return Err(words.error(problem));
                }
            }
        }
        self.keys.insert(name, Arc::new(keys));
        Ok(())
    }
}

fn track<T>(
    words: &mut Words<'_>,
    name: &str,
    value: fn(&mut Words<'_>) -> Result<T, LoadError>,
) -> Result<Track<T>, LoadError> {
    let count = words.count("the number of keys")?;
    let mut keys = Vec::new();
    for _ in 0..count {
        let time = words.number("the time of a key")?;
        let value = value(words)?;
        let [tension, continuity, bias] = words.numbers("tension, continuity and bias")?;
        keys.push(Key {
            time,
            value,
            tension,
            continuity,
            bias,
        });
    }
    Track::new(keys).ok_or_else(|| {
        let least = Track::<T>::LEAST;
        words.error(if count < least {
            format!("`{name}` has {count} keys, at least {least} are needed")
        } else {
            format!("`{name}`: the times of keys descend")
        })
    })
}

fn vector(words: &mut Words<'_>) -> Result<DVec3, LoadError> {
    words.numbers("a key").map(DVec3::from_array)
}

fn rotation(words: &mut Words<'_>) -> Result<Quaternion, LoadError> {
    let [x, y, z, degrees] = words.numbers("a rotation")?;
    Ok(Quaternion::about(DVec3::new(x, y, z), degrees))
}

fn visibility(words: &mut Words<'_>) -> Result<Vec<(f64, bool)>, LoadError> {
    let count = words.count("the number of keys")?;
    let mut keys: Vec<(f64, bool)> = Vec::new();
    for _ in 0..count {
        let time = words.number("the time of a key")?;
        let is_visible = words.number("0 or 1")? != 0.0;
        if keys.last().is_some_and(|(before, _)| *before > time) {
            return Err(words.error("`visibility`: the times of keys descend"));
        }
        keys.push((time, is_visible));
    }
    Ok(keys)
}
