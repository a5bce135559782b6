//! A renderer for [`kd_scene`] descriptions, and views of the trees that it traces.
//!
//! A [`Stage`] holds a scene description, the trees over its parts, and its decoded textures. [`Stage::show`] moves the scene
//! to a time of its animation; the cost is proportional to the triangles that move. [`render`] makes a [`Picture`] by Whitted
//! ray tracing (direct light, mirrors, glass) or by path tracing of diffuse surfaces. Rays are traced in batches, one bucket of
//! pixels at a time. Pictures are identical for every number of threads.
//!
//! Alpha ([`AlphaMode`](kd_scene::AlphaMode)) makes holes in surfaces, and blends them with what is behind: hits of all rays pass a
//! filter. A scene without such a material is rendered without one.
//!
//! The renderer sends its rays to a [`Tracer`], which every [`RayQuery`](kd_trace::RayQuery) over parts implements.
//!
//! ```no_run
//! use kd_render::{RenderOptions, Stage, render};
//! use kd_scene::{AffOptions, load_aff};
//!
//! let scene = load_aff("kitchen.aff", &AffOptions::default())?;
//! let mut stage = Stage::new(scene, Default::default(), Default::default())?;
//! for frame in 0..10 {
//!     stage.show(f64::from(frame) / 25.0)?;
//!     let options = RenderOptions::default();
//!     let rendering = render(&stage, &stage.tracer(), &stage.camera(), &options, &|_| {});
//!     rendering.picture.save(format!("{frame:04}.png"))?;
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod alpha;
mod light;
mod path_tracer;
mod picture;
mod placed;
mod random;
mod render;
mod shadows;
mod shown;
mod spot;
mod stage;
mod surface;
mod texture;
mod tracer;
mod views;
mod whitted;

pub use picture::Picture;
pub use render::{RayCounts, RenderMethod, RenderOptions, Rendering, render};
pub use stage::{Stage, StageError};
pub use tracer::{FrameTracer, HitFilter, PartHit, Tracer};
pub use views::{Heat, draw_boxes, heat_color, heat_map, leaf_depths};
