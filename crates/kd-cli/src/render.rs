//! `kd render`.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use kd::{KdTree, Strategy};
use kd_render::{
    Picture, RayCounts, RenderMethod, RenderOptions, Stage, draw_boxes, heat_map, leaf_depths,
    render,
};

use crate::animation::Output;
use crate::say::say;
use crate::scene::{Builder, SceneArgs, Size, time_of};

/// What to make a picture of, and how.
#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Where to write it: .png, .jpg, .ppm; with frames also .gif, or a number is added to the name
    #[arg(short, long, value_name = "FILE", default_value = "out.png")]
    output: PathBuf,

    /// All frames from the first to before the last of these
    #[arg(long, value_name = "A..B", conflicts_with = "frame")]
    frames: Option<Frames>,

    /// Pixels [default: what the scene asks for, or 800x600]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// How often rays are mirrored, refracted or scattered
    #[arg(long, value_name = "N", default_value_t = 2)]
    bounces: u32,

    /// Lights that are used, in the order of the file [default: all]
    #[arg(long, value_name = "N")]
    lights: Option<usize>,

    /// Rays for each pixel: so many across, and as many down
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    subpixels: u32,

    /// Without textures
    #[arg(long)]
    plain: bool,

    /// Follow light by chance, as dull surfaces scatter it
    #[arg(long)]
    diffuse: bool,

    /// Which builder makes the trees of what stands still
    #[arg(long, value_enum, default_value_t = Builder::Best)]
    builder: Builder,

    /// What to show of the tree in place of the scene: what rays cost
    #[arg(long)]
    heatmap: bool,

    /// A view of the tree in place of the scene, or over it
    #[arg(long, value_enum, conflicts_with = "heatmap")]
    view: Option<View>,

    /// With `--view boxes`: nodes of this level, from 0
    #[arg(long, value_name = "N", default_value_t = 6)]
    level: u32,
}

/// What to show of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// What rays cost: nodes, leaves and triangles that each looks at
    Heat,
    /// How deep the leaf is in which each ray ends
    Depth,
    /// The cells of nodes, drawn over the scene
    Boxes,
}

/// Frames of an animation.
#[derive(Clone, Debug)]
struct Frames(Range<usize>);

impl FromStr for Frames {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let (first, end) = text.split_once("..").context("frames are like 0..100")?;
        let range = first.parse()?..end.parse()?;
        if range.is_empty() {
            bail!("no frames: the second is the one after the last");
        }
        Ok(Self(range))
    }
}

pub(crate) fn run(arguments: &RenderArgs) -> anyhow::Result<()> {
    let start = Instant::now();
    let description = arguments.scene.load()?;
    let frames = match &arguments.frames {
        Some(Frames(frames)) => frames.clone(),
        None => arguments.scene.frame..arguments.scene.frame + 1,
    };
    // Before anything takes time.
    for frame in [frames.start, frames.end - 1] {
        time_of(&description, frame)?;
    }
    let is_animation = arguments.frames.is_some();
    let mut output = Output::new(&arguments.output, is_animation, &description)?;
    let size = arguments.size.unwrap_or_else(|| {
        let [width, height] = description.resolution.unwrap_or([800, 600]);
        Size { width, height }
    });
    let options = RenderOptions {
        width: size.width,
        height: size.height,
        method: if arguments.diffuse {
            RenderMethod::Diffuse
        } else {
            RenderMethod::Whitted
        },
        bounces: arguments.bounces,
        lights: arguments.lights.unwrap_or(usize::MAX),
        subpixels: arguments.subpixels,
        textures: !arguments.plain,
    };
    let mut stage = Stage::new(description, arguments.builder.options(), Strategy::Auto)?;
    for warning in stage.warnings() {
        eprintln!("warning: {warning}");
    }
    let ready = start.elapsed();
    let progress = Progress::new(&options, frames.len());
    let mut rays = RayCounts::default();
    let mut updates = Duration::ZERO;
    for frame in frames.clone() {
        let update = Instant::now();
        stage.show(time_of(stage.description(), frame)?)?;
        updates += update.elapsed();
        let (picture, counts) = picture(&stage, arguments, &options, &progress)?;
        rays += counts;
        output.add(frame, &picture)?;
    }
    progress.finish();
    let written = output.finish()?;
    let seconds = start.elapsed();
    let tracing = seconds - ready - updates;
    say(format_args!(
        "{}: {} triangles, {} frame{} of {}x{}",
        written.display(),
        stage
            .scene()
            .frame()
            .parts()
            .map(|part| stage
                .scene()
                .frame()
                .mesh(part)
                .map_or(0, |mesh| mesh.len()))
            .sum::<usize>(),
        frames.len(),
        if frames.len() == 1 { "" } else { "s" },
        size.width,
        size.height,
    ))?;
    say(format_args!(
        "{:.2} s until the first ray, {:.3} s for updates, {:.2} s for pictures",
        ready.as_secs_f64(),
        updates.as_secs_f64(),
        tracing.as_secs_f64()
    ))?;
    if rays.total() > 0 {
        say(format_args!(
            "{:.2} million rays a second: {} primary, {} shadow, {} mirrored, {} refracted, {} diffuse",
            rays.total() as f64 / tracing.as_secs_f64() * 1e-6,
            rays.primary,
            rays.shadow,
            rays.mirrored,
            rays.refracted,
            rays.diffuse,
        ))?;
    }
    Ok(())
}

