//! Public data survives serialization: feature `serde`.

use std::fmt::Debug;

use kd::glam::{Affine3A, Vec3};
use kd::scene::{CommitReport, SceneError};
use kd::{BuildOptions, CostModel, KdTree, Layout, MergeMethod, Method, PartId, Scene, Strategy};
use kd_scene::Spd;
use serde::Serialize;
use serde::de::DeserializeOwned;

#[track_caller]
fn round_trip<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) -> T {
    let text = serde_json::to_string(value).expect("serializable");
    let back = serde_json::from_str(&text).expect("just written");
    assert_eq!(back, *value, "{text}");
    back
}

#[test]
fn options_are_read_back() {
    for options in [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best()
            .with_cost(CostModel::CLASSIC)
            .with_max_depth(12)
            .with_max_refs(99)
            .with_layout(Layout::Binary),
        BuildOptions::default().with_method(Method::Sampled { all_axes: true }),
    ] {
        round_trip(&options);
        round_trip(&Strategy::Rebuild(options));
    }
    round_trip(&Strategy::Merge(MergeMethod::Insertion));
}

/// A file of options names what it changes; a misspelt name is an error.
#[test]
fn options_left_out_are_the_defaults() {
    let read = serde_json::from_str::<BuildOptions>;
    let options = read(r#"{ "threads": 2 }"#).expect("valid");
    assert_eq!(options, BuildOptions::default().with_threads(2));
    let error = read(r#"{ "thread": 2 }"#).expect_err("misspelt");
    assert!(error.to_string().contains("`thread`"), "{error}");
}

#[test]
fn statistics_and_reports_are_read_back() {
    let mesh = Spd::Gears.generate(1).expect("a small size").mesh;
    let tree = KdTree::build(mesh, &BuildOptions::fast()).expect("valid options");
    let stats = round_trip(&tree.stats());
    assert_eq!(stats.to_string(), tree.stats().to_string(), "the same text");

    let mut scene = Scene::new(BuildOptions::fast());
    let part = Spd::Balls.generate(1).expect("a small size").mesh;
    let part = scene.add_dynamic(part).expect("fits");
    for step in 0..2_u8 {
        let place = Affine3A::from_translation(f32::from(step) * Vec3::X);
        scene.set_transform(part, place).expect("finite");
        let report: CommitReport = scene.commit().expect("a frame");
        round_trip(&report);
    }
}

#[test]
fn an_id_that_was_read_names_no_part() {
    let mut scene = Scene::new(BuildOptions::fast());
    let mesh = Spd::Balls.generate(1).expect("a small size").mesh;
    let part = scene.add_dynamic(mesh).expect("fits");
    let read: PartId = round_trip(&part);
    assert_eq!(scene.remove(read), Err(SceneError::NoSuchPart { part }));
    scene.remove(part).expect("its own");
}
