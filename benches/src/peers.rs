//! Rival libraries, compiled in with the feature `peers`.
//!
//! A rival first gets a copy of the mesh in its own form of input. Its clock starts then, and stops when it is ready to trace.

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
pub(crate) use available::{build, check_available, filtered, following};
#[cfg(not(feature = "peers"))]
pub(crate) use missing::{build, check_available, filtered, following};

use kd::{Hit, Mesh};
use kd_trace::RayQuery;

use crate::names::Variant;
use crate::structure::{Built, Structure};

/// A structure with the query for several hits.
type Filtered = Box<dyn RayQuery<Hit = Hit>>;

/// A structure over a static and a moving mesh.
pub(crate) trait Following {
    /// Moves the vertices of the moving mesh and updates the structure: the timed part.
    fn update(&mut self, positions: &[[f32; 3]]) -> anyhow::Result<()>;
    fn structure(&self) -> &dyn Structure;
}

/// The ways in which Embree follows a moving mesh: everything rebuilt, the moving mesh rebuilt, the moving mesh refitted.
pub(crate) const FOLLOWING: [&str; 3] = ["rebuild", "medium", "refit"];

#[cfg(feature = "peers")]
mod available {
    use super::{Built, Filtered, Following, Mesh, Variant, bvh, embree, obvhs, parry3d};
    use crate::names::StructureName;
    use crate::structure::Shape;

    /// Whether rivals can be measured; the error says what to do if not.
    pub(crate) fn check_available() -> anyhow::Result<()> {
        Ok(super::embree_api::check_installed()?)
    }

    /// Builds a rival's structure over a mesh.
    pub(crate) fn build(variant: Variant, mesh: &Mesh, threads: usize) -> anyhow::Result<Built> {
        let builder = variant.builder;
        match variant.structure {
            StructureName::Obvhs => obvhs::build(builder, mesh, threads),
            StructureName::Bvh => bvh::build(mesh, threads),
            StructureName::Parry3d => parry3d::build(mesh, threads),
            structure => embree::build(structure, builder, mesh, threads),
        }
    }

    /// Embree's medium BVH, with a filter that keeps the nearest hits of a ray.
    pub(crate) fn filtered(mesh: &Mesh, threads: usize) -> anyhow::Result<Filtered> {
        embree::filtered(mesh, threads)
    }

    /// Embree over a static and a moving mesh, in one of the ways of [`FOLLOWING`](super::FOLLOWING).
    pub(crate) fn following(
        way: &str,
        [fixed, moving]: [&Mesh; 2],
    ) -> anyhow::Result<Box<dyn Following>> {
        Ok(Box::new(embree::Moved::new(way, fixed, moving)?))
    }

    /// The shape of a structure that reveals only its size.
    pub(super) fn shape_of(bytes_total: usize) -> Shape {
        Shape {
            bytes_total,
            ..Shape::default()
        }
    }
}

#[cfg(feature = "peers")]
use available::shape_of;

#[cfg(not(feature = "peers"))]
mod missing {
    use super::{Built, Filtered, Following, Mesh, Variant};
    use crate::arguments::UsageError;

    /// Whether rivals can be measured; the error says what to do if not.
    pub(crate) fn check_available() -> anyhow::Result<()> {
        let message = "no rival libraries are compiled in; `cargo xtask bench --peers` compiles them, \
                       which is the feature `peers` of kd-bench";
        Err(UsageError(message.into()).into())
    }

    /// Refuses.
    pub(crate) fn build(_: Variant, _: &Mesh, _: usize) -> anyhow::Result<Built> {
        Err(check_available().expect_err("none are compiled in"))
    }

    /// Refuses.
    pub(crate) fn filtered(_: &Mesh, _: usize) -> anyhow::Result<Filtered> {
        Err(check_available().expect_err("none are compiled in"))
    }

    /// Refuses.
    pub(crate) fn following(_: &str, _: [&Mesh; 2]) -> anyhow::Result<Box<dyn Following>> {
        Err(check_available().expect_err("none are compiled in"))
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
