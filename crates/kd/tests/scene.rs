//! Scenes that change, under every strategy, against testing all triangles of all parts; and their errors.

mod rays;
mod strategies;

use std::sync::Arc;

use fastrand::Rng;
use kd::glam::{Affine3A, EulerRot, Mat3A, Quat, Vec3};
use kd::scene::{CommitAction, CommitError, SceneError};
use kd::{
    BuildOptions, FrameData, Hit, MergeMethod, Mesh, MeshError, PartId, Ray, RayPacket8, Scene,
    Strategy,
};
use kd_oracle::effort;
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;
use strategies::updating;

/// Those of [`updating`], and rebuilds.
fn strategies() -> Vec<Strategy> {
    let mut all = updating();
    all.push(Strategy::Rebuild(BuildOptions::balanced()));
    all.push(Strategy::Rebuild(BuildOptions::best().with_threads(1)));
    all
}

/// All triangles of a frame, and the part and triangle of each.
struct Oracle {
    mesh: Mesh,
    owners: Vec<(PartId, u32)>,
}

impl Oracle {
    fn new(frame: &FrameData) -> Self {
        let mesh_of = |part| &**frame.mesh(part).expect("it is in the frame");
        let owners = frame.parts().flat_map(|part| {
            let triangles = (0..).take(mesh_of(part).len());
            triangles.map(move |triangle| (part, triangle))
        });
        Self {
            mesh: Mesh::concatenated(frame.parts().map(mesh_of)).expect("few"),
            owners: owners.collect(),
        }
    }

    fn of_part(&self, hit: Hit) -> (PartId, Hit) {
        let (part, triangle) = self.owners[hit.triangle as usize];
        (part, Hit { triangle, ..hit })
    }

    /// Compares every query.
    fn check(&self, frame: &FrameData, rays: usize, seed: u64, what: &str) {
        if self.mesh.is_empty() {
            let ray = Ray::new([0.1, 0.2, 0.3], [1.0, 0.5, 0.2]);
            assert!(
                frame.intersect(&ray).is_none() && !frame.occluded(&ray),
                "{what}"
            );
            return;
        }
        let rays = rays_for(&self.mesh, rays, seed);
        let mut batch = vec![None; rays.len()];
        frame.intersect_batch(&rays, &mut batch);
        let mut occluded = vec![false; rays.len()];
        frame.occluded_batch(&rays, &mut occluded);
        let (mut hits, mut expected_hits) = (vec![], vec![]);
        for ((ray, batched), occluded) in rays.iter().zip(&batch).zip(&occluded) {
            let expected = brute_force::intersect(&self.mesh, ray);
            let expected = expected.map(|hit| self.of_part(hit));
            assert_eq!(frame.intersect(ray), expected, "{what}: {ray:?}");
            assert_eq!(*batched, expected, "{what}, batch: {ray:?}");
            assert_eq!(frame.occluded(ray), expected.is_some(), "{what}: {ray:?}");
            assert_eq!(*occluded, expected.is_some(), "{what}, batch: {ray:?}");
            brute_force::hits(&self.mesh, ray, 5, &mut expected_hits);
            let expected: Vec<_> = expected_hits.iter().map(|hit| self.of_part(*hit)).collect();
            for max in [1, 5] {
                frame.hits(ray, max, &mut hits);
                let first = &expected[..max.min(expected.len())];
                assert_eq!(hits, first, "{what}, at most {max}: {ray:?}");
            }
        }
        for (rays, expected) in rays.chunks_exact(8).zip(batch.chunks_exact(8)) {
            let mut packet = RayPacket8::default();
            for (lane, ray) in rays.iter().enumerate() {
                packet.set(lane, ray);
            }
            assert_eq!(frame.intersect8(&packet), expected, "{what}: packet");
            let any: Vec<bool> = expected.iter().map(Option::is_some).collect();
            assert_eq!(frame.occluded8(&packet).as_slice(), any, "{what}: packet");
        }
    }
}

