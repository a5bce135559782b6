//! Frames of many small parts: the first one, one in which a single part moves, and the removal of half of the parts.

use std::time::{Duration, Instant};

use kd::glam::{Affine3A, Vec3};
use kd::{BuildOptions, Scene};

use crate::animation::cuboid;
use crate::environment::Environment;
use crate::measure::Pairs;
use crate::record::Record;
use crate::session::Session;

/// Parts along the side of a square, of twelve triangles each.
const SIDE: u16 = 200;
const SMOKE_SIDE: u16 = 10;
/// No repeat begins after this time.
const LIMIT: Duration = Duration::from_secs(20);

/// Cells of `scene/parts/first`, `scene/parts/one` and `scene/parts/remove`: times alone.
pub(super) fn measure(
    environment: &Environment,
    samples: usize,
    is_smoke: bool,
) -> anyhow::Result<Vec<Record>> {
    let side = if is_smoke { SMOKE_SIDE } else { SIDE };
    let count = usize::from(side) * usize::from(side);
    let name = format!("{count} parts");
    eprintln!("{name}");
    let mut session = Session::new(environment, name, 12 * count, samples);
    let mut times = [(); 3].map(|()| Vec::new());
    let start = Instant::now();
    while times[0].len() < samples && (times[0].is_empty() || start.elapsed() < LIMIT) {
        for (times, seconds) in times.iter_mut().zip(once(side)?) {
            times.push(seconds);
        }
    }
    for (what, times) in ["first", "one", "remove"].into_iter().zip(times) {
        session.add_build(&format!("scene/parts/{what}"), "", &Pairs::alone(times));
    }
    Ok(session.cells)
}

/// Seconds of the first frame with the addition of all parts, of a frame in which one part moves, and of the removal of half of the parts
/// with its frame.
fn once(side: u16) -> anyhow::Result<[f64; 3]> {
    let start = Instant::now();
    let mut scene = Scene::new(BuildOptions::fast().with_threads(1));
    let mut parts = Vec::new();
    for place in (0..side).flat_map(|x| (0..side).map(move |y| (x, y))) {
        let part = scene.add_dynamic(cuboid(Vec3::ZERO, Vec3::ONE)?)?;
        scene.set_transform(part, at(place, 0.0))?;
        parts.push(part);
    }
    scene.commit()?;
    let first = start.elapsed().as_secs_f64();

    scene.set_transform(parts[parts.len() / 3], at((1, 2), 0.4))?;
    scene.commit()?;
    let start = Instant::now();
    scene.set_transform(parts[parts.len() / 2], at((3, 4), 0.5))?;
    scene.commit()?;
    let one = start.elapsed().as_secs_f64();

    let start = Instant::now();
    for part in parts.iter().step_by(2) {
        scene.remove(*part)?;
    }
    scene.commit()?;
    Ok([first, one, start.elapsed().as_secs_f64()])
}

fn at((x, y): (u16, u16), z: f32) -> Affine3A {
    Affine3A::from_translation(2.0 * Vec3::new(f32::from(x), f32::from(y), z))
}
