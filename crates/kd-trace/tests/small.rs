//! Every way to ask, once, over a mesh that is small enough for Miri: see `.ci/miri`.

use std::ops::ControlFlow;

use glam::{Affine3A, Vec3};
use kd_core::{Aabb, Culling, Hit, Mesh, Ray, RayPacket8};
use kd_sah::{BuildOptions, build};
use kd_trace::kit::{Closest, Frame, Placement, VisitItem, WideBoxes, collect_placed, walk_boxes};
use kd_trace::{Join, Level, PackedTree, RayQuery, WideForest, WideTree, brute_force};

/// Three sheets of small triangles, one behind the other.
fn sheets() -> Mesh {
    const SIDE: u8 = if cfg!(miri) { 2 } else { 6 };
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for sheet in 0..3_u8 {
        let first = u32::try_from(positions.len()).expect("small");
        for i in 0..=SIDE {
            for j in 0..=SIDE {
                let [x, y] = [i, j].map(|i| f32::from(i) / f32::from(SIDE));
                positions.push([x, y, f32::from(sheet) + 0.3 * x * y]);
            }
        }
        let row = u32::from(SIDE) + 1;
        for i in 0..u32::from(SIDE) {
            for j in 0..u32::from(SIDE) {
                let a = first + row * i + j;
                triangles.extend([[a, a + 1, a + row], [a + 1, a + row + 1, a + row]]);
            }
        }
    }
    Mesh::new(positions, triangles).expect("valid")
}

/// Rays of a tile.
const TILE: u8 = if cfg!(miri) { 16 } else { 64 };

/// A tile that stays together, one that parts, and rays that go their own ways, as many as are traced in turn.
fn rays() -> Vec<Ray> {
    let at = |i: u8| Vec3::new(f32::from(i % 8), f32::from(i / 8), 0.0) / 8.0;
    let eye = Vec3::new(0.4, 0.6, -2.0);
    let camera = (0..TILE).map(|i| Ray::new(eye, at(i) - eye));
    let lamp = Vec3::new(0.5, 0.5, 5.0);
    let shadows = (0..TILE).map(|i| Ray::between(at(i) + 1.5 * Vec3::Z, lamp));
    let mixed = (0..64_u8).map(|i| {
        let from = 3.0
            * Vec3::new(
                f32::from(i % 5) - 2.0,
                f32::from(i % 7) - 3.0,
                f32::from(i % 3),
            );
        let ray = Ray::new(from, at(i % 64) + f32::from(i % 4) * Vec3::Z - from);
        if i == 37 { ray.with_mask(0) } else { ray }
    });
    camera.chain(shadows).chain(mixed).collect()
}

/// The sheets as parts of a forest, of which one has moved there and back, and one was taken out and put in again.
fn joined(mesh: &Mesh) -> WideForest {
    let third = mesh.len() / 3;
    let part = |sheet: usize| {
        let triangles = mesh.triangles()[sheet * third..][..third].to_vec();
        Mesh::new(mesh.positions().to_vec(), triangles).expect("a part of a mesh")
    };
    let first = |sheet: usize| u32::try_from(sheet * third).expect("few");
    let mut forest = WideForest::new();
    for sheet in 0..3 {
        forest.push(&WideTree::from_objects(&part(sheet)), first(sheet));
    }
    let moved = part(1).transformed(&Affine3A::from_rotation_x(2.0));
    forest.refit(1, &moved.expect("finite"), first(1));
    forest.join(Join::default());
    forest.refit(1, &part(1), first(1));
    let mut other = WideForest::new();
    other.push_copy(&forest, 2);
    forest.remove(2);
    forest.push_copy(&other, 0);
    forest.join(Join::default());
    forest
}

