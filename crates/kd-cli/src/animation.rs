//! Output of pictures: one file, numbered files, or an animated GIF.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, DynamicImage, Frame, ImageFormat};
use kd_render::Picture;
use kd_scene::SceneDescription;

use crate::render::numbered;

/// The destination of pictures.
pub(crate) enum Output {
    /// One file for one picture.
    Single(PathBuf),
    /// One file per frame, with the frame number in its name.
    Numbered(PathBuf),
    /// One animated GIF.
    Gif {
        path: PathBuf,
        encoder: Box<GifEncoder<BufWriter<File>>>,
        delay: Delay,
    },
}

impl Output {
    /// Opens the output. Fails before any picture is rendered if the format cannot be written.
    pub(crate) fn new(
        path: &Path,
        is_animation: bool,
        scene: &SceneDescription,
    ) -> anyhow::Result<Self> {
        let format = ImageFormat::from_path(path).with_context(|| format!("{}", path.display()))?;
        if !format.can_write() || !format.writing_enabled() {
            bail!(
                "{}: this picture format cannot be written; use .png, .jpg, .ppm or .gif",
                path.display()
            );
        }
        if !is_animation {
            return Ok(Self::Single(path.to_owned()));
        }
        if format != ImageFormat::Gif {
            return Ok(Self::Numbered(path.to_owned()));
        }
        let file = File::create(path).with_context(|| format!("{}", path.display()))?;
        let mut encoder = GifEncoder::new_with_speed(BufWriter::new(file), 10);
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self::Gif {
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
            Self::Single(path) => save(path),
            Self::Numbered(path) => save(&numbered(path, frame)),
            Self::Gif { encoder, delay, .. } => {
                let image = DynamicImage::from(picture.to_image()).to_rgba8();
                Ok(encoder.encode_frame(Frame::from_parts(image, 0, 0, *delay))?)
            }
        }
    }

    /// The path of the output.
    pub(crate) fn finish(self) -> anyhow::Result<PathBuf> {
        Ok(match self {
            Self::Single(path) | Self::Numbered(path) | Self::Gif { path, .. } => path,
        })
    }
}

/// The display time of a frame.
fn delay(scene: &SceneDescription) -> Delay {
    let seconds = scene.span.map_or(0.04, |span| {
        (span.end - span.start) / span.frames.saturating_sub(1).max(1) as f64
    });
    // Most viewers show no frame for less than 20 ms.
    let seconds = seconds.clamp(0.02, 60.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 20..=60000 above"
    )]
    let milliseconds = (seconds * 1e3).round() as u32;
    Delay::from_numer_denom_ms(milliseconds, 1)
}
