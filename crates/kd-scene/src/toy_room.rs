//! A generated animated scene: a toy car that drives through a room.
//!
//! It resembles BART's kitchen: many static triangles, some of them mirrors or glass, few moving triangles with nested
//! rotations, and a camera that follows. The scene is written as AFF text and read back, so that other programs can use it.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use crate::{AffOptions, LoadError, SceneDescription, read_aff};

/// Length of the animation in seconds and in frames.
const SECONDS: f64 = 10.0;
const FRAMES: usize = 250;
/// Radius of the wheels, and the half-axes of the road: an ellipse around the table.
const WHEEL: f64 = 0.06;
const ROAD: [f64; 2] = [1.9, 1.3];
/// Number of keys along the road, and of a wheel per revolution.
const ROAD_KEYS: u32 = 24;
const TURN_KEYS: f64 = 4.0;

/// Appends a line to a `String`, which cannot fail.
macro_rules! add {
    ($text:expr, $($arguments:tt)*) => {
        let _ = writeln!($text, $($arguments)*);
    };
}

/// Generates an animated scene: a room with a table, shelves, vases and balls, a car with rotating wheels that drives around
/// the table, and a camera that follows it. 250 frames in 10 seconds.
///
/// The scene has about 3000 · `size`² + 2000 triangles, of which 4 to 7 % move. A `size` of 0 counts as 1.
///
/// ```
/// let room = kd_scene::toy_room(1)?;
/// let moving = room.parts.iter().filter(|part| part.node.is_some());
/// assert_eq!(moving.count(), 5, "a car and its wheels");
/// # Ok::<(), kd_scene::LoadError>(())
/// ```
///
/// # Errors
///
/// [`LoadError`] if the scene would exceed the default [`AffOptions::max_triangles`].
pub fn toy_room(size: u32) -> Result<SceneDescription, LoadError> {
    let options = AffOptions {
        resolution: size.max(1).saturating_mul(2),
        ..AffOptions::default()
    };
    let mut only = |_: &Path| Ok(toy_room_aff().into_bytes());
    read_aff("toy_room.aff".as_ref(), &mut only, &options)
}

/// The AFF text of [`toy_room`]. The size of the room is set on reading: [`AffOptions::resolution`] is twice the size.
pub fn toy_room_aff() -> String {
    let mut text = String::from(
        "b 0.5 0.6 0.8\nam 1 1 1\n\
         v from 0 1.7 3.4 at 0 0.7 0 up 0 1 0 angle 52 hither 0.01 resolution 800 600\n\
         l -1.2 2.7 0.6 0.55 0.52 0.48\nla lamp 1.6 2.4 -0.4 0.5 0.5 0.55\n",
    );
    add!(text, "a 0 {SECONDS} {FRAMES}");
    room(&mut text);
    table(&mut text);
    shelves(&mut text);
    balls(&mut text);
    car(&mut text);
    keys(&mut text);
    text
}

fn material(text: &mut String, color: [f64; 3], mirror: f64, shine: f64) {
    let [r, g, b] = color;
    let ambient = color.map(|x| 0.25 * x);
    let [ar, ag, ab] = ambient;
    add!(
        text,
        "fm {ar} {ag} {ab} {r} {g} {b} {mirror} {mirror} {mirror} {shine} 0 1"
    );
}

/// Adds an axis-aligned box by its lower and upper corners, facing outwards, or inwards if `inside`.
fn cuboid(text: &mut String, low: [f64; 3], high: [f64; 3], inside: bool) {
    let corner = |i: usize| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        };
        [pick(0), pick(1), pick(2)]
    };
    for mut face in [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ] {
        if inside {
            face.reverse();
        }
        let _ = write!(text, "p 4");
        for [x, y, z] in face.map(corner) {
            let _ = write!(text, " {x} {y} {z}");
        }
        add!(text, "");
    }
}

fn room(text: &mut String) {
    // A polished floor, walls, and a ceiling.
    material(text, [0.45, 0.32, 0.22], 0.25, 60.0);
    add!(text, "p 4 -4 0 3 4 0 3 4 0 -3 -4 0 -3");
    material(text, [0.75, 0.72, 0.62], 0.0, 0.0);
    add!(
        text,
        "p 4 -4 0 -3 4 0 -3 4 3 -3 -4 3 -3\np 4 -4 3 4 4 3 4 4 0 4 -4 0 4"
    );
    material(text, [0.62, 0.68, 0.72], 0.0, 0.0);
    add!(
        text,
        "p 4 -4 0 4 -4 0 -3 -4 3 -3 -4 3 4\np 4 4 0 -3 4 0 4 4 3 4 4 3 -3"
    );
    material(text, [0.85, 0.85, 0.85], 0.0, 0.0);
    add!(
        text,
        "p 4 -4 3 4 -4 3 -3 4 3 -3 4 3 4\np 4 -4 0 4 4 0 4 4 0 3 -4 0 3"
    );
    // A mirror on the wall, in a frame.
    material(text, [0.3, 0.2, 0.1], 0.05, 20.0);
    cuboid(text, [-1.3, 1.0, -3.0], [1.3, 2.4, -2.95], false);
    material(text, [0.05, 0.05, 0.05], 0.85, 200.0);
    add!(
        text,
        "p 4 -1.2 1.1 -2.94 1.2 1.1 -2.94 1.2 2.3 -2.94 -1.2 2.3 -2.94"
    );
}

