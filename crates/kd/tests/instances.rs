//! Instances that share a tree: answers of every query against testing all transformed triangles, memory, and reports.

mod rays;

use std::cmp;
use std::sync::Arc;

use kd::glam::{Affine3A, EulerRot, Mat3, Quat, Vec3};
use kd::query::RayHit;
use kd::scene::{CommitAction, CommitReason, PartChange};
use kd::{BuildOptions, FrameData, Hit, Mesh, PartId, Scene, Strategy};
use kd_oracle::rng::Rng;
use kd_oracle::{check_batch, check_ray, effort};
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;

fn random(rng: &mut Rng, range: f32) -> f32 {
    rng.between(-range, range)
}

/// Turned, scaled, mirrored, sheared, flattened, or far away.
fn place(rng: &mut Rng) -> Affine3A {
    let at = Vec3::new(random(rng, 2.0), random(rng, 2.0), random(rng, 2.0));
    let angles = [random(rng, 3.0), random(rng, 3.0), random(rng, 3.0)];
    let turn = Quat::from_euler(EulerRot::XYZ, angles[0], angles[1], angles[2]);
    let size = rng.between(0.2, 0.6);
    let scale = match rng.below(8) {
        0 => Vec3::new(size, -size, size),
        1 => Vec3::new(size, 0.0, size),
        2 => Vec3::new(size, 1e-6 * size, size),
        3 => Vec3::new(0.3 * size, 2.0 * size, size),
        _ => Vec3::splat(size),
    };
    let placed = Affine3A::from_scale_rotation_translation(scale, turn, at);
    match rng.below(8) {
        0 => {
            placed
                * Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::new(0.7, 1.0, 0.0), Vec3::Z))
        }
        1 => Affine3A::from_translation(Vec3::new(3e3, 0.0, 0.0)) * placed,
        _ => placed,
    }
}

/// Compares every query with a test of all triangles of all parts.
#[track_caller]
fn check(frame: &FrameData, rays: usize, what: &str) {
    let parts: Vec<(PartId, Arc<Mesh>)> = frame
        .parts()
        .map(|part| (part, Arc::clone(frame.mesh(part).expect("it is there"))))
        .collect();
    let all = Mesh::concatenated(parts.iter().map(|(_, mesh)| &**mesh)).expect("few");
    let bounds = frame.bounds();
    assert_eq!(bounds.union(&all.bounds()), bounds, "{what}: the box");
    let rays = rays_for(&all, rays, 5);
    let expected = rays.iter().map(|ray| {
        let mut hits: Vec<(PartId, Hit)> = Vec::new();
        let mut of_part = Vec::new();
        for (part, mesh) in &parts {
            brute_force::hits(mesh, ray, usize::MAX, &mut of_part);
            hits.extend(of_part.iter().map(|hit| (*part, *hit)));
        }
        hits.sort_by(|a, b| {
            if a.is_before(b) {
                cmp::Ordering::Less
            } else {
                cmp::Ordering::Greater
            }
        });
        hits
    });
    let expected: Vec<Vec<(PartId, Hit)>> = expected.collect();
    for (ray, expected) in rays.iter().zip(&expected) {
        check_ray(what, frame, ray, expected);
    }
    check_batch(what, frame, &rays, &expected);
    for (part, mesh) in &parts {
        for triangle in (0..u32::try_from(mesh.len()).expect("few")).step_by(97) {
            let corners = frame.corners(*part, triangle);
            assert_eq!(corners, Some(mesh.corners(triangle)), "{what}: {part}");
        }
    }
}

/// A row of collinear triangles among others: turned, some have an area.
fn with_slivers() -> Mesh {
    let teapot = Spd::Teapot.generate(1).expect("small").mesh;
    let mut positions = teapot.positions().to_vec();
    let mut triangles = teapot.triangles().to_vec();
    for i in 0..20_u8 {
        let first = u32::try_from(positions.len()).expect("few");
        let x = 0.37 * f32::from(i);
        positions.extend([[x, 0.1, 0.2], [x, 0.3, 0.6], [x, 0.2, 0.4]]);
        triangles.push([first, first + 1, first + 2]);
    }
    Mesh::new(positions, triangles).expect("valid")
}

