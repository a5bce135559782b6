//! What queries know about the hits of any structure.

use std::fmt::Debug;

use kd_core::Hit;

/// A hit of a structure: its place along the ray, and its order among other hits.
pub trait RayHit: Copy + Debug + PartialEq + Send + Sync {
    /// Distance along the ray, in multiples of its direction.
    fn t(&self) -> f32;

    /// The triangle's number in its mesh.
    fn triangle(&self) -> u32;

    /// The order of hits along a ray: nearer first, then the lower part, then the lower triangle.
    fn is_before(&self, other: &Self) -> bool;
}

impl RayHit for Hit {
    #[inline]
    fn t(&self) -> f32 {
        self.t
    }

    #[inline]
    fn triangle(&self) -> u32 {
        self.triangle
    }

    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        Self::is_before(self, other)
    }
}

/// A part, and the hit in it.
impl<Part: Copy + Debug + Ord + Send + Sync> RayHit for (Part, Hit) {
    #[inline]
    fn t(&self) -> f32 {
        self.1.t
    }

    #[inline]
    fn triangle(&self) -> u32 {
        self.1.triangle
    }

    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        let key = |(part, hit): &Self| (*part, hit.triangle);
        self.1.t < other.1.t || (self.1.t == other.1.t && key(self) < key(other))
    }
}
