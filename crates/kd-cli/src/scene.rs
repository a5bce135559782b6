//! Arguments that several commands share: scene, builder, size.

use std::path::PathBuf;
use std::str::FromStr;

use crate::print::progress_bar;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use kd::BuildOptions;
use kd_scene::{
    AffOptions, LoadOptions, SceneDescription, Spd, Strictness, load_scene_with, toy_room,
};

/// Selects a scene and a frame of its animation.
#[derive(Args, Clone, Debug)]
pub(crate) struct SceneArgs {
    /// A file (.obj, .ply, .stl, .off, .gltf, .glb, .3mf, .aff, .nff), `room:N`, or a generated scene and its size, such as `gears:4`.
    /// `cast`, `stats` and `convert` also open a tree (.kd), which nothing may change meanwhile
    #[arg(value_name = "SCENE")]
    pub(crate) scene: String,

    /// Leave out damaged elements, and unknown commands of AFF and NFF files, with a warning
    #[arg(long, conflicts_with = "strict")]
    lenient: bool,

    /// Refuse a file with anything that is left out or replaced
    #[arg(long)]
    strict: bool,

    /// Level of detail up to which AFF scenes include files
    #[arg(long, value_name = "N", default_value_t = 0)]
    detail: u32,

    /// Frame of the animation, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) frame: usize,
}

impl SceneArgs {
    pub(crate) fn load(&self) -> anyhow::Result<SceneDescription> {
        if let Some((name, size)) = self.scene.split_once(':')
            && !PathBuf::from(&self.scene).exists()
        {
            return generated(name, size);
        }
        let aff = AffOptions {
            detail: self.detail,
            ..AffOptions::default()
        };
        let strictness = match (self.strict, self.lenient) {
            (true, _) => Strictness::Strict,
            (_, true) => Strictness::Lenient,
            _ => Strictness::Usual,
        };
        let bar = progress_bar(None, "reading {bar:40} {bytes} of {total_bytes}");
        let of_reader = bar.clone();
        let options = LoadOptions::new()
            .with_strictness(strictness)
            .with_aff(aff)
            .with_progress(move |read, length| {
                of_reader.set_length(length);
                of_reader.set_position(read);
            });
        let loaded = load_scene_with(&self.scene, &options);
        bar.finish_and_clear();
        Ok(loaded?.value)
    }

    /// [`load`](Self::load), and prints the warnings.
    pub(crate) fn load_with_warnings(&self) -> anyhow::Result<SceneDescription> {
        let scene = self.load()?;
        for warning in &scene.warnings {
            eprintln!("warning: {warning}");
        }
        Ok(scene)
    }

    /// The time of the frame, in seconds.
    pub(crate) fn time(&self, scene: &SceneDescription) -> anyhow::Result<f64> {
        time_of(scene, self.frame)
    }
}

fn generated(name: &str, size: &str) -> anyhow::Result<SceneDescription> {
    let size = u32::from_str(size).with_context(|| format!("the size in `{name}:{size}`"))?;
    if name == "room" {
        return Ok(toy_room(size)?);
    }
    let Some(spd) = Spd::ALL.into_iter().find(|spd| spd.to_string() == name) else {
        let names = Spd::ALL.map(|spd| spd.to_string());
        bail!(
            "unknown generated scene `{name}`; expected one of room, {}",
            names.join(", ")
        );
    };
    Ok(SceneDescription::of_setup(spd.generate(size)?))
}

/// The time of a frame, in seconds.
pub(crate) fn time_of(scene: &SceneDescription, frame: usize) -> anyhow::Result<f64> {
    match scene.span {
        None if frame == 0 => Ok(0.0),
        None => bail!("frame {frame}: the scene has no animation"),
        Some(span) if frame < span.frames => Ok(span.time_of(frame)),
        Some(span) => bail!(
            "frame {frame}: the animation has {} frames, numbered from 0",
            span.frames
        ),
    }
}

/// A builder preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Builder {
    /// Fastest rays
    Best,
    /// Nearly as fast rays, shorter build
    Balanced,
    /// Shortest build
    Fast,
}

impl Builder {
    pub(crate) fn options(self) -> BuildOptions {
        match self {
            Self::Best => BuildOptions::best(),
            Self::Balanced => BuildOptions::balanced(),
            Self::Fast => BuildOptions::fast(),
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Best => "best",
            Self::Balanced => "balanced",
            Self::Fast => "fast",
        }
    }
}

/// Width and height in pixels, from 1 to 32768 each, as `800x600`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let (width, height) = text
            .split_once('x')
            .context("expected a size such as 800x600")?;
        let [width, height] = [width, height].map(u32::from_str);
        let (width, height) = (width?, height?);
        if width == 0 || height == 0 || width > 1 << 15 || height > 1 << 15 {
            bail!("size {width}x{height}: width and height must be from 1 to 32768");
        }
        Ok(Self { width, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_parse_as_two_numbers() {
        let size = "80x60".parse::<Size>().expect("valid");
        assert_eq!((size.width, size.height), (80, 60));
        for bad in ["80", "80x", "0x5", "x", "-1x2", "99999x1"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
    }

    #[test]
    fn frames_outside_of_the_animation_are_refused() {
        let room = generated("room", "1").expect("within the limits");
        let last = room.span.expect("an animation").frames - 1;
        assert!(time_of(&room, last).is_ok() && time_of(&room, last + 1).is_err());
        let gears = generated("gears", "1").expect("within the limits");
        assert!(time_of(&gears, 0).is_ok() && time_of(&gears, 1).is_err());
        let error = generated("nothing", "1")
            .expect_err("no such scene")
            .to_string();
        assert!(
            error.contains("room, ") && error.contains("gears"),
            "{error}"
        );
    }
}
