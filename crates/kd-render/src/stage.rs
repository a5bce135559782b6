//! A scene ready to render: its description, its trees and its textures.

use std::sync::Arc;

use kd::glam::{Affine3A, DVec3, Mat3A, Vec3};
use kd::scene::{CommitError, CommitReport, SceneError};
use kd::{Aabb, BuildOptions, Mesh, MeshError, PartId, Scene, Strategy};
use kd_scene::{AlphaMode, Camera, Light, Part, SceneDescription, TextureSource, light_above};
use thiserror::Error;

use crate::light::ShownLight;
use crate::texture::TextureImage;
use crate::tracer::FrameTracer;

/// A scene ready to render, at one time of its animation.
#[derive(Debug)]
pub struct Stage {
    description: SceneDescription,
    scene: Scene,
    /// For each part of the description, its id in the scene and its current transform; `None` while it is invisible.
    parts: Vec<Option<(PartId, Affine3A)>>,
    /// The visible parts in order of their ids, each with its index in the description.
    part_indices: Vec<(PartId, usize)>,
    shown: Vec<ShownPart>,
    textures: Vec<Option<TextureImage>>,
    /// Whether a material has holes or blends.
    has_alpha: bool,
    time: f64,
    warnings: Vec<String>,
    /// Position of a default light, for scenes without lights.
    default_light: Option<Vec3>,
}

/// The geometry of a part at the current time.
#[derive(Clone, Debug)]
pub(crate) struct ShownPart {
    /// Triangles in scene coordinates.
    pub(crate) mesh: Arc<Mesh>,
    /// Transforms vertex normals to scene coordinates.
    pub(crate) inverse_transpose: Mat3A,
    /// Vertex normals of a deformed part, in the coordinates of its node; empty if the part does not deform.
    pub(crate) morphed_normals: Vec<[Vec3; 3]>,
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
            parts: vec![None; description.parts.len()],
            description,
            scene,
            part_indices: Vec::new(),
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
        for (index, part) in self.description.parts.iter().enumerate() {
            let transform = SceneDescription::placed_part(part, &nodes);
            let is_visible = self.description.is_visible(part, time);
            let transform = is_visible.then_some(transform);
            let deformed = part.deformed(time, &nodes);
            let placed = &mut self.parts[index];
            update(&mut self.scene, placed, part, transform, deformed, time)?;
        }
        let report = self.scene.commit();
        let report = report.map_err(|error| StageError::Commit { time, error })?;
        let frame = self.scene.frame();
        let parts = self.description.parts.iter().zip(&self.parts);
        self.shown = parts
            .map(|(part, placed)| {
                let transform = SceneDescription::placed_part(part, &nodes);
                let mesh = placed.and_then(|(id, _)| frame.mesh(id));
                ShownPart {
                    mesh: Arc::clone(mesh.unwrap_or(&part.mesh)),
                    inverse_transpose: inverse_transpose(&transform),
                    morphed_normals: part.deformed_normals(time, &nodes).unwrap_or_default(),
                }
            })
            .collect();
        let seen = self
            .parts
            .iter()
            .zip(0..)
            .filter_map(|(placed, index)| placed.map(|(id, _)| (id, index)));
        self.part_indices = seen.collect();
        self.part_indices.sort_unstable();
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
            part_indices: &self.part_indices,
            parts: &self.parts,
        }
    }

    pub(crate) fn shown(&self, part: usize) -> &ShownPart {
        &self.shown[part]
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

/// Adds a part, moves it, or removes it if `transform` is `None`. A part that did not move is left alone.
fn update(
    scene: &mut Scene,
    placed: &mut Option<(PartId, Affine3A)>,
    part: &Part,
    transform: Option<Affine3A>,
    deformed: Option<Vec<[f32; 3]>>,
    time: f64,
) -> Result<(), StageError> {
    let fail = |error| StageError::Scene {
        part: part.name.clone(),
        error,
    };
    let Some(transform) = transform else {
        if let Some((id, _)) = placed.take() {
            scene.remove(id).map_err(fail)?;
        }
        return Ok(());
    };
    let deformed = deformed.map(|positions| {
        part.mesh
            .with_positions(positions)
            .map_err(|error| StageError::Mesh {
                part: part.name.clone(),
                time,
                error,
            })
    });
    let deformed = deformed.transpose()?;
    let (id, before) = match *placed {
        None => {
            let mesh = deformed.map_or_else(|| Arc::clone(&part.mesh), Arc::new);
            let added = if part.may_move() {
                scene.add_dynamic(mesh)
            } else {
                scene.add_static(mesh)
            };
            (added.map_err(fail)?, Affine3A::IDENTITY)
        }
        Some(placed) => {
            if let Some(mesh) = deformed {
                scene
                    .set_positions(placed.0, mesh.positions())
                    .map_err(fail)?;
            }
            placed
        }
    };
    // Recorded before the transform is set: the part stays in the scene if that fails.
    *placed = Some((id, before));
    if transform != before {
        scene.set_transform(id, transform).map_err(fail)?;
        *placed = Some((id, transform));
    }
    Ok(())
}

/// The inverse transpose, which transforms normals; the matrix itself if it is singular.
fn inverse_transpose(transform: &Affine3A) -> Mat3A {
    let matrix = transform.matrix3.as_dmat3();
    if matrix.determinant() == 0.0 {
        return transform.matrix3;
    }
    let matrix = matrix.inverse().transpose();
    let column = |column: DVec3| column.as_vec3().into();
    Mat3A::from_cols(
        column(matrix.x_axis),
        column(matrix.y_axis),
        column(matrix.z_axis),
    )
}
