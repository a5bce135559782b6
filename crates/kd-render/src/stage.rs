//! A scene ready to render: its description, its trees and its textures.

use kd::glam::{Mat3A, Vec3};
use kd::scene::{CommitError, CommitReport, SceneError};
use kd::{Aabb, BuildOptions, MeshError, Scene, Strategy};
use kd_scene::{
    AlphaMode, Camera, InstancePlace, Light, Part, SceneDescription, TextureSource, light_above,
};
use thiserror::Error;

use crate::light::ShownLight;
use crate::placed::{PlacedPart, SeenInstance};
use crate::shown::ShownPart;
use crate::texture::TextureImage;
use crate::tracer::{FrameTracer, PartHit};

/// A scene ready to render, at one time of its animation.
#[derive(Debug)]
pub struct Stage {
    description: SceneDescription,
    scene: Scene,
    /// For each part of the description, its instances in the scene.
    parts: Vec<PlacedPart>,
    /// The visible instances in order of their ids.
    seen: Vec<SeenInstance>,
    shown: Vec<ShownPart>,
    textures: Vec<Option<TextureImage>>,
    /// Whether a material has holes or blends.
    has_alpha: bool,
    time: f64,
    warnings: Vec<String>,
    /// Position of a default light, for scenes without lights.
    default_light: Option<Vec3>,
}

/// Why a [`Stage`] cannot be built or moved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StageError {
    /// The scene refuses a part.
    #[error("part `{part}`: {error}")]
    Scene {
        /// Name of the part in the file.
        part: String,
        /// Error of the scene.
        error: SceneError,
    },
    /// A deformed part has a position that is not finite in `f32`.
    #[error("part `{part}` at {time} s: {error}")]
    Mesh {
        /// Name of the part in the file.
        part: String,
        /// Time in seconds.
        time: f64,
        /// Error of the mesh.
        error: MeshError,
    },
    /// The scene cannot be committed.
    #[error("at {time} s: {error}")]
    Commit {
        /// Time in seconds.
        time: f64,
        /// Error of the commit.
        error: CommitError,
    },
}

impl StageError {
    /// An error of the scene about a part.
    pub(crate) fn of_scene(part: &Part) -> impl Fn(SceneError) -> Self {
        |error| Self::Scene {
            part: part.name.clone(),
            error,
        }
    }
}

impl Stage {
    /// Builds all trees, decodes the textures, and shows the scene at the start of its animation.
    ///
    /// `options` selects the builder of static parts, `strategy` the way frames are made. A texture that cannot be read is
    /// replaced by white, with a [warning](Self::warnings). A scene without lights gets a white one, at the camera or above the
    /// bounding box.
    ///
    /// # Errors
    ///
    /// [`StageError`] if the scene has too many triangles, or if a tree cannot be built.
    pub fn new(
        description: SceneDescription,
        options: BuildOptions,
        strategy: Strategy,
    ) -> Result<Self, StageError> {
        let warnings = description.warnings.iter();
        let mut warnings: Vec<String> = warnings.map(ToString::to_string).collect();
        let textures = description.textures.iter().map(|texture| {
            let loaded = TextureImage::load(&texture.source, description.colors);
            loaded
                .map_err(|error| {
                    let name = match &texture.source {
                        TextureSource::File(path) => path.display().to_string(),
                        TextureSource::Bytes(_) => texture.name.clone(),
                    };
                    warnings.push(format!("{name}: {error}; using a plain color instead"));
                })
                .ok()
        });
        let textures = textures.collect();
        let mut materials = description.materials.iter();
        let has_alpha = materials.any(|material| material.alpha_mode != AlphaMode::Opaque);
        let mut scene = Scene::new(options);
        scene.set_strategy(strategy);
        let start = description.span.map_or(0.0, |span| span.start);
        let mut stage = Self {
            parts: vec![PlacedPart::default(); description.parts.len()],
            description,
            scene,
            seen: Vec::new(),
            shown: Vec::new(),
            textures,
            has_alpha,
            time: start,
            warnings,
            default_light: None,
        };
        stage.show(start)?;
        if stage.description.lights.is_empty() {
            let light = match stage.description.camera_at(start) {
                Some(camera) => camera.eye,
                None => light_above(stage.bounds(), Vec3::Y),
            };
            stage.default_light = Some(light);
            let warning = "the scene has no light; adding one at the viewpoint";
            stage.warnings.push(warning.to_owned());
        }
        Ok(stage)
    }

