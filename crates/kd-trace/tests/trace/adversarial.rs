//! One row per way of being awkward.

use glam::Vec3;
use kd_core::{Aabb, Axis, CostModel, Mesh, Node, NodeIndex, Pair, Ray, Slot, Tree};
use kd_sah::{BuildOptions, build};
use kd_trace::{brute_force, hits, intersect, intersect_counted, occluded};

use crate::check::{Subject, check, source};
use crate::random_tree::random_tree;
use crate::rng::Rng;
use crate::scenes::{self, Soup};

const INFINITY: f32 = f32::INFINITY;

fn trees(mesh: &Mesh) -> Vec<Subject> {
    let mut trees = vec![build(mesh, &BuildOptions::best()).expect("valid")];
    trees.extend((20..23).map(|seed| random_tree(mesh, seed)));
    let subject = |tree| Subject::new(mesh, tree);
    trees.into_iter().map(subject).collect()
}

/// The square [0, 2]² at z = 0, two triangles.
fn square() -> Mesh {
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let mut soup = Soup::default();
    soup.quad([
        corner(0.0, 0.0),
        corner(2.0, 0.0),
        corner(2.0, 2.0),
        corner(0.0, 2.0),
    ]);
    soup.mesh()
}

#[test]
fn rays_that_cannot_hit_do_not() {
    let mesh = scenes::cube(2);
    let trees = trees(&mesh);
    let good = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, 1.0]);
    assert!(check("cube", &mesh, &trees, &good) > 0, "a plain ray hits");
    let (nan, tiny) = (f32::NAN, f32::from_bits(1));
    for bad in [
        Ray::new([nan, 0.0, 0.0], [0.0, 0.0, 1.0]),
        Ray::new([0.0, INFINITY, 0.0], [0.0, 0.0, 1.0]),
        Ray::new([0.0, 0.0, 0.0], [0.0, nan, 1.0]),
        Ray::new([0.0, 0.0, 0.0], [0.0, -INFINITY, 1.0]),
        Ray::new([0.0, 0.0, 0.0], [0.0, -0.0, 0.0]),
        good.with_range(nan, 2.0),
        good.with_range(0.0, nan),
        good.with_range(2.0, 0.0),
        good.with_range(INFINITY, INFINITY),
        good.with_range(-INFINITY, -INFINITY),
        good.with_mask(0),
    ] {
        assert_eq!(check("cube", &mesh, &trees, &bad), 0, "{}", source(&bad));
    }
    for direction in [
        [0.0, 0.0, tiny],
        [0.0, tiny, -tiny],
        [f32::MAX, 0.0, f32::MAX],
        [-f32::MAX; 3],
    ] {
        let ray = Ray::new([0.1, 0.2, 0.3], direction);
        check("cube", &mesh, &trees, &ray);
        let back = ray.with_range(-INFINITY, INFINITY);
        check("cube", &mesh, &trees, &back);
    }
    // With so short a direction, t is large but finite; with so long a one, tiny but not zero.
    let slow = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, 1e-38]);
    assert!(check("cube", &mesh, &trees, &slow) > 0, "t is 7e37");
    let fast = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, f32::MAX]);
    assert!(check("cube", &mesh, &trees, &fast) > 0, "t is 2e-39");
}

#[test]
fn no_triangles_no_hits() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let empty = Tree::from_parts(
        vec![Pair([Node::EMPTY_LEAF; 2])],
        vec![],
        Aabb::EMPTY,
        0,
        CostModel::CLASSIC,
    )
    .expect("valid");
    let built = build(&mesh, &BuildOptions::default()).expect("valid");
    let ray = Ray::new([0.0; 3], [1.0; 3]);
    let trees = [empty, built].map(|tree| Subject::new(&mesh, tree));
    assert_eq!(check("empty", &mesh, &trees, &ray), 0, "nothing there");
}

