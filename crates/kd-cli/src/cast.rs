//! The command `kd cast`: rays in, hits out.

mod array;
mod generated;
mod read;
mod shard;
mod write;

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use kd::glam::Vec3;
use kd::{Hit, KdTree, Ray};

use crate::print::{print_line, progress_bar};
use crate::scene::{Builder, SceneArgs, Size};
use crate::tree::SceneTree;
use generated::{CameraRays, LidarRays};
use shard::Shard;
use write::{Format, Output};

/// Arguments of `kd cast`.
#[derive(Args, Debug)]
pub(crate) struct CastArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// A file of rays (.csv, .npy), `camera`, or `lidar`
    ///
    /// A file has a ray in each row: origin, direction, and optionally the least and the greatest distance of hits, in multiples of the
    /// direction. A CSV file may name its columns: `ox`, `oy`, `oz`, `dx`, `dy`, `dz`, `t_min`, `t_max`. An NPY file has an array of
    /// shape (N, 6) or (N, 8).
    #[arg(value_name = "RAYS")]
    rays: String,

    /// Output file: .csv, .npy, or .las for the points that are hit
    #[arg(short, long, value_name = "FILE", default_value = "hits.csv")]
    output: PathBuf,

    /// Whether anything is hit, in place of the closest hit
    #[arg(long)]
    any: bool,

    /// Builder of the tree
    #[arg(long, value_enum, default_value_t = Builder::Best)]
    builder: Builder,

    /// Trace only a part of the rays, as `2/8`: the second of eight. The output files of all parts, one after the other, are the same bytes
    /// as that of one run; only the first has a header
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,

    /// Size of the image of `camera`, a ray for each pixel [default: the resolution in the scene, or 800x600]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Position of `lidar` [default: the middle of the scene]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    at: Option<Point>,

    /// Axis about which `lidar` turns
    #[arg(long, value_enum, default_value_t = Axis::Z)]
    up: Axis,

    /// Number of beams of `lidar`
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    channels: u32,

    /// Elevations of the lowest and the highest beam of `lidar`, in degrees
    #[arg(
        long,
        value_name = "LOW,HIGH",
        default_value = "-24.8,2",
        allow_hyphen_values = true
    )]
    elevation: Span,

    /// Steps in a turn of `lidar`
    #[arg(long, value_name = "N", default_value_t = 1800, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    steps: u32,

    /// Distances between which `lidar` detects surfaces, in scene units, from 0 on
    #[arg(long, value_name = "NEAR,FAR", default_value = "0,inf", value_parser = distances)]
    range: Span,
}

/// An axis of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    fn vector(self) -> Vec3 {
        match self {
            Self::X => Vec3::X,
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
        }
    }
}

/// Three coordinates, as `1,2.5,-3`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point(Vec3);

impl FromStr for Point {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let point = Vec3::from(numbers(text)?);
        if !point.is_finite() {
            bail!("`{text}`: the coordinates must be finite");
        }
        Ok(Self(point))
    }
}

/// Two numbers, of which the second is not less, as `-24.8,2`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span([f32; 2]);

impl FromStr for Span {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let [low, high] = numbers(text)?;
        if low.is_nan() || high.is_nan() || low > high {
            bail!("`{text}`: the second number must not be less than the first");
        }
        if low.is_infinite() {
            bail!("`{text}`: the first number must be finite");
        }
        Ok(Self([low, high]))
    }
}

/// A span of distances.
fn distances(text: &str) -> anyhow::Result<Span> {
    let span: Span = text.parse()?;
    if span.0[0] < 0.0 {
        bail!("`{text}`: a distance must not be negative");
    }
    Ok(span)
}

fn numbers<const N: usize>(text: &str) -> anyhow::Result<[f32; N]> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|word| word.trim().parse()).collect();
    let numbers = numbers.with_context(|| format!("`{text}`: expected {N} numbers"))?;
    let numbers = <[f32; N]>::try_from(numbers);
    numbers.map_err(|_| anyhow::anyhow!("`{text}`: expected {N} numbers, separated by commas"))
}

/// A source of rays.
trait RaySource {
    /// The number of rays, if it is known.
    fn len(&self) -> Option<u64>;

    /// Appends the next rays, at most `most`; none at the end.
    fn read(&mut self, most: usize, to: &mut Vec<Ray>) -> anyhow::Result<()>;

    /// Passes over rays.
    fn skip(&mut self, rays: u64) -> anyhow::Result<()> {
        let mut skipped = Vec::new();
        let mut left = rays;
        while left > 0 {
            skipped.clear();
            self.read(at_most_a_batch(left), &mut skipped)?;
            if skipped.is_empty() {
                break;
            }
            left -= skipped.len() as u64;
        }
        Ok(())
    }
}

/// Rays that are traced at once.
const BATCH: usize = 1 << 16;

fn at_most_a_batch(rays: u64) -> usize {
    usize::try_from(rays).map_or(BATCH, |rays| rays.min(BATCH))
}