/// One picture, and the rays it took.
fn picture(
    stage: &Stage,
    arguments: &RenderArgs,
    options: &RenderOptions,
    progress: &Progress,
) -> anyhow::Result<(Picture, RayCounts)> {
    let camera = stage.camera();
    let view = arguments.heatmap.then_some(View::Heat).or(arguments.view);
    let size = [options.width, options.height];
    let tree = || -> anyhow::Result<KdTree> {
        let mesh = stage.description().mesh_at(stage.time())?;
        Ok(KdTree::build(mesh, &arguments.builder.options())?)
    };
    match view {
        Some(View::Heat) => {
            let heat = heat_map(&tree()?, &camera, size);
            say(format_args!(
                "steps of a ray: {:.1} on average, {} where it is brightest",
                heat.mean, heat.brightest
            ))?;
            Ok((heat.picture, RayCounts::default()))
        }
        Some(View::Depth) => {
            let depths = leaf_depths(&tree()?, &camera, size);
            say(format_args!(
                "levels above a leaf: {:.1} on average, {} where it is brightest",
                depths.mean, depths.brightest
            ))?;
            Ok((depths.picture, RayCounts::default()))
        }
        Some(View::Boxes) | None => {
            let rendering = render(stage, &stage.tracer(), &camera, options, &|counts| {
                progress.tile(counts);
            });
            let mut picture = rendering.picture;
            if view == Some(View::Boxes) {
                draw_boxes(&mut picture, &tree()?, &camera, arguments.level);
            }
            Ok((picture, rendering.rays))
        }
    }
}

/// How far it is, with rays a second.
struct Progress {
    bar: ProgressBar,
    rays: AtomicU64,
    start: Instant,
}

impl Progress {
    fn new(options: &RenderOptions, frames: usize) -> Self {
        let samples = u64::from(options.subpixels).pow(2);
        let primary = u64::from(options.width) * u64::from(options.height) * samples;
        let bar = ProgressBar::new(primary * frames as u64);
        let style = ProgressStyle::with_template("{bar:40} {percent} % {msg} {eta}");
        bar.set_style(style.expect("it is well-formed"));
        Self {
            bar,
            rays: AtomicU64::new(0),
            start: Instant::now(),
        }
    }

    fn tile(&self, counts: &RayCounts) {
        let rays = self.rays.fetch_add(counts.total(), Ordering::Relaxed) + counts.total();
        let seconds = self.start.elapsed().as_secs_f64().max(1e-9);
        self.bar
            .set_message(format!("{:.2} Mray/s", rays as f64 / seconds * 1e-6));
        self.bar.inc(counts.primary);
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// The file of one of several frames.
pub(crate) fn numbered(path: &Path, frame: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{frame:04}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_range_and_files_are_numbered() {
        assert_eq!("3..7".parse::<Frames>().expect("valid").0, 3..7);
        for bad in ["3", "7..3", "3..3", "a..b"] {
            assert!(bad.parse::<Frames>().is_err(), "{bad}");
        }
        assert_eq!(
            numbered(Path::new("a/b.png"), 12),
            Path::new("a/b_0012.png")
        );
    }
}
