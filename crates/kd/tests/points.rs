//! Questions of points, through the facade: trees in both layouts, and frames of scenes with every strategy.

mod strategies;

use kd::glam::{Affine3A, Vec3};
use kd::points::Nearest;
use kd::points::{WINDING_ERROR, WindingNumbers, brute_force};
use kd::{Aabb, BuildOptions, FrameData, KdTree, Layout, Mesh, PartId, Scene, Strategy};
use kd_oracle::rng::Rng;
use kd_oracle::{effort, scenes};
use strategies::updating;

/// Points on, near and far from a mesh.
fn points(mesh: &Mesh, count: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Rng(seed);
    let bounds = mesh.bounds();
    let mut point = |number: usize| {
        let triangle = u32::try_from(rng.below(mesh.len())).expect("small");
        let [a, b, c] = mesh.corners(triangle);
        match number % 5 {
            0 => a,
            1 => b.midpoint(c),
            2 => a + 0.3 * (b - a) + 0.3 * (c - a) + 0.01 * rng.vec3(),
            3 => bounds.center() + 1.5 * bounds.extent() * rng.vec3(),
            _ => Vec3::new(bounds.min.x, a.y, b.z),
        }
    };
    (0..count).map(&mut point).collect()
}

#[test]
fn trees_answer_as_brute_force_in_both_layouts() {
    for (name, mesh) in [
        ("cube", scenes::cube(8)),
        ("room", scenes::room()),
        ("duplicates", scenes::duplicates()),
        ("zero area", scenes::zero_area()),
    ] {
        let points = points(&mesh, effort::count(300, 3000), 1);
        let near = 0.2 * mesh.bounds().diagonal();
        let built = KdTree::build(mesh.clone(), &BuildOptions::balanced()).expect("valid");
        for layout in [Layout::Wide, Layout::Binary] {
            let tree = built.clone().with_layout(layout).expect("valid");
            for portable in [false, true] {
                let tree = if portable {
                    tree.clone().with_level(kd::layout::Level::portable())
                } else {
                    tree.clone()
                };
                let mut list = Vec::new();
                let mut expected_list = Vec::new();
                for &point in &points {
                    let place = format!("{name}, {layout:?}, {point}");
                    let expected = brute_force::closest_point(&mesh, point, near);
                    assert_eq!(tree.closest_point(point, near), expected, "{place}");
                    let expected = brute_force::contains(&mesh, point);
                    assert_eq!(tree.contains(point), expected, "{place}");
                    let expected = brute_force::signed_distance(&mesh, point);
                    assert_eq!(tree.signed_distance(point), expected, "{place}");
                    tree.triangles_in_sphere(point, near, &mut list);
                    brute_force::triangles_in_sphere(&mesh, point, near, &mut expected_list);
                    assert_eq!(list, expected_list, "{place}");
                    let bounds = Aabb::around([point, point + near]);
                    tree.triangles_in_box(&bounds, &mut list);
                    brute_force::triangles_in_box(&mesh, &bounds, &mut expected_list);
                    assert_eq!(list, expected_list, "{place}");
                }
                check_batches(&tree, &points, near);
            }
        }
    }
}

/// Batches, on one thread and on several, answer as single points.
fn check_batches(tree: &KdTree, points: &[Vec3], near: f32) {
    let of_each = points.iter();
    let nearest: Vec<_> = of_each.map(|p| tree.closest_point(*p, near)).collect();
    let inside: Vec<_> = points.iter().map(|p| tree.contains(*p)).collect();
    let distances: Vec<_> = points.iter().map(|p| tree.signed_distance(*p)).collect();
    let winding: Vec<_> = points.iter().map(|p| tree.winding_number(*p)).collect();
    let count = points.len();

    let mut found = [vec![None; count], vec![None; count]];
    tree.closest_point_batch(points, near, &mut found[0]);
    tree.par_closest_point_batch(points, near, &mut found[1]);
    assert!(
        found.iter().all(|found| *found == nearest),
        "closest points"
    );
    let mut found = [vec![false; count], vec![true; count]];
    tree.contains_batch(points, &mut found[0]);
    tree.par_contains_batch(points, &mut found[1]);
    assert!(found.iter().all(|found| *found == inside), "inside");
    let mut found = [vec![None; count], vec![None; count]];
    tree.signed_distance_batch(points, &mut found[0]);
    tree.par_signed_distance_batch(points, &mut found[1]);
    assert!(found.iter().all(|found| *found == distances), "distances");
    let mut found = [vec![0.0; count], vec![1.0; count]];
    tree.winding_number_batch(points, &mut found[0]);
    tree.par_winding_number_batch(points, &mut found[1]);
    assert!(
        found.iter().all(|found| *found == winding),
        "winding numbers"
    );

    let spheres: Vec<(Vec3, f32)> = points.iter().map(|point| (*point, near)).collect();
    let lists = tree.triangles_in_sphere_batch(&spheres);
    assert_eq!(
        lists,
        tree.par_triangles_in_sphere_batch(&spheres),
        "spheres"
    );
    let boxes: Vec<Aabb> = points
        .iter()
        .map(|p| Aabb::around([*p, *p + near]))
        .collect();
    let in_boxes = tree.triangles_in_box_batch(&boxes);
    assert_eq!(in_boxes, tree.par_triangles_in_box_batch(&boxes), "boxes");
    let mut list = Vec::new();
    for number in 0..count {
        tree.triangles_in_sphere(spheres[number].0, near, &mut list);
        assert_eq!(lists.list(number), list, "sphere {number}");
        tree.triangles_in_box(&boxes[number], &mut list);
        assert_eq!(in_boxes.list(number), list, "box {number}");
    }
}

