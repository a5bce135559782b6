//! Parts that come, move and go in random order, against a model, with snapshots held.

use std::collections::BTreeMap;
use std::sync::Arc;

use fastrand::Rng;
use kd::glam::{Affine3A, Quat, Vec3};
use kd::scene::{MergeMethod, SceneError, Strategy};
use kd::{BuildOptions, FrameData, Hit, Mesh, PartId, Ray, Scene};
use kd_oracle::effort;
use kd_trace::brute_force;

/// The transformed mesh of each part.
type Frame = BTreeMap<PartId, Arc<Mesh>>;

/// A scene, and what it should be.
struct Model {
    rng: Rng,
    scene: Scene,
    ids: Vec<PartId>,
    parts: BTreeMap<PartId, Part>,
    frame: Frame,
    gone: Vec<PartId>,
    held: Vec<(Arc<FrameData>, Frame)>,
}

struct Part {
    mesh: Mesh,
    original: Option<PartId>,
    to: Affine3A,
}

fn point(rng: &mut Rng, size: f32) -> Vec3 {
    size * (2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 1.0)
}

fn corners(rng: &mut Rng, triangles: usize) -> Vec<[f32; 3]> {
    let corners = (0..3 * triangles).map(|_| point(rng, 1.0).to_array());
    let mut corners: Vec<[f32; 3]> = corners.collect();
    // Now and then a triangle without an area.
    if !corners.is_empty() && rng.u32(0..4) == 0 {
        corners[0] = corners[1];
    }
    corners
}

fn somewhere(rng: &mut Rng) -> Affine3A {
    let turn = match rng.u32(0..3) {
        0 => Quat::from_rotation_x(3.0 * rng.f32()),
        _ => Quat::IDENTITY,
    };
    let scale = Vec3::splat(if rng.u32(0..20) == 0 { 3.0 } else { 0.5 });
    Affine3A::from_scale_rotation_translation(scale, turn, point(rng, 3.0))
}

fn closest(frame: &Frame, ray: &Ray) -> Option<(PartId, Hit)> {
    let hits = frame
        .iter()
        .filter_map(|(id, mesh)| Some((*id, brute_force::intersect(mesh, ray)?)));
    // The earlier part among equals.
    hits.reduce(|best, hit| if hit.1.t < best.1.t { hit } else { best })
}

#[track_caller]
fn check(data: &FrameData, frame: &Frame, rng: &mut Rng, what: &str) {
    assert!(data.parts().eq(frame.keys().copied()), "{what}: parts");
    let boxes = frame.values().map(|mesh| mesh.bounds());
    let bounds = boxes.reduce(|around, bounds| around.union(&bounds));
    let (bounds, around) = (bounds.unwrap_or_default(), data.bounds());
    assert_eq!(around.union(&bounds), around, "{what}: box");
    // The box of an instance that shares a tree is larger. A snapshot may be of another strategy.
    let may_share = ["Auto", "Instances"]
        .iter()
        .any(|name| what.starts_with(name))
        || what.ends_with("a snapshot");
    assert!(may_share || around == bounds, "{what}: box {around:?}");
    for _ in 0..4 {
        let (from, to) = (point(rng, 8.0), point(rng, 3.0));
        let ray = Ray::new(from, to - from);
        let expected = closest(frame, &ray);
        assert_eq!(data.intersect(&ray), expected, "{what}: {ray:?}");
        assert_eq!(data.occluded(&ray), expected.is_some(), "{what}: {ray:?}");
    }
}

impl Model {
    fn new(seed: u64, options: BuildOptions) -> Self {
        Self {
            rng: Rng::with_seed(seed),
            scene: Scene::new(options.with_threads(1)),
            ids: Vec::new(),
            parts: BTreeMap::new(),
            frame: Frame::new(),
            gone: Vec::new(),
            held: Vec::new(),
        }
    }

    fn add(&mut self) {
        let count = self.rng.usize(0..4);
        let corners = corners(&mut self.rng, count);
        let triangles = (0..).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let mesh = Mesh::new(corners, triangles.take(count).collect()).expect("valid");
        let id = match self.rng.u32(0..3) {
            0 => self.scene.add_static(mesh.clone()),
            _ => self.scene.add_dynamic(mesh.clone()),
        };
        self.place(id.expect("few"), mesh, None, Affine3A::IDENTITY);
    }