fn small_mesh(rng: &mut Rng) -> Mesh {
    match rng.u32(..6) {
        0 => Spd::Balls.generate(1).expect("small").mesh,
        1 => Spd::Teapot.generate(2).expect("small").mesh,
        2 => Spd::Tetra.generate(3).expect("small").mesh,
        3 => Spd::Jacks.generate(1).expect("small").mesh,
        4 => Mesh::new(
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vec![[0, 1, 2]],
        )
        .expect("valid"),
        _ => Mesh::new(vec![], vec![]).expect("empty is valid"),
    }
}

/// About the size of the scene; now and then mirrored, flattened or far away.
fn somewhere(rng: &mut Rng, mesh: &Mesh) -> Affine3A {
    let mut random = |range: f32| range * (2.0 * rng.f32() - 1.0);
    let place = Vec3::new(random(1.5), random(1.5), random(1.5));
    let turn = Quat::from_euler(EulerRot::XYZ, random(3.0), random(3.0), random(3.0));
    let extent = mesh.bounds().extent().max_element().max(1e-3);
    let size = 1.0 / extent;
    let (turn, scale) = match rng.u32(..12) {
        0 => (Quat::IDENTITY, Vec3::new(size, -size, size)),
        1 => (turn, Vec3::new(size, 0.0, size)),
        2 => (turn, Vec3::splat(100.0 * size)),
        3..=6 => (Quat::IDENTITY, Vec3::splat(size)),
        _ => (turn, Vec3::splat(size)),
    };
    Affine3A::from_scale_rotation_translation(scale, turn, place)
}

fn shaken(rng: &mut Rng, mesh: &Mesh) -> Vec<[f32; 3]> {
    let by = 0.2 * mesh.bounds().extent().max_element().max(1e-3);
    let shake = |p: &[f32; 3]| p.map(|x| x + by * (rng.f32() - 0.5));
    mesh.positions().iter().map(shake).collect()
}

#[test]
fn changing_scenes_answer_as_all_their_triangles_do() {
    const COMMITS: usize = effort::count(6, 12);
    for (number, strategy) in strategies().into_iter().enumerate() {
        let mut rng = Rng::with_seed(7);
        let mut scene = Scene::new(BuildOptions::best());
        let mut meshes: Vec<(PartId, Arc<Mesh>)> = vec![];
        let mut kept: Option<(Arc<FrameData>, Oracle)> = None;
        for commit in 0..COMMITS {
            // First all strategies, then one for the rest; the last cycles through all.
            if number == 0 {
                scene.set_strategy(strategies()[commit % strategies().len()].clone());
            } else {
                scene.set_strategy(strategy.clone());
            }
            for _ in 0..rng.usize(1..5) {
                match rng.u32(..10) {
                    0..=4 => {
                        let mesh = Arc::new(small_mesh(&mut rng));
                        let part = if rng.u32(..3) == 0 {
                            scene.add_static(Arc::clone(&mesh))
                        } else {
                            scene.add_dynamic(Arc::clone(&mesh))
                        };
                        let part = part.expect("fits");
                        let place = somewhere(&mut rng, &mesh);
                        scene.set_transform(part, place).expect("finite");
                        meshes.push((part, mesh));
                    }
                    5 if !meshes.is_empty() => {
                        let (part, mesh) = meshes[rng.usize(..meshes.len())].clone();
                        let place = somewhere(&mut rng, &mesh);
                        let instance = scene.add_instance(part, place).expect("it is there");
                        meshes.push((instance, mesh));
                    }
                    6 if meshes.len() > 2 => {
                        let (part, _) = meshes.swap_remove(rng.usize(..meshes.len()));
                        scene.remove(part).expect("it is there");
                    }
                    7 | 8 if !meshes.is_empty() => {
                        let (part, mesh) = &meshes[rng.usize(..meshes.len())];
                        let place = somewhere(&mut rng, mesh);
                        scene.set_transform(*part, place).expect("finite");
                    }
                    _ if !meshes.is_empty() => {
                        let (part, mesh) = &meshes[rng.usize(..meshes.len())];
                        let positions = shaken(&mut rng, mesh);
                        scene.set_positions(*part, &positions).expect("finite");
                    }
                    _ => {}
                }
            }
            let what = format!("{strategy:?}, commit {commit}");
            let report = scene.commit().expect(&what);
            assert_eq!(report.parts, scene.parts().len(), "{what}");
            let frame = scene.frame();
            let oracle = Oracle::new(&frame);
            assert_eq!(report.triangles, oracle.mesh.len(), "{what}");
            let (bounds, around) = (oracle.mesh.bounds(), frame.bounds());
            assert_eq!(around.union(&bounds), around, "{what}");
            // The box of an instance that shares a tree is larger.
            let may_share = matches!(report.strategy, Strategy::Auto | Strategy::Instances);
            assert!(may_share || around == bounds, "{what}: {around:?}");
            oracle.check(&frame, 400, commit as u64, &what);
            if let Some((before, oracle)) = &kept {
                oracle.check(before, 100, commit as u64, "a snapshot of a frame before");
            }
            // Kept over up to three commits.
            if rng.bool() {
                kept = rng.bool().then(|| (scene.snapshot(), oracle));
            }
        }
    }
}

