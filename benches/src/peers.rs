//! Rival libraries, as structures under measurement. The feature `peers` compiles them.

use kd::{Hit, Mesh, Ray};
use kd_rivals::{
    Bytes, EmbreeBuild, Following, ObvhsBuild, Options, Purpose, Queries, Rival, RivalError,
    TinybvhBuild,
};

use crate::arguments::UsageError;
use crate::memory::bytes_during;
use crate::names::{BuilderName, StructureName, Variant};
use crate::structure::{Built, Manner, Shape, Structure};

/// Whether rivals can be measured; the error says what to do if not.
pub(crate) fn check_available() -> anyhow::Result<()> {
    match kd_rivals::check_available() {
        Err(RivalError::NotCompiled(_)) => {
            let message = "no rival libraries are compiled in; `cargo xtask bench --peers` compiles them, \
                           which is the feature `peers` of kd-bench";
            Err(UsageError(message.into()).into())
        }
        available => Ok(available?),
    }
}

/// The name of Embree with its version if one of these structures is Embree's; empty otherwise.
pub(crate) fn library_of(names: &[&str]) -> String {
    if names.iter().any(|name| name.starts_with("embree")) {
        kd_rivals::embree_name().unwrap_or_default()
    } else {
        String::new()
    }
}

/// Builds a rival's structure over a mesh.
pub(crate) fn build(variant: Variant, mesh: &Mesh, threads: usize) -> anyhow::Result<Built> {
    let embree = match variant.builder {
        BuilderName::Low => EmbreeBuild::Low,
        BuilderName::High => EmbreeBuild::High,
        _ => EmbreeBuild::Medium,
    };
    let rival = match variant.structure {
        StructureName::Obvhs => Rival::Obvhs(match variant.builder {
            BuilderName::Fastest => ObvhsBuild::Fastest,
            BuilderName::Slow => ObvhsBuild::Slow,
            _ => ObvhsBuild::Medium,
        }),
        StructureName::Bvh => Rival::Bvh,
        StructureName::Parry3d => Rival::Parry3d,
        StructureName::Tinybvh => Rival::Tinybvh(match variant.builder {
            BuilderName::High => TinybvhBuild::High,
            _ => TinybvhBuild::Medium,
        }),
        StructureName::EmbreeRobust => Rival::Embree(embree, Purpose::Robust),
        _ => Rival::Embree(embree, Purpose::Usual),
    };
    let built = rival.build(mesh, options(threads))?;
    Ok(Built {
        structure: Box::new(OfRival {
            always_in_packets: variant.structure == StructureName::Embree8,
            bytes: built.bytes.kept,
            ..OfRival::new(built.structure)
        }),
        seconds: built.seconds,
        peak_bytes: built.bytes.peak,
    })
}

/// The ways in which Embree follows a moving mesh, with their names in records.
pub(crate) const FOLLOWING: [(&str, Following); 3] = [
    ("rebuild", Following::Rebuild),
    ("medium", Following::RebuildMoving),
    ("refit", Following::Refit),
];

/// Embree's medium BVH.
pub(crate) fn medium(mesh: &Mesh, threads: usize) -> anyhow::Result<Box<dyn Queries>> {
    let rival = Rival::Embree(EmbreeBuild::Medium, Purpose::Usual);
    Ok(rival.build(mesh, options(threads))?.structure)
}

/// Embree's medium BVH, with a filter that keeps the nearest hits of a ray.
pub(crate) fn filtered(mesh: &Mesh, threads: usize) -> anyhow::Result<Box<dyn Queries>> {
    let rival = Rival::Embree(EmbreeBuild::Medium, Purpose::FirstHits);
    Ok(rival.build(mesh, options(threads))?.structure)
}

fn options(threads: usize) -> Options {
    Options {
        threads,
        count: |work| {
            let ((), taken) = bytes_during(work);
            Bytes {
                peak: taken.peak,
                kept: taken.kept,
            }
        },
    }
}

/// The structure of a rival.
pub(crate) struct OfRival<'a> {
    queries: Box<dyn Queries + 'a>,
    always_in_packets: bool,
    bytes: usize,
}

impl<'a> OfRival<'a> {
    pub(crate) fn new(queries: Box<dyn Queries + 'a>) -> Self {
        Self {
            queries,
            always_in_packets: false,
            bytes: 0,
        }
    }

    fn is_one_at_a_time(&self, by: Manner) -> bool {
        by == Manner::Single && !self.always_in_packets
    }
}

impl Structure for OfRival<'_> {
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        if self.is_one_at_a_time(by) {
            self.queries.intersect_each(rays, hits);
        } else {
            self.queries.intersect_batch(rays, hits);
        }
    }

    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
        if self.is_one_at_a_time(by) {
            self.queries.occluded_each(rays, occluded);
        } else {
            self.queries.occluded_batch(rays, occluded);
        }
    }

    fn shape(&self) -> Shape {
        Shape {
            bytes_total: self.bytes,
            ..Shape::default()
        }
    }
}

#[cfg(all(test, not(feature = "peers")))]
mod tests {
    use super::*;

    #[test]
    fn without_the_feature_the_message_names_the_command() {
        let refused = check_available()
            .expect_err("nothing compiled in")
            .to_string();
        for part in ["cargo xtask bench --peers", "feature `peers`"] {
            assert!(refused.contains(part), "{part} in: {refused}");
        }
    }
}