#[test]
fn triangles_without_area_are_not_hit() {
    let mut soup = Soup::default();
    let (a, b) = (Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0));
    for corners in [[a, a, a], [a, b, b], [a, b, a.midpoint(b)]] {
        soup.triangle(corners);
    }
    let mesh = soup.mesh();
    let trees = trees(&mesh);
    for target in [a, b, a.midpoint(b)] {
        let ray = Ray::new([0.0; 3], target);
        assert_eq!(check("no area", &mesh, &trees, &ray), 0, "{}", source(&ray));
    }
}

#[test]
fn edge_on_triangles_are_not_hit() {
    let mesh = square();
    let trees = trees(&mesh);
    for ray in [
        Ray::new([-1.0, 0.5, 0.0], [1.0, 0.0, 0.0]),
        Ray::new([-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]),
        Ray::new([1.0, 0.5, 0.0], [0.25, 1.0, -0.0]),
    ] {
        assert_eq!(check("square", &mesh, &trees, &ray), 0, "{}", source(&ray));
    }
}

#[test]
fn edges_and_corners_belong_to_all_their_triangles() {
    let mesh = square();
    let trees = trees(&mesh);
    for (point, triangles) in [
        ([0.0, 0.0], 2),
        ([2.0, 2.0], 2),
        ([1.0, 1.0], 2),
        ([2.0, 0.0], 1),
        ([0.0, 2.0], 1),
        ([1.0, 0.0], 1),
        ([0.0, 0.5], 1),
        ([1.5, 0.5], 1),
        ([f32::from_bits(1).next_down() - f32::MIN_POSITIVE, 0.5], 0),
        ([2.0_f32.next_up(), 0.5], 0),
    ] {
        for sign in [1.0, -1.0] {
            for zero in [0.0, -0.0] {
                let ray = Ray::new([point[0], point[1], -3.0 * sign], [zero, -zero, sign]);
                let n = check("square", &mesh, &trees, &ray);
                assert_eq!(n, triangles, "{}", source(&ray));
            }
        }
    }
}

/// The range is closed, may be a single number, and may be negative.
#[test]
fn ranges_are_closed() {
    let mesh = square();
    let trees = trees(&mesh);
    let ray = Ray::new([1.5, 0.5, 0.3], [0.0, 0.0, -0.7]);
    let t = brute_force::intersect(&mesh, &ray).expect("below").t;
    for (low, high, expected) in [
        (t, t, 1),
        (t, INFINITY, 1),
        (0.0, t, 1),
        (-INFINITY, INFINITY, 1),
        (t.next_up(), INFINITY, 0),
        (0.0, t.next_down(), 0),
        (-INFINITY, -0.0, 0),
    ] {
        let ray = ray.with_range(low, high);
        let n = check("square", &mesh, &trees, &ray);
        assert_eq!(n, expected, "{}", source(&ray));
    }
    let behind = Ray::new(ray.origin, -ray.direction).with_range(-t, -t);
    assert_eq!(check("square", &mesh, &trees, &behind), 1, "behind, at -t");
    let on_it = Ray::new([1.5, 0.5, 0.0], [0.3, 0.2, 1.0]);
    for (low, high, expected) in [
        (0.0, 0.0, 1),
        (-0.0, 0.0, 1),
        (0.0, -0.0, 1),
        (f32::from_bits(1), 1.0, 0),
    ] {
        let ray = on_it.with_range(low, high);
        let n = check("square", &mesh, &trees, &ray);
        assert_eq!(
            n,
            expected,
            "an origin on the surface is at t = 0: {}",
            source(&ray)
        );
    }
}