fn gears_and_balls(options: BuildOptions) -> (Scene, [PartId; 3]) {
    let gears = Spd::Gears.generate(1).expect("small").mesh;
    let balls = Arc::new(Spd::Balls.generate(1).expect("small").mesh);
    let mut scene = Scene::new(options);
    let still = scene.add_static(gears).expect("fits");
    let moving = [(); 2].map(|()| scene.add_dynamic(Arc::clone(&balls)).expect("fits"));
    (scene, [still, moving[0], moving[1]])
}

#[test]
fn frames_of_one_pose_take_equal_memory_after_any_history() {
    for strategy in updating() {
        let (mut scene, [_, moving, other]) = gears_and_balls(BuildOptions::balanced());
        scene.set_strategy(strategy.clone());
        let mut sizes = vec![];
        for commit in 0..effort::cases(1_000, 10_000) {
            let pose = (commit % 10) as f32;
            let place = Vec3::new(0.3 * pose, 0.1 * pose, 0.2);
            scene
                .set_transform(moving, Affine3A::from_translation(place))
                .expect("finite");
            let turn = Mat3A::from_rotation_z(0.6 * pose);
            scene
                .set_transform(other, Affine3A::from_mat3(turn.into()))
                .expect("finite");
            // Building takes longer, and gives the same sizes.
            if commit < effort::cases(60, 300)
                || matches!(strategy, Strategy::Refit | Strategy::Instances)
            {
                sizes.push(scene.commit().expect("a frame").bytes);
            }
        }
        for (commit, size) in sizes.iter().enumerate().skip(20) {
            assert_eq!(
                *size,
                sizes[10 + commit % 10],
                "{strategy:?}, commit {commit}"
            );
        }
    }
}

#[test]
fn threads_do_not_show() {
    for strategy in strategies() {
        let mut reports = vec![];
        let mut answers = vec![];
        for threads in [1, 2, 5] {
            let options = BuildOptions::best().with_threads(threads);
            let (mut scene, [_, moving, other]) = gears_and_balls(options);
            scene.set_strategy(strategy.clone());
            scene.commit().expect("a frame");
            for part in [moving, other] {
                let place = Affine3A::from_rotation_y(0.7);
                scene.set_transform(part, place).expect("finite");
            }
            reports.push(scene.commit().expect("a frame"));
            let frame = scene.frame();
            let rays = rays_for(&Oracle::new(&frame).mesh, 500, 3);
            let hits: Vec<_> = rays.iter().map(|ray| frame.intersect(ray)).collect();
            answers.push(hits);
        }
        let is_same = reports.windows(2).all(|pair| pair[0] == pair[1]);
        assert!(is_same, "{strategy:?}: {reports:?}");
        let is_same = answers.windows(2).all(|pair| pair[0] == pair[1]);
        assert!(is_same, "{strategy:?}: answers");
    }
}