pub(crate) fn run(arguments: &CastArgs) -> anyhow::Result<()> {
    let format = Format::of(&arguments.output, arguments.any)?;
    if arguments.shard.is_some() && format == Format::Las {
        bail!("--shard: the header of LAS describes all points; use .csv or .npy");
    }
    // A wrong file of rays fails before the tree is built.
    let of_file = match arguments.rays.as_str() {
        "camera" | "lidar" => None,
        path => Some(read::open(Path::new(path))?),
    };
    for input in [&arguments.rays, &arguments.scene.scene] {
        if is_same_file(Path::new(input), &arguments.output) {
            bail!(
                "{}: is the input, and would be lost",
                arguments.output.display()
            );
        }
    }
    let SceneTree { scene, time, tree } = SceneTree::new(&arguments.scene, arguments.builder)?;
    let mut source: Box<dyn RaySource> = match of_file {
        Some(source) => source,
        None if arguments.rays == "camera" => Box::new(CameraRays::new(
            &scene,
            time,
            tree.mesh().bounds(),
            arguments.size,
        )),
        None => Box::new(LidarRays::new(arguments.lidar(&tree))),
    };
    let rays_in_all = match source.len() {
        None if arguments.shard.is_some() => Some(count(&arguments.rays)?),
        known => known,
    };
    let shard = arguments.shard.unwrap_or(Shard::WHOLE);
    let part = rays_in_all.map(|rays| shard.of(rays));
    let first = part.as_ref().map_or(0, |part| part.start);
    source.skip(first)?;
    let mut left = part.as_ref().map(|part| part.end - part.start);
    let mut output = Output::create(
        &arguments.output,
        format,
        arguments.any,
        tree.mesh(),
        (shard, rays_in_all),
    )?;
    let progress = progress(left);
    let start = Instant::now();
    let mut seconds = 0.0;
    let (mut count, mut found) = (0_u64, 0_u64);
    let mut rays = Vec::with_capacity(BATCH);
    loop {
        rays.clear();
        let most = left.map_or(BATCH, at_most_a_batch);
        source.read(most, &mut rays)?;
        if rays.is_empty() {
            break;
        }
        left = left.map(|left| left - rays.len() as u64);
        let tracing = Instant::now();
        let answers = trace(&tree, &rays, arguments.any);
        seconds += tracing.elapsed().as_secs_f64();
        found += answers.hits() as u64;
        output.write(first + count, &rays, &answers, tree.mesh())?;
        count += rays.len() as u64;
        let speed = count as f64 / start.elapsed().as_secs_f64().max(1e-9) * 1e-6;
        progress.set_message(format!("{speed:.2} Mray/s"));
        progress.inc(rays.len() as u64);
    }
    output.finish()?;
    progress.finish_and_clear();
    print_line(format_args!(
        "{}: {count} rays, {found} of which hit one of {} triangles",
        arguments.output.display(),
        tree.mesh().len()
    ))?;
    if count > 0 {
        print_line(format_args!(
            "{:.2} million rays per second, {:.2} with files",
            count as f64 / seconds.max(1e-9) * 1e-6,
            count as f64 / start.elapsed().as_secs_f64().max(1e-9) * 1e-6
        ))?;
    }
    Ok(())
}

/// The number of rays in a file that does not say it.
fn count(path: &str) -> anyhow::Result<u64> {
    let mut source = read::open(Path::new(path))?;
    let mut rays = Vec::with_capacity(BATCH);
    let mut count = 0;
    loop {
        rays.clear();
        source.read(BATCH, &mut rays)?;
        if rays.is_empty() {
            return Ok(count);
        }
        count += rays.len() as u64;
    }
}

/// Whether two paths are the same file, which exists.
fn is_same_file(one: &Path, other: &Path) -> bool {
    let [one, other] = [one, other].map(|path| path.canonicalize().ok());
    one.is_some() && one == other
}

/// The answers to a batch of rays.
enum Answers {
    Closest(Vec<Option<Hit>>),
    Any(Vec<bool>),
}

impl Answers {
    fn hits(&self) -> usize {
        match self {
            Self::Closest(hits) => hits.iter().filter(|hit| hit.is_some()).count(),
            Self::Any(occluded) => occluded.iter().filter(|occluded| **occluded).count(),
        }
    }
}

fn trace(tree: &KdTree, rays: &[Ray], any: bool) -> Answers {
    if any {
        let mut occluded = vec![false; rays.len()];
        tree.occluded_batch(rays, &mut occluded);
        return Answers::Any(occluded);
    }
    let mut hits = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut hits);
    Answers::Closest(hits)
}

fn progress(rays: Option<u64>) -> ProgressBar {
    let template = match rays {
        Some(_) => "{bar:40} {percent} % {msg} {eta}",
        None => "{spinner} {pos} rays {msg}",
    };
    progress_bar(rays, template)
}

impl CastArgs {
    fn lidar(&self, tree: &KdTree) -> kd_scene::Lidar {
        let middle = tree.mesh().bounds().center();
        let middle = if middle.is_finite() {
            middle
        } else {
            Vec3::ZERO
        };
        let forward = if self.up == Axis::X { Vec3::Y } else { Vec3::X };
        kd_scene::Lidar {
            forward,
            elevation_degrees: self.elevation.0,
            channels: self.channels,
            steps: self.steps,
            range: self.range.0,
            ..kd_scene::Lidar::new(self.at.map_or(middle, |at| at.0), self.up.vector())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_spans_parse() {
        assert_eq!(
            "1, -2,3e1".parse::<Point>().expect("valid"),
            Point(Vec3::new(1.0, -2.0, 30.0))
        );
        assert_eq!(
            "-3,inf".parse::<Span>().expect("valid"),
            Span([-3.0, f32::INFINITY])
        );
        for bad in ["1,2", "1,2,x", "1,2,3,4", "nan,0,0", ""] {
            assert!(bad.parse::<Point>().is_err(), "{bad}");
        }
        for bad in ["2,1", "nan,1", "-inf,0", "1"] {
            assert!(bad.parse::<Span>().is_err(), "{bad}");
        }
        assert!(
            distances("0,1").is_ok() && distances("-1,1").is_err(),
            "from 0 on"
        );
    }
}