/// Along every axis through every corner, every edge's middle and every lattice point, with zeros of both signs.
#[test]
fn rays_along_axes_through_everything() {
    for mesh in [scenes::cube(2), scenes::room()] {
        let trees = trees(&mesh);
        let bounds = mesh.bounds();
        let mut points: Vec<Vec3> = mesh.positions().iter().map(|&p| p.into()).collect();
        for triangle in 0..u32::try_from(mesh.len()).expect("small") {
            let [a, b, c] = mesh.corners(triangle);
            points.extend([a.midpoint(b), b.midpoint(c), (a + b + c) / 3.0]);
        }
        points.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("finite"));
        points.dedup();
        let (mut rays, mut hit) = (0, 0);
        for point in points {
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    // From outside, from a face of the box, from the point itself.
                    let outside = bounds.center()[axis] - 10.0 * sign;
                    let face = if sign > 0.0 { bounds.min } else { bounds.max }[axis];
                    for start in [outside, face, point[axis]] {
                        let mut origin = point;
                        origin[axis] = start;
                        let mut direction = Vec3::new(0.0, -0.0, 0.0);
                        direction[axis] = sign;
                        let ray = Ray::new(origin, direction);
                        rays += 1;
                        hit += usize::from(check("axes", &mesh, &trees, &ray) > 0);
                    }
                }
            }
        }
        assert!(10 * hit > 3 * rays, "{hit} of {rays}");
    }
}

/// Nearly parallel to planes, grazing along faces.
#[test]
fn grazing_rays() {
    let mesh = scenes::room();
    let trees = trees(&mesh);
    let (mut rays, mut hit) = (0, 0);
    let tilts = [
        0.0, -0.0, 1e-45, -1e-38, 1e-30, 1e-19, -1e-18, 1e-12, -1e-7, 1e-5,
    ];
    for lattice in 0..9 {
        for tilt in tilts {
            for axis in 0..3 {
                let mut origin = Vec3::new(0.3, 1.7, 2.1);
                let mut direction = Vec3::new(0.6, 1.0, -0.4);
                for nudge in [0.0, 1e-7, -1e-7, 1e-5] {
                    origin[axis] = lattice as f32 + nudge;
                    direction[axis] = tilt;
                    let ray = Ray::new(origin, direction).with_range(-INFINITY, INFINITY);
                    rays += 1;
                    hit += usize::from(check("room", &mesh, &trees, &ray) > 0);
                }
            }
        }
    }
    assert!(10 * hit > 3 * rays, "{hit} of {rays}");
}

/// A scene so small that every product of two coordinates underflows in f32.
#[test]
fn subnormal_scenes_are_hit() {
    for scale in [1e-25, 1e-32, 1e-37] {
        let mesh = scenes::moved(&scenes::cube(2), |p| p * scale);
        let trees = trees(&mesh);
        let ray = Ray::new(Vec3::new(0.1, 0.2, -3.0) * scale, [0.0, 0.0, 1.0]);
        assert!(check("tiny", &mesh, &trees, &ray) > 0, "scale {scale}");
        let ray = Ray::new(
            Vec3::new(0.1, 0.2, -3.0) * scale,
            Vec3::new(0.01, 0.01, 1.0) * scale,
        );
        assert!(check("tiny", &mesh, &trees, &ray) > 0, "scale {scale}");
    }
}

#[test]
fn scenes_at_the_end_of_f32_agree() {
    for scale in [1e18, 1e19, 1e20, 1e37, 3e38] {
        let mesh = scenes::moved(&scenes::cube(2), |p| p * scale);
        let trees = trees(&mesh);
        let mut some = 0;
        for direction in [
            [0.0, 0.0, 1.0],
            [0.1, 0.2, 1.0],
            [1e-30, -1e-19, 1.0],
            [1e30, 1e29, 1e30],
        ] {
            let ray = Ray::new(Vec3::new(0.1, 0.2, -0.3) * scale, direction);
            some += check("huge", &mesh, &trees, &ray);
        }
        assert!(some > 0, "scale {scale}");
    }
}

#[test]
fn hits_clears_and_counts() {
    let mesh = scenes::cube(2);
    let tree = &trees(&mesh)[0];
    let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
    let mut out = Vec::new();
    hits(tree, &mesh, &ray, 9, &mut out);
    assert_eq!(out.len(), 2, "in and out");
    hits(tree, &mesh, &ray, 0, &mut out);
    assert!(out.is_empty(), "none were asked for");
    hits(tree, &mesh, &ray, 1, &mut out);
    assert_eq!(
        out,
        intersect(tree, &mesh, &ray).as_slice(),
        "the closest one"
    );
    hits(tree, &mesh, &ray.with_mask(0), 9, &mut out);
    assert!(out.is_empty(), "what was there before is gone");
    assert!(!occluded(tree, &mesh, &ray.with_mask(0)), "no mask");
}

