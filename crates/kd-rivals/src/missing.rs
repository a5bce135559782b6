//! The functions of rivals without their features: each is an error.

#[cfg(not(feature = "crates"))]
pub(crate) mod crates {
    use kd_core::Mesh;

    use crate::{Built, ObvhsBuild, Options, PointQueries, RivalError};

    const MISSING: RivalError = RivalError::NotCompiled("crates");

    pub(crate) fn check() -> Result<(), RivalError> {
        Err(MISSING)
    }

    pub(crate) fn obvhs(_: ObvhsBuild, _: &Mesh, _: Options) -> Result<Built, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn bvh(_: &Mesh, _: Options) -> Result<Built, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn parry3d(_: &Mesh, _: Options) -> Result<Built, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn parry3d_points(_: &Mesh) -> Result<Box<dyn PointQueries>, RivalError> {
        Err(MISSING)
    }
}

#[cfg(not(feature = "tinybvh"))]
pub(crate) mod tinybvh {
    use kd_core::Mesh;

    use crate::{Built, Options, RivalError, TinybvhBuild};

    pub(crate) fn build(_: TinybvhBuild, _: &Mesh, _: Options) -> Result<Built, RivalError> {
        Err(RivalError::NotCompiled("tinybvh"))
    }
}

#[cfg(not(feature = "embree"))]
pub(crate) mod embree {
    use kd_core::Mesh;

    use crate::{Built, EmbreeBuild, Following, Moving, PointQueries, Purpose, RivalError};

    const MISSING: RivalError = RivalError::NotCompiled("embree");

    pub(crate) fn name() -> Result<String, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn build(
        _: EmbreeBuild,
        _: Purpose,
        _: &Mesh,
        _: usize,
    ) -> Result<Built, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn build_primitives<P>(_: P, _: usize) -> Result<Built, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn points(_: &Mesh, _: usize) -> Result<Box<dyn PointQueries>, RivalError> {
        Err(MISSING)
    }

    pub(crate) fn follow(_: Following, _: &Mesh, _: &Mesh) -> Result<Box<dyn Moving>, RivalError> {
        Err(MISSING)
    }
}
