//! The one place that compares a ray's answers.

use kd_comparators::{Octree, Options, PolygonBsp};
use kd_core::{Hit, Mesh, Ray};
use kd_trace::brute_force;

/// Both structures over a mesh, built in one way.
pub(crate) struct Subject {
    pub(crate) options: Options,
    pub(crate) octree: Octree,
    pub(crate) bsp: PolygonBsp,
}

impl Subject {
    pub(crate) fn new(mesh: &Mesh, options: Options) -> Self {
        Self {
            octree: Octree::build(mesh, &options).expect("valid"),
            bsp: PolygonBsp::build(mesh, &options).expect("valid"),
            options,
        }
    }

    /// As it comes, divided as far as possible, and ended early by limits.
    pub(crate) fn all(mesh: &Mesh) -> [Self; 3] {
        let default = Options::default();
        let fine = default.clone().with_small_leaf(0);
        let few = 2 * mesh.len() as u64;
        let coarse = default
            .clone()
            .with_small_leaf(1)
            .with_max_depth(5)
            .with_max_refs(few);
        [default, fine, coarse].map(|options| Self::new(mesh, options))
    }
}

/// Asks every query of both structures about a ray, and expects what brute force says. Gives the number of hits.
#[track_caller]
pub(crate) fn check(scene: &str, mesh: &Mesh, subjects: &[Subject], ray: &Ray) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    let mut found = Vec::new();
    for subject in subjects {
        let (octree, bsp) = (&subject.octree, &subject.bsp);
        let same = |name: &str, answer: &[Hit], most: usize| {
            let first = &expected[..most.min(expected.len())];
            let place = || format!("{scene}, {name}, {:?}: {}", subject.options, source(ray));
            assert!(answer == first, "{}: {answer:?}, not {first:?}", place());
        };
        same("octree", octree.intersect(mesh, ray).as_slice(), 1);
        same("bsp", bsp.intersect(mesh, ray).as_slice(), 1);
        for most in [2, usize::MAX] {
            octree.hits(mesh, ray, most, &mut found);
            same("octree", &found, most);
            bsp.hits(mesh, ray, most, &mut found);
            same("bsp", &found, most);
        }
        let occluded = [octree.occluded(mesh, ray), bsp.occluded(mesh, ray)];
        let expected = [!expected.is_empty(); 2];
        assert_eq!(occluded, expected, "{scene}, any: {}", source(ray));
    }
    expected.len()
}

/// The ray as Rust source, to paste into a test.
pub(crate) fn source(ray: &Ray) -> String {
    let number = |x: f32| {
        if x.is_finite() {
            format!("{x:?}")
        } else {
            format!("f32::from_bits({:#x})", x.to_bits())
        }
    };
    let list = |v: glam::Vec3| v.to_array().map(number).join(", ");
    format!(
        "Ray::new([{}], [{}]).with_range({}, {})",
        list(ray.origin),
        list(ray.direction),
        number(ray.t_min),
        number(ray.t_max)
    )
}
