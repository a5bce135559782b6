//! The command `kd render`.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use kd::{KdTree, Strategy};
use kd_render::{
    Picture, RayCounts, RenderMethod, RenderOptions, Stage, draw_boxes, heat_map, leaf_depths,
    render,
};

use crate::animation::Output;
use crate::print::{print_line, progress_bar};
use crate::scene::{Builder, SceneArgs, Size, time_of};

/// Arguments of `kd render`.
#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Output file: .png, .jpg or .ppm. With --frames, a .gif holds all frames; other formats get a numbered file per frame
    #[arg(short, long, value_name = "FILE", default_value = "out.png")]
    output: PathBuf,

    /// Frames A up to but not including B
    #[arg(long, value_name = "A..B", conflicts_with = "frame")]
    frames: Option<Frames>,

    /// Size in pixels [default: the resolution in the scene, or 800x600]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Maximum number of reflections, refractions or scattering events along a path
    #[arg(long, value_name = "N", default_value_t = 2)]
    bounces: u32,

    /// Number of lights to use, in file order [default: all]
    #[arg(long, value_name = "N")]
    lights: Option<usize>,

    /// Samples per pixel along each axis: N x N primary rays per pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    subpixels: u32,

    /// Ignore textures
    #[arg(long)]
    plain: bool,

    /// Path-trace diffuse surfaces instead of Whitted ray tracing
    #[arg(long)]
    diffuse: bool,

    /// Builder of the trees of static parts
    #[arg(long, value_enum, default_value_t = Builder::Best)]
    builder: Builder,

    /// Show the cost of each ray instead of the scene; the same as --view heat
    #[arg(long)]
    heatmap: bool,

    /// Show a view of the tree instead of the scene, or over it
    #[arg(long, value_enum, conflicts_with = "heatmap")]
    view: Option<View>,

    /// Level of the nodes that --view boxes draws; the root is level 0
    #[arg(long, value_name = "N", default_value_t = 6)]
    level: u32,
}

/// A view of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// Cost of each ray: nodes, leaves and triangles that it visits
    Heat,
    /// Depth of the leaf in which each ray ends
    Depth,
    /// Cells of nodes, drawn over the scene
    Boxes,
}

/// A range of frames, as `0..100`.
#[derive(Clone, Debug)]
struct Frames(Range<usize>);

impl FromStr for Frames {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let (first, end) = text
            .split_once("..")
            .context("expected a range of frames such as 0..100")?;
        let range = first.parse()?..end.parse()?;
        if range.is_empty() {
            bail!(
                "the range of frames is empty; `A..B` excludes frame B, so B must be greater than A"
            );
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
    // Wrong frame numbers fail before the trees are built.
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
    let mut triangles = 0;
    for frame in frames.clone() {
        let update = Instant::now();
        triangles = stage.show(time_of(stage.description(), frame)?)?.triangles;
        updates += update.elapsed();
        let (picture, counts) = picture(&stage, arguments, &options, &progress)?;
        rays += counts;
        output.add(frame, &picture)?;
    }
    progress.finish();
    let written = output.finish()?;
    let seconds = start.elapsed();
    let tracing = seconds - ready - updates;
    print_line(format_args!(
        "{}: {} triangles, {} frame{} of {}x{}",
        written.display(),
        triangles,
        frames.len(),
        if frames.len() == 1 { "" } else { "s" },
        size.width,
        size.height,
    ))?;
    print_line(format_args!(
        "{:.2} s until the first ray, {:.3} s for updates, {:.2} s for rendering",
        ready.as_secs_f64(),
        updates.as_secs_f64(),
        tracing.as_secs_f64()
    ))?;
    if rays.total() > 0 {
        print_line(format_args!(
            "{:.2} million rays per second: {} primary, {} shadow, {} mirrored, {} refracted, {} diffuse",
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

/// Renders one picture and counts its rays.
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
            print_line(format_args!(
                "steps per ray: {:.1} on average, {} at the brightest color",
                heat.mean, heat.brightest
            ))?;
            Ok((heat.picture, RayCounts::default()))
        }
        Some(View::Depth) => {
            let depths = leaf_depths(&tree()?, &camera, size)?;
            print_line(format_args!(
                "depth of leaves: {:.1} on average, {} at the brightest color",
                depths.mean, depths.brightest
            ))?;
            Ok((depths.picture, RayCounts::default()))
        }
        Some(View::Boxes) | None => {
            let rendering = render(stage, &stage.tracer(), &camera, options, &|counts| {
                progress.add_bucket(counts);
            });
            let mut picture = rendering.picture;
            if view == Some(View::Boxes) {
                draw_boxes(&mut picture, &tree()?, &camera, arguments.level)?;
            }
            Ok((picture, rendering.rays))
        }
    }
}

/// A progress bar with the number of rays per second.
struct Progress {
    bar: ProgressBar,
    rays: AtomicU64,
    start: Instant,
}

impl Progress {
    fn new(options: &RenderOptions, frames: usize) -> Self {
        let samples = u64::from(options.subpixels).pow(2);
        let primary = u64::from(options.width) * u64::from(options.height) * samples;
        let length = primary * frames as u64;
        Self {
            bar: progress_bar(Some(length), "{bar:40} {percent} % {msg} {eta}"),
            rays: AtomicU64::new(0),
            start: Instant::now(),
        }
    }

    fn add_bucket(&self, counts: &RayCounts) {
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

/// The path of a frame: the frame number is added to the file name.
pub(crate) fn numbered(path: &Path, frame: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{frame:04}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_parse_as_a_range_and_files_get_numbers() {
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