#[test]
fn kd_trees_move_with_parts_that_stay_on_course() {
    let turn = Affine3A::from_rotation_y(0.4);
    let mirror = Affine3A::from_scale(Vec3::new(-0.5, 1.5, 1.0));
    for method in [MergeMethod::PartitionTrees, MergeMethod::BspMerge] {
        let (mut scene, [_, turned, mirrored]) = gears_and_balls(BuildOptions::best());
        scene.set_strategy(Strategy::Merge(method));
        let mut actions = vec![];
        for step in 0..6_u8 {
            // A course, then another one.
            let on = Affine3A::from_translation(Vec3::new(0.3, -0.2, 0.1) * f32::from(step));
            let (turn, mirror) = if step < 4 {
                (turn, mirror)
            } else {
                (turn.inverse(), turn * mirror)
            };
            scene.set_transform(turned, on * turn).expect("finite");
            scene.set_transform(mirrored, on * mirror).expect("finite");
            let report = scene.commit().expect("a frame");
            let of = |part| report.changes.iter().find(|change| change.part == part);
            actions.push([turned, mirrored].map(|part| of(part).expect("moved").action));
            let frame = scene.frame();
            let oracle = Oracle::new(&frame);
            oracle.check(
                &frame,
                300,
                u64::from(step),
                &format!("{method:?}, step {step}"),
            );
        }
        let (built, moved) = (CommitAction::BuiltFast, CommitAction::Moved);
        let expected = [built, built, moved, moved, built, built].map(|action| [action; 2]);
        assert_eq!(actions, expected, "{method:?}");
    }
}

#[test]
fn a_commit_that_fails_names_the_part_and_changes_nothing() {
    let (mut scene, [still, moving, gone]) = gears_and_balls(BuildOptions::balanced());
    scene.remove(gone).expect("it is there");
    scene.commit().expect("a frame");
    let oracle = Oracle::new(&scene.frame());

    let mut positions = scene
        .frame()
        .mesh(moving)
        .expect("there")
        .positions()
        .to_vec();
    positions[5][1] = f32::NAN;
    let refused = scene.set_positions(moving, &positions).expect_err("NaN");
    assert_eq!(refused.to_string(), "part 1: vertex 5 is not finite");
    let refused = scene
        .set_positions(moving, &positions[1..])
        .expect_err("one too few");
    assert!(
        matches!(
            refused,
            SceneError::Mesh {
                part,
                error: MeshError::VertexCount { .. }
            } if part == moving
        ),
        "{refused}"
    );
    for bad in [f32::NAN, f32::INFINITY] {
        let transform = Affine3A::from_translation(Vec3::new(0.0, bad, 0.0));
        let refused = scene
            .set_transform(moving, transform)
            .expect_err("not finite");
        assert_eq!(refused.to_string(), "part 1: the transform is not finite");
        let refused = scene
            .add_instance(moving, transform)
            .expect_err("not finite");
        assert_eq!(refused, SceneError::NotFinite { part: moving });
    }
    for refused in [
        scene.remove(gone),
        scene.set_transform(gone, Affine3A::IDENTITY),
        scene.set_positions(gone, &[]),
        scene.add_instance(gone, Affine3A::IDENTITY).map(|_| ()),
    ] {
        assert_eq!(refused, Err(SceneError::NoSuchPart { part: gone }));
    }
    scene.commit().expect("nothing of it was taken");
    oracle.check(&scene.frame(), 200, 1, "after what was refused");

    // Finite, but not when it is applied.
    let huge = Affine3A::from_scale(Vec3::splat(f32::MAX));
    scene.set_transform(moving, huge).expect("finite");
    let refused = scene.commit().expect_err("overflows");
    assert!(
        matches!(refused, CommitError::Mesh { part, .. } if part == moving),
        "{refused}"
    );
    oracle.check(&scene.frame(), 200, 2, "after a commit that failed");
    scene.set_strategy(Strategy::Rebuild(
        BuildOptions::balanced().with_max_depth(99),
    ));
    scene
        .set_transform(moving, Affine3A::IDENTITY)
        .expect("finite");
    let refused = scene.commit().expect_err("too deep");
    assert!(matches!(refused, CommitError::Rebuild { .. }), "{refused}");
    oracle.check(&scene.frame(), 200, 3, "after another");
    scene.set_strategy(Strategy::Auto);
    scene.commit().expect("corrected");
    oracle.check(&scene.frame(), 200, 4, "corrected");

    let (mut bad, _) = gears_and_balls(BuildOptions::balanced().with_max_depth(99));
    let refused = bad.commit().expect_err("too deep");
    assert!(
        matches!(refused, CommitError::Build { part, .. } if part == still),
        "{refused}"
    );
}

