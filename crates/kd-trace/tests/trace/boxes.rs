//! Wide nodes over boxes: every item that a ray may meet is visited.

use std::ops::ControlFlow;

use glam::Vec3;
use kd_core::{Aabb, Culling, Mesh, Ray};
use kd_oracle::rays::{Rays, that_cannot_hit};
use kd_trace::Level;
use kd_trace::kit::{Frame, VisitItem, WideBoxes, walk_boxes};

use super::rng::Rng;
use super::scenes;
use crate::check::source;

/// The boxes of the triangles of a mesh, and empty ones among them.
fn boxes_of(mesh: &Mesh) -> Vec<Aabb> {
    let mut boxes = Vec::new();
    for triangle in 0..u32::try_from(mesh.len()).expect("few") {
        if triangle % 7 == 3 {
            boxes.push(Aabb::EMPTY);
        }
        boxes.push(Aabb::around(mesh.corners(triangle)));
    }
    boxes
}

fn at_all_levels(boxes: &[Aabb]) -> [WideBoxes; 2] {
    let tree = WideBoxes::new(boxes, true, None).expect("nothing cancels it");
    let portable = tree.clone().with_level(Level::portable());
    [tree, portable]
}

/// Where a ray enters a box that is widened by what `walk_boxes` promises; `None` if it misses the box in its range.
fn enter(ray: &Ray, frame: &Frame, bounds: &Aabb) -> Option<f64> {
    let (mut enter, mut exit) = (f64::from(ray.t_min), f64::from(ray.t_max.min(f32::MAX)));
    if !ray.can_hit() || bounds.is_empty() {
        return None;
    }
    for axis in 0..3 {
        let origin = f64::from(ray.origin[axis]);
        let farthest = frame
            .corners
            .map(|corner| (f64::from(corner[axis]) - origin).abs());
        let beside = 0.999 / f64::from(1 << 21) * farthest[0].max(farthest[1]);
        let faces = [
            f64::from(bounds.min[axis]) - beside - origin,
            f64::from(bounds.max[axis]) + beside - origin,
        ];
        let direction = f64::from(ray.direction[axis]);
        if direction == 0.0 {
            if faces[0] > 0.0 || faces[1] < 0.0 {
                return None;
            }
            continue;
        }
        let [a, b] = faces.map(|face| face / direction);
        enter = enter.max(a.min(b));
        exit = exit.min(a.max(b));
    }
    (enter <= exit).then_some(enter)
}

/// The items visited.
#[derive(Default)]
struct Visited(Vec<u32>);

impl VisitItem for Visited {
    fn limit(&self) -> f32 {
        f32::INFINITY
    }

    fn visit(&mut self, item: u32) -> ControlFlow<()> {
        self.0.push(item);
        ControlFlow::Continue(())
    }
}

/// The items visited while looking for the box that is entered first.
struct Nearest<'a> {
    ray: &'a Ray,
    frame: &'a Frame,
    boxes: &'a [Aabb],
    limit: f32,
    visited: Vec<u32>,
}

impl VisitItem for Nearest<'_> {
    fn limit(&self) -> f32 {
        self.limit
    }

    fn visit(&mut self, item: u32) -> ControlFlow<()> {
        self.visited.push(item);
        if let Some(enter) = enter(self.ray, self.frame, &self.boxes[item as usize]) {
            #[allow(clippy::cast_possible_truncation, reason = "rounded up")]
            let enter = (enter as f32).next_up();
            self.limit = self.limit.min(enter);
        }
        ControlFlow::Continue(())
    }
}

/// The first item visited.
#[derive(Default)]
struct First(Option<u32>);

impl VisitItem for First {
    const ANY: bool = true;

    fn limit(&self) -> f32 {
        f32::INFINITY
    }

    fn visit(&mut self, item: u32) -> ControlFlow<()> {
        assert!(self.0.is_none(), "nothing is visited after a break");
        self.0 = Some(item);
        ControlFlow::Break(())
    }
}

/// Compares what is visited with all boxes. Returns the numbers of items visited and of those that must be.
fn check(name: &str, tree: &WideBoxes, frame: &Frame, boxes: &[Aabb], ray: &Ray) -> [usize; 2] {
    let place = || format!("{name}, {}, {}", tree.level(), source(ray));
    let expected: Vec<(u32, f64)> = (0..)
        .zip(boxes)
        .filter_map(|(item, bounds)| Some((item, enter(ray, frame, bounds)?)))
        .collect();
    let mut visited = Visited::default();
    walk_boxes(tree, frame, ray, &mut visited);
    visited.0.sort_unstable();
    let count = visited.0.len();
    visited.0.dedup();
    assert_eq!(visited.0.len(), count, "each once: {}", place());
    for item in &visited.0 {
        assert!(!boxes[*item as usize].is_empty(), "empty: {}", place());
    }
    for (item, _) in &expected {
        let is_visited = visited.0.binary_search(item).is_ok();
        assert!(is_visited, "item {item}: {}", place());
    }
    let mut nearest = Nearest {
        ray,
        frame,
        boxes,
        limit: f32::INFINITY,
        visited: Vec::new(),
    };
    walk_boxes(tree, frame, ray, &mut nearest);
    for (item, enter) in &expected {
        let is_near = *enter <= f64::from(nearest.limit);
        assert!(
            !is_near || nearest.visited.contains(item),
            "item {item} before the limit: {}",
            place()
        );
    }
    let mut first = First::default();
    walk_boxes(tree, frame, ray, &mut first);
    assert_eq!(first.0.is_some(), count > 0, "any: {}", place());
    [count, expected.len()]
}

