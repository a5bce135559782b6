//! Frames of many small parts: the first one, frames in which a single part moves, the removal of half of the parts, and rays through a
//! frame that was changed part by part.

use std::hint::black_box;
use std::time::{Duration, Instant};

use fastrand::Rng;
use kd::glam::{Affine3A, Vec3};
use kd::{BuildOptions, PartId, Scene};

use super::rays_through;
use crate::animation::cuboid;
use crate::environment::Environment;
use crate::measure::{Pairs, in_sure_pairs};
use crate::record::Record;
use crate::session::Session;

/// Parts of twelve triangles each.
const COUNT: usize = 40_000;
const SMOKE_COUNT: usize = 100;
/// Frames in which one part moves.
const FRAMES: usize = 100;
const RAYS: usize = 20_000;
/// No repeat begins after this time.
const LIMIT: Duration = Duration::from_secs(20);

/// Cells of `scene/parts/first`, `one`, `held` and `remove`: times alone; and of rays by `scene/parts/changed` over those by
/// `scene/parts/joined`.
pub(super) fn measure(
    environment: &Environment,
    samples: usize,
    is_smoke: bool,
) -> anyhow::Result<Vec<Record>> {
    let count = if is_smoke { SMOKE_COUNT } else { COUNT };
    let name = format!("{count} parts");
    eprintln!("{name}");
    let mut session = Session::new(environment, name, 12 * count, samples);
    let mut times = [(); 4].map(|()| Vec::new());
    let start = Instant::now();
    while times[0].len() < samples && (times[0].is_empty() || start.elapsed() < LIMIT) {
        for (times, seconds) in times.iter_mut().zip(once(count)?) {
            times.push(seconds);
        }
    }
    for (what, times) in ["first", "one", "held", "remove"].into_iter().zip(times) {
        session.add_build(&format!("scene/parts/{what}"), "", &Pairs::alone(times));
    }
    add_rays(&mut session, count)?;
    Ok(session.cells)
}

/// Boxes at places of a cube, of which about a quarter is filled.
struct Field {
    scene: Scene,
    parts: Vec<PartId>,
    rng: Rng,
    side: f32,
}

impl Field {
    fn new(count: usize) -> anyhow::Result<Self> {
        let mut field = Self {
            scene: Scene::new(BuildOptions::fast().with_threads(1)),
            parts: Vec::with_capacity(count),
            rng: Rng::with_seed(7),
            side: (4.0 * count as f32).cbrt(),
        };
        for _ in 0..count {
            let part = field.scene.add_dynamic(cuboid(Vec3::ZERO, Vec3::ONE)?)?;
            let place = field.somewhere();
            field.scene.set_transform(part, place)?;
            field.parts.push(part);
        }
        Ok(field)
    }

    fn somewhere(&mut self) -> Affine3A {
        let rng = &mut self.rng;
        let place = Vec3::new(rng.f32(), rng.f32(), rng.f32());
        Affine3A::from_translation(self.side * place)
    }

    fn move_one(&mut self) -> anyhow::Result<()> {
        let part = self.parts[self.rng.usize(0..self.parts.len())];
        let place = self.somewhere();
        Ok(self.scene.set_transform(part, place)?)
    }
}

/// Seconds of the first frame with the addition of all parts; of a frame in which one part moves, on average, alone and while a snapshot
/// of the frame before is held; and of the removal of half of the parts with its frame.
fn once(count: usize) -> anyhow::Result<[f64; 4]> {
    let start = Instant::now();
    let mut field = Field::new(count)?;
    field.scene.commit()?;
    let first = start.elapsed().as_secs_f64();

    let start = Instant::now();
    for _ in 0..FRAMES {
        field.move_one()?;
        field.scene.commit()?;
    }
    let one = start.elapsed().as_secs_f64() / FRAMES as f64;

    let mut held = field.scene.snapshot();
    // The first frame beside a snapshot is made in new memory, and so is the second.
    for _ in 0..2 {
        field.move_one()?;
        field.scene.commit()?;
        held = field.scene.snapshot();
    }
    let start = Instant::now();
    for _ in 0..FRAMES {
        field.move_one()?;
        field.scene.commit()?;
        held = field.scene.snapshot();
    }
    let beside = start.elapsed().as_secs_f64() / FRAMES as f64;
    drop(held);

    let start = Instant::now();
    for part in field.parts.iter().step_by(2) {
        field.scene.remove(*part)?;
    }
    field.scene.commit()?;
    Ok([first, one, beside, start.elapsed().as_secs_f64()])
}

/// Rays through a frame after as many commits as a quarter of the parts, each of which moved one; over those through a frame of the same
/// parts whose nodes were all joined at once.
fn add_rays(session: &mut Session<'_>, count: usize) -> anyhow::Result<()> {
    let mut field = Field::new(count)?;
    field.scene.commit()?;
    for _ in 0..count / 4 {
        field.move_one()?;
        field.scene.commit()?;
    }
    let frame = field.scene.frame();
    let mut joined = Scene::new(BuildOptions::fast().with_threads(1));
    for part in frame.parts() {
        let mesh = frame.mesh(part).expect("a part of the frame");
        joined.add_dynamic(std::sync::Arc::clone(mesh))?;
    }
    joined.commit()?;
    let rays = rays_through(&frame.bounds(), RAYS.min(50 * count));
    let trace = |scene: &Scene| {
        for ray in &rays {
            black_box(scene.frame().intersect(ray));
        }
    };
    let pairs = in_sure_pairs(session.repeats, || trace(&joined), || trace(&field.scene));
    let over = "scene/parts/joined";
    session.add_rays("scene/parts/changed", "random", over, &pairs, rays.len());
    Ok(())
}