#[test]
fn singular_transforms_and_far_parts_are_right() {
    let (mut scene, [_, moving, other]) = gears_and_balls(BuildOptions::balanced());
    for flat in [
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::ZERO,
    ] {
        scene
            .set_transform(moving, Affine3A::from_scale(flat))
            .expect("finite");
        let far = Affine3A::from_translation(Vec3::splat(1e6));
        scene.set_transform(other, far).expect("finite");
        scene.commit().expect("a frame");
        let frame = scene.frame();
        Oracle::new(&frame).check(&frame, 600, 5, &format!("{flat:?}"));
    }
}

#[test]
fn ten_thousand_parts_are_a_frame() {
    let triangle = Mesh::new(
        vec![[0.0, 0.0, 0.0], [0.8, 0.0, 0.0], [0.0, 0.8, 0.1]],
        vec![[0, 1, 2]],
    );
    let triangle = Arc::new(triangle.expect("valid"));
    let mut scene = Scene::new(BuildOptions::best());
    let first = scene.add_dynamic(triangle).expect("fits");
    let place = |i: u16| {
        let i = f32::from(i);
        Affine3A::from_translation(Vec3::new(i % 100.0, (0.01 * i).floor(), 0.3 * (i % 7.0)))
    };
    let mut parts = vec![first];
    for i in 1..10_000 {
        parts.push(scene.add_instance(first, place(i)).expect("fits"));
    }
    scene.commit().expect("a frame");
    let frame = scene.frame();
    Oracle::new(&frame).check(&frame, 120, 1, "ten thousand parts");
    for (i, part) in (0..).zip(&parts).step_by(3) {
        scene.set_transform(*part, place(i + 3)).expect("finite");
    }
    for part in parts.iter().step_by(2) {
        scene.remove(*part).expect("it is there");
    }
    let report = scene.commit().expect("a frame");
    assert_eq!(report.parts, 5_000, "half of them");
    let frame = scene.frame();
    Oracle::new(&frame).check(&frame, 120, 2, "five thousand, some of them elsewhere");
}

#[test]
fn reports_tell_what_was_done_and_auto_reckons() {
    let (mut scene, [still, moving, other]) = gears_and_balls(BuildOptions::best());
    let report = scene.commit().expect("a frame");
    let actions: Vec<_> = report.changes.iter().map(|c| (c.part, c.action)).collect();
    let built = [
        (still, CommitAction::Built),
        (moving, CommitAction::BuiltFast),
        (other, CommitAction::BuiltFast),
    ];
    assert_eq!(actions, built, "{report}");
    let report = scene.commit().expect("a frame");
    assert!(report.changes.is_empty(), "nothing has changed: {report}");

    // A part that moves as a whole keeps its nodes, for any number of rays.
    scene.set_ray_budget(1_000_000_000);
    let place = Affine3A::from_translation(Vec3::new(0.5, 0.25, 0.125));
    scene.set_transform(moving, place).expect("finite");
    let report = scene.commit().expect("a frame");
    assert_eq!(report.changes.len(), 1, "{report}");
    assert_eq!(report.changes[0].action, CommitAction::Refitted, "{report}");

    // Triangles that move apart are rebuilt for many rays, and refitted for few.
    let mesh = Arc::clone(scene.frame().mesh(other).expect("there"));
    let mut rng = Rng::with_seed(1);
    let mut apart = mesh.positions().to_vec();
    rng.shuffle(&mut apart);
    for (rays, action) in [
        (1_000, CommitAction::Refitted),
        (1_000_000_000, CommitAction::BuiltFast),
    ] {
        scene.set_ray_budget(rays);
        scene.set_positions(other, &apart).expect("finite");
        let report = scene.commit().expect("a frame");
        assert_eq!(report.changes[0].action, action, "{rays} rays: {report}");
    }
    let frame = scene.frame();
    Oracle::new(&frame).check(&frame, 300, 6, "after all of it");
}

