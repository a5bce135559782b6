//! Masks of parts and culling of sides, in scenes of every strategy, for every query: against testing all triangles.

mod rays;
mod strategies;

use std::sync::Arc;

use kd::glam::{Affine3A, Quat, Vec3};
use kd::query::RayHit;
use kd::scene::SceneError;
use kd::{BuildOptions, Culling, FrameData, Hit, Mesh, PartId, Ray, Scene, Strategy};
use kd_oracle::{check_batch, check_ray, effort};
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;
use strategies::updating;

/// All strategies, those that build wide nodes of parts with builders of both kinds of splits and for both layouts.
fn strategies() -> Vec<(BuildOptions, Strategy)> {
    let fast = BuildOptions::fast;
    let mut all: Vec<_> = updating().into_iter().map(|each| (fast(), each)).collect();
    all.push((BuildOptions::best(), Strategy::Auto));
    all.push((fast().with_layout(kd::Layout::Binary), Strategy::Auto));
    all.push((fast(), Strategy::Rebuild(fast())));
    all
}

/// A part as it was added: its mask, and whether its transform mirrors.
type Added = (PartId, u32, bool);

/// All hits of a ray: in each part those of a test of all its triangles, on the sides that the part's own mesh has.
fn all_hits(frame: &FrameData, parts: &[Added], ray: &Ray) -> Vec<(PartId, Hit)> {
    let (mut all, mut of_part) = (Vec::new(), Vec::new());
    for (part, mask, is_mirrored) in parts {
        if ray.mask & mask == 0 {
            continue;
        }
        let culling = if *is_mirrored {
            ray.culling.turned()
        } else {
            ray.culling
        };
        let mesh = frame.mesh(*part).expect("it is in the frame");
        brute_force::hits(mesh, &ray.with_culling(culling), usize::MAX, &mut of_part);
        all.extend(of_part.iter().map(|hit| (*part, *hit)));
    }
    all.sort_by(|a, b| {
        if a.is_before(b) {
            std::cmp::Ordering::Less
        } else {
            std::cmp::Ordering::Greater
        }
    });
    all
}

/// Compares every query of some rays, each with some mask and culling.
#[track_caller]
fn check(frame: &FrameData, parts: &[Added], what: &str) {
    let meshes = frame
        .parts()
        .map(|part| &**frame.mesh(part).expect("it is in the frame"));
    let all = Mesh::concatenated(meshes).expect("few");
    let masks = [u32::MAX, 0b001, 0b010, 0b110, 0b1000, 0];
    let cullings = [Culling::NONE, Culling::BACK, Culling::FRONT, Culling::BOTH];
    let rays = rays_for(&all, effort::count(60, 2000), 11);
    let mut met = [0; 3];
    let rays: Vec<Ray> = rays
        .iter()
        .enumerate()
        .map(|(number, ray)| {
            let ray = ray.with_mask(masks[number % masks.len()]);
            ray.with_culling(cullings[number / masks.len() % cullings.len()])
        })
        .collect();
    let expected: Vec<_> = rays.iter().map(|ray| all_hits(frame, parts, ray)).collect();
    for (ray, expected) in rays.iter().zip(&expected) {
        check_ray(what, frame, ray, expected);
        for side in [Culling::NONE, Culling::BACK, Culling::FRONT] {
            met[usize::from(side == Culling::BACK) + 2 * usize::from(side == Culling::FRONT)] +=
                usize::from(ray.culling == side && !expected.is_empty());
        }
    }
    assert!(
        met.iter().all(|count| *count > 2),
        "{what}: {met:?} rays hit"
    );
    check_batch(what, frame, &rays, &expected);
    let plain: Vec<Ray> = rays
        .iter()
        .map(|ray| ray.with_mask(0b111).with_culling(Culling::NONE))
        .collect();
    let expected: Vec<_> = plain
        .iter()
        .map(|ray| all_hits(frame, parts, ray))
        .collect();
    check_batch(what, frame, &plain, &expected);
}

