//! Trees over primitives of any kind against asking every primitive in turn.

#[path = "../examples/shapes/curve.rs"]
mod curve;
#[path = "../examples/shapes/sphere.rs"]
mod sphere;

use std::ops::ControlFlow;

use curve::{Curve, Curves};
use kd::custom::{PrimitiveHit, PrimitiveTree, Primitives};
use kd::glam::{Vec3, Vec4};
use kd::layout::Level;
use kd::{Aabb, BuildError, BuildOptions, Culling, Hit, Layout, Mesh, Method, Ray, RayQuery};
use kd_oracle::rays::{Rays, that_cannot_hit};
use kd_oracle::rng::Rng;
use kd_oracle::{check_batch, check_ray, source};
use sphere::{Sphere, Spheres};

/// All hits in order, of asking every primitive.
fn brute_force(primitives: &impl Primitives, ray: &Ray) -> Vec<Hit> {
    if !ray.can_hit() {
        return Vec::new();
    }
    let hit_of = |triangle: u32| {
        let PrimitiveHit { t, u, v } = primitives.intersect(triangle, ray)?;
        Some(Hit { t, u, v, triangle })
    };
    let mut hits: Vec<Hit> = (0..primitives.count()).filter_map(hit_of).collect();
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
    hits
}

/// Both layouts, and both levels of the wide one.
fn trees<P: Primitives>(primitives: &P) -> [PrimitiveTree<&P>; 4] {
    let balanced = BuildOptions::balanced();
    let binary = balanced.clone().with_layout(Layout::Binary);
    let median = binary.clone().with_method(Method::Median);
    let build = |options| PrimitiveTree::build(primitives, options).expect("valid");
    [
        build(&balanced),
        build(&balanced).with_level(Level::portable()),
        build(&binary),
        build(&median.with_threads(1)),
    ]
}

/// A mesh to aim rays at.
fn mesh_of(corners: impl Iterator<Item = [Vec3; 3]>) -> Mesh {
    let positions: Vec<[f32; 3]> = corners.flatten().map(|point| point.to_array()).collect();
    let triangles = (0..u32::try_from(positions.len()).expect("few"))
        .step_by(3)
        .map(|first| [first, first + 1, first + 2])
        .collect();
    Mesh::new(positions, triangles).expect("finite")
}

/// A triangle in each sphere.
fn in_spheres(Spheres(spheres): &Spheres) -> Mesh {
    mesh_of(spheres.iter().map(|Sphere { center, radius }| {
        let offsets = [Vec3::X, Vec3::Y, Vec3::new(-0.5, -0.5, 0.5)];
        offsets.map(|offset| *center + 0.9 * *radius * offset)
    }))
}

/// A triangle along each curve.
fn along_curves(Curves(curves): &Curves) -> Mesh {
    let corners = |curve: &Curve| [0.0, 0.4, 1.0].map(|u| curve.at(u).truncate());
    mesh_of(curves.iter().map(corners))
}

/// A triangle in each box.
fn in_boxes(primitives: &impl Primitives) -> Mesh {
    let boxes = (0..primitives.count()).map(|primitive| primitives.bounds(primitive));
    mesh_of(boxes.map(|Aabb { min, max }| [min, min.with_y(max.y), max]))
}

/// Compares every query of many rays with brute force. Returns the number of hits.
fn check(name: &str, primitives: &impl Primitives, targets: &Mesh, rays: usize) -> usize {
    let mut rays_of = Rays::new(targets, Vec::new(), 1);
    let rays: Vec<Ray> = (0..rays).map(|_| rays_of.draw()).collect();
    let expected: Vec<Vec<Hit>> = rays
        .iter()
        .map(|ray| brute_force(primitives, ray))
        .collect();
    for (number, tree) in trees(primitives).iter().enumerate() {
        let name = format!("{name}, tree {number}");
        for (ray, expected) in rays.iter().zip(&expected) {
            check_ray(&name, tree, ray, expected);
        }
        check_batch(&name, tree, &rays, &expected);
    }
    expected.iter().map(Vec::len).sum()
}

/// Spheres of many sizes, some in one place, some points.
fn spheres(count: usize, seed: u64) -> Spheres {
    let mut rng = Rng(seed);
    let mut all: Vec<Sphere> = Vec::new();
    for _ in 0..count {
        let sphere = if rng.chance(0.1) && !all.is_empty() {
            rng.pick(&all)
        } else {
            Sphere {
                center: rng.vec3(),
                radius: rng.pick(&[0.0, 1e-3, 0.03, 0.1, 0.4]) * rng.unit(),
            }
        };
        all.push(sphere);
    }
    Spheres(all)
}

