//! Many parts that come, move and go in random order, against a model, with snapshots held.

use std::collections::BTreeMap;
use std::sync::Arc;

use fastrand::Rng;
use kd::glam::{Affine3A, Vec3};
use kd::scene::SceneError;
use kd::{BuildOptions, FrameData, Hit, Mesh, PartId, Ray, Scene};
use kd_oracle::effort;
use kd_trace::brute_force;

/// The transformed mesh of each part.
type Model = BTreeMap<PartId, Mesh>;

fn point(rng: &mut Rng, size: f32) -> Vec3 {
    size * (2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 1.0)
}

fn part(rng: &mut Rng) -> Mesh {
    let count = rng.u32(0..4);
    let corners = (0..3 * count).map(|_| point(rng, 1.0).to_array());
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Mesh::new(corners.collect(), triangles.collect()).expect("valid")
}

fn closest(model: &Model, ray: &Ray) -> Option<(PartId, Hit)> {
    let hits = model
        .iter()
        .filter_map(|(id, mesh)| Some((*id, brute_force::intersect(mesh, ray)?)));
    // The earlier part among equals.
    hits.reduce(|best, hit| if hit.1.t < best.1.t { hit } else { best })
}

#[track_caller]
fn check(frame: &FrameData, model: &Model, rng: &mut Rng, what: &str) {
    assert!(frame.parts().eq(model.keys().copied()), "{what}");
    for _ in 0..4 {
        let (from, to) = (point(rng, 8.0), point(rng, 3.0));
        let ray = Ray::new(from, to - from);
        assert_eq!(
            frame.intersect(&ray),
            closest(model, &ray),
            "{what}: {ray:?}"
        );
    }
}

#[test]
fn parts_come_move_and_go() {
    let mut rng = Rng::with_seed(11);
    let mut scene = Scene::new(BuildOptions::balanced().with_threads(1));
    let (mut meshes, mut model) = (BTreeMap::new(), Model::new());
    let mut gone: Vec<PartId> = Vec::new();
    let mut held: Vec<(Arc<FrameData>, Model)> = Vec::new();
    for step in 0..effort::count(20_000, 100_000) {
        let ids: Vec<PartId> = model.keys().copied().collect();
        let some = rng.choice(ids);
        match (rng.u32(0..20), some) {
            (0..=3, _) | (_, None) if model.len() < 60 => {
                let mesh = part(&mut rng);
                let id = if rng.bool() {
                    scene.add_static(mesh.clone())
                } else {
                    scene.add_dynamic(mesh.clone())
                };
                let id = id.expect("few");
                meshes.insert(id, mesh.clone());
                model.insert(id, mesh);
            }
            (4..=7, Some(id)) => {
                scene.remove(id).expect("it is there");
                model.remove(&id);
                gone.push(id);
            }
            (8..=17, Some(id)) => {
                let to = Affine3A::from_translation(point(&mut rng, 3.0));
                scene.set_transform(id, to).expect("it is there");
                let moved = meshes[&id].transformed(&to).expect("finite");
                model.insert(id, moved);
            }
            (18, _) => {
                scene.commit().expect("few parts");
                check(&scene.frame(), &model, &mut rng, "a frame");
                if rng.u32(0..4) == 0 {
                    held.push((scene.snapshot(), model.clone()));
                }
            }
            _ => {
                if held.len() > 3 {
                    let (frame, model) = held.swap_remove(rng.usize(0..held.len()));
                    check(&frame, &model, &mut rng, "a snapshot");
                }
            }
        }
        if let (0, Some(id)) = (step % 50, rng.choice(&gone)) {
            let refused = scene.remove(*id);
            assert_eq!(refused, Err(SceneError::NoSuchPart { part: *id }), "twice");
        }
        assert!(scene.parts().eq(model.keys().copied()), "step {step}");
    }
    assert!(gone.len() > 1000, "{} removed", gone.len());
}