#[test]
fn shared_trees_answer_as_copies() {
    let mut rng = Rng(4);
    let meshes = [
        Spd::Teapot.generate(2).expect("small").mesh,
        Spd::Gears.generate(1).expect("small").mesh,
        with_slivers(),
        Mesh::new(vec![], vec![]).expect("empty is valid"),
    ];
    for (strategy, budget) in [(Strategy::Instances, u64::MAX), (Strategy::Auto, 0)] {
        let mut scene = Scene::new(BuildOptions::fast());
        scene.set_strategy(strategy.clone());
        scene.set_ray_budget(budget);
        let mut originals = Vec::new();
        for (number, mesh) in meshes.iter().enumerate() {
            let original = if number % 2 == 0 {
                scene.add_static(mesh.clone())
            } else {
                scene.add_dynamic(mesh.clone())
            };
            originals.push(original.expect("fits"));
        }
        let mut parts = originals.clone();
        let mut kept: Vec<(Arc<FrameData>, String)> = Vec::new();
        let mut shared = 0;
        for commit in 0..effort::count(6, 20) {
            for _ in 0..3 {
                let of = rng.pick(&originals);
                parts.push(
                    scene
                        .add_instance(of, place(&mut rng))
                        .expect("it is there"),
                );
            }
            let moved = rng.pick(&parts);
            scene.set_transform(moved, place(&mut rng)).expect("finite");
            if commit % 3 == 1 {
                let removed =
                    parts.swap_remove(rng.below(parts.len() - originals.len()) + originals.len());
                scene.remove(removed).expect("it is there");
            }
            if commit % 4 == 2 {
                let of = originals[rng.below(3)];
                let mesh = &meshes[originals
                    .iter()
                    .position(|part| *part == of)
                    .expect("one of them")];
                let shaken = mesh
                    .positions()
                    .iter()
                    .map(|at| at.map(|x| x + random(&mut rng, 0.05)));
                scene
                    .set_positions(of, &shaken.collect::<Vec<_>>())
                    .expect("finite");
            }
            let what = format!("{strategy:?}, commit {commit}");
            let report = scene.commit().expect(&what);
            let shares = |change: &&PartChange| change.action == CommitAction::Shared;
            shared += report.changes.iter().filter(shares).count();
            check(&scene.snapshot(), 60, &what);
            for (frame, of) in &kept {
                check(frame, 20, &format!("{of}, after {what}"));
            }
            kept.push((scene.snapshot(), what));
            if kept.len() > 2 {
                kept.remove(0);
            }
        }
        assert!(shared > 6, "{strategy:?}: {shared} parts shared a tree");
        // To frames without shared trees, and back.
        for other in [
            Strategy::Rebuild(BuildOptions::fast()),
            Strategy::Dual,
            strategy.clone(),
        ] {
            scene.set_strategy(other.clone());
            scene
                .set_transform(originals[0], place(&mut rng))
                .expect("finite");
            scene.commit().expect("a frame");
            check(
                &scene.snapshot(),
                60,
                &format!("{other:?}, after {strategy:?}"),
            );
        }
    }
}

/// As many instances as asked for take the memory of one part, and at most 1 kB each.
#[test]
fn an_instance_takes_at_most_a_kilobyte() {
    const INSTANCES: u16 = if effort::IS_LONG { 10_000 } else { 1000 };
    let mesh = Spd::Balls.generate(2).expect("small").mesh;
    let mut alone = Scene::new(BuildOptions::fast());
    alone.add_dynamic(mesh.clone()).expect("fits");
    let one = alone.commit().expect("a frame").bytes.total();
    let mut scene = Scene::new(BuildOptions::fast());
    let part = scene.add_dynamic(mesh).expect("fits");
    for i in 0..INSTANCES {
        let at = Vec3::new(
            f32::from(i % 100),
            f32::from(i / 100),
            0.1 * f32::from(i % 7),
        );
        scene
            .add_instance(part, Affine3A::from_translation(3.0 * at))
            .expect("it is there");
    }
    let report = scene.commit().expect("a frame");
    let limit = one + 1000 * usize::from(INSTANCES);
    let taken = report.bytes.total();
    assert!(taken <= limit, "{taken} bytes, at most {limit}");
    for change in &report.changes {
        assert_eq!(change.action, CommitAction::Shared, "{change}");
        assert!(
            matches!(change.reason, CommitReason::Sharing { .. }),
            "{change}"
        );
    }
    // An instance that moves is not a copy either.
    let moved = scene.parts().nth(7).expect("many");
    scene
        .set_transform(moved, Affine3A::from_rotation_x(0.3))
        .expect("finite");
    let report = scene.commit().expect("a frame");
    assert_eq!(report.changes.len(), 1, "{report}");
    assert_eq!(report.changes[0].action, CommitAction::Shared, "{report}");
    assert!(
        report.bytes.total() <= limit,
        "{} bytes",
        report.bytes.total()
    );
}

/// Few small instances are copied: rays are faster, and it costs little.
#[test]
fn auto_copies_what_is_small() {
    let mut scene = Scene::new(BuildOptions::fast());
    let part = scene
        .add_dynamic(Spd::Tetra.generate(3).expect("small").mesh)
        .expect("fits");
    scene
        .add_instance(part, Affine3A::from_translation(Vec3::X))
        .expect("it is there");
    let report = scene.commit().expect("a frame");
    assert!(
        report
            .changes
            .iter()
            .all(|change| change.action != CommitAction::Shared),
        "{report}"
    );
    scene.set_strategy(Strategy::Instances);
    scene
        .set_transform(part, Affine3A::from_rotation_y(1.0))
        .expect("finite");
    let report = scene.commit().expect("a frame");
    assert_eq!(report.changes[0].action, CommitAction::Shared, "{report}");
}
