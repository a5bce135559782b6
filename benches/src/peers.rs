//! Rival libraries, built in with the feature `peers`.
//!
//! A rival gets the mesh copied into its own form of input first; its clock starts then, and stops when it can be
//! traced.

#[cfg(feature = "peers")]
mod bvh;
#[cfg(feature = "peers")]
mod embree;
#[cfg(feature = "peers")]
mod embree_api;
#[cfg(feature = "peers")]
mod obvhs;
#[cfg(feature = "peers")]
mod parry3d;
#[cfg(feature = "peers")]
mod rust;

#[cfg(feature = "peers")]
pub(crate) use embree::{EmbreeMoving, Following};

use kd::Mesh;

use crate::structure::{Built, OrderedHits, Variant};

/// Whether rivals can be measured; what to do about it if not.
#[cfg(feature = "peers")]
pub(crate) fn check_available() -> anyhow::Result<()> {
    Ok(embree_api::check_installed()?)
}

/// Whether rivals can be measured; what to do about it if not.
#[cfg(not(feature = "peers"))]
pub(crate) fn check_available() -> anyhow::Result<()> {
    Err(refusal())
}

#[cfg(not(feature = "peers"))]
fn refusal() -> anyhow::Error {
    let message = "no rival libraries are built in; `cargo xtask bench --peers` builds with them, \
                   which is the feature `peers` of kd-bench";
    crate::cli::UsageError(message.into()).into()
}

/// Builds a rival's structure over a mesh.
#[cfg(feature = "peers")]
pub(crate) fn build(variant: Variant, mesh: &Mesh, threads: usize) -> anyhow::Result<Built> {
    use crate::structure::StructureName;

    let Variant {
        structure, builder, ..
    } = variant;
    match structure {
        StructureName::Obvhs => obvhs::build(builder, mesh, threads),
        StructureName::Bvh => bvh::build(mesh, threads),
        StructureName::Parry3d => parry3d::build(mesh, threads),
        _ => embree::build(structure, builder, mesh, threads),
    }
}

/// Builds what a rival has for several hits of a ray: Embree's medium BVH, with a filter that keeps the nearest.
#[cfg(feature = "peers")]
pub(crate) fn ordered_hits(mesh: &Mesh, threads: usize) -> anyhow::Result<Box<dyn OrderedHits>> {
    embree::ordered_hits(mesh, threads)
}

/// Of a structure that does not show what it is like: all 0 but its size.
#[cfg(feature = "peers")]
fn shape_of(bytes_total: usize) -> crate::structure::Shape {
    crate::structure::Shape {
        bytes_total,
        ..crate::structure::Shape::unknown()
    }
}

/// There are no rivals to build.
#[cfg(not(feature = "peers"))]
pub(crate) fn build(_: Variant, _: &Mesh, _: usize) -> anyhow::Result<Built> {
    Err(refusal())
}

/// There are no rivals to build.
#[cfg(not(feature = "peers"))]
pub(crate) fn ordered_hits(_: &Mesh, _: usize) -> anyhow::Result<Box<dyn OrderedHits>> {
    Err(refusal())
}

#[cfg(all(test, not(feature = "peers")))]
mod tests {
    use super::*;

    #[test]
    fn without_the_feature_the_message_says_what_builds_with_it() {
        let refused = check_available().expect_err("nothing built in").to_string();
        for part in ["cargo xtask bench --peers", "feature `peers`"] {
            assert!(refused.contains(part), "{part} in: {refused}");
        }
    }
}
