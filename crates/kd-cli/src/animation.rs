//! Where pictures go: to a file, to numbered files, or into one that moves.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, DynamicImage, Frame, ImageFormat};
use kd_render::Picture;
use kd_scene::SceneDescription;

use crate::render::numbered;

/// Where pictures go.
pub(crate) enum Output {
    One(PathBuf),
    Numbered(PathBuf),
    Moving {
        path: PathBuf,
        encoder: Box<GifEncoder<BufWriter<File>>>,
        delay: Delay,
    },
}

impl Output {
    /// Refuses at once what could not be written in the end.
    pub(crate) fn new(
        path: &Path,
        is_animation: bool,
        scene: &SceneDescription,
    ) -> anyhow::Result<Self> {
        let format = ImageFormat::from_path(path).with_context(|| format!("{}", path.display()))?;
        if !format.can_write() || !format.writing_enabled() {
            bail!(
                "{}: pictures in this format cannot be written",
                path.display()
            );
        }
        if !is_animation {
            return Ok(Self::One(path.to_owned()));
        }
        if format != ImageFormat::Gif {
            return Ok(Self::Numbered(path.to_owned()));
        }
        let file = File::create(path).with_context(|| format!("{}", path.display()))?;
        let mut encoder = GifEncoder::new_with_speed(BufWriter::new(file), 10);
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self::Moving {
            path: path.to_owned(),
            encoder: Box::new(encoder),
            delay: delay(scene),
        })
    }

    pub(crate) fn add(&mut self, frame: usize, picture: &Picture) -> anyhow::Result<()> {
        let save = |path: &Path| {
            picture
                .save(path)
                .with_context(|| format!("{}", path.display()))
        };
        match self {
            Self::One(path) => save(path),
            Self::Numbered(path) => save(&numbered(path, frame)),
            Self::Moving { encoder, delay, .. } => {
                let image = DynamicImage::from(picture.to_image()).to_rgba8();
                Ok(encoder.encode_frame(Frame::from_parts(image, 0, 0, *delay))?)
            }
        }
    }

    /// What was written.
    pub(crate) fn finish(self) -> anyhow::Result<PathBuf> {
        Ok(match self {
            Self::One(path) | Self::Numbered(path) | Self::Moving { path, .. } => path,
        })
    }
}

/// How long each frame of a scene is seen.
fn delay(scene: &SceneDescription) -> Delay {
    let seconds = scene.span.map_or(0.04, |span| {
        (span.end - span.start) / span.frames.saturating_sub(1).max(1) as f64
    });
    // Faster than this is not shown by most programs.
    let seconds = seconds.clamp(0.02, 60.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 20 and 60000"
    )]
    let milliseconds = (seconds * 1e3).round() as u32;
    Delay::from_numer_denom_ms(milliseconds, 1)
}
