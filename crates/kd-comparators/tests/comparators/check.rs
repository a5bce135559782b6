//! The one place that compares a ray's answers.

use kd_comparators::{Octree, Options, PolygonBsp};
use kd_core::{Hit, Mesh, Ray};
use kd_oracle::rays::Rays;
pub(crate) use kd_oracle::source;
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

/// Rays around a mesh and the planes of its octree, four levels of them.
pub(crate) fn rays(mesh: &Mesh, seed: u64) -> Rays<'_> {
    let bounds = mesh.bounds();
    let mut planes = Vec::new();
    for axis in 0..3 {
        let mut places = vec![bounds.min[axis], bounds.max[axis]];
        for _ in 0..4 {
            let middles = places.windows(2).map(|pair| 0.5 * pair[0] + 0.5 * pair[1]);
            let middles: Vec<f32> = middles.collect();
            places.extend(middles);
            places.sort_by(f32::total_cmp);
        }
        planes.extend(places.into_iter().map(|place| (axis, place)));
    }
    Rays::new(mesh, planes, seed)
}
