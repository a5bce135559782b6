//! Scenes to build kd-trees for: mesh files, scenes that move, the eleven procedural scenes of the SPD, cameras.
//!
//! [`load_mesh`] reads the triangles of a file; its errors name the line or element, and no content causes a panic. [`Spd`]
//! generates Eric Haines' Standard Procedural Databases, the scenes that ray tracers have been compared on since 1987, the same
//! bit for bit on every platform. [`Camera`] looks at a scene, or at anything with a box, and gives directions for rays; [`Lidar`] gives
//! the rays of a spinning scanner.
//!
//! With the feature `scenes`, on by default, `load_mesh` also reads AFF, NFF, 3MF and glTF 2.0, and `load_scene` reads all of a scene: a
//! `SceneDescription` has parts with their materials, lights, a camera, and their motion. `toy_room` generates one.
//!
//! ```
//! use kd_scene::{Camera, Spd, read_obj};
//!
//! let gears = Spd::Gears.generate(2)?;
//! assert_eq!(gears.mesh.len(), 8 * 572 + 2);
//! let direction = gears.camera.ray_direction(0.5, 0.5);
//! assert!((direction.length() - 1.0).abs() < 1e-6, "the middle of the image");
//!
//! let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
//! let mesh = read_obj(quad.as_bytes(), "quad.obj")?;
//! assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
//! let camera = Camera::looking_at_whole(mesh.bounds(), glam::Vec3::Y);
//! assert_eq!(camera.target, glam::Vec3::new(0.5, 0.5, 0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

#[cfg(feature = "scenes")]
mod aff;
#[cfg(feature = "scenes")]
mod alpha;
mod camera;
#[cfg(feature = "scenes")]
mod description;
#[cfg(feature = "scenes")]
mod draft;
mod error;
mod file_mesh;
#[cfg(feature = "scenes")]
mod files;
mod format;
#[cfg(feature = "scenes")]
mod gltf;
mod hostile;
#[cfg(feature = "scenes")]
mod keys;
mod lidar;
mod load;
#[cfg(feature = "scenes")]
mod load_scene;
mod memory;
mod obj;
mod off;
mod ply;
mod polygon;
mod report;
mod rooms;
mod source;
mod spd;
mod stl;
mod tessellate;
mod text_lines;
#[cfg(feature = "scenes")]
mod threemf;
#[cfg(feature = "scenes")]
mod toy_room;
#[cfg(feature = "scenes")]
mod whole_mesh;
mod words;

#[cfg(feature = "scenes")]
pub use aff::{AffOptions, load_aff, read_aff};
#[cfg(feature = "scenes")]
pub use alpha::AlphaMode;
pub use camera::{Camera, View, light_above};
#[cfg(feature = "scenes")]
pub use description::{
    ColorSpace, Deformation, InstancePlace, Light, LightKind, Material, Morph, MorphKey,
    MorphTargets, Node, Part, SceneDescription, Skin, Span, Surface, Texture, TextureSource,
};
pub use error::LoadError;
#[cfg(feature = "scenes")]
pub use gltf::read_gltf;
pub use hostile::Hostile;
#[cfg(feature = "scenes")]
pub use keys::Keys;
pub use lidar::Lidar;
pub use load::{LoadOptions, load_mesh, load_mesh_with};
#[cfg(feature = "scenes")]
pub use load_scene::{load_scene, load_scene_with};
pub use obj::read_obj;
#[cfg(feature = "scenes")]
pub use obj::read_obj_scene;
pub use off::read_off;
pub use ply::read_ply;
pub use report::{Loaded, Place, Strictness, Warning, WarningCode};
pub use rooms::Room;
pub use spd::{SceneSetup, Spd, SpdError};
pub use stl::read_stl;
#[cfg(feature = "scenes")]
pub use threemf::read_3mf;
#[cfg(feature = "scenes")]
pub use toy_room::{toy_room, toy_room_aff};
#[cfg(feature = "scenes")]
pub use whole_mesh::WholeMeshError;
