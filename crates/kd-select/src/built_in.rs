//! The calibration that comes with the library, as Rust data.

mod data;

use crate::calibration::{Features, RayScheme};
use crate::times::{Opening, Structure, Times};

pub(crate) use data::{COMMIT, CPU, DATE, LEVEL, SCENES, THREADS, VERSION};

/// A measured scene.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) rays: RayScheme,
    pub(crate) features: Features,
    pub(crate) times: &'static [(Structure, Times)],
}

const fn features(
    triangles: u64,
    refs_per_triangle: f64,
    sigma: f64,
    sparseness: f64,
    hit_share: f64,
) -> Features {
    Features {
        triangles,
        refs_per_triangle,
        sigma,
        sparseness,
        hit_share,
    }
}

/// The build, a ray, and the opening cost with its number of rays.
const fn lazy(build_seconds: f64, ray_seconds: f64, seconds: f64, rays: f64) -> Times {
    Times {
        build_seconds,
        ray_seconds,
        opening: Some(Opening { seconds, rays }),
    }
}
