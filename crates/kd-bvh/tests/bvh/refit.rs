//! Hierarchies whose triangles have moved.

use glam::Vec3;
use kd_bvh::{Bvh, BvhOptions, RefitError};
use kd_core::Mesh;

use crate::check::{self, Subject, check, option_rows};
use crate::rng::Rng;
use crate::scenes;

fn build(mesh: &Mesh, options: &BvhOptions) -> Bvh {
    Bvh::build(mesh, options).expect("valid options")
}

/// The same triangles in each other's places.
fn scrambled(mesh: &Mesh) -> Mesh {
    let mut rng = Rng(2);
    let mut triangles: Vec<[Vec3; 3]> = (0..u32::try_from(mesh.len()).expect("few"))
        .map(|triangle| mesh.corners(triangle))
        .collect();
    for i in (1..triangles.len()).rev() {
        triangles.swap(i, rng.below(i + 1));
    }
    scenes::soup(&triangles)
}

#[test]
fn moved_meshes_answer_as_brute_force() {
    let mesh = scenes::confetti(300, 21);
    let bent = scenes::moved(&mesh, |p| p + Vec3::new(p.z * p.z, (3.0 * p.x).sin(), 5.0));
    let flattened = scenes::moved(&mesh, |p| Vec3::new(p.x, 0.0, p.z));
    let blown_up = scenes::moved(&mesh, |p| 1e30 * p);
    for (name, now) in [
        ("bent", bent),
        ("flattened", flattened),
        ("blown up", blown_up),
        ("scrambled", scrambled(&mesh)),
    ] {
        let subjects = option_rows().into_iter().map(|options| {
            let mut bvh = build(&mesh, &options);
            bvh.refit(&now).expect("as many triangles");
            Subject::of(&now, bvh, &options)
        });
        let subjects: Vec<Subject<'_>> = subjects.collect();
        let mut rays = check::rays(&now, &subjects, 3);
        let mut hit = 0;
        for _ in 0..3000 {
            hit += usize::from(check(name, &now, &subjects, &rays.draw()) > 0);
        }
        assert!(hit > 500, "{name}: {hit} hit");
    }
}

#[test]
fn quality_tells_what_became_of_it() {
    for (name, mesh) in scenes::generated() {
        for options in option_rows() {
            let new = build(&mesh, &options);
            assert_eq!(new.quality(), 1.0, "{name}, {options:?}: as built");
            let mut bvh = new.clone();
            bvh.refit(&mesh).expect("the same mesh");
            assert_eq!((bvh.quality(), &bvh), (1.0, &new), "{name}, {options:?}");

            let worse = scrambled(&mesh);
            bvh.refit(&worse).expect("as many triangles");
            let quality = bvh.quality();
            assert!(
                quality > 1.5,
                "{name}, {options:?}: {quality} when scrambled"
            );
            let stats = [&bvh, &new].map(|bvh| bvh.stats().sah_cost_own);
            let ratio = stats[0] / stats[1];
            assert!((ratio / quality - 1.0).abs() < 1e-12, "{ratio}, {quality}");

            bvh.refit(&mesh).expect("back");
            assert_eq!((bvh.quality(), &bvh), (1.0, &new), "{name}: as it was");
        }
    }
}

#[test]
fn another_number_of_triangles_is_refused() {
    let mesh = scenes::confetti(20, 1);
    let mut bvh = build(&mesh, &BvhOptions::new());
    let before = bvh.clone();
    for given in [0, 19, 21] {
        let error = bvh.refit(&scenes::confetti(given, 1)).expect_err("others");
        let triangles = 20;
        assert_eq!(error, RefitError::TriangleCount { given, triangles });
        assert_eq!(bvh, before, "nothing has changed");
    }
    let text = "19 triangles for a hierarchy over 20";
    let error = bvh.refit(&scenes::confetti(19, 1)).expect_err("others");
    assert_eq!(error.to_string(), text, "both are named");

    let nothing = scenes::soup(&[]);
    let mut bvh = build(&nothing, &BvhOptions::new());
    assert_eq!(bvh.refit(&nothing), Ok(()), "nothing has not moved");
    assert_eq!(bvh.quality(), 1.0, "and is as good as ever");
}
