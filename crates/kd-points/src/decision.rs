//! Which point of a triangle is closest, and how far it is: the one decision of all queries, in f64.
//!
//! Candidates are the closest points of the three edges, and the foot of the perpendicular where it is inside. After C. Ericson,
//! *Real-Time Collision Detection*, 2005, section 5.1.5, with these differences:
//!
//! - Each edge is measured from its lower end, in the order of x, y, z. So the squared distance to an edge or to a corner is the same
//!   number for all triangles around it, and ties are real ties.
//! - The foot has weights that are products of three differences, and not of four: thin triangles keep them.
//! - A point that is on the triangle exactly has distance 0, and no other has.
//!
//! # Error
//!
//! Each candidate is a sum of corners with weights that are at least 0, whose sum is 1 up to 2⁻⁵¹. So, whichever is chosen, it is a point
//! of the triangle up to 2⁻⁵⁰ R in each coordinate, R being the largest coordinate of a corner seen from the point. The distance is
//! therefore never smaller than that of *some* point of the triangle less 2⁻⁴⁸ R. Early rejection needs no more.

use glam::{DVec3, Vec3};

use crate::exact;
use crate::nearest::{Feature, Nearest};

/// 2⁻⁸⁰, of squared distances of corners: below it a distance may be a rounding error of 0.
const LEAST_SQUARE: f64 = 1.0 / (1_u128 << 80) as f64;

/// A corner, and the way to it from the point.
#[derive(Clone, Copy)]
struct Corner {
    place: Vec3,
    way: DVec3,
}

/// The closest point of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// The squared distance, in f64. 0 exactly if the point is on the triangle.
    pub(crate) squared: f64,
    /// Of the corners.
    weights: [f64; 3],
    feature: Feature,
}

/// The closest point of an edge: how much of the way from its first end to its second, 0 to 1.
struct OnEdge {
    part: f64,
    squared: f64,
}

impl Foot {
    /// The closest point of a triangle that has an area. A pure function of point and corners, all finite.
    #[inline(always)]
    pub(crate) fn new(point: Vec3, corners: [Vec3; 3]) -> Self {
        let from = point.as_dvec3();
        let [a, b, c] = corners.map(|place| Corner {
            place,
            way: place.as_dvec3() - from,
        });
        let mut nearest = Self::on_edge(0, OnEdge::new(a, b));
        for (number, edge) in [(1, OnEdge::new(b, c)), (2, OnEdge::new(c, a))] {
            if edge.squared < nearest.squared {
                nearest = Self::on_edge(number, edge);
            }
        }
        let weights = weights(a, b, c);
        if weights.iter().all(|weight| *weight > 0.0) {
            let weights = weights.map(|weight| weight / weights.iter().sum::<f64>());
            let [u, v, w] = weights;
            let squared = (a.way * u + b.way * v + c.way * w).length_squared();
            if squared < nearest.squared {
                nearest = Self {
                    squared,
                    weights,
                    feature: Feature::Face,
                };
            }
        }
        let size = a.way.length_squared() + b.way.length_squared() + c.way.length_squared();
        if nearest.squared <= LEAST_SQUARE * size {
            nearest.squared = exact_square(nearest.squared, point, corners);
        }
        nearest
    }

    #[inline(always)]
    fn on_edge(number: u8, OnEdge { part, squared }: OnEdge) -> Self {
        let next = (number + 1) % 3;
        let mut weights = [0.0; 3];
        weights[usize::from(number)] = 1.0 - part;
        weights[usize::from(next)] = part;
        let feature = if part == 0.0 {
            Feature::Corner(number)
        } else if part == 1.0 {
            Feature::Corner(next)
        } else {
            Feature::Edge(number)
        };
        Self {
            squared,
            weights,
            feature,
        }
    }

    /// The answer; `corners` are those of the triangle.
    #[allow(clippy::cast_possible_truncation, reason = "an answer has f32 values")]
    pub(crate) fn answer(&self, corners: [Vec3; 3], triangle: u32) -> Nearest {
        let point = match self.feature {
            Feature::Corner(number) => corners[usize::from(number)],
            _ => {
                let parts = corners.iter().zip(self.weights);
                let sum: DVec3 = parts.map(|(corner, part)| corner.as_dvec3() * part).sum();
                sum.as_vec3()
            }
        };
        Nearest {
            point,
            distance: self.squared.sqrt() as f32,
            triangle,
            u: self.weights[1] as f32,
            v: self.weights[2] as f32,
            feature: self.feature,
        }
    }
}

impl OnEdge {
    #[inline(always)]
    fn new(from: Corner, to: Corner) -> Self {
        if is_before(to.place, from.place) {
            let Self { part, squared } = Self::of_ordered(to, from);
            return Self {
                part: 1.0 - part,
                squared,
            };
        }
        Self::of_ordered(from, to)
    }

    #[inline(always)]
    fn of_ordered(from: Corner, to: Corner) -> Self {
        let along = to.place.as_dvec3() - from.place.as_dvec3();
        let part = -from.way.dot(along) / along.length_squared();
        if part > 0.0 && part < 1.0 {
            let squared = (from.way + along * part).length_squared();
            Self { part, squared }
        } else if part >= 1.0 {
            let squared = to.way.length_squared();
            Self { part: 1.0, squared }
        } else {
            let squared = from.way.length_squared();
            Self { part: 0.0, squared }
        }
    }
}

/// The order of x, then y, then z.
#[inline(always)]
fn is_before(a: Vec3, b: Vec3) -> bool {
    a.x < b.x || (a.x == b.x && (a.y < b.y || (a.y == b.y && a.z < b.z)))
}

/// How much each corner counts at the foot of the perpendicular, up to a common factor that is at least 0: the volumes of the tetrahedra
/// of the normal, the point and each edge.
#[inline(always)]
fn weights(a: Corner, b: Corner, c: Corner) -> [f64; 3] {
    let from = a.place.as_dvec3();
    let normal = (b.place.as_dvec3() - from).cross(c.place.as_dvec3() - from);
    [
        normal.dot(b.way.cross(c.way)),
        normal.dot(c.way.cross(a.way)),
        normal.dot(a.way.cross(b.way)),
    ]
}

/// The squared distance where rounding could have made or hidden a 0.
#[cold]
fn exact_square(squared: f64, point: Vec3, corners: [Vec3; 3]) -> f64 {
    if exact::is_on(point, corners) {
        0.0
    } else {
        squared.max(f64::MIN_POSITIVE)
    }
}
