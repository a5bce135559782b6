//! Pictures of scenes, by rays through kd: what is seen, and what the trees behind it look like.
//!
//! A [`Stage`] is a scene of [`kd_scene`] with trees over its parts and its textures read; [`Stage::show`] moves it to a time of
//! its animation, which costs what moves. [`render`] makes a [`Picture`] of it: Whitted's light, mirrors and glass, or light that
//! dull surfaces scatter. Rays go in batches, tile by tile, and pictures do not depend on the number of threads.
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

mod path_tracer;
mod picture;
mod random;
mod render;
mod shadows;
mod stage;
mod surface;
mod texture;
mod tracer;
mod views;
mod whitted;

pub use picture::Picture;
pub use render::{RayCounts, RenderMethod, RenderOptions, Rendering, render};
pub use stage::{Stage, StageError};
pub use tracer::{FrameTracer, PartHit, Tracer};
pub use views::{Heat, draw_boxes, heat_color, heat_map, leaf_depths};