#[test]
fn every_item_in_reach_is_visited() {
    let scenes = scenes::all().into_iter().chain(scenes::extreme());
    for (name, mesh) in scenes {
        let boxes = boxes_of(&mesh);
        let mut rays = Rays::new(&mesh, Vec::new(), 1);
        let rays: Vec<Ray> = (0..400).map(|_| rays.draw()).collect();
        for tree in at_all_levels(&boxes) {
            for ray in &rays {
                check(name, &tree, tree.frame(), &boxes, ray);
            }
        }
    }
}

#[test]
fn few_items_are_visited_in_vain() {
    let mesh = scenes::sphere(4);
    let boxes = boxes_of(&mesh);
    let mut rng = Rng(3);
    for tree in at_all_levels(&boxes) {
        let (mut visited, mut needed) = (0, 0);
        for _ in 0..300 {
            let origin = 3.0 * rng.direction();
            let ray = Ray::new(origin, 0.5 * rng.vec3() - origin);
            let [of_ray, of_ray_needed] = check("sphere", &tree, tree.frame(), &boxes, &ray);
            visited += of_ray;
            needed += of_ray_needed;
        }
        assert!(
            needed > 100 && visited <= needed + needed / 50,
            "{visited} visited, {needed} needed"
        );
    }
}

#[test]
fn a_wider_frame_visits_what_is_farther_beside() {
    let mesh = scenes::sphere(3);
    let boxes = boxes_of(&mesh);
    let far = mesh.bounds().union(&Aabb::around([Vec3::splat(3000.0)]));
    let frame = Frame::new(&far);
    let mut rng = Rng(4);
    for tree in at_all_levels(&boxes) {
        let mut gained = 0;
        for _ in 0..500 {
            let ray = Ray::new(3.0 * rng.direction(), rng.direction());
            let [wide, _] = check("sphere", &tree, &frame, &boxes, &ray);
            let [own, _] = check("sphere", &tree, tree.frame(), &boxes, &ray);
            gained += usize::from(wide > own);
        }
        assert!(gained > 0, "some rays pass just beside a box");
    }
}

#[test]
fn flat_boxes_points_and_few_items() {
    let mut rng = Rng(5);
    for count in [0, 1, 2, 8, 9, 57, 300] {
        let boxes: Vec<Aabb> = (0..count)
            .map(|_| {
                let corner = rng.vec3();
                let mut extent = rng.vec3().abs();
                for axis in 0..3 {
                    if rng.chance(0.6) {
                        extent[axis] = 0.0;
                    }
                }
                Aabb {
                    min: corner,
                    max: corner + extent,
                }
            })
            .collect();
        for tree in at_all_levels(&boxes) {
            for _ in 0..200 {
                let target = boxes
                    .get(rng.below(count.max(1)))
                    .map_or(Vec3::ZERO, |bounds| bounds.min.lerp(bounds.max, rng.unit()));
                let origin = 2.0 * rng.vec3();
                let mut ray = Ray::new(origin, target - origin);
                if rng.chance(0.3) {
                    let axis = rng.below(3);
                    ray = Ray::new(origin, Vec3::AXES[axis]);
                    ray.origin[(axis + 1) % 3] = target[(axis + 1) % 3];
                    ray.origin[(axis + 2) % 3] = target[(axis + 2) % 3];
                }
                check("few", &tree, tree.frame(), &boxes, &ray);
            }
        }
    }
}

#[test]
fn many_items_in_one_place_are_all_visited() {
    let bounds = Aabb {
        min: Vec3::ONE,
        max: Vec3::splat(2.0),
    };
    let boxes = vec![bounds; 1000];
    for tree in at_all_levels(&boxes) {
        let ray = Ray::new([0.0; 3], [1.0; 3]);
        let [visited, _] = check("coincident", &tree, tree.frame(), &boxes, &ray);
        assert_eq!(visited, 1000, "all of them");
    }
}

#[test]
fn rays_that_cannot_hit_visit_nothing_and_culled_ones_everything() {
    let mesh = scenes::sphere(2);
    let boxes = boxes_of(&mesh);
    for tree in at_all_levels(&boxes) {
        for ray in that_cannot_hit() {
            let [visited, _] = check("sphere", &tree, tree.frame(), &boxes, &ray);
            assert_eq!(visited, 0, "{}", source(&ray));
        }
        let ray = Ray::new([0.0, 0.1, -3.0], [0.0, 0.0, 1.0]);
        let count = |culling: Culling| {
            let ray = ray.with_culling(culling);
            check("sphere", &tree, tree.frame(), &boxes, &ray)[0]
        };
        assert!(count(Culling::NONE) > 1, "some are met");
        assert_eq!(count(Culling::BACK), count(Culling::NONE), "back");
        assert_eq!(count(Culling::FRONT), count(Culling::NONE), "front");
        assert_eq!(count(Culling::BOTH), 0, "both");
    }
}
