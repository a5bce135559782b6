//! The crossings of a ray with a surface: hits, of which a ray through an edge or a corner has several, counted once.
//!
//! Triangles are closed, so a ray that passes exactly through an edge or a corner hits every triangle around it. These hits are a *group*:
//! those of triangles that share the edge or the corner, by its coordinates. Of a group, as many hits count on each side, front and back, as
//! a ray would have that is moved aside by an amount smaller than every number, first along one axis across, then along the other. The
//! first hits of the group stand for them.
//!
//! So a ray crosses a closed surface as often as a ray beside it: once through the vertex of a sphere, and an even number of times from
//! outside to outside. Where the ray beside it misses the whole group, at the rim of an open surface or where a ray touches a ridge, one
//! hit of each side counts, so that nothing that is hit is lost. A ray that runs in the plane of a triangle does not hit it, and may cross
//! its neighbors an odd number of times.

use std::mem;

use kd::{Hit, KdTree, Mesh, Ray};
use kd_trace::kit::TriangleTest;
use rayon::prelude::*;

use crate::lists::Lists;

/// Rays of one task.
const RUN: usize = 4096;

/// The first `max` crossings of each ray, in order.
pub(crate) fn crossings(tree: &KdTree, rays: &[Ray], max: usize, is_parallel: bool) -> Lists<Hit> {
    let of_run = |rays: &[Ray]| {
        let mut lists = Lists::with_room_for(rays.len());
        let (mut hits, mut groups) = (Vec::new(), Groups::default());
        for ray in rays {
            tree.hits(ray, usize::MAX, &mut hits);
            groups.reduce(tree.mesh(), ray, &mut hits);
            lists.push(&hits[..hits.len().min(max)]);
        }
        lists
    };
    if !is_parallel {
        return of_run(rays);
    }
    Lists::joined(rays.par_chunks(RUN).map(of_run).collect())
}

/// The corners that a hit and others share: the ends of an edge in order, or a corner twice.
type Feature = [[u32; 3]; 2];

/// A hit on an edge or a corner.
#[derive(Clone, Copy, Debug)]
struct Member {
    feature: Feature,
    is_front: bool,
    /// Its place among the hits of the ray.
    place: usize,
    /// Whether the ray that is moved aside hits its triangle.
    is_hit_beside: bool,
}

/// The groups of the hits of one ray; memory that rays share.
#[derive(Debug, Default)]
struct Groups {
    members: Vec<Member>,
    /// Places of hits that do not count.
    dropped: Vec<usize>,
}

impl Groups {
    /// Removes hits that are not crossings of their own.
    fn reduce(&mut self, mesh: &Mesh, ray: &Ray, hits: &mut Vec<Hit>) {
        if hits.len() < 2 {
            return;
        }
        let test = TriangleTest::new(ray, f32::INFINITY);
        self.members.clear();
        for (place, hit) in hits.iter().enumerate() {
            self.members
                .extend(member(&test, mesh, hit.triangle, place));
        }
        if self.members.len() < 2 {
            return;
        }
        // Within a side of a group by the order of hits.
        self.members
            .sort_unstable_by_key(|member| (member.feature, member.is_front, member.place));
        self.dropped.clear();
        for group in self.members.chunk_by(|a, b| a.feature == b.feature) {
            let is_missed = !group.iter().any(|member| member.is_hit_beside);
            for side in group.chunk_by(|a, b| a.is_front == b.is_front) {
                let beside = side.iter().filter(|member| member.is_hit_beside).count();
                let count = if is_missed { 1 } else { beside };
                self.dropped
                    .extend(side[count..].iter().map(|member| member.place));
            }
        }
        self.dropped.sort_unstable();
        let mut dropped = self.dropped.iter().copied().peekable();
        let mut place = 0..;
        hits.retain(|_| {
            dropped
                .next_if_eq(&place.next().expect("endless"))
                .is_none()
        });
    }
}

/// `None` if the ray passes inside of the triangle, off its edges.
fn member(test: &TriangleTest, mesh: &Mesh, triangle: u32, place: usize) -> Option<Member> {
    let corners = mesh.corners(triangle);
    let seen = test.places(corners);
    let sides = [0, 1, 2].map(|i| (seen[(i + 1) % 3], seen[(i + 2) % 3]));
    let areas = sides.map(|(a, b)| a[0] * b[1] - a[1] * b[0]);
    let mut on = [0, 1, 2].into_iter().filter(|&i| areas[i] == 0.0);
    let (first, second) = (on.next()?, on.next());
    let bits = |corner: usize| {
        // One form for both zeros.
        corners[corner].to_array().map(|x| (x + 0.0).to_bits())
    };
    let feature = match second {
        None => {
            let mut ends = [bits((first + 1) % 3), bits((first + 2) % 3)];
            if ends[0] > ends[1] {
                let [a, b] = &mut ends;
                mem::swap(a, b);
            }
            ends
        }
        // The corner that both edges have.
        Some(second) => [bits(3 - first - second); 2],
    };
    let is_positive = areas.iter().sum::<f64>() > 0.0;
    let is_hit_beside = [first].into_iter().chain(second).all(|i| {
        let (a, b) = sides[i];
        let beside = if a[1] == b[1] {
            b[0] > a[0]
        } else {
            a[1] > b[1]
        };
        beside == is_positive
    });
    Some(Member {
        feature,
        is_front: is_positive,
        place,
        is_hit_beside,
    })
}
