//! Random meshes of degenerate and coplanar triangles, which are hard for builders.

use kd_core::Mesh;
use proptest::prelude::*;

/// A mesh of triangles that share no vertices.
pub(crate) fn soup(triangles: &[[[f32; 3]; 3]]) -> Mesh {
    let indices = (0_u32..)
        .zip(triangles)
        .map(|(i, _)| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    Mesh::new(triangles.concat(), indices).expect("finite, in range")
}

/// A coordinate on a coarse grid, so that many coordinates are equal; one in seven is -0.0.
fn grid() -> BoxedStrategy<f32> {
    (-3_i8..4)
        .prop_map(|x| if x == 0 { -0.0 } else { f32::from(x) })
        .boxed()
}

fn anywhere() -> BoxedStrategy<f32> {
    (-3.0_f32..3.0).boxed()
}

/// A random triangle: arbitrary, on a grid, in an axis-aligned plane, of zero area, a point, huge, or tiny.
pub(crate) fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> {
    let in_axis_plane = (
        0_usize..3,
        grid(),
        prop::array::uniform3([grid(), anywhere(), grid()]),
    )
        .prop_map(|(axis, at, mut corners)| {
            for corner in &mut corners {
                corner[axis] = at;
            }
            corners
        });
    let zero_area =
        ([grid(), grid(), grid()], [grid(), anywhere(), grid()]).prop_map(|(a, b)| [a, b, a]);
    prop_oneof![
        4 => prop::array::uniform3([anywhere(), anywhere(), anywhere()]),
        3 => prop::array::uniform3([grid(), grid(), grid()]),
        3 => in_axis_plane,
        1 => zero_area,
        1 => [anywhere(), anywhere(), anywhere()].prop_map(|p| [p; 3]),
        1 => Just([[-40.0, 0.5, -40.0], [40.0, 0.25, -40.0], [0.0, -0.5, 40.0]]),
        2 => ([anywhere(), anywhere(), anywhere()], 0.01_f32..0.1).prop_map(|([x, y, z], s)| {
            [[x, y, z], [x + s, y, z], [x, y + s, z + s]]
        }),
    ]
}

/// Fewer than `limit` such triangles, half of them repeated up to twice.
pub(crate) fn mesh(limit: usize) -> impl Strategy<Value = Mesh> {
    (prop::collection::vec(triangle(), 0..limit), 0_usize..3).prop_map(|(mut triangles, copies)| {
        let half = triangles[..triangles.len() / 2].to_vec();
        for _ in 0..copies {
            triangles.extend_from_slice(&half);
        }
        soup(&triangles)
    })
}
