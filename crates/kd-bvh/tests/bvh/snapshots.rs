//! Statistics of every method on small scenes, as text. A change here is a change of hierarchies: say so in the changelog.

use kd_bvh::{Bvh, BvhOptions};

use crate::check::METHODS;
use crate::scenes;

#[test]
fn statistics() {
    for (name, mesh) in scenes::generated() {
        let methods = METHODS.map(|method| {
            let options = BvhOptions::new().with_method(method);
            let bvh = Bvh::build(&mesh, &options).expect("valid options");
            let stats = bvh.stats().with_zero_area(mesh.zero_area_count());
            assert_eq!(stats.references, mesh.len(), "{name}: each triangle once");
            format!("{method:?}\n{stats}")
        });
        insta::assert_snapshot!(name, methods.join("\n"));
    }
}
