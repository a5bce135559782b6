//! Scenes whose parts are placed in f64.

use kd::glam::{Affine3A, DAffine3, DVec3, Vec3};
use kd::scene::{CommitAction, PartChange, SceneError};
use kd::world::{World, WorldRay};
use kd::{BuildOptions, Frame, Hit, Mesh, PartId, Ray, Scene, Strategy};
use kd_oracle::rng::Rng;
use kd_trace::brute_force;

use crate::UTM;
use crate::city::{City, Grid};
use crate::strategies::updating;

/// Those of [`updating`], and a rebuild.
fn strategies() -> Vec<Strategy> {
    let mut all = updating();
    all.push(Strategy::Rebuild(BuildOptions::fast()));
    all
}

fn scene(origin: DVec3, strategy: Strategy) -> Scene {
    let options = BuildOptions::fast().with_threads(1);
    let mut scene = Scene::with_origin(options, origin).expect("finite");
    scene.set_strategy(strategy);
    scene
}

/// A flying house.
fn house() -> Mesh {
    let city = City::new(1, 32.0, Grid::Of(1.0 / 1024.0));
    Mesh::new(city.rounded(), city.triangles).expect("valid")
}

/// The closest hit by a test of all triangles of all parts.
fn slow(frame: Frame<'_>, ray: &Ray) -> Option<(PartId, Hit)> {
    let hits = frame.parts().filter_map(|part| {
        let mesh = frame.mesh(part).expect("it is in the frame");
        Some((part, brute_force::intersect(mesh, ray)?))
    });
    hits.reduce(|first, other| if other.1.t < first.1.t { other } else { first })
}

/// A scene at UTM coordinates answers as the same scene at zero, which is placed in f32.
#[test]
fn scenes_at_utm_answer_as_at_zero() {
    let city = City::new(6, 60.0, Grid::Of(1.0 / 16384.0));
    let ground = Mesh::from_f64(&city.shifted(UTM), city.triangles.clone()).expect("valid");
    assert_eq!(ground.rounding, DVec3::ZERO, "exact");
    // Offsets of the ground from its own origin, as f32 places it in the scene at zero.
    let from_zero = (ground.origin - UTM).as_vec3();
    for strategy in strategies() {
        let mut near = scene(DVec3::ZERO, strategy.clone());
        let mut far = scene(UTM, strategy.clone());
        let parts = [&mut near, &mut far].map(|scene| {
            let ground = scene.add_static(ground.mesh.clone()).expect("fits");
            let house = scene.add_dynamic(house()).expect("fits");
            (ground, house)
        });
        let [(near_ground, near_house), (far_ground, far_house)] = parts;
        near.set_transform(near_ground, Affine3A::from_translation(from_zero))
            .expect("finite");
        far.set_world_transform(far_ground, DAffine3::from_translation(ground.origin))
            .expect("finite");
        let row = Vec3::new(-64.0, 40.0, 90.0);
        near.add_instance(near_house, Affine3A::from_translation(row))
            .expect("fits");
        let there = DAffine3::from_translation(UTM + row.as_dvec3());
        far.add_world_instance(far_house, there).expect("fits");
        let mut rng = Rng(12);
        for step in 0..4_u8 {
            let place = Vec3::new(0.0, 16.5, 50.0) + 8.25 * f32::from(step);
            near.set_transform(near_house, Affine3A::from_translation(place))
                .expect("finite");
            let there = DAffine3::from_translation(UTM + place.as_dvec3());
            far.set_world_transform(far_house, there).expect("finite");
            near.commit().expect("a frame");
            let report = far.commit().expect("a frame");
            // Moving a kd-tree in f32 would round otherwise than its triangles do in f64.
            let is_moved = |change: &PartChange| change.action == CommitAction::Moved;
            assert!(!report.changes.iter().any(is_moved), "{strategy:?}");
            let snapshot = far.snapshot();
            let snapshot = World::new(&*snapshot, far.origin());
            let mut hits = [Vec::new(), Vec::new()];
            for _ in 0..200 {
                let (start, direction) = city.ray(&mut rng);
                let ray = Ray::new(start.as_vec3(), direction);
                let world_ray = WorldRay::new(start + UTM, direction);
                let found = far.world().intersect(&world_ray);
                assert_eq!(found, near.frame().intersect(&ray), "{strategy:?}: {ray:?}");
                assert_eq!(found, slow(near.frame(), &ray), "{strategy:?}: {ray:?}");
                assert_eq!(found, snapshot.intersect(&world_ray), "{strategy:?}");
                let [near_hits, far_hits] = &mut hits;
                near.frame().hits(&ray, 9, near_hits);
                far.world().hits(&world_ray, 9, far_hits);
                assert_eq!(near_hits, far_hits, "{strategy:?}: {ray:?}");
            }
        }
    }
}