#[test]
fn winding_numbers_are_near_the_sum_of_all_triangles() {
    let mesh = scenes::bumpy();
    let tree = KdTree::build(mesh.clone(), &BuildOptions::fast()).expect("valid");
    for point in points(&mesh, effort::count(200, 2000), 2) {
        let error = tree.winding_number(point) - brute_force::winding_number(&mesh, point);
        assert!(error.abs() <= WINDING_ERROR + 1e-6, "{point}: {error}");
        let same = WindingNumbers::new(tree.mesh()).at(point);
        assert_eq!(tree.winding_number(point), same, "the same hierarchy");
    }
}

/// Those of [`updating`], and rebuilds.
fn strategies() -> Vec<Strategy> {
    let rebuild = BuildOptions::fast();
    let mut all = updating();
    all.push(Strategy::Rebuild(
        rebuild.clone().with_layout(Layout::Binary),
    ));
    all.push(Strategy::Rebuild(rebuild));
    all
}

/// All parts of a frame in one mesh, and the part and number of each triangle.
fn whole(frame: &FrameData) -> (Mesh, Vec<(PartId, u32)>) {
    let parts: Vec<PartId> = frame.parts().collect();
    let meshes = parts
        .iter()
        .map(|part| &**frame.mesh(*part).expect("a part"));
    let mesh = Mesh::concatenated(meshes.clone()).expect("small");
    let numbered = parts.iter().zip(meshes).flat_map(|(part, mesh)| {
        let count = u32::try_from(mesh.len()).expect("small");
        (0..count).map(|triangle| (*part, triangle))
    });
    (mesh, numbered.collect())
}

#[test]
fn frames_answer_for_all_parts() {
    for strategy in strategies() {
        let mut scene = Scene::new(BuildOptions::default());
        scene.set_strategy(strategy.clone());
        scene.add_static(scenes::room()).expect("a part");
        let ball = scene.add_dynamic(scenes::sphere(2)).expect("a part");
        // With some strategies, both share a tree.
        scene
            .add_instance(ball, Affine3A::IDENTITY)
            .expect("it is there");
        for step in 0..3_u8 {
            let shift = Vec3::new(f32::from(step), 4.0, 4.0);
            scene
                .set_transform(ball, Affine3A::from_translation(shift))
                .expect("a part");
            scene.commit().expect("valid");
            check_frame(&scene.frame(), &format!("{strategy:?}, step {step}"));
        }
    }
}

