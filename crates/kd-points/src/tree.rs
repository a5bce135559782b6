//! The trees that points ask.

use glam::Vec3;
use kd_core::Aabb;
use kd_simd::Level;
use kd_trace::PackedTree;
use kd_wide::WideTree;

/// A tree that points ask, in either layout.
#[derive(Clone, Copy, Debug)]
pub enum PointTree<'a> {
    /// Wide nodes.
    Wide(&'a WideTree),
    /// The 8-byte nodes of a kd-tree over blocks.
    Packed(&'a PackedTree),
}

impl PointTree<'_> {
    /// The box around all triangles; empty without any.
    pub(crate) fn bounds(self) -> Aabb {
        match self {
            Self::Wide(tree) => {
                let [min, max] = tree.frame().corners;
                let corner = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
                Aabb {
                    min: corner(min),
                    max: corner(max),
                }
            }
            Self::Packed(tree) => tree.bounds(),
        }
    }

    pub(crate) fn level(self) -> Level {
        match self {
            Self::Wide(tree) => tree.level(),
            Self::Packed(tree) => tree.level(),
        }
    }
}

impl<'a> From<&'a WideTree> for PointTree<'a> {
    fn from(tree: &'a WideTree) -> Self {
        Self::Wide(tree)
    }
}

impl<'a> From<&'a PackedTree> for PointTree<'a> {
    fn from(tree: &'a PackedTree) -> Self {
        Self::Packed(tree)
    }
}
