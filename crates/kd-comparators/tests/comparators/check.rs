//! The one place that compares a ray's answers.

use kd_comparators::{Octree, Options, PolygonBsp};
use kd_core::{Hit, Mesh, Ray};
use kd_oracle::rays::Rays;
use kd_oracle::{Answers, source};

/// Both structures over a mesh, built in one way.
pub(crate) struct Subject<'a> {
    mesh: &'a Mesh,
    pub(crate) octree: Octree,
    pub(crate) bsp: PolygonBsp,
}

impl<'a> Subject<'a> {
    pub(crate) fn new(mesh: &'a Mesh, options: &Options) -> Self {
        Self {
            mesh,
            octree: Octree::build(mesh, options).expect("valid"),
            bsp: PolygonBsp::build(mesh, options).expect("valid"),
        }
    }

    /// As it comes, divided as far as possible, and ended early by limits.
    pub(crate) fn all(mesh: &'a Mesh) -> [Self; 3] {
        let default = Options::default();
        let fine = default.clone().with_small_leaf(0);
        let few = 2 * mesh.len() as u64;
        let coarse = default
            .clone()
            .with_small_leaf(1)
            .with_max_depth(5)
            .with_max_refs(few);
        [default, fine, coarse].map(|options| Self::new(mesh, &options))
    }
}

/// As the octree does, having made sure that the BSP tree gives the same.
impl Answers for Subject<'_> {
    #[track_caller]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.octree.intersect(self.mesh, ray);
        let bsp = self.bsp.intersect(self.mesh, ray);
        assert_eq!(bsp, hit, "bsp, not octree, closest: {}", source(ray));
        hit
    }

    #[track_caller]
    fn any(&self, ray: &Ray) -> bool {
        let any = self.octree.occluded(self.mesh, ray);
        let bsp = self.bsp.occluded(self.mesh, ray);
        assert_eq!(bsp, any, "bsp, not octree, any: {}", source(ray));
        any
    }

    #[track_caller]
    fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        let mut found = out.clone();
        self.octree.hits(self.mesh, ray, max, out);
        self.bsp.hits(self.mesh, ray, max, &mut found);
        assert_eq!(found, *out, "bsp, not octree, {max}: {}", source(ray));
    }

    /// Those of the octree, four levels of them.
    fn planes(&self) -> Vec<(usize, f32)> {
        let bounds = self.mesh.bounds();
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
        planes
    }
}

/// Asks every query of both structures about a ray, and expects what brute force says. Gives the number of hits.
#[track_caller]
pub(crate) fn check(scene: &str, mesh: &Mesh, subjects: &[Subject<'_>], ray: &Ray) -> usize {
    let answers: Vec<&dyn Answers> = subjects.iter().map(|subject| subject as _).collect();
    kd_oracle::check(scene, mesh, &answers, ray)
}

/// Rays around a mesh and the planes of structures over it.
pub(crate) fn rays<'a>(mesh: &'a Mesh, subjects: &[Subject<'_>], seed: u64) -> Rays<'a> {
    // They are the same for all.
    Rays::new(mesh, subjects[0].planes(), seed)
}
