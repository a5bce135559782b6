//! The number of threads has no effect.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhOptions};
use kd_scene::Spd;

use crate::check::{METHODS, check_sound};

#[test]
fn thread_counts_have_no_effect() {
    let mesh = Arc::new(Spd::Lattice.generate(4).expect("a small size").mesh);
    assert!(mesh.len() > 20_000, "enough for tasks: {}", mesh.len());
    for method in METHODS {
        let built = |threads| {
            let options = BvhOptions::new().with_method(method).with_threads(threads);
            let bvh = Bvh::build(Arc::clone(&mesh), &options).expect("valid options");
            check_sound(&bvh, &options);
            bytes(&bvh)
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