    /// Moves all parts to their positions at `time`, in seconds, commits the frame, and reports what the commit did.
    ///
    /// # Errors
    ///
    /// [`StageError`] if a position at that time is not finite in `f32`.
    pub fn show(&mut self, time: f64) -> Result<CommitReport, StageError> {
        let nodes = self.description.placed_nodes(time);
        let mut shown = Vec::with_capacity(self.parts.len());
        for (part, placed) in self.description.parts.iter().zip(&mut self.parts) {
            let places = part.places(&nodes);
            // No ray hits a point, and a scene would copy each instance that is one, as those of a node that grows from nothing are.
            let is_point = |place: &InstancePlace| place.transform.matrix3 == Mat3A::ZERO;
            let are_points = !part.instances.is_empty() && places.iter().all(is_point);
            if self.description.is_visible(part, time) && !are_points {
                let deformed = part.deformed(time, &nodes);
                placed.show(&mut self.scene, part, &places, deformed, time)?;
            } else {
                placed.hide(&mut self.scene, part)?;
            }
            shown.push(ShownPart::new(part, &places, &nodes, time));
        }
        let report = self.scene.commit();
        let report = report.map_err(|error| StageError::Commit { time, error })?;
        let frame = self.scene.frame();
        for ((shown, part), placed) in shown
            .iter_mut()
            .zip(&self.description.parts)
            .zip(&self.parts)
        {
            let single = placed.id(0).filter(|_| part.instances.is_empty());
            shown.mesh = single.and_then(|id| frame.mesh(id)).cloned();
        }
        self.shown = shown;
        self.seen = SeenInstance::all(&self.parts);
        self.time = time;
        Ok(report)
    }

    /// The scene description.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The scene that holds the trees.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The current time in seconds.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Warnings of the reader and of [`new`](Self::new), in the order in which they arose.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The bounding box of all visible parts at the current time.
    pub fn bounds(&self) -> Aabb {
        self.scene.frame().bounds()
    }

    /// The camera of the scene at the current time, or one that sees all of [`bounds`](Self::bounds).
    pub fn camera(&self) -> Camera {
        let own = self.description.camera_at(self.time);
        own.unwrap_or_else(|| Camera::looking_at_whole(self.bounds(), Vec3::Y))
    }

    /// The current frame, for [`render`](crate::render). It borrows, and costs nothing.
    pub fn tracer(&self) -> FrameTracer<'_> {
        FrameTracer {
            frame: self.scene.frame().data(),
            seen: &self.seen,
            parts: &self.parts,
        }
    }

    pub(crate) fn shown(&self, part: usize) -> &ShownPart {
        &self.shown[part]
    }

    /// The corners of the triangle that was hit, in scene coordinates; `None` if its part is invisible.
    #[inline]
    pub(crate) fn corners(&self, hit: &PartHit) -> Option<[Vec3; 3]> {
        if let Some(mesh) = &self.shown[hit.part].mesh {
            return Some(mesh.corners(hit.hit.triangle));
        }
        let id = self.parts[hit.part].id(hit.instance)?;
        self.scene.frame().corners(id, hit.hit.triangle)
    }

    pub(crate) fn has_alpha(&self) -> bool {
        self.has_alpha
    }

    pub(crate) fn texture(&self, number: u32) -> Option<&TextureImage> {
        self.textures.get(number as usize)?.as_ref()
    }

    /// The first `max` lights at the current time.
    pub(crate) fn lights(&self, max: usize) -> Vec<ShownLight> {
        let default = self.default_light.map(|at| Light::point(at, Vec3::ONE));
        let nodes = self.description.placed_nodes(self.time);
        let lights = self.description.lights.iter().chain(&default);
        let shown = lights.map(|light| ShownLight::new(light, self.time, &nodes));
        shown.take(max).collect()
    }
}