/// Rays that see one side, rays through the placed tree, and the boxes of triangles.
fn check_sides_placed_and_boxes(mesh: &Mesh, wide: &WideTree, ray: &Ray, level: Level) {
    for side in [Culling::BACK, Culling::FRONT] {
        let ray = ray.with_culling(side);
        let expected = brute_force::intersect(mesh, &ray);
        assert_eq!(wide.intersect(&ray), expected, "{level}, {ray:?}");
        assert_eq!(wide.occluded(&ray), expected.is_some(), "{level}, {ray:?}");
    }
    let turned = Affine3A::from_rotation_x(0.2);
    let placement = Placement::new(wide, &turned, 0).expect("not flat");
    let mut closest = Closest::default();
    let frame = Frame::new(&placement.bounds());
    collect_placed(wide, &placement, &frame, ray, &mut closest);
    let placed = mesh.transformed(&turned).expect("finite");
    let expected = brute_force::intersect(&placed, ray);
    assert_eq!(closest.0, expected, "{level}, placed, {ray:?}");

    let triangles = 0..u32::try_from(mesh.len()).expect("few");
    let boxes: Vec<Aabb> = triangles.map(|i| Aabb::around(mesh.corners(i))).collect();
    let boxes = WideBoxes::new(&boxes, false, None).expect("nothing cancels it");
    let mut met = Met(Vec::new());
    walk_boxes(&boxes.with_level(level), wide.frame(), ray, &mut met);
    if let Some(hit) = brute_force::intersect(mesh, ray) {
        assert!(met.0.contains(&hit.triangle), "{level}, boxes, {ray:?}");
    }
}

/// The boxes that a ray meets.
struct Met(Vec<u32>);

impl VisitItem for Met {
    fn limit(&self) -> f32 {
        f32::INFINITY
    }

    fn visit(&mut self, item: u32) -> ControlFlow<()> {
        self.0.push(item);
        ControlFlow::Continue(())
    }
}

#[test]
fn every_way_to_ask_gives_the_same_answers() {
    let mesh = sheets();
    let tree = build(&mesh, &BuildOptions::fast().with_threads(1)).expect("valid");
    let rays = rays();
    let expected: Vec<Option<Hit>> = rays
        .iter()
        .map(|ray| brute_force::intersect(&mesh, ray))
        .collect();
    let any: Vec<bool> = expected.iter().map(Option::is_some).collect();
    assert!(
        expected.iter().flatten().count() > rays.len() / 3,
        "rays hit something"
    );

    for level in [Level::detect(), Level::portable()] {
        let packed = PackedTree::new(&tree, &mesh).with_level(level);
        let wide = WideTree::new(&tree, &mesh).with_level(level);
        let forest = joined(&mesh).with_level(level);
        let (mut few, mut expected_few) = (Vec::new(), Vec::new());
        for (i, ray) in rays.iter().enumerate() {
            assert_eq!(packed.intersect(ray), expected[i], "{level}, packed, {i}");
            assert_eq!(wide.intersect(ray), expected[i], "{level}, {i}");
            assert_eq!(packed.occluded(ray), any[i], "{level}, packed, {i}");
            assert_eq!(wide.occluded(ray), any[i], "{level}, {i}");
            let forest = forest.tree();
            assert_eq!(forest.intersect(ray), expected[i], "{level}, joined, {i}");
            if i % 4 == 0 {
                check_sides_placed_and_boxes(&mesh, &wide, ray, level);
            }
            wide.hits(ray, 2, &mut few);
            brute_force::hits(&mesh, ray, 2, &mut expected_few);
            assert_eq!(few, expected_few, "{level}, {i}");
        }
        let tile = usize::from(TILE);
        for range in [0..tile, tile..2 * tile, 2 * tile..rays.len()] {
            let mut hits = vec![None; range.len()];
            wide.intersect_batch(&rays[range.clone()], &mut hits);
            assert_eq!(hits, expected[range.clone()], "{level}, in batches");
            let mut occluded = vec![false; range.len()];
            wide.occluded_batch(&rays[range.clone()], &mut occluded);
            assert_eq!(occluded, any[range], "{level}, in batches");
        }
        // Under Miri enough rays for each way of a batch: as streams, in turns and one by one.
        let repeated = |i: usize| 2 * tile + i * 7 % (rays.len() - 2 * tile);
        let many: Vec<Ray> = (0..5 * 96).map(|i| rays[repeated(i)]).collect();
        let mut hits = vec![None; many.len()];
        wide.intersect_batch(&many, &mut hits);
        let mut occluded = vec![false; many.len()];
        wide.occluded_batch(&many, &mut occluded);
        for i in 0..many.len() {
            assert_eq!(hits[i], expected[repeated(i)], "{level}, in a large batch");
            assert_eq!(occluded[i], any[repeated(i)], "{level}, in a large batch");
        }
        for (i, rays) in rays.chunks(8).enumerate() {
            let packet = RayPacket8::new(rays);
            assert_eq!(
                wide.intersect8(&packet),
                expected[8 * i..][..8],
                "{level}, packet {i}"
            );
            assert_eq!(
                wide.occluded8(&packet),
                any[8 * i..][..8],
                "{level}, packet {i}"
            );
        }
    }
}