#[test]
fn counting_changes_nothing_and_the_tree_helps() {
    let mesh = scenes::sphere(2);
    let tree = &trees(&mesh)[0];
    let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
    let (hit, counts) = intersect_counted(tree, &mesh, &ray);
    assert_eq!(hit, intersect(tree, &mesh, &ray), "the same hit");
    assert!(hit.is_some(), "it points at the sphere");
    assert!(counts.nodes > 0 && counts.leaves > 0, "{counts:?}");
    assert!(
        counts.decisions >= 1 && counts.decisions <= counts.triangles,
        "{counts:?}"
    );
    assert!(counts.triangles < 40, "a few of 320: {counts:?}");
    let (_, none) = intersect_counted(tree, &mesh, &Ray::new([3.0; 3], [0.0, 0.0, 1.0]));
    assert_eq!(none, kd_trace::TraversalCounts::default(), "beside the box");
}

/// Rounding corners to 26 bits lets a ray that passes an edge at 1.4e-8 hit. Two planes cut out a cell around the ray
/// that the triangle does not reach into, so that only their pads find it.
#[test]
fn a_hit_beside_its_triangle_is_found() {
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| {
            let mut p = Vec3::ZERO;
            p[axis] = x;
            p[(axis + 1) % 3] = y;
            p[(axis + 2) % 3] = z;
            p
        };
        let mut soup = Soup::default();
        // One edge runs through the origin.
        soup.triangle([
            turned(-1.1, -0.75, 0.0),
            turned(1.1, 0.75, 0.0),
            turned(-1.1, 0.75, 0.0),
        ]);
        let mesh = soup.mesh();
        let interior = |axis: usize, split, first| {
            Node::interior(Axis::ALL[axis % 3], split, NodeIndex(first)).expect("small")
        };
        let leaf = |first| Node::leaf(first, 1).expect("small");
        let pairs = vec![
            Pair([interior(axis, 9e-9, 2), Node::EMPTY_LEAF]),
            Pair([leaf(0), interior(axis + 1, 5e-9, 4)]),
            Pair([Node::EMPTY_LEAF, leaf(1)]),
        ];
        let refs = vec![Slot(0); 2];
        let tree = Tree::from_parts(pairs, refs, mesh.bounds(), 1, CostModel::CLASSIC);
        let tree = Subject::new(&mesh, tree.expect("valid"));
        assert_eq!(tree.check_coverage(&mesh), Ok(()), "nothing is missing");
        for sign in [1.0, -1.0] {
            let ray = Ray::new(turned(1.4e-8, 0.0, -3.0 * sign), turned(0.0, 0.0, sign));
            assert_eq!(check("beside", &mesh, [&tree], &ray), 1, "{}", source(&ray));
        }
    }
}

/// With one leaf, each triangle is looked at; only about those that a ray's line meets are not rejected early.
#[test]
fn the_filter_is_worth_having() {
    let mesh = scenes::soup();
    let slots: Vec<Slot> = (0..250).map(Slot).collect();
    let leaf = Pair([Node::leaf(0, 250).expect("small"), Node::EMPTY_LEAF]);
    let tree = Tree::from_parts(vec![leaf], slots, mesh.bounds(), 250, CostModel::CLASSIC);
    let tree = Subject::new(&mesh, tree.expect("valid"));
    let mut rng = Rng(15);
    let (mut hit, mut decided) = (0, 0);
    for _ in 0..1000 {
        let ray = Ray::new(rng.vec3(), rng.direction()).with_range(-INFINITY, INFINITY);
        hit += check("one leaf", &mesh, [&tree], &ray);
        let (_, counts) = intersect_counted(&tree, &mesh, &ray);
        assert_eq!(
            (counts.leaves, counts.triangles),
            (1, 250),
            "{}",
            source(&ray)
        );
        decided += counts.decisions as usize;
    }
    assert!(hit > 500, "{hit} hits");
    assert!(decided < hit + hit / 100, "{decided} decided, {hit} hit");
}