    fn add_instance(&mut self, of: PartId) {
        let to = somewhere(&mut self.rng);
        let id = self.scene.add_instance(of, to).expect("it is there");
        let original = self.parts[&of].original.unwrap_or(of);
        let mesh = self.parts[&of].mesh.clone();
        self.place(id, mesh, Some(original), to);
    }

    fn place(&mut self, id: PartId, mesh: Mesh, original: Option<PartId>, to: Affine3A) {
        if !self.parts.contains_key(&id) {
            self.ids.push(id);
        }
        let placed = mesh.transformed(&to).expect("finite");
        self.frame.insert(id, Arc::new(placed));
        self.parts.insert(id, Part { mesh, original, to });
    }

    fn remove(&mut self, place: usize) {
        let id = self.ids.swap_remove(place);
        self.scene.remove(id).expect("it is there");
        self.frame.remove(&id);
        self.parts.remove(&id);
        self.gone.push(id);
    }

    fn transform(&mut self, id: PartId) {
        let to = somewhere(&mut self.rng);
        self.scene.set_transform(id, to).expect("it is there");
        let part = &self.parts[&id];
        self.place(id, part.mesh.clone(), part.original, to);
    }

    fn deform(&mut self, id: PartId) {
        let corners = corners(&mut self.rng, self.parts[&id].mesh.len());
        self.scene.set_positions(id, &corners).expect("as many");
        let mesh = self.parts[&id].mesh.with_positions(corners);
        let mesh = mesh.expect("finite");
        let followers = self.parts.iter();
        let followers =
            followers.filter(|(other, part)| **other == id || part.original == Some(id));
        let followers: Vec<_> = followers
            .map(|(id, part)| (*id, part.original, part.to))
            .collect();
        for (id, original, to) in followers {
            self.place(id, mesh.clone(), original, to);
        }
    }

    /// Changes one part.
    fn change(&mut self, most_parts: usize) {
        let place = self.rng.usize(0..self.ids.len().max(1));
        let some = self.ids.get(place).copied();
        match (self.rng.u32(0..20), some) {
            (0..=2, _) | (_, None) if self.ids.len() < most_parts => self.add(),
            (3, Some(id)) if self.ids.len() < most_parts => self.add_instance(id),
            (4..=7, Some(_)) => self.remove(place),
            (8, Some(id)) => self.deform(id),
            (_, Some(id)) => self.transform(id),
            (_, None) => {}
        }
    }

    /// Commits and checks the frame, and now and then one from before.
    fn commit(&mut self, what: &str) {
        self.scene.commit().expect("few parts");
        check(&self.scene.frame(), &self.frame, &mut self.rng, what);
        if self.rng.u32(0..4) == 0 {
            self.held.push((self.scene.snapshot(), self.frame.clone()));
        }
        if self.held.len() > 3 {
            let place = self.rng.usize(0..self.held.len());
            let (data, frame) = self.held.swap_remove(place);
            check(&data, &frame, &mut self.rng, &format!("{what}, a snapshot"));
        }
    }
}

#[test]
fn parts_come_move_and_go() {
    let mut model = Model::new(11, BuildOptions::balanced());
    for step in 0..effort::count(20_000, 100_000) {
        model.change(60);
        if model.rng.u32(0..20) == 0 {
            model.commit(&format!("step {step}"));
        }
        if let (0, Some(id)) = (step % 50, model.rng.choice(&model.gone)) {
            let refused = model.scene.remove(*id);
            assert_eq!(refused, Err(SceneError::NoSuchPart { part: *id }), "twice");
        }
        assert!(
            model.scene.parts().eq(model.frame.keys().copied()),
            "{step}"
        );
    }
    assert!(model.gone.len() > 1000, "{} removed", model.gone.len());
}

/// From a thousand parts on, commits repair the frame before where few parts have changed.
#[test]
fn few_of_many_parts_change() {
    let strategies = [
        Strategy::Auto,
        Strategy::Instances,
        Strategy::Dual,
        Strategy::Refit,
        Strategy::Merge(MergeMethod::Guided),
    ];
    let mut model = Model::new(3, BuildOptions::fast());
    while model.ids.len() < 1500 {
        model.add();
    }
    for round in 0..effort::count(200, 2000) {
        // A few commits of each strategy.
        let strategy = &strategies[round / 8 % strategies.len()];
        model.scene.set_strategy(strategy.clone());
        for _ in 0..model.rng.usize(0..30) {
            model.change(1600);
        }
        model.commit(&format!("{strategy:?}, round {round}"));
    }
}