fn curves(count: usize, seed: u64) -> Curves {
    let mut rng = Rng(seed);
    let curve = |_| {
        let root = rng.vec3();
        let radius = rng.pick(&[0.0, 0.004, 0.06]);
        Curve([0, 1, 2, 3].map(|_| -> Vec4 {
            let point = root + 0.3 * rng.vec3();
            point.extend(radius * rng.unit())
        }))
    };
    Curves((0..count).map(curve).collect())
}

#[test]
fn spheres_answer_as_brute_force() {
    for count in [1, 7, 9, 400] {
        let spheres = spheres(count, 3);
        let hits = check("spheres", &spheres, &in_spheres(&spheres), 300);
        assert!(hits >= 150, "{hits} hits with {count} spheres");
    }
}

#[test]
fn curves_answer_as_brute_force() {
    let curves = curves(60, 4);
    let hits = check("curves", &curves, &along_curves(&curves), 400);
    assert!(hits > 100, "{hits} hits");
}

#[test]
fn hits_of_curves_are_on_their_surface() {
    let curves = curves(200, 5);
    let tree = PrimitiveTree::build(&curves, &BuildOptions::fast()).expect("valid");
    let mut rng = Rng(5);
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = Ray::new(3.0 * rng.direction(), rng.vec3());
        let ray = Ray::new(ray.origin, ray.direction - ray.origin);
        let Some(hit) = tree.intersect(&ray) else {
            continue;
        };
        let sphere = curves.0[hit.triangle as usize].at(hit.u);
        let distance = sphere.truncate().distance(hit.point(&ray));
        // Round cones in place of a curve, and of two spheres one that is not exactly across from the point.
        assert!(
            (distance - sphere.w).abs() < 0.006,
            "{distance} from a sphere of radius {}: {}",
            sphere.w,
            source(&ray)
        );
        hits += 1;
    }
    assert!(hits > 100, "{hits} hits");
}

#[test]
fn spheres_anywhere_and_of_any_size() {
    let scales = [1e-20_f32, 1e-6, 1e6, 1e15];
    for (scale, away) in scales
        .map(|scale| (scale, 0.0))
        .into_iter()
        .chain([(1.0, 1e6)])
    {
        let moved = spheres(100, 5).0.into_iter().map(|sphere| Sphere {
            center: scale * sphere.center + away,
            radius: scale * sphere.radius,
        });
        let spheres = Spheres(moved.collect());
        let name = format!("spheres times {scale}, at {away}");
        let hits = check(&name, &spheres, &in_spheres(&spheres), 200);
        assert!(hits > 50, "{name}: {hits} hits");
    }
}