fn table(text: &mut String) {
    material(text, [0.5, 0.35, 0.2], 0.1, 40.0);
    cuboid(text, [-1.0, 0.70, -0.6], [1.0, 0.75, 0.6], false);
    for (x, z) in [(-0.9, -0.5), (0.9, -0.5), (-0.9, 0.5), (0.9, 0.5)] {
        add!(text, "c {x} 0 {z} 0.03 {x} 0.7 {z} 0.05");
    }
    // Two vases, and balls of glass and metal.
    for (x, z, color) in [(-0.6, 0.1, [0.2, 0.35, 0.6]), (0.7, -0.3, [0.6, 0.2, 0.2])] {
        material(text, color, 0.15, 80.0);
        vase(text, x, z);
    }
    add!(
        text,
        "fm 0.02 0.02 0.02 0.05 0.05 0.05 0.08 0.08 0.08 100 0.85 1.5\ns 0.05 0.93 0.15 0.18"
    );
    material(text, [0.8, 0.6, 0.1], 0.4, 120.0);
    add!(text, "s 0.45 0.85 0.3 0.1\ns -0.25 0.82 -0.3 0.07");
}

/// Adds a surface of revolution.
fn vase(text: &mut String, x: f64, z: f64) {
    let radius = |fraction: f64| {
        0.06 + 0.07 * libm::sin(0.5 * TAU * fraction) + 0.03 * libm::cos(TAU * fraction)
    };
    for slice in 0..8 {
        let [low, high] = [slice, slice + 1].map(|i| f64::from(i) / 8.0);
        let [y0, y1] = [low, high].map(|fraction| 0.75 + 0.4 * fraction);
        add!(
            text,
            "c {x} {y0} {z} {:.4} {x} {y1} {z} {:.4}",
            radius(low),
            radius(high)
        );
    }
}

fn shelves(text: &mut String) {
    for side in [-1.0_f64, 1.0] {
        material(text, [0.55, 0.45, 0.3], 0.0, 0.0);
        for level in 0..4 {
            let y = 0.3 + 0.6 * f64::from(level);
            let [near, far] = [3.55 * side, 3.98 * side];
            cuboid(
                text,
                [near.min(far), y, -2.6],
                [near.max(far), y + 0.03, 2.0],
                false,
            );
            // Books of pseudo-random sizes and colors.
            for book in 0_u32..14 {
                let number = book + 14 * level + if side > 0.0 { 56 } else { 0 };
                let random = |step: u32| f64::from((number * 7919 + step * 104_729) % 97) / 97.0;
                material(
                    text,
                    [
                        0.2 + 0.6 * random(1),
                        0.2 + 0.5 * random(2),
                        0.2 + 0.6 * random(3),
                    ],
                    0.0,
                    10.0,
                );
                let z = -2.5 + 0.3 * f64::from(book);
                let (x, depth) = (3.95 * side, 0.25 + 0.1 * random(4));
                let ends = [x, x - depth * side];
                let high = y + 0.03 + 0.2 + 0.2 * random(5);
                let low = [ends[0].min(ends[1]), y + 0.03, z];
                cuboid(
                    text,
                    low,
                    [ends[0].max(ends[1]), high, z + 0.05 + 0.15 * random(6)],
                    false,
                );
            }
        }
    }
}

fn balls(text: &mut String) {
    // Pyramids in two corners, with 4 × 4, 3 × 3, 2 × 2 and 1 balls.
    for (x, z, turn) in [(-3.2, -2.2, 1.0), (3.0, 2.6, -1.0)] {
        for level in 0..4 {
            let count = 4 - level;
            for i in 0..count {
                for k in 0..count {
                    let shift = 0.12 * f64::from(level);
                    let at = |j: i32| shift + 0.24 * f64::from(j);
                    let (bx, bz) = (x + turn * at(i), z - turn * at(k));
                    let y = 0.12 + 0.17 * f64::from(level);
                    let red = f64::from((i * 5 + k * 3 + level) % 7) / 7.0;
                    material(text, [0.3 + 0.6 * red, 0.5, 0.9 - 0.6 * red], 0.1, 50.0);
                    add!(text, "s {bx:.3} {y:.3} {bz:.3} 0.12");
                }
            }
        }
    }
}

