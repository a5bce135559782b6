//! The structures under test, and the comparison of their answers with brute force.

use std::sync::Arc;

use kd_comparators::{CellOptions, CellStats, Octree, PolygonBsp};
use kd_core::{Hit, Mesh, Ray};
use kd_oracle::rays::Rays;
use kd_trace::RayQuery;

/// Both structures over a mesh, built with the same options.
pub(crate) struct Pair {
    pub(crate) octree: Octree,
    pub(crate) bsp: PolygonBsp,
}

impl Pair {
    pub(crate) fn new(mesh: &Arc<Mesh>, options: &CellOptions) -> Self {
        Self {
            octree: Octree::build(Arc::clone(mesh), options).expect("valid"),
            bsp: PolygonBsp::build(Arc::clone(mesh), options).expect("valid"),
        }
    }

    /// With default options, divided as far as possible, and limited early.
    pub(crate) fn all(mesh: &Arc<Mesh>) -> [Self; 3] {
        let default = CellOptions::default();
        let fine = default.clone().with_small_leaf(0);
        let few = 2 * mesh.len() as u64;
        let coarse = default
            .clone()
            .with_small_leaf(1)
            .with_max_depth(5)
            .with_max_refs(few);
        [default, fine, coarse].map(|options| Self::new(mesh, &options))
    }

    pub(crate) fn stats(&self) -> [CellStats; 2] {
        [self.octree.stats(), self.bsp.stats()]
    }
}

/// The planes of the octree's first four levels.
pub(crate) fn planes(mesh: &Mesh) -> Vec<(usize, f32)> {
    let bounds = mesh.bounds();
    let mut planes = Vec::new();
    for axis in 0..3 {
        let mut positions = vec![bounds.min[axis], bounds.max[axis]];
        for _ in 0..4 {
            let pairs = positions.windows(2);
            let middles: Vec<f32> = pairs.map(|pair| 0.5 * pair[0] + 0.5 * pair[1]).collect();
            positions.extend(middles);
            positions.sort_by(f32::total_cmp);
        }
        planes.extend(positions.into_iter().map(|position| (axis, position)));
    }
    planes
}

/// Compares every query of both structures with brute force. Returns the number of hits.
#[track_caller]
pub(crate) fn check(scene: &str, mesh: &Mesh, pairs: &[Pair], ray: &Ray) -> usize {
    let structures: Vec<&dyn RayQuery<Hit = Hit>> = pairs
        .iter()
        .flat_map(|pair| [&pair.octree as &dyn RayQuery<Hit = Hit>, &pair.bsp])
        .collect();
    kd_oracle::check(scene, mesh, &structures, ray)
}

/// Rays around a mesh and the planes of structures over it.
pub(crate) fn rays(mesh: &Mesh, seed: u64) -> Rays<'_> {
    Rays::new(mesh, planes(mesh), seed)
}
