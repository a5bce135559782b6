//! Thread counts do not show.

use kd_bvh::{Bvh, BvhOptions};
use kd_scene::Spd;

use crate::check::{METHODS, check_sound};
use crate::scenes::moved;

#[test]
fn thread_counts_do_not_show() {
    let mesh = Spd::Lattice.generate(4).expect("a small size").mesh;
    assert!(mesh.len() > 20_000, "enough for tasks: {}", mesh.len());
    let twisted = moved(&mesh, |p| {
        let (sin, cos) = (3.0 * p.z).sin_cos();
        glam::Vec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)
    });
    for method in METHODS {
        let built = |threads| {
            let options = BvhOptions::new().with_method(method).with_threads(threads);
            let mut bvh = Bvh::build(&mesh, &options).expect("valid options");
            check_sound(&mesh, &bvh, &options);
            let before = bytes(&bvh);
            bvh.refit(&twisted).expect("as many triangles");
            (before, bytes(&bvh))
        };
        let alone = built(1);
        for threads in [0, 2, 3, 8] {
            assert!(built(threads) == alone, "{method:?}, {threads} threads");
        }
    }
}

fn bytes(bvh: &Bvh) -> (Vec<u8>, Vec<u32>) {
    let nodes: &[u8] = bytemuck::cast_slice(bvh.nodes());
    (nodes.to_vec(), bvh.triangles().to_vec())
}
