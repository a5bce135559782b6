//! A tracer that tests every triangle.

use kd::{Hit, Ray};
use kd_core::Mesh;
use kd_render::{PartHit, Stage};
use kd_trace::{RayQuery, brute_force};

/// Tests every ray against every triangle of every part.
pub(crate) struct BruteForce {
    meshes: Vec<Placed>,
}

/// The triangles of an instance in the scene.
struct Placed {
    part: usize,
    instance: u32,
    mesh: Mesh,
}

impl BruteForce {
    pub(crate) fn new(stage: &Stage) -> Self {
        let nodes = stage.description().placed_nodes(stage.time());
        let mut meshes = Vec::new();
        for (number, part) in stage.description().parts.iter().enumerate() {
            let mesh = match part.deformed(stage.time(), &nodes) {
                Some(positions) => &part
                    .mesh
                    .with_positions(positions)
                    .expect("finite positions"),
                None => &*part.mesh,
            };
            for (instance, place) in (0..).zip(part.places(&nodes)) {
                meshes.push(Placed {
                    part: number,
                    instance,
                    mesh: mesh
                        .transformed(&place.transform)
                        .expect("finite positions"),
                });
            }
        }
        Self { meshes }
    }
}

impl Placed {
    fn hit(&self) -> impl Fn(Hit) -> PartHit {
        let (part, instance) = (self.part, self.instance);
        move |hit| PartHit {
            part,
            instance,
            hit,
        }
    }
}

impl RayQuery for BruteForce {
    type Hit = PartHit;

    fn intersect(&self, ray: &Ray) -> Option<PartHit> {
        let meshes = self.meshes.iter();
        let found = meshes.filter_map(|of| brute_force::intersect(&of.mesh, ray).map(of.hit()));
        // The lower part wins among equal distances.
        found.reduce(|best, next| if next.hit.t < best.hit.t { next } else { best })
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let mut meshes = self.meshes.iter();
        meshes.any(|of| brute_force::occluded(&of.mesh, ray))
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<PartHit>) {
        out.clear();
        for of in &self.meshes {
            let mut found = Vec::new();
            brute_force::hits(&of.mesh, ray, max, &mut found);
            out.extend(found.into_iter().map(of.hit()));
        }
        // The sort is stable, so the lower part stays first among equal distances.
        out.sort_by(|a, b| a.hit.t.total_cmp(&b.hit.t));
        out.truncate(max);
    }
}