/// Ids of two scenes are equal, and still not exchangeable.
#[test]
fn ids_of_another_scene_are_no_such_part() {
    let (mut scene, ids) = gears_and_balls(BuildOptions::balanced());
    let (mut other, foreign) = gears_and_balls(BuildOptions::balanced());
    assert_eq!(ids, foreign, "text and order of ids are those of any run");
    assert_eq!(format!("{ids:?}"), format!("{foreign:?}"));
    let order = |ids: [PartId; 3]| {
        let mut ids = ids;
        ids.sort_unstable();
        ids
    };
    assert_eq!(order(ids), order(foreign), "the order ignores the scene");
    for part in foreign {
        for refused in [
            scene.set_transform(part, Affine3A::IDENTITY),
            scene.set_positions(part, &[]),
            scene.add_instance(part, Affine3A::IDENTITY).map(|_| ()),
            scene.remove(part),
        ] {
            assert_eq!(refused, Err(SceneError::NoSuchPart { part }));
        }
    }
    scene.commit().expect("a frame");
    other.commit().expect("a frame");
    for (own, part) in ids.into_iter().zip(foreign) {
        assert!(scene.frame().mesh(own).is_some(), "{own} is in its frame");
        assert!(scene.frame().mesh(part).is_none(), "{part} is foreign");
        assert!(other.snapshot().mesh(part).is_some(), "{part} at home");
    }
    other.remove(foreign[0]).expect("its own part");
}

#[test]
fn hits_of_coincident_parts_are_in_the_order_of_parts() {
    let at = |depths: &[f32]| {
        let corners = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        let positions = depths.iter().copied().flat_map(corners).collect();
        let triangles = (0..).step_by(3).take(depths.len());
        let triangles = triangles.map(|first| [first, first + 1, first + 2]);
        Mesh::new(positions, triangles.collect()).expect("valid")
    };
    let ray = Ray::new([0.2, 0.2, -1.0], [0.0, 0.0, 1.0]);
    for strategy in strategies() {
        let mut scene = Scene::new(BuildOptions::best());
        scene.set_strategy(strategy.clone());
        for part in 0..4 {
            let mesh = at(&[[2.0; 9], [1.0; 9], [2.0; 9]].concat());
            let added = if part % 2 == 0 {
                scene.add_dynamic(mesh)
            } else {
                scene.add_static(mesh)
            };
            added.expect("fits");
        }
        scene.commit().expect("a frame");
        let frame = scene.frame();
        let oracle = Oracle::new(&frame);
        let (mut hits, mut expected) = (vec![], vec![]);
        brute_force::hits(&oracle.mesh, &ray, usize::MAX, &mut expected);
        assert_eq!(expected.len(), 4 * 27, "all are in the way");
        for max in (0..=20).chain([36, 37, 60, 108, 109, usize::MAX]) {
            frame.hits(&ray, max, &mut hits);
            let first = expected.iter().take(max);
            let first: Vec<_> = first.map(|hit| oracle.of_part(*hit)).collect();
            assert_eq!(hits, first, "{strategy:?}, at most {max}");
        }
    }
}
