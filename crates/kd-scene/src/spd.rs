//! The Standard Procedural Databases (SPD) of Eric Haines: eleven procedural scenes with a size parameter.
//!
//! The tessellation of primitives follows the tools of the SPD: see [`tessellate`](crate::tessellate). Positions are computed
//! in `f64` and rounded once. Sine, cosine, tangent and exponential come from `libm`, a port in Rust, because those of the
//! standard library differ in the last bit between platforms, and a benchmark must build the same tree everywhere.

mod balls;
mod gears;
mod jacks;
mod lattice;
mod mount;
mod rings;
mod shells;
mod sombrero;
mod teapot;
mod tetra;
mod tree;

use std::fmt;
use std::str::FromStr;

use glam::Vec3;
use kd_core::{Mesh, MeshError};
use thiserror::Error;

use crate::Camera;

/// A generated mesh with a camera and lights.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSetup {
    /// Scene and size, for example `balls-4`.
    pub name: String,
    /// The triangles, in the order in which the scene generates them.
    pub mesh: Mesh,
    /// The camera that the SPD specifies.
    pub camera: Camera,
    /// Positions of the point lights, at least one.
    pub lights: Vec<Vec3>,
}

/// One of the procedural scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Spd {
    /// Recursive spheres on spheres over a large floor: very uneven density.
    Balls,
    /// Gears in a cube: coplanar caps, long thin triangles, and flat faces on shared planes.
    Gears,
    /// A fractal height field and four spheres.
    Mount,
    /// A pyramid of interlocking rings in front of a wall.
    Rings,
    /// Newell's teapot on a board.
    Teapot,
    /// A Sierpinski tetrahedron: many shared corners, no axis-aligned triangles.
    Tetra,
    /// A tree of cones on a huge field: long thin triangles, very uneven density.
    Tree,
    /// A regular lattice of spheres and cylinders: uniform density, axis-aligned.
    Lattice,
    /// A spiral of heavily overlapping spheres, over several orders of magnitude in size: few planes separate them.
    Shells,
    /// A smooth height field on a uniform grid.
    Sombrero,
    /// Nested crosses of cylinders and spheres.
    Jacks,
}

/// Why a scene cannot be generated.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SpdError {
    /// The size is 0.
    #[error("scene {scene}: size must be at least 1")]
    SizeZero {
        /// The requested scene.
        scene: Spd,
    },
    /// The scene has more than [`Spd::MAX_TRIANGLES`] triangles at this size.
    #[error(
        "scene {scene} of size {size} has more than {} triangles",
        Spd::MAX_TRIANGLES
    )]
    TooLarge {
        /// The requested scene.
        scene: Spd,
        /// The requested size.
        size: u32,
    },
    /// No scene has this name.
    #[error("unknown scene `{name}`, expected one of {}", names())]
    UnknownName {
        /// The requested name.
        name: String,
    },
    /// [`Mesh`] refuses the generated triangles, which is a fault of this crate.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

fn names() -> String {
    Spd::ALL.map(Spd::name).join(", ")
}

impl Spd {
    /// Maximum number of triangles of [`generate`](Self::generate), 2^25. Their arrays take up to 0.8 GB.
    pub const MAX_TRIANGLES: u64 = 1 << 25;

    /// All scenes, in the order of the SPD.
    pub const ALL: [Self; 11] = [
        Self::Balls,
        Self::Gears,
        Self::Mount,
        Self::Rings,
        Self::Teapot,
        Self::Tetra,
        Self::Tree,
        Self::Lattice,
        Self::Shells,
        Self::Sombrero,
        Self::Jacks,
    ];