fn check_frame(frame: &FrameData, what: &str) {
    let (mesh, parts) = whole(frame);
    let of_part = |nearest: Nearest| {
        let (part, triangle) = parts[nearest.triangle as usize];
        (
            part,
            Nearest {
                triangle,
                ..nearest
            },
        )
    };
    let points = points(&mesh, effort::count(150, 1500), 3);
    let expected: Vec<_> = points
        .iter()
        .map(|point| brute_force::closest_point(&mesh, *point, f32::INFINITY).map(of_part))
        .collect();
    let of_each = points.iter();
    let inside: Vec<bool> = of_each.map(|p| brute_force::contains(&mesh, *p)).collect();
    let of_each = points.iter();
    let distances: Vec<Option<f32>> = of_each
        .map(|p| brute_force::signed_distance(&mesh, *p))
        .collect();
    let (mut list, mut slots) = (Vec::new(), Vec::new());
    let boxes: Vec<Aabb> = points
        .iter()
        .map(|p| Aabb::around([*p, *p - 0.7]))
        .collect();
    let in_boxes = frame.triangles_in_box_batch(&boxes);
    assert_eq!(frame.par_triangles_in_box_batch(&boxes), in_boxes, "{what}");
    let spheres: Vec<(Vec3, f32)> = points.iter().map(|point| (*point, 0.7)).collect();
    let in_spheres = frame.triangles_in_sphere_batch(&spheres);
    let in_parallel = frame.par_triangles_in_sphere_batch(&spheres);
    assert_eq!(in_parallel, in_spheres, "{what}");
    let mut windings = [vec![0.0; points.len()], vec![0.0; points.len()]];
    frame.winding_number_batch(&points, &mut windings[0]);
    frame.par_winding_number_batch(&points, &mut windings[1]);
    assert_eq!(windings[0], windings[1], "{what}");
    for (number, &point) in points.iter().enumerate() {
        let winding = frame.winding_number(point);
        assert_eq!(winding, windings[0][number], "{what}, {point}");
        let error = winding - brute_force::winding_number(&mesh, point);
        assert!(
            error.abs() <= WINDING_ERROR + 1e-6,
            "{what}, {point}: {error}"
        );
        let found = frame.closest_point(point, f32::INFINITY);
        assert_eq!(found, expected[number], "{what}, {point}");
        assert_eq!(frame.contains(point), inside[number], "{what}, {point}");
        assert_eq!(
            frame.signed_distance(point),
            distances[number],
            "{what}, {point}"
        );
        frame.triangles_in_sphere(point, 0.7, &mut list);
        brute_force::triangles_in_sphere(&mesh, point, 0.7, &mut slots);
        let in_parts = slots.iter().map(|slot| parts[*slot as usize]);
        assert!(list.iter().copied().eq(in_parts), "{what}, {point}");
        assert_eq!(in_spheres.list(number), list, "{what}, {point}");
        let bounds = boxes[number];
        frame.triangles_in_box(&bounds, &mut list);
        brute_force::triangles_in_box(&mesh, &bounds, &mut slots);
        let in_parts = slots.iter().map(|slot| parts[*slot as usize]);
        assert!(list.iter().copied().eq(in_parts), "{what}, {point}");
        assert_eq!(in_boxes.list(number), list, "{what}, {point}");
    }
    let count = points.len();
    let mut found = [vec![None; count], vec![None; count]];
    frame.closest_point_batch(&points, f32::INFINITY, &mut found[0]);
    frame.par_closest_point_batch(&points, f32::INFINITY, &mut found[1]);
    assert!(
        found.iter().all(|found| *found == expected),
        "{what}: batches"
    );
    let mut found = [vec![false; count], vec![false; count]];
    frame.contains_batch(&points, &mut found[0]);
    frame.par_contains_batch(&points, &mut found[1]);
    assert!(
        found.iter().all(|found| *found == inside),
        "{what}: batches"
    );
    let mut found = [vec![None; count], vec![None; count]];
    frame.signed_distance_batch(&points, &mut found[0]);
    frame.par_signed_distance_batch(&points, &mut found[1]);
    assert!(
        found.iter().all(|found| *found == distances),
        "{what}: batches"
    );
}

#[test]
fn parts_that_are_mirrored_keep_their_sides() {
    let corners = vec![
        [-1.0; 3],
        [3.0, -1.0, -1.0],
        [-1.0, 3.0, -1.0],
        [-1.0, -1.0, 3.0],
    ];
    let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let tetrahedron = Mesh::new(corners, faces).expect("valid");
    for strategy in strategies() {
        let mut scene = Scene::new(BuildOptions::default());
        scene.set_strategy(strategy.clone());
        let first = scene.add_static(tetrahedron.clone()).expect("a part");
        let mirrored = Affine3A::from_translation(5.0 * Vec3::X)
            * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let other = scene.add_instance(first, mirrored).expect("it is there");
        scene.commit().expect("valid");
        let inside = [Vec3::ZERO, 5.0 * Vec3::X];
        for point in inside {
            let winding = scene.frame().winding_number(point);
            assert!(
                (winding - 1.0).abs() <= WINDING_ERROR,
                "{strategy:?}: {winding}"
            );
        }
        // The hierarchy is that of the frame, not of the one before.
        scene.remove(other).expect("it is there");
        scene.commit().expect("valid");
        let windings = inside.map(|point| scene.frame().winding_number(point).round());
        assert_eq!(windings, [1.0, 0.0], "{strategy:?}");
    }
}

#[test]
fn empty_trees_and_frames_answer_nothing() {
    let empty = Mesh::new(vec![], vec![]).expect("valid");
    let tree = KdTree::build(empty, &BuildOptions::default()).expect("valid");
    assert_eq!(
        tree.closest_point(Vec3::ZERO, f32::INFINITY),
        None,
        "a tree"
    );
    assert_eq!(tree.signed_distance(Vec3::ZERO), None, "a tree");
    assert!(!tree.contains(Vec3::ZERO), "a tree");
    assert_eq!(tree.winding_number(Vec3::ZERO), 0.0, "a tree");
    let scene = Scene::new(BuildOptions::default());
    let frame = scene.snapshot();
    assert_eq!(
        frame.closest_point(Vec3::ZERO, f32::INFINITY),
        None,
        "a frame"
    );
    assert!(!frame.contains(Vec3::ZERO), "a frame");
}