/// Adds the car at the origin, facing +x.
fn car(text: &mut String) {
    add!(text, "x car {{");
    material(text, [0.75, 0.08, 0.06], 0.25, 90.0);
    cuboid(text, [-0.26, 0.05, -0.11], [0.22, 0.13, 0.11], false);
    add!(
        text,
        "p 4 -0.2 0.13 0.09 -0.12 0.21 0.08 -0.12 0.21 -0.08 -0.2 0.13 -0.09"
    );
    add!(
        text,
        "p 4 -0.12 0.21 0.08 0.04 0.21 0.08 0.04 0.21 -0.08 -0.12 0.21 -0.08"
    );
    material(text, [0.1, 0.12, 0.15], 0.4, 150.0);
    add!(
        text,
        "p 4 0.04 0.21 0.08 0.12 0.13 0.09 0.12 0.13 -0.09 0.04 0.21 -0.08"
    );
    for side in [-1.0, 1.0] {
        let (low, high) = (0.09 * side, 0.08 * side);
        let mut window = [
            (-0.2, 0.13, low),
            (0.12, 0.13, low),
            (0.04, 0.21, high),
            (-0.12, 0.21, high),
        ];
        if side < 0.0 {
            window.reverse();
        }
        let _ = write!(text, "p 4");
        for (x, y, z) in window {
            let _ = write!(text, " {x} {y} {z}");
        }
        add!(text, "");
    }
    material(text, [0.95, 0.95, 0.7], 0.0, 30.0);
    add!(text, "s 0.22 0.1 0.07 0.02\ns 0.22 0.1 -0.07 0.02");
    for x in [0.14, -0.17] {
        for side in [-1.0, 1.0] {
            add!(
                text,
                "xs 1 1 1 0 1 0 0 {x} {WHEEL} {} {{\nx wheel {{",
                0.1 * side
            );
            material(text, [0.06, 0.06, 0.06], 0.0, 10.0);
            add!(text, "c 0 0 -0.025 {WHEEL} 0 0 0.025 {WHEEL}");
            add!(
                text,
                "c 0 0 {0} {WHEEL} 0 0 {1} 0.035",
                0.025 * side,
                0.03 * side
            );
            material(text, [0.7, 0.7, 0.72], 0.4, 120.0);
            add!(
                text,
                "c 0 0 {0} 0.035 0 0 {1} 0.001",
                0.03 * side,
                0.02 * side
            );
            // A bar makes the rotation visible.
            cuboid(
                text,
                [-0.034, -0.006, 0.02 * side - 0.01],
                [0.034, 0.006, 0.02 * side + 0.01],
                false,
            );
            add!(text, "}}\n}}");
        }
    }
    add!(text, "}}");
}

fn keys(text: &mut String) {
    // The first and the last key only define the tangents.
    add!(text, "k car {{\ntransl {}", ROAD_KEYS + 3);
    let on_road = |key: i32| {
        let fraction = f64::from(key) / f64::from(ROAD_KEYS);
        (SECONDS * fraction, TAU * fraction)
    };
    let keys = || -1..=i32::try_from(ROAD_KEYS).expect("fits in 32 bits") + 1;
    for key in keys() {
        let (time, angle) = on_road(key);
        let (x, z) = (ROAD[0] * libm::cos(angle), -ROAD[1] * libm::sin(angle));
        add!(text, "{time:.4} {x:.5} 0 {z:.5} 0 0 0");
    }
    add!(text, "rot {}", ROAD_KEYS + 3);
    for key in keys() {
        let (time, angle) = on_road(key);
        let (dx, dz) = (-ROAD[0] * libm::sin(angle), -ROAD[1] * libm::cos(angle));
        add!(
            text,
            "{time:.4} 0 1 0 {:.4} 0 0 0",
            libm::atan2(-dz, dx).to_degrees()
        );
    }
    add!(text, "}}");
    // The wheels roll without slipping.
    let [a, b] = ROAD;
    let circumference =
        std::f64::consts::PI * (3.0 * (a + b) - ((3.0 * a + b) * (a + 3.0 * b)).sqrt());
    let turns = (circumference / (TAU * WHEEL) * TURN_KEYS).round();
    #[expect(clippy::cast_possible_truncation, reason = "about a hundred")]
    let count = turns as i32;
    add!(text, "k wheel {{\nrot {}", count + 3);
    for key in -1..=count + 1 {
        let time = SECONDS * f64::from(key) / turns;
        add!(
            text,
            "{time:.5} 0 0 1 {:.3} 0 0 0",
            -360.0 / TURN_KEYS * f64::from(key % 4)
        );
    }
    add!(text, "}}\nk lamp {{\ntransl 6");
    for (time, x) in [
        (-2.0, 0.0),
        (0.0, 0.0),
        (3.0, -0.5),
        (6.0, 0.5),
        (10.0, 0.0),
        (12.0, 0.0),
    ] {
        add!(text, "{time} {x} 0 0 0 0 0");
    }
    add!(text, "}}");
    camera(text);
}

