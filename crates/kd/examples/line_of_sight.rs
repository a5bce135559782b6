//! Which of some points see each other across a landscape, and through how many slopes they look.
//!
//! ```text
//! cargo run --release --example line_of_sight
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Ray};
use kd_scene::Spd;

fn main() -> Result<(), Box<dyn Error>> {
    let tree = KdTree::build(Spd::Mount.generate(6)?.mesh, &BuildOptions::balanced())?;

    // Masts at the corners and in the middle, a little above the ground that a ray from above hits.
    let places = [
        [-0.9, -0.9],
        [0.9, -0.9],
        [0.9, 0.9],
        [-0.2, -0.9],
        [0.0, 0.0],
    ];
    let masts = places.map(|[x, y]| {
        let down = Ray::new([x, y, 100.0], [0.0, 0.0, -1.0]);
        let ground = tree
            .intersect(&down)
            .map_or(Vec3::new(x, y, 0.0), |hit| hit.point(&down));
        ground + Vec3::new(0.0, 0.0, 0.05)
    });

    let mut between = Vec::new();
    for (i, &from) in masts.iter().enumerate() {
        for (j, &to) in masts.iter().enumerate().skip(i + 1) {
            let line = Ray::between(from, to);
            if tree.occluded(&line) {
                tree.hits(&line, usize::MAX, &mut between);
                println!(
                    "{i} and {j}: hidden, {} triangles in the way",
                    between.len()
                );
            } else {
                println!("{i} and {j}: in sight, {:.2} apart", from.distance(to));
            }
        }
    }
    Ok(())
}