    /// The name in lower case, which [`FromStr`] parses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Balls => "balls",
            Self::Gears => "gears",
            Self::Mount => "mount",
            Self::Rings => "rings",
            Self::Teapot => "teapot",
            Self::Tetra => "tetra",
            Self::Tree => "tree",
            Self::Lattice => "lattice",
            Self::Shells => "shells",
            Self::Sombrero => "sombrero",
            Self::Jacks => "jacks",
        }
    }

    /// The default size of the original program.
    pub const fn default_size(self) -> u32 {
        match self {
            Self::Balls | Self::Gears => 4,
            Self::Mount | Self::Teapot | Self::Tetra => 6,
            Self::Rings => 7,
            Self::Tree => 11,
            Self::Lattice => 12,
            Self::Shells => 5,
            Self::Sombrero | Self::Jacks => 1,
        }
    }

    /// The number of triangles of the scene at `size`. `None` if `size` is 0, or the number exceeds
    /// [`MAX_TRIANGLES`](Self::MAX_TRIANGLES). Computed in constant time.
    pub fn triangles(self, size: u32) -> Option<u64> {
        // Every scene has at least size^2 triangles, so larger sizes exceed the maximum. Smaller sizes do not overflow 64 bits
        // below, because `power` is bounded.
        if size == 0 || size > 1 << 13 {
            return None;
        }
        let power = |base: u64| {
            base.checked_pow(size)
                .filter(|&power| power <= Self::MAX_TRIANGLES)
        };
        let s = u64::from(size);
        let (sphere, cone, small_jack) = (192, 32, 336);
        let count = match self {
            Self::Balls => sphere * ((9 * power(9)? - 1) / 8) + 2,
            Self::Gears => 572 * s.pow(3) + 2,
            Self::Mount => 2 * power(4)? + 4 * sphere,
            Self::Rings => 5 * s * (s + 1) * (2 * s + 1) * (sphere + cone) + 2,
            Self::Teapot => 66 * s * s - 8 * s,
            Self::Tetra => power(4)?,
            Self::Tree => (2 * power(2)? - 1) * (sphere + cone) + 2,
            Self::Lattice => sphere * (s + 1).pow(3) + cone * 3 * s * (s + 1).pow(2),
            Self::Shells => sphere * (180 * power(2)? + 1),
            Self::Sombrero => 2 * (16 * power(2)? - 1).pow(2),
            Self::Jacks => small_jack * ((power(8)? - 1) / 7),
        };
        (count <= Self::MAX_TRIANGLES).then_some(count)
    }

    /// Generates the scene, identical bit for bit on every platform. Its mesh has exactly [`triangles`](Self::triangles)
    /// triangles; time and memory are linear in that number.
    ///
    /// # Errors
    ///
    /// [`SpdError::SizeZero`], or [`SpdError::TooLarge`] before any allocation.
    ///
    /// ```
    /// use kd_scene::Spd;
    ///
    /// let scene = Spd::Tetra;
    /// let setup = scene.generate(scene.default_size())?;
    /// assert_eq!((setup.name.as_str(), setup.mesh.len()), ("tetra-6", 4096));
    /// assert!(scene.generate(100).is_err());
    /// # Ok::<(), kd_scene::SpdError>(())
    /// ```
    pub fn generate(self, size: u32) -> Result<SceneSetup, SpdError> {
        if size == 0 {
            return Err(SpdError::SizeZero { scene: self });
        }
        if self.triangles(size).is_none() {
            return Err(SpdError::TooLarge { scene: self, size });
        }
        let (draft, setup) = match self {
            Self::Balls => balls::make(size),
            Self::Gears => gears::make(size),
            Self::Mount => mount::make(size),
            Self::Rings => rings::make(size),
            Self::Teapot => teapot::make(size),
            Self::Tetra => tetra::make(size),
            Self::Tree => tree::make(size),
            Self::Lattice => lattice::make(size),
            Self::Shells => shells::make(size),
            Self::Sombrero => sombrero::make(size),
            Self::Jacks => jacks::make(size),
        };
        Ok(SceneSetup {
            name: format!("{self}-{size}"),
            mesh: draft.into_mesh()?,
            camera: setup.camera,
            lights: setup.lights,
        })
    }
}

impl fmt::Display for Spd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Spd {
    type Err = SpdError;

    fn from_str(name: &str) -> Result<Self, SpdError> {
        let mut all = Self::ALL.into_iter();
        all.find(|scene| scene.name() == name)
            .ok_or_else(|| SpdError::UnknownName {
                name: name.to_owned(),
            })
    }
}

/// The camera and the lights of a scene.
pub(crate) struct CameraAndLights {
    pub(crate) camera: Camera,
    pub(crate) lights: Vec<Vec3>,
}

/// A camera with a field of view of 45 degrees and up along +z, as in most scenes, and lights.
pub(crate) fn camera_and_lights(
    eye: [f32; 3],
    target: [f32; 3],
    lights: &[[f32; 3]],
) -> CameraAndLights {
    CameraAndLights {
        camera: Camera {
            eye: eye.into(),
            target: target.into(),
            up: Vec3::Z,
            fov_degrees: 45.0,
        },
        lights: lights.iter().map(|&light| light.into()).collect(),
    }
}

#[cfg(test)]
mod tests;
