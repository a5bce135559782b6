//! Meshes and points for property tests.

use glam::Vec3;
use kd_core::Mesh;
use proptest::prelude::*;

use crate::scenes::Soup;

/// Coordinates that often coincide, with some far away and some that are close but not equal.
pub fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        3 => -3.0_f32..3.0,
        1 => (-3_i8..=3).prop_map(|x| f32::from(x).next_up()),
        1 => -1e5_f32..1e5,
        1 => -1e-5_f32..1e-5,
    ]
}

/// Points of such coordinates.
pub fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

/// Meshes of up to some dozens of triangles, some in a common plane, some twice, some without area.
pub fn mesh() -> impl Strategy<Value = Mesh> {
    let triangle = ([point(), point(), point()], 0..8_u8);
    prop::collection::vec(triangle, 1..24).prop_map(|triangles| {
        let mut soup = Soup::default();
        for ([a, b, c], kind) in triangles {
            let in_plane = |p: Vec3| Vec3::new(p.x, p.y, 1.0);
            match kind {
                0 => soup.triangle([a, b, c].map(in_plane)),
                1 => {
                    soup.triangle([a, b, c]);
                    soup.triangle([b, a, c]);
                }
                2 => soup.triangle([a, b, a]),
                3 => soup.quad([a, b, c, b.midpoint(c)]),
                _ => soup.triangle([a, b, c]),
            }
        }
        soup.mesh()
    })
}