#[test]
fn each_sphere_is_hit_once_where_the_ray_enters_it() {
    let row = (0..5_u8).map(|i| Sphere {
        center: Vec3::new(f32::from(i), 0.0, 0.0),
        radius: 0.75,
    });
    let spheres = Spheres(row.collect());
    let ray = Ray::new([-9.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
    for tree in trees(&spheres) {
        let mut hits = Vec::new();
        tree.hits(&ray, usize::MAX, &mut hits);
        let depths: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
        assert_eq!(depths, [8.25, 9.25, 10.25, 11.25, 12.25], "where it enters");
        // Spheres overlap: behind the second hit, the first sphere is left.
        let second = hits[1];
        tree.hits_behind(&ray, &second, usize::MAX, &mut hits);
        assert_eq!(hits.len(), 3, "no sphere again");
        let inside = ray.with_range(8.5, f32::INFINITY);
        let hit = tree.intersect(&inside).expect("inside of the first");
        assert_eq!((hit.triangle, hit.t), (1, 9.25), "the next one");
        let culled = tree.intersect(&ray.with_culling(Culling::BACK));
        assert_eq!(culled.map(|hit| hit.t), Some(8.25), "as the sphere decides");
    }
}

#[test]
fn rays_that_cannot_hit_ask_nothing() {
    struct Asked;

    impl Primitives for Asked {
        fn count(&self) -> u32 {
            3
        }

        fn bounds(&self, _: u32) -> Aabb {
            Aabb::around([Vec3::splat(-9.0), Vec3::splat(9.0)])
        }

        fn intersect(&self, _: u32, ray: &Ray) -> Option<PrimitiveHit> {
            panic!("asked for {}", source(ray));
        }
    }

    for tree in trees(&Asked) {
        for ray in that_cannot_hit() {
            assert_eq!(tree.intersect(&ray), None, "{}", source(&ray));
        }
    }
}

/// Spheres with other boxes.
struct OtherBoxes<F>(Spheres, F);

impl<F: Fn(u32, Aabb) -> Aabb + Sync> Primitives for OtherBoxes<F> {
    fn count(&self) -> u32 {
        self.0.count()
    }

    fn bounds(&self, sphere: u32) -> Aabb {
        (self.1)(sphere, self.0.bounds(sphere))
    }

    fn intersect(&self, sphere: u32, ray: &Ray) -> Option<PrimitiveHit> {
        self.0.intersect(sphere, ray)
    }
}

#[test]
fn boxes_may_be_too_large() {
    let mut rng = Rng(6);
    let more: Vec<Vec3> = (0..100).map(|_| 2.0 * rng.vec3().abs()).collect();
    let larger = OtherBoxes(spheres(100, 6), |sphere, bounds: Aabb| Aabb {
        min: bounds.min - more[sphere as usize],
        max: bounds.max + more[sphere as usize],
    });
    let hits = check("large boxes", &larger, &in_spheres(&larger.0), 300);
    assert!(hits > 150, "{hits} hits");
}

#[test]
fn boxes_that_are_too_small_lose_hits_and_invent_none() {
    let smaller = OtherBoxes(spheres(200, 7), |_, bounds: Aabb| {
        let (center, extent) = (bounds.center(), bounds.extent());
        Aabb {
            min: center - 0.2 * extent,
            max: center + 0.2 * extent,
        }
    });
    let targets = in_boxes(&smaller);
    let mut rays = Rays::new(&targets, Vec::new(), 2);
    let (mut found, mut all) = (0, 0);
    for _ in 0..300 {
        let ray = rays.draw();
        let expected = brute_force(&smaller, &ray);
        for tree in trees(&smaller) {
            let mut hits = Vec::new();
            tree.hits(&ray, usize::MAX, &mut hits);
            assert!(
                hits.iter().all(|hit| expected.contains(hit)),
                "only hits: {}",
                source(&ray)
            );
            let closest = tree.intersect(&ray);
            assert!(
                closest.is_none_or(|hit| expected.contains(&hit)),
                "a hit: {}",
                source(&ray)
            );
            found += hits.len();
            all += expected.len();
        }
    }
    assert!(found > 0 && found < all, "{found} of {all}");
}

#[test]
fn empty_boxes_are_never_hit() {
    let some = OtherBoxes(spheres(100, 8), |sphere, bounds: Aabb| match sphere % 3 {
        0 => Aabb::EMPTY,
        1 => bounds,
        _ => Aabb {
            min: bounds.max + 1.0,
            max: bounds.min,
        },
    });
    let ray = Ray::new([-3.0, 0.1, 0.1], [1.0, 0.0, 0.0]);
    let mut expected = brute_force(&some, &ray);
    expected.retain(|hit| hit.triangle % 3 == 1);
    assert!(!expected.is_empty(), "some are hit");
    for tree in trees(&some) {
        check_ray("some empty", &tree, &ray, &expected);
    }
    for count in [0, 5] {
        let none = OtherBoxes(spheres(count, 8), |_, _| Aabb::EMPTY);
        for tree in trees(&none) {
            check_ray("all empty", &tree, &ray, &[]);
        }
    }
}

#[test]
fn boxes_that_are_not_finite_are_refused_by_number() {
    let bad = [
        Aabb {
            min: Vec3::NAN,
            max: Vec3::ONE,
        },
        Aabb {
            min: Vec3::ZERO,
            max: Vec3::new(1.0, f32::NAN, 1.0),
        },
        Aabb {
            min: Vec3::new(5.0, f32::NAN, 0.0),
            max: Vec3::ONE,
        },
        Aabb {
            min: Vec3::ZERO,
            max: Vec3::INFINITY,
        },
    ];
    for bad in bad {
        let some = OtherBoxes(
            spheres(9, 9),
            |sphere, bounds| {
                if sphere >= 5 { bad } else { bounds }
            },
        );
        for layout in [Layout::Wide, Layout::Binary] {
            let options = BuildOptions::fast().with_layout(layout);
            let refused = PrimitiveTree::build(&some, &options).map(|_| ());
            let expected = BuildError::NotFinite { primitive: 5 };
            assert_eq!(refused, Err(expected), "{bad:?}, {layout:?}");
        }
    }
}

/// Primitives whose answers are noise.
struct Noise {
    count: u32,
}

impl Noise {
    fn rng(primitive: u32, ray: &Ray) -> Rng {
        let bits = words_of(ray).into_iter().map(u64::from);
        Rng(bits.fold(u64::from(primitive), |seed, word| {
            (seed ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        }))
    }
}

/// All that a primitive knows of a ray.
fn words_of(ray: &Ray) -> [u32; 8] {
    let [x, y, z] = ray.origin.to_array();
    let [u, v, w] = ray.direction.to_array();
    [x, y, z, u, v, w, ray.t_min, ray.t_max].map(f32::to_bits)
}

impl Primitives for Noise {
    fn count(&self) -> u32 {
        self.count
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        let mut rng = Rng(u64::from(primitive));
        let center = rng.vec3();
        Aabb::around([center, center + 0.5 * rng.vec3()])
    }

    fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb> {
        let mut rng = Rng(u64::from(primitive) ^ u64::from(cell.min.x.to_bits()));
        match rng.below(5) {
            0 => None,
            1 => Some(Aabb {
                min: Vec3::NAN,
                max: rng.vec3(),
            }),
            2 => Some(Aabb {
                min: Vec3::NEG_INFINITY,
                max: Vec3::INFINITY,
            }),
            3 => Some(Aabb::around([9.0 * rng.vec3(), 9.0 * rng.vec3()])),
            _ => Some(Aabb::EMPTY),
        }
    }

    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<PrimitiveHit> {
        let mut rng = Self::rng(primitive, ray);
        let t = match rng.below(8) {
            0 => return None,
            1 => f32::NAN,
            2 => f32::INFINITY,
            3 => f32::NEG_INFINITY,
            4 => ray.t_max,
            5 => ray.t_min.next_down(),
            _ => rng.between(-1.0, 3.0),
        };
        let u = rng.pick(&[0.5, f32::NAN, f32::INFINITY]);
        Some(PrimitiveHit { t, u, v: u })
    }
}

#[test]
fn noise_never_panics_and_stays_in_range() {
    let noise = Noise { count: 300 };
    let targets = in_boxes(&noise);
    let mut rays = Rays::new(&targets, Vec::new(), 3);
    let mut found = 0;
    for tree in trees(&noise) {
        let mut hits = Vec::new();
        for _ in 0..300 {
            let ray = rays.draw();
            tree.hits(&ray, usize::MAX, &mut hits);
            hits.extend(tree.intersect(&ray));
            found += hits.len();
            for hit in &hits {
                let is_in_range = ray.t_min <= hit.t && hit.t <= ray.t_max && hit.t.is_finite();
                assert!(is_in_range, "{hit:?}: {}", source(&ray));
                assert!(hit.triangle < 300, "a primitive: {hit:?}");
            }
            tree.occluded(&ray);
            let last = Hit {
                t: 0.5,
                u: 0.0,
                v: 0.0,
                triangle: 7,
            };
            tree.hits_behind(&ray, &last, 3, &mut hits);
            assert!(hits.iter().all(|hit| last.is_before(hit)), "behind");
            let taken = tree.each_hit(&ray).take(1000).count();
            assert!(taken <= 1000, "it is finite");
        }
    }
    assert!(found > 1000, "{found} hits");
}

#[test]
fn threads_do_not_show() {
    let spheres = spheres(20_000, 10);
    let mut rng = Rng(11);
    for layout in [Layout::Wide, Layout::Binary] {
        let options = BuildOptions::fast().with_layout(layout);
        let [one, many] = [1, 3].map(|threads| {
            let options = options.clone().with_threads(threads);
            PrimitiveTree::build(&spheres, &options).expect("valid")
        });
        assert_eq!(one.bytes(), many.bytes(), "{layout:?}");
        assert_eq!(format!("{one:?}"), format!("{many:?}"), "{layout:?}");
        for _ in 0..100 {
            let ray = Ray::new(rng.vec3(), rng.direction());
            assert_eq!(one.intersect(&ray), many.intersect(&ray), "{layout:?}");
        }
    }
}

#[test]
fn builds_can_be_cancelled() {
    let spheres = spheres(1000, 12);
    for layout in [Layout::Wide, Layout::Binary] {
        let options = BuildOptions::fast().with_layout(layout);
        let stopped =
            PrimitiveTree::build_with_progress(&spheres, &options, &|_| ControlFlow::Break(()));
        assert_eq!(
            stopped.map(|_| ()),
            Err(BuildError::Cancelled),
            "{layout:?}"
        );
        let built =
            PrimitiveTree::build_with_progress(&spheres, &options, &|_| ControlFlow::Continue(()));
        assert!(built.is_ok(), "{layout:?}");
    }
}

#[test]
fn too_many_primitives_and_bad_options_are_refused() {
    let noise = Noise { count: u32::MAX };
    for layout in [Layout::Wide, Layout::Binary] {
        let options = BuildOptions::fast().with_layout(layout);
        let refused = PrimitiveTree::build(&noise, &options).map(|_| ());
        let primitives = u32::MAX;
        let expected = BuildError::TooManyPrimitives { primitives };
        assert_eq!(refused, Err(expected), "{layout:?}");
        let bad = options.with_max_depth(1000);
        let refused = PrimitiveTree::build(&Noise { count: 3 }, &bad).map(|_| ());
        let is_named = matches!(refused, Err(BuildError::InvalidOption { .. }));
        assert!(is_named, "{refused:?}");
    }
}
