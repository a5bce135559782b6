//! Filters, lists of hits and culling: what the comparison with brute force in `oracle.rs` does not ask.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};

use kd::glam::Vec3;
use kd::{BuildOptions, Culling, Hit, KdTree, Layout, Mesh, Ray, Verdict};
use kd_oracle::{effort, scenes};
use kd_scene::Spd;

const LAYOUTS: [Layout; 2] = [Layout::Wide, Layout::Binary];

fn tree_of(mesh: Mesh, layout: Layout) -> KdTree {
    let options = BuildOptions::fast().with_layout(layout);
    KdTree::build(mesh, &options).expect("a tree")
}

/// As many equal triangles.
fn coincident(count: u32) -> Mesh {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = (0..count).map(|_| [0, 1, 2]).collect();
    Mesh::new(corners, triangles).expect("valid")
}

/// A ray through them.
fn through() -> Ray {
    Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])
}

#[test]
fn a_filter_that_panics_leaves_the_tree_usable() {
    for layout in LAYOUTS {
        let tree = tree_of(coincident(100), layout);
        let rays = vec![through(); 10_000];
        let expected = tree.intersect(&rays[0]);
        let mut hits = vec![None; rays.len()];
        let panics = |number: usize, hit: &Hit| {
            assert!(number < 5000 || hit.triangle < 40, "as planned");
            Verdict::Reject
        };
        let result = catch_unwind(AssertUnwindSafe(|| {
            tree.intersect_filtered_batch(&rays, &mut hits, panics);
        }));
        assert!(result.is_err(), "the panic is passed on");
        let result = catch_unwind(AssertUnwindSafe(|| {
            tree.par_intersect_filtered_batch(&rays, &mut hits, panics);
        }));
        assert!(result.is_err(), "from other threads too");
        let result = catch_unwind(|| tree.intersect_filtered(&rays[0], |hit| panics(5000, hit)));
        assert!(result.is_err(), "and of a single ray");
        assert_eq!(tree.intersect(&rays[0]), expected, "{layout:?}: afterwards");
        tree.intersect_batch(&rays, &mut hits);
        assert!(
            hits.iter().all(|hit| *hit == expected),
            "{layout:?}: batches"
        );
    }
}

#[test]
fn a_filter_may_use_the_tree() {
    for layout in LAYOUTS {
        let tree = tree_of(scenes::sphere(2), layout);
        let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
        let mut inner = Vec::new();
        let accepted = tree.intersect_filtered(&ray, |hit| {
            // Only what is the last hit of the same ray.
            tree.hits(
                &ray.with_range(hit.t.next_up(), f32::INFINITY),
                1,
                &mut inner,
            );
            let mut batch = [None; 64];
            tree.intersect_batch(&[ray; 64], &mut batch);
            assert!(batch[63].is_some(), "a batch within a filter");
            if inner.is_empty() {
                Verdict::Accept
            } else {
                Verdict::Reject
            }
        });
        let mut all = Vec::new();
        tree.hits(&ray, usize::MAX, &mut all);
        assert_eq!(
            accepted.map(|hit| hit.t),
            all.last().map(|hit| hit.t),
            "{layout:?}"
        );
    }
}

#[test]
fn the_number_of_hits_may_be_any() {
    for layout in LAYOUTS {
        let tree = tree_of(coincident(3000), layout);
        let ray = through();
        let mut out = vec![tree.intersect(&ray).expect("a hit")];
        let mut calls = 0;
        tree.hits_filtered(&ray, 0, &mut out, |_| {
            calls += 1;
            Verdict::Accept
        });
        assert_eq!((out.len(), calls), (0, 0), "none is asked for");
        let lists = tree.hits_batch(&[ray; 3], 0);
        assert_eq!(lists.offsets(), [0; 4], "no hits, but a list for each ray");
        let lists = tree.hits_batch(&[ray; 3], usize::MAX);
        assert_eq!(lists.offsets(), [0, 3000, 6000, 9000]);
        tree.hits_filtered(&ray, usize::MAX, &mut out, |hit| {
            if hit.triangle % 3 == 0 {
                Verdict::Accept
            } else {
                Verdict::Reject
            }
        });
        let thirds: Vec<u32> = out.iter().map(|hit| hit.triangle).collect();
        assert_eq!(
            thirds,
            (0..3000).step_by(3).collect::<Vec<u32>>(),
            "{layout:?}"
        );
        let last = tree.each_hit(&ray).last().expect("a hit");
        assert_eq!(last.triangle, 2999, "one after another");
        assert_eq!(tree.hits_batch(&[], 5).len(), 0, "no rays");
        assert!(
            tree.par_hits_filtered_batch(&[], 5, |_, _| Verdict::Stop)
                .is_empty(),
            "no rays"
        );
        let mut behind = Vec::new();
        for (t, count) in [
            (f32::NAN, 0),
            (f32::INFINITY, 0),
            (f32::NEG_INFINITY, 3000),
            (-5.0, 3000),
        ] {
            tree.hits_behind(&ray, &Hit { t, ..last }, usize::MAX, &mut behind);
            assert_eq!(behind.len(), count, "{layout:?}, behind {t}");
        }
    }
}

