//! Which sides of triangles a ray passes through.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::BitOr;

use bytemuck::{Pod, Zeroable};

/// The sides of triangles that a ray passes through: a triangle whose culled side the ray meets is not hit.
///
/// A ray meets the *front* of a triangle whose corners it sees in counter-clockwise order, and the *back* of any other. So the
/// front is the side that [`Mesh::normal`](crate::Mesh::normal) points to. An instance of a part keeps the sides of its mesh,
/// also if its transform mirrors it.
///
/// The side is decided by the sign of the exact number that decides whether the ray hits the triangle. So a closed mesh is
/// closed for each side too: neighbors never disagree about the side at their shared edge.
///
/// ```
/// use kd_core::Culling;
///
/// assert_eq!(Culling::default(), Culling::NONE);
/// assert_eq!(Culling::FRONT | Culling::BACK, Culling::BOTH);
/// assert!(Culling::BACK.sees(true) && !Culling::BACK.sees(false));
/// ```
///
/// In memory it is one word, of which the two lowest bits count.
#[derive(Clone, Copy, Default, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Culling(u32);

impl Culling {
    /// The ray hits both sides: the default.
    pub const NONE: Self = Self(0);
    /// The ray passes through triangles whose back it meets.
    pub const BACK: Self = Self(1);
    /// The ray passes through triangles whose front it meets.
    pub const FRONT: Self = Self(2);
    /// The ray passes through everything, and hits nothing.
    pub const BOTH: Self = Self(3);

    /// Whether the ray hits a triangle whose front, or else whose back, it meets.
    #[inline(always)]
    pub const fn sees(self, is_front: bool) -> bool {
        let side = if is_front { Self::FRONT } else { Self::BACK };
        self.0 & side.0 == 0
    }

    /// The same for triangles whose corners are in the opposite order.
    #[must_use]
    #[inline]
    pub const fn turned(self) -> Self {
        Self(self.bits() >> 1 | (self.bits() & 1) << 1)
    }

    /// The two bits that count.
    #[inline(always)]
    pub(crate) const fn bits(self) -> u32 {
        self.0 & 3
    }

    #[cfg(feature = "serde")]
    pub(crate) const fn of_bits(bits: u32) -> Self {
        Self(bits & 3)
    }

    /// Whether the ray hits both sides. One comparison, for use at every ray: false as well where bits are set that do not count, which
    /// [`sees`](Self::sees) knows.
    #[inline(always)]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }
}

/// Bits that do not count make no difference.
impl PartialEq for Culling {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }
}

impl Hash for Culling {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.bits().hash(state);
    }
}

impl BitOr for Culling {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl fmt::Debug for Culling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.bits() {
            0 => "Culling::NONE",
            1 => "Culling::BACK",
            2 => "Culling::FRONT",
            _ => "Culling::BOTH",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn culled_sides_are_not_seen() {
        for (culling, front, back, turned) in [
            (Culling::NONE, true, true, Culling::NONE),
            (Culling::BACK, true, false, Culling::FRONT),
            (Culling::FRONT, false, true, Culling::BACK),
            (Culling::BOTH, false, false, Culling::BOTH),
        ] {
            assert_eq!(
                [culling.sees(true), culling.sees(false)],
                [front, back],
                "{culling:?}"
            );
            assert_eq!(culling.turned(), turned, "{culling:?}");
            assert_eq!(culling.is_none(), front && back, "{culling:?}");
            let other_bits: Culling = bytemuck::must_cast(culling.0 | 0xff00);
            assert_eq!(other_bits, culling, "only two bits count");
            assert_eq!(other_bits.turned(), turned, "only two bits count");
        }
    }
}