/// Balls, a mirrored pot, a turned instance of the pot and a mirrored one: they overlap.
fn scene(options: &BuildOptions) -> (Scene, Vec<Added>) {
    let mut scene = Scene::new(options.clone());
    let balls = scene
        .add_static(Spd::Balls.generate(1).expect("small").mesh)
        .expect("fits");
    let pot = scene
        .add_dynamic(Spd::Teapot.generate(2).expect("small").mesh)
        .expect("fits");
    let size = 0.3;
    let place = |scale: Vec3, turn: f32, to: Vec3| {
        Affine3A::from_scale_rotation_translation(size * scale, Quat::from_rotation_x(turn), to)
    };
    let mirrored = place(Vec3::new(-1.0, 1.0, 1.0), 0.3, Vec3::new(0.2, 0.1, 0.0));
    scene.set_transform(pot, mirrored).expect("finite");
    let turned = place(Vec3::new(-1.0, -1.0, 2.0), 1.0, Vec3::new(-0.3, 0.2, 0.1));
    let first = scene.add_instance(pot, turned).expect("it is there");
    let other = place(Vec3::new(1.0, 1.0, -1.0), 2.0, Vec3::new(0.1, -0.4, 0.3));
    let second = scene.add_instance(pot, other).expect("it is there");
    let all = vec![
        (balls, u32::MAX, false),
        (pot, u32::MAX, true),
        (first, u32::MAX, false),
        (second, u32::MAX, true),
    ];
    (scene, all)
}

#[test]
fn masks_and_culling_hold_for_every_query_of_every_strategy() {
    for (options, strategy) in strategies() {
        let (mut scene, mut parts) = scene(&options);
        scene.set_strategy(strategy.clone());
        let mut what = format!("{strategy:?}");
        scene.commit().expect(&what);
        check(scene.snapshot().as_ref(), &parts, &what);
        // The last one only sees no ray at all.
        for masks in [[0b001, 0b010, u32::MAX, 0b1100], [0b111, 0, 0b110, 0b001]] {
            what += ", masked";
            for ((part, mask, _), new) in parts.iter_mut().zip(masks) {
                scene.set_mask(*part, new).expect("it is there");
                *mask = new;
            }
            let report = scene.commit().expect(&what);
            assert_eq!(report.changes, [], "{what}: nothing is built");
            check(scene.snapshot().as_ref(), &parts, &what);
        }
        // A mask and a motion at once; and a part that keeps its mask.
        let (pot, mask, is_mirrored) = &mut parts[1];
        scene.set_mask(*pot, 0b100).expect("it is there");
        scene
            .set_transform(*pot, Affine3A::from_scale(Vec3::splat(0.2)))
            .expect("finite");
        (*mask, *is_mirrored) = (0b100, false);
        scene.remove(parts[0].0).expect("it is there");
        parts.remove(0);
        scene.commit().expect(&what);
        check(scene.snapshot().as_ref(), &parts, &format!("{what}, moved"));
    }
}

#[test]
fn masks_are_of_their_commit() {
    let (mut scene, mut parts) = scene(&BuildOptions::fast());
    scene.commit().expect("a frame");
    let before = scene.snapshot();
    scene.set_mask(parts[0].0, 0b10).expect("it is there");
    check(scene.snapshot().as_ref(), &parts, "before the commit");
    scene.commit().expect("a frame");
    check(&before, &parts, "a snapshot of the frame before");
    parts[0].1 = 0b10;
    check(scene.snapshot().as_ref(), &parts, "after the commit");
    let removed = parts.pop().expect("four");
    scene.set_mask(removed.0, 0).expect("it is there");
    scene.remove(removed.0).expect("it is there");
    let error = scene.set_mask(removed.0, 1).expect_err("it is removed");
    assert_eq!(error, SceneError::NoSuchPart { part: removed.0 });
    scene.commit().expect("a frame");
    check(scene.snapshot().as_ref(), &parts, "with a part less");
}

/// Hits behind a part that is not in the frame are those of parts that were added later, at that distance.
#[test]
fn places_of_removed_parts_keep_their_order() {
    let square = Arc::new(
        Mesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vec![[0, 1, 2]],
        )
        .expect("valid"),
    );
    let ray = Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]);
    for removed in 0..3 {
        let mut scene = Scene::new(BuildOptions::fast());
        let add = |_| scene.add_dynamic(Arc::clone(&square)).expect("fits");
        let parts: Vec<PartId> = (0..3).map(add).collect();
        scene.commit().expect("a frame");
        let (mut before, mut behind) = (Vec::new(), Vec::new());
        scene.frame().hits(&ray, usize::MAX, &mut before);
        scene.remove(parts[removed]).expect("it is there");
        scene.commit().expect("a frame");
        scene
            .frame()
            .hits_behind(&ray, &before[removed], usize::MAX, &mut behind);
        assert_eq!(behind, before[removed + 1..], "without part {removed}");
    }
}