/// The lists hold what is asked for, however many triangles there are.
#[test]
fn many_rays_through_coincident_triangles_take_bounded_memory() {
    const RAYS: usize = effort::count(20_000, 1_000_000);
    for (rays, triangles) in [(RAYS, 1000), (8, 1_000_000)] {
        let tree = tree_of(coincident(triangles), Layout::Wide);
        let lists = tree.par_hits_batch(&vec![through(); rays], 8);
        assert_eq!(lists.len(), rays);
        for hits in lists.iter() {
            assert!(
                hits.iter().map(|hit| hit.triangle).eq(0..8),
                "the first eight"
            );
        }
        let (offsets, hits) = lists.into_parts();
        assert!(
            hits.capacity() <= 16 * rays + 16,
            "{} hits of room",
            hits.capacity()
        );
        assert!(
            offsets.capacity() <= 2 * rays + 2,
            "{} lists of room",
            offsets.capacity()
        );
    }
}

/// A filter gets only the hits that are needed, and those of the part of the ray.
#[test]
fn filters_are_called_no_more_than_needed() {
    let tree = tree_of(coincident(1000), Layout::Wide);
    let mut calls = 0;
    let hit = tree.intersect_filtered(&through(), |hit| {
        calls += 1;
        if hit.triangle == 700 {
            Verdict::Accept
        } else {
            Verdict::Reject
        }
    });
    assert_eq!((hit.map(|hit| hit.triangle), calls), (Some(700), 701));
    let counted = AtomicUsize::new(0);
    let is_hit = tree.occluded_filtered(&through().with_range(0.0, 0.5), |_| {
        counted.fetch_add(1, Ordering::Relaxed);
        Verdict::Accept
    });
    assert!(!is_hit && counted.into_inner() == 0, "nothing is in range");
}

/// The front is where the normal points to.
#[test]
fn culled_sides_are_those_of_normals() {
    let meshes = [
        ("sphere", scenes::sphere(3)),
        ("room", scenes::room()),
        ("teapot", Spd::Teapot.generate(3).expect("small").mesh),
    ];
    for (name, mesh) in meshes {
        for layout in LAYOUTS {
            let tree = tree_of(mesh.clone(), layout);
            let mut rays = kd_oracle::rays::Rays::new(&mesh, Vec::new(), 5);
            let mut counts = [0; 2];
            let mut hits = Vec::new();
            for _ in 0..2000 {
                let ray = rays.draw();
                for (culling, is_front) in [(Culling::BACK, true), (Culling::FRONT, false)] {
                    tree.hits(&ray.with_culling(culling), usize::MAX, &mut hits);
                    for hit in &hits {
                        let normal = mesh.normal(hit.triangle).as_dvec3();
                        let cosine = normal.dot(ray.direction.as_dvec3().normalize());
                        // Where it is nearly edge-on, the rounding of corners may turn a triangle.
                        let is_clear = cosine.abs() > 1e-5;
                        assert!(
                            !is_clear || (cosine < 0.0) == is_front,
                            "{name}, {layout:?}: {ray:?}, {hit:?}"
                        );
                        counts[usize::from(is_front)] += usize::from(is_clear);
                    }
                }
            }
            assert!(
                counts.iter().all(|count| *count > 300),
                "{name}: {counts:?}"
            );
        }
    }
}

/// A convex mesh around the origin, with all fronts outside.
fn outwards(mesh: &Mesh) -> Mesh {
    let triangles = (0..).zip(mesh.triangles()).map(|(number, [a, b, c])| {
        let outwards = mesh.corners(number)[0].dot(mesh.normal(number)) > 0.0;
        if outwards { [*a, *b, *c] } else { [*a, *c, *b] }
    });
    Mesh::new(mesh.positions().to_vec(), triangles.collect()).expect("valid")
}

/// Rays from inside of a convex closed mesh meet the back of it, and never the front: neighbors agree about sides at edges and
/// corners.
#[test]
fn closed_meshes_are_closed_on_each_side() {
    for mesh in [scenes::sphere(2), scenes::cube(3)] {
        let mesh = outwards(&mesh);
        let tree = tree_of(mesh.clone(), Layout::Wide);
        let from = [0.01, 0.02, -0.03];
        for triangle in 0..u32::try_from(mesh.len()).expect("few") {
            let corners = mesh.corners(triangle);
            let middle = (corners[0] + corners[1]) * 0.5;
            for target in [corners[0], corners[1], corners[2], middle] {
                let ray = Ray::new(from, target - Vec3::from(from));
                assert!(
                    tree.occluded(&ray.with_culling(Culling::FRONT)),
                    "{ray:?}: closed"
                );
                let other = ray.with_culling(Culling::BACK);
                assert!(!tree.occluded(&other), "{ray:?}: no other side");
            }
        }
    }
}
