//! Many points at once: neighbors one after the other, on one thread or on several.

use glam::Vec3;
use kd_core::Aabb;

use crate::closest::{Best, Candidate};
use crate::inside::{contains_with, signed};
use crate::nearest::Nearest;
use crate::order::along_a_curve;
use crate::tree::PointTree;
use crate::winding::WindingNumbers;
use crate::within::{triangles_in_box, triangles_in_sphere};

/// Points that are sorted together; bounds the memory of a batch.
const MOST_SORTED: usize = 1 << 20;
/// Points of a task.
const TASK: usize = 1 << 9;
/// Tasks whose answers are put in their places together, while they are in a cache.
const TASKS: usize = 1 << 7;

/// Lists of triangles, one after the other: of their numbers, or of parts with numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TriangleLists<T = u32> {
    /// Where each list starts in `triangles`, and where the last one ends.
    starts: Vec<usize>,
    triangles: Vec<T>,
}

impl<T> TriangleLists<T> {
    /// The number of lists.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there are no lists.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A list.
    ///
    /// # Panics
    ///
    /// If there is no such list.
    pub fn list(&self, number: usize) -> &[T] {
        &self.triangles[self.starts[number]..self.starts[number + 1]]
    }

    /// Where each list starts in [`triangles`](Self::triangles), and where the last one ends: one number more than lists.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// All lists, one after the other.
    pub fn triangles(&self) -> &[T] {
        &self.triangles
    }

    /// The same lists of other names of the triangles.
    pub fn map<U>(self, name: impl FnMut(T) -> U) -> TriangleLists<U> {
        TriangleLists {
            starts: self.starts,
            triangles: self.triangles.into_iter().map(name).collect(),
        }
    }
}

/// [`closest_point`](crate::closest_point) for each point; parallel on the threads of the pool in scope. The order of the points does not
/// matter: they are sorted along a curve, and each starts from the triangle of the one before.
///
/// # Panics
///
/// If the slices differ in length.
pub fn closest_point_batch(
    trees: &[PointTree<'_>],
    points: &[Vec3],
    max_distance: f32,
    out: &mut [Option<Nearest>],
    is_parallel: bool,
) {
    in_sorted_tasks(points, out, is_parallel, |points| {
        closest_of_neighbors(trees, points, max_distance)
    });
}

/// The closest points of neighbors.
fn closest_of_neighbors(
    trees: &[PointTree<'_>],
    points: &[Vec3],
    max_distance: f32,
) -> Vec<Option<Nearest>> {
    let mut last: Option<Candidate> = None;
    let one = |point: &Vec3| {
        let mut best = Best::new(*point, max_distance)?;
        if let Some(candidate) = last {
            best.take(candidate);
        }
        for &tree in trees {
            best.improve(tree);
        }
        last = best.triangle().or(last);
        best.nearest()
    };
    points.iter().map(one).collect()
}

/// [`contains`](crate::contains) for each point; parallel on the threads of the pool in scope.
///
/// # Panics
///
/// If the slices differ in length.
pub fn contains_batch(
    trees: &[PointTree<'_>],
    points: &[Vec3],
    out: &mut [bool],
    is_parallel: bool,
) {
    in_sorted_tasks(points, out, is_parallel, |points| {
        let mut crossed = Vec::new();
        let one = |point: &Vec3| contains_with(trees, *point, &mut crossed);
        points.iter().map(one).collect()
    });
}

/// [`signed_distance`](crate::signed_distance) for each point; parallel on the threads of the pool in scope.
///
/// # Panics
///
/// If the slices differ in length.
pub fn signed_distance_batch(
    trees: &[PointTree<'_>],
    points: &[Vec3],
    out: &mut [Option<f32>],
    is_parallel: bool,
) {
    in_sorted_tasks(points, out, is_parallel, |points| {
        let mut crossed = Vec::new();
        let nearest = closest_of_neighbors(trees, points, f32::INFINITY);
        let one = |(point, nearest): (&Vec3, Option<Nearest>)| {
            nearest.map(|nearest| signed(trees, *point, &nearest, &mut crossed))
        };
        points.iter().zip(nearest).map(one).collect()
    });
}

/// [`WindingNumbers::at`] for each point; parallel on the threads of the pool in scope.
///
/// # Panics
///
/// If the slices differ in length.
pub fn winding_number_batch(
    numbers: &WindingNumbers,
    points: &[Vec3],
    out: &mut [f64],
    is_parallel: bool,
) {
    in_sorted_tasks(points, out, is_parallel, |points| {
        points.iter().map(|point| numbers.at(*point)).collect()
    });
}

/// [`triangles_in_box`] for each box; parallel on the threads of the pool in scope.
pub fn triangles_in_box_batch(
    trees: &[PointTree<'_>],
    boxes: &[Aabb],
    is_parallel: bool,
) -> TriangleLists {
    lists(boxes, is_parallel, |bounds, out| {
        triangles_in_box(trees, bounds, out);
    })
}

/// [`triangles_in_sphere`] for each center and radius; parallel on the threads of the pool in scope.
pub fn triangles_in_sphere_batch(
    trees: &[PointTree<'_>],
    spheres: &[(Vec3, f32)],
    is_parallel: bool,
) -> TriangleLists {
    lists(spheres, is_parallel, |(center, radius), out| {
        triangles_in_sphere(trees, *center, *radius, out);
    })
}

/// One list for each item.
fn lists<T: Sync>(
    items: &[T],
    is_parallel: bool,
    list: impl Fn(&T, &mut Vec<u32>) + Send + Sync,
) -> TriangleLists {
    let tasks: Vec<&[T]> = items.chunks(TASK).collect();
    let parts = kd_tasks::map(tasks, is_parallel, |items| {
        let (mut one, mut all) = (Vec::new(), Vec::new());
        let mut ends = Vec::with_capacity(items.len());
        for item in items {
            list(item, &mut one);
            all.extend_from_slice(&one);
            ends.push(all.len());
        }
        (ends, all)
    });
    let mut lists = TriangleLists {
        starts: vec![0],
        triangles: Vec::with_capacity(parts.iter().map(|(_, all)| all.len()).sum()),
    };
    for (ends, all) in parts {
        let first = lists.triangles.len();
        lists.starts.extend(ends.iter().map(|end| first + end));
        lists.triangles.extend(all);
    }
    lists
}

/// Answers each point by a function of neighbors, in any order.
fn in_sorted_tasks<T: Send>(
    points: &[Vec3],
    out: &mut [T],
    is_parallel: bool,
    answer: impl Fn(&[Vec3]) -> Vec<T> + Send + Sync,
) {
    assert_eq!(points.len(), out.len(), "one answer per point");
    for (points, out) in points.chunks(MOST_SORTED).zip(out.chunks_mut(MOST_SORTED)) {
        let order = along_a_curve(points, is_parallel);
        let tasks_at_once = if is_parallel { TASKS } else { 1 };
        for places in order.chunks(TASK * tasks_at_once) {
            let tasks = places.chunks(TASK).collect();
            let answers = kd_tasks::map(tasks, is_parallel, |places: &[u32]| {
                let neighbors = places.iter().map(|place| points[*place as usize]);
                answer(&neighbors.collect::<Vec<Vec3>>())
            });
            for (place, answer) in places.iter().zip(answers.into_iter().flatten()) {
                out[*place as usize] = answer;
            }
        }
    }
}