/// Adds the camera, which stays near the wall and turns towards the car.
fn camera(text: &mut String) {
    let count = 12;
    add!(text, "k camera {{\ntransl {}", count + 3);
    let eye = |fraction: f64| {
        [
            0.9 * libm::sin(TAU * fraction),
            1.5 + 0.15 * libm::cos(TAU * fraction),
            2.85,
        ]
    };
    let fractions = || (-1..=count + 1).map(|key| f64::from(key) / f64::from(count));
    for fraction in fractions() {
        let [x, y, z] = eye(fraction);
        add!(text, "{:.4} {x:.5} {y:.5} {z:.5} 0 0 0", SECONDS * fraction);
    }
    add!(text, "rot {}", count + 3);
    for fraction in fractions() {
        let angle = TAU * fraction;
        let [x, y, z] = eye(fraction);
        // The target is about half of the way to the car.
        let (dx, dy, dz) = (
            0.45 * ROAD[0] * libm::cos(angle) - x,
            0.45 - y,
            -0.45 * ROAD[1] * libm::sin(angle) - z,
        );
        // Pitch, then yaw, combined into one rotation.
        let (side, down) = (libm::atan2(-dx, -dz), libm::atan2(dy, libm::hypot(dx, dz)));
        let (s, c) = libm::sincos(0.5 * side);
        let (t, d) = libm::sincos(0.5 * down);
        let (w, axis) = (c * d, [c * t, s * d, -s * t]);
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
        let [ax, ay, az] = axis.map(|x| x / length);
        let degrees = (2.0 * libm::atan2(length, w)).to_degrees();
        add!(
            text,
            "{:.4} {ax:.6} {ay:.6} {az:.6} {degrees:.4} 0 0 0",
            SECONDS * fraction
        );
    }
    add!(text, "}}");
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn the_car_stays_on_the_road() {
        let room = toy_room(1).expect("within the limits");
        let span = room.span.expect("an animation");
        assert_eq!((span.frames, span.end), (FRAMES, SECONDS));
        for frame in (0..FRAMES).step_by(10) {
            let nodes = room.placed_nodes(span.time_of(frame));
            for part in room.parts.iter().filter(|part| part.node.is_some()) {
                let to = SceneDescription::placed_part(part, &nodes);
                let mesh = part.mesh.transformed(&to).expect("finite positions");
                let bounds = mesh.bounds();
                assert!(
                    bounds.min.y > -1e-3 && bounds.max.y < 0.3,
                    "{frame}: {bounds:?}"
                );
                assert!(
                    bounds.max.x < 2.4 && bounds.min.x > -2.4,
                    "{frame}: {bounds:?}"
                );
                assert!(
                    bounds.max.z < 2.0 && bounds.min.z > -2.0,
                    "{frame}: {bounds:?}"
                );
                // The car does not collide with the table.
                let middle = bounds.center();
                assert!(
                    (middle.x / 1.05).abs() > 1.0 || (middle.z / 0.65).abs() > 1.0,
                    "{frame}: {middle}"
                );
            }
        }
    }

    #[test]
    fn the_camera_follows_the_car() {
        let room = toy_room(1).expect("within the limits");
        let span = room.span.expect("an animation");
        for frame in (0..FRAMES).step_by(25) {
            let time = span.time_of(frame);
            let camera = room.camera_at(time).expect("a camera");
            let car = room.placed_nodes(time)[0].translation.as_vec3();
            let forward = (camera.target - camera.eye).normalize();
            let cosine = forward.dot((car - camera.eye).normalize());
            assert!(cosine > 0.75, "{frame}: {cosine} from {camera:?} to {car}");
            assert!(camera.up.dot(Vec3::Y) > 0.5, "{frame}: {camera:?}");
        }
    }

    #[test]
    fn triangles_grow_with_the_size_and_few_of_them_move() {
        let count = |size: u32| {
            let room = toy_room(size).expect("within the limits");
            let moving = room.parts.iter().filter(|part| part.node.is_some());
            let moving: usize = moving.map(|part| part.mesh.len()).sum();
            let all: usize = room.parts.iter().map(|part| part.mesh.len()).sum();
            (all, moving)
        };
        let ((small, _), (large, moving)) = (count(1), count(4));
        assert!(large > 8 * small, "{small}, {large}");
        assert!(
            moving * 200 > large && moving * 20 < large,
            "{moving} of {large}"
        );
        assert!(toy_room(u32::MAX).is_err(), "too many triangles");
    }
}
