//! Rays through many spheres, primitives of a program's own: our tree over Embree's user geometry, with the same functions in Rust.

#[path = "../../crates/kd/examples/shapes/sphere.rs"]
mod sphere;

use std::sync::Arc;

use clap::Args;
use kd::custom::PrimitiveTree;
use kd::glam::Vec3;
use kd::{BuildOptions, CostModel, Hit, Layout, Ray, RayQuery};
use kd_rivals::{embree_name, embree_of_primitives};
use kd_scene::Camera;
use sphere::{Sphere, Spheres};

use crate::arguments::at_least_one;
use crate::measure::{Pairs, Repeats, in_sure_pairs, seconds, timed_in_pairs};
use crate::record::{median, median_ratio};
use crate::sampling::Random;
use crate::{peers, rays, text};

/// What to measure.
#[derive(Args, Debug)]
pub(crate) struct SpheresArgs {
    /// Timed repeats of each measurement, each after one of Embree
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Few spheres and few rays: a check that the command works
    #[arg(long)]
    smoke: bool,
}

/// The least speed of rays through wide nodes, over Embree.
const GOAL: f64 = 0.8;
/// The most answers that may differ, of a million: Embree's boxes have no bound for rounding.
const MOST_DIFFERENT: usize = 100;

const LAYOUTS: [(&str, Layout); 2] = [("wide", Layout::Wide), ("binary", Layout::Binary)];

/// Measures and prints; false if an answer is wrong.
pub(crate) fn run(arguments: &SpheresArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let (count, side, random) = if arguments.smoke {
        (1_000, 32, 1 << 10)
    } else {
        (100_000, 512, 1 << 18)
    };
    let spheres = Arc::new(cloud(count));
    let kinds = [
        ("camera", rays::primary(&camera(), side)),
        ("random", through_two_points(random)),
    ];
    let embree = embree_of_primitives(Arc::clone(&spheres), 1)?.structure;
    let repeats = Repeats::all(arguments.samples);
    let mut table = text::empty_table(["layout", "measured", "Embree", "kd", "kd's speed", "goal"]);
    let mut problems = Vec::new();
    for (name, layout) in LAYOUTS {
        // The cost model counts for kd-trees alone: primitives are asked one by one.
        let options = BuildOptions::balanced()
            .with_layout(layout)
            .with_cost(CostModel::CLASSIC)
            .with_threads(1);
        let build = || PrimitiveTree::build(Arc::clone(&spheres), &options);
        let tree = build()?;
        let built = timed_in_pairs(
            repeats,
            || Ok(embree_of_primitives(Arc::clone(&spheres), 1)?.seconds),
            || seconds(|| Ok::<_, anyhow::Error>(build()?)),
        )?;
        table.add_row(row(name, "build", &built, 1e3, "ms", None));
        let goal = (layout == Layout::Wide).then_some(GOAL);
        for (kind, rays) in &kinds {
            let mut closest = [vec![None; rays.len()], vec![None; rays.len()]];
            let [theirs, ours] = &mut closest;
            let pairs = in_sure_pairs(
                repeats,
                || embree.intersect_each(rays, theirs),
                || tree.intersect_batch(rays, ours),
            );
            let per_ray = 1e9 / rays.len() as f64;
            let measured = format!("closest, {kind}");
            table.add_row(row(name, &measured, &pairs, per_ray, "ns", goal));
            problems.extend(complaint(
                &format!("{name}, {measured}"),
                different(theirs, ours),
                rays,
            ));

            let mut any = [vec![false; rays.len()], vec![false; rays.len()]];
            let [theirs, ours] = &mut any;
            let pairs = in_sure_pairs(
                repeats,
                || embree.occluded_each(rays, theirs),
                || tree.occluded_batch(rays, ours),
            );
            let measured = format!("any, {kind}");
            table.add_row(row(name, &measured, &pairs, per_ray, "ns", goal));
            let count = theirs.iter().zip(&*ours).filter(|(a, b)| a != b).count();
            problems.extend(complaint(&format!("{name}, {measured}"), count, rays));
        }
    }
    text::align_right(&mut table, 2);
    println!("{table}");
    println!(
        "{count} spheres; {}, user geometry by its medium build; one ray at a time, on one thread; medians of {} pairs",
        embree_name()?,
        arguments.samples
    );
    Ok(text::report_problems(&problems))
}

/// A row: medians of times, and of the ratios of pairs.
fn row(
    layout: &str,
    measured: &str,
    pairs: &Pairs,
    units: f64,
    unit: &str,
    goal: Option<f64>,
) -> [String; 6] {
    let (own, embree) = pairs.scaled(units);
    let time = |times: &[f64]| format!("{:.1} {unit}", median(times));
    [
        layout.to_owned(),
        measured.to_owned(),
        time(&embree),
        time(&own),
        format!("×{:.2}", median_ratio(&embree, &own)),
        goal.map_or_else(String::new, |goal| format!("{goal:.2}")),
    ]
}

/// Answers with another distance. (Which of two spheres at one distance is hit is not Embree's to decide.)
fn different(theirs: &[Option<Hit>], ours: &[Option<Hit>]) -> usize {
    let depth = |hit: &Option<Hit>| hit.map(|hit| hit.t);
    let pairs = theirs.iter().zip(ours);
    pairs.filter(|(a, b)| depth(a) != depth(b)).count()
}

fn complaint(measured: &str, different: usize, rays: &[Ray]) -> Option<String> {
    let is_wrong = different * 1_000_000 > MOST_DIFFERENT * rays.len();
    is_wrong.then(|| format!("{measured}: {different} of {} answers differ", rays.len()))
}

/// Spheres in a cube of side 2, of radii up to a third of their mean distance.
fn cloud(count: usize) -> Spheres {
    let mut random = Random::new(1);
    let spacing = 2.0 / (count as f32).cbrt();
    let sphere = |_| {
        let [x, y, z, size] = [(); 4].map(|()| random.signed_unit());
        Sphere {
            center: Vec3::new(x, y, z),
            radius: spacing * (0.1 + 0.23 * size.abs()),
        }
    };
    Spheres((0..count).map(sphere).collect())
}

/// From outside.
fn camera() -> Camera {
    Camera {
        eye: Vec3::new(2.2, 1.4, 2.8),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_degrees: 45.0,
    }
}

/// Rays through two random points of the sphere around the cube.
fn through_two_points(count: u32) -> Vec<Ray> {
    let mut random = Random::new(2);
    let mut on_sphere = || 3.0_f32.sqrt() * random.on_sphere();
    std::iter::repeat_with(|| (on_sphere(), on_sphere()))
        .filter_map(|(from, to)| Some(Ray::new(from, (to - from).try_normalize()?)))
        .take(count as usize)
        .collect()
}
