//! The closest point of a mesh, as an answer.

use glam::Vec3;

/// The point of a mesh that is closest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The closest point, in scene units: the corner itself on a corner, elsewhere rounded to f32.
    pub point: Vec3,
    /// Its distance, at least 0, in scene units. Computed in f64 from the unrounded point, then rounded to f32; infinite only beyond
    /// the range of f32.
    pub distance: f32,
    /// The triangle that has the point.
    pub triangle: u32,
    /// The weight of the second corner, from 0 to 1: the point is (1 − u − v) a + u b + v c.
    pub u: f32,
    /// The weight of the third corner, from 0 to 1.
    pub v: f32,
    /// The part of the triangle that has the point.
    pub feature: Feature,
}

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Feature {
    /// Inside, off all edges.
    Face,
    /// An edge without its ends: 0 joins the first and the second corner, 1 the second and the third, 2 the third and the first.
    Edge(u8),
    /// A corner: 0, 1 or 2.
    Corner(u8),
}