/// Parts that turn in f64, and change between placements, answer as all their triangles do, and lie where f64 says.
#[test]
fn turning_parts_are_rounded_once() {
    let city = City::new(4, 60.0, Grid::Of(1.0 / 16384.0));
    let ground = Mesh::from_f64_at(UTM, &city.shifted(UTM), city.triangles.clone());
    let ground = ground.expect("valid");
    for strategy in strategies() {
        let mut scene = scene(UTM, strategy.clone());
        scene.add_static(ground.mesh.clone()).expect("fits");
        let part = scene.add_dynamic(house()).expect("fits");
        let mut rng = Rng(13);
        for step in 0..6_u8 {
            let angle = 0.3 * f64::from(step);
            let place = UTM + DVec3::new(-20.3, 7.7, 60.1);
            let turned = DAffine3::from_translation(place) * DAffine3::from_rotation_y(angle);
            if step % 3 == 2 {
                let place = Affine3A::from_translation(Vec3::new(0.1, 0.2, 70.0));
                scene.set_transform(part, place).expect("finite");
            } else {
                scene.set_world_transform(part, turned).expect("finite");
            }
            scene.commit().expect("a frame");
            let frame = scene.frame();
            let placed = frame.mesh(part).expect("it is in the frame").positions();
            if step % 3 != 2 {
                for (own, placed) in house().positions().iter().zip(placed) {
                    let own = Vec3::from(*own).as_dvec3();
                    let exact = turned.matrix3 * own + (place - UTM);
                    let error = (Vec3::from(*placed).as_dvec3() - exact).abs();
                    let most = exact.abs() / f64::from(1 << 24) + 1e-12;
                    assert!(error.cmple(most).all(), "{error} of {most}");
                }
            }
            for _ in 0..100 {
                let (start, direction) = city.ray(&mut rng);
                let ray = WorldRay::new(start + UTM, direction);
                let found = scene.world().intersect(&ray);
                let expected = slow(frame, &ray.relative_to(UTM));
                assert_eq!(found, expected, "{strategy:?}: {ray:?}");
            }
        }
    }
}

#[test]
fn bad_origins_and_transforms_are_refused() {
    let options = BuildOptions::fast();
    let error = Scene::with_origin(options.clone(), [0.0, f64::NAN, 0.0]);
    assert_eq!(error.err(), Some(SceneError::Origin));
    let mut scene = Scene::with_origin(options, UTM).expect("finite");
    assert_eq!(scene.origin(), UTM);
    let part = scene.add_static(house()).expect("fits");
    let bad = DAffine3::from_translation(DVec3::INFINITY);
    let expected = SceneError::NotFinite { part };
    let error = scene.set_world_transform(part, bad);
    assert_eq!(error.as_ref(), Err(&expected));
    assert_eq!(scene.add_world_instance(part, bad), Err(expected));
    let far = DAffine3::from_translation(DVec3::X * 1e39);
    scene.set_world_transform(part, far).expect("finite in f64");
    let error = scene.commit().expect_err("out of the range of f32");
    assert_eq!(
        error.to_string(),
        format!("{part}, moved: vertex 0 is not finite")
    );
}
