//! A tracer that tests every triangle.

use kd::{Hit, Ray};
use kd_core::Mesh;
use kd_render::{PartHit, Stage};
use kd_scene::SceneDescription;
use kd_trace::{RayQuery, brute_force};

/// Tests every ray against every triangle of every part.
pub(crate) struct BruteForce {
    meshes: Vec<Mesh>,
}

impl BruteForce {
    pub(crate) fn new(stage: &Stage) -> Self {
        let nodes = stage.description().placed_nodes(stage.time());
        let parts = stage.description().parts.iter();
        let placed = parts.map(|part| {
            let to = SceneDescription::placed_part(part, &nodes);
            let mesh = match part.deformed(stage.time(), &nodes) {
                Some(positions) => &part
                    .mesh
                    .with_positions(positions)
                    .expect("finite positions"),
                None => &*part.mesh,
            };
            mesh.transformed(&to).expect("finite positions")
        });
        Self {
            meshes: placed.collect(),
        }
    }
}

/// The hits of one mesh, as hits of a part.
fn of_part(part: usize) -> impl Fn(Hit) -> PartHit {
    move |hit| PartHit { part, hit }
}

impl RayQuery for BruteForce {
    type Hit = PartHit;

    fn intersect(&self, ray: &Ray) -> Option<PartHit> {
        let parts = self.meshes.iter().enumerate();
        let found =
            parts.filter_map(|(part, mesh)| brute_force::intersect(mesh, ray).map(of_part(part)));
        // The lower part wins among equal distances.
        found.reduce(|best, next| if next.hit.t < best.hit.t { next } else { best })
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let mut meshes = self.meshes.iter();
        meshes.any(|mesh| brute_force::occluded(mesh, ray))
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<PartHit>) {
        out.clear();
        for (part, mesh) in self.meshes.iter().enumerate() {
            let mut found = Vec::new();
            brute_force::hits(mesh, ray, max, &mut found);
            out.extend(found.into_iter().map(of_part(part)));
        }
        // The sort is stable, so the lower part stays first among equal distances.
        out.sort_by(|a, b| a.hit.t.total_cmp(&b.hit.t));
        out.truncate(max);
    }
}
