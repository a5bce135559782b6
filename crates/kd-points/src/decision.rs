//! Which point of a triangle is closest, and how far it is: the one decision of all queries, in f64.
//!
//! Candidates are the closest points of the three edges, and the foot of the perpendicular where it is inside. After C. Ericson,
//! *Real-Time Collision Detection*, 2005, section 5.1.5, with these differences:
//!
//! - Edges are computed alike from both ends: only by sums and products of numbers that are swapped or negated with the ends. So the squared
//!   distance to an edge or to a corner is the same number for all triangles around it, and ties are real ties.
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
    place: DVec3,
    way: DVec3,
    /// Of the way.
    squared: f64,
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

/// The closest point of an edge, by the weights of its ends.
#[derive(Clone, Copy)]
struct OnEdge {
    weights: [f64; 2],
    squared: f64,
}

impl Foot {
    /// The closest point of a triangle that has an area. A pure function of point and corners, all finite.
    #[inline(always)]
    pub(crate) fn new(point: Vec3, corners: [Vec3; 3]) -> Self {
        let from = point.as_dvec3();
        let corner = |place: Vec3| {
            let place = place.as_dvec3();
            let way = place - from;
            let squared = way.length_squared();
            Corner {
                place,
                way,
                squared,
            }
        };
        let [a, b, c] = [corner(corners[0]), corner(corners[1]), corner(corners[2])];
        let edges = [OnEdge::new(a, b), OnEdge::new(b, c), OnEdge::new(c, a)];
        let (mut number, mut edge) = (0, edges[0]);
        for (other_number, other) in [(1, edges[1]), (2, edges[2])] {
            if other.squared < edge.squared {
                (number, edge) = (other_number, other);
            }
        }
        let mut nearest = Self::on_edge(number, edge);
        let weights = weights(a, b, c);
        if weights.iter().all(|weight| *weight > 0.0) {
            let [u, v, w] = weights;
            let scale = 1.0 / (u + v + w);
            let weights = [u * scale, v * scale, w * scale];
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
        if nearest.squared <= LEAST_SQUARE * (a.squared + b.squared + c.squared) {
            nearest.squared = exact_square(nearest.squared, point, corners);
        }
        nearest
    }

    #[inline(always)]
    fn on_edge(number: u8, edge: OnEdge) -> Self {
        let next = (number + 1) % 3;
        let [from, to] = edge.weights;
        let mut weights = [0.0; 3];
        weights[usize::from(number)] = from;
        weights[usize::from(next)] = to;
        let feature = if to == 0.0 {
            Feature::Corner(number)
        } else if from == 0.0 {
            Feature::Corner(next)
        } else {
            Feature::Edge(number)
        };
        Self {
            squared: edge.squared,
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
        let along = to.place - from.place;
        // How far the closest point of the line is from both ends, times the length of the edge.
        let from_here = -from.way.dot(along);
        let from_there = to.way.dot(along);
        if from_here > 0.0 && from_there > 0.0 {
            let scale = 1.0 / (from_here + from_there);
            let (here, there) = (from_there * scale, from_here * scale);
            return Self {
                weights: [here, there],
                squared: (from.way * here + to.way * there).length_squared(),
            };
        }
        // Rounding may put it beyond both ends of a short edge that is far away.
        if from.squared <= to.squared {
            Self {
                weights: [1.0, 0.0],
                squared: from.squared,
            }
        } else {
            Self {
                weights: [0.0, 1.0],
                squared: to.squared,
            }
        }
    }
}

/// How much each corner counts at the foot of the perpendicular, up to a common factor that is at least 0: the volumes of the tetrahedra
/// of the normal, the point and each edge.
#[inline(always)]
fn weights(a: Corner, b: Corner, c: Corner) -> [f64; 3] {
    let normal = (b.place - a.place).cross(c.place - a.place);
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
