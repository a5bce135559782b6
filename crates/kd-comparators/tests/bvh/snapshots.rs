//! Statistics of every method on small scenes, as text. A change here is a change of hierarchies, for the changelog.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhOptions};

use crate::check::METHODS;
use crate::scenes;

#[test]
fn statistics() {
    for (name, mesh) in scenes::generated() {
        let methods = METHODS.map(|method| {
            let options = BvhOptions::new().with_method(method);
            let bvh = Bvh::build(Arc::clone(&mesh), &options).expect("valid options");
            let stats = bvh.stats();
            assert_eq!(stats.references, mesh.len(), "{name}: each triangle once");
            format!("{method:?}\n{stats}")
        });
        insta::assert_snapshot!(name, methods.join("\n"));
    }
}
