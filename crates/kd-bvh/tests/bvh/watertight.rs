//! Nothing gets out of a closed mesh that was refitted.

use glam::Vec3;
use kd_oracle::watertight::check_closed;

use crate::check::{Subject, check};
use crate::rng::Rng;
use crate::scenes;

/// Points in the octahedron around the origin, some of which give exact directions.
fn inside() -> Vec<Vec3> {
    let mut rng = Rng(11);
    let mut points = vec![Vec3::ZERO, Vec3::new(0.0, 0.25, 0.0), Vec3::splat(0.125)];
    points.extend([(); 3].map(|()| 0.3 * rng.vec3()));
    points
}

/// How far boxes are widened follows what was refitted, too.
#[test]
fn what_has_grown_is_tight() {
    let small = scenes::moved(&scenes::sphere(2), |p| 1e-4 * p);
    let off = Vec3::new(30.0, -20.0, 10.0);
    let large = scenes::moved(&scenes::sphere(2), |p| 1e3 * p + off);
    let subjects: Vec<Subject<'_>> = Subject::all(&small)
        .into_iter()
        .map(
            |Subject {
                 mut bvh, options, ..
             }| {
                bvh.refit(&large).expect("as many triangles");
                Subject::of(&large, bvh, &options)
            },
        )
        .collect();
    // Where it was, so that what is near there looks near enough.
    let points: Vec<Vec3> = inside().into_iter().map(|p| 1e-4 * p).collect();
    check_closed("grown", &large, &points, |ray| {
        check("grown", &large, &subjects, ray)
    });
}
