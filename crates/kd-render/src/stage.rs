//! A scene that can be seen: its description, its trees, and its textures.

use std::sync::Arc;

use kd::glam::{Affine3A, DVec3, Mat3A, Vec3};
use kd::scene::{CommitError, CommitReport, SceneError};
use kd::{Aabb, BuildOptions, Mesh, MeshError, PartId, Scene, Strategy};
use kd_scene::{Camera, Part, SceneDescription, TextureSource, light_above};
use thiserror::Error;

use crate::texture::TextureImage;
use crate::tracer::FrameTracer;

/// A scene that can be seen, at one time of its animation.
#[derive(Debug)]
pub struct Stage {
    description: SceneDescription,
    scene: Scene,
    /// For each part of the description its part of the scene, and where that is, unless it is not seen now.
    parts: Vec<Option<(PartId, Affine3A)>>,
    /// Those that are seen, in the order of their ids, and their numbers.
    numbers: Vec<(PartId, usize)>,
    shown: Vec<ShownPart>,
    textures: Vec<Option<TextureImage>>,
    time: f64,
    warnings: Vec<String>,
    /// A light for scenes that have none.
    spare_light: Option<Vec3>,
}

/// A part as it is seen now.
#[derive(Clone, Debug)]
pub(crate) struct ShownPart {
    /// Where its triangles are.
    pub(crate) mesh: Arc<Mesh>,
    /// For the normals of its corners.
    pub(crate) inverse_transpose: Mat3A,
    /// Normals of what changes its shape, in the coordinates of its node.
    pub(crate) morphed_normals: Vec<[Vec3; 3]>,
}

/// A light as it shines now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShownLight {
    pub(crate) position: Vec3,
    pub(crate) color: Vec3,
}

/// Why a scene cannot be seen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StageError {
    /// A part cannot be added.
    #[error("part `{part}`: {error}")]
    Scene {
        /// What the file calls it.
        part: String,
        /// What is wrong with it.
        error: SceneError,
    },
    /// A part is moved to where f32 ends.
    #[error("part `{part}` at {time} s: {error}")]
    Mesh {
        /// What the file calls it.
        part: String,
        /// When, in seconds.
        time: f64,
        /// What is wrong with it.
        error: MeshError,
    },
    /// A frame cannot be made.
    #[error("at {time} s: {error}")]
    Commit {
        /// When, in seconds.
        time: f64,
        /// What the scene says.
        error: CommitError,
    },
}

impl Stage {
    /// Builds what stands still, and shows the scene as it is when its animation begins.
    ///
    /// What cannot be found, textures above all, is made do without, with a [warning](Self::warnings).
    ///
    /// # Errors
    ///
    /// [`StageError`] if there are too many triangles, or if a tree cannot be built.
    pub fn new(
        description: SceneDescription,
        options: BuildOptions,
        strategy: Strategy,
    ) -> Result<Self, StageError> {
        let mut warnings = description.warnings.clone();
        let textures = description.textures.iter().map(|texture| {
            let loaded = TextureImage::load(&texture.source, description.colors);
            loaded
                .map_err(|error| {
                    let name = match &texture.source {
                        TextureSource::File(path) => path.display().to_string(),
                        TextureSource::Bytes(_) => texture.name.clone(),
                    };
                    warnings.push(format!("{name}: {error}; a plain colour is used"));
                })
                .ok()
        });
        let textures = textures.collect();
        let mut scene = Scene::new(options);
        scene.set_strategy(strategy);
        let start = description.span.map_or(0.0, |span| span.start);
        let mut stage = Self {
            parts: vec![None; description.parts.len()],
            description,
            scene,
            numbers: Vec::new(),
            shown: Vec::new(),
            textures,
            time: start,
            warnings,
            spare_light: None,
        };
        stage.show(start)?;
        if stage.description.lights.is_empty() {
            let light = match stage.description.camera_at(start) {
                Some(camera) => camera.eye,
                None => light_above(stage.bounds(), Vec3::Y),
            };
            stage.spare_light = Some(light);
            let warning = "the scene has no light; one is put where it is seen from";
            stage.warnings.push(warning.to_owned());
        }
        Ok(stage)
    }

    /// Moves everything to where it is at a time, in seconds, and tells what that took.
    ///
    /// # Errors
    ///
    /// [`StageError`] if something is moved to where f32 ends.
    pub fn show(&mut self, time: f64) -> Result<CommitReport, StageError> {
        let nodes = self.description.placed_nodes(time);
        for (place, part) in self.description.parts.iter().enumerate() {
            let transform = SceneDescription::placed_part(part, &nodes);
            let is_visible = self.description.is_visible(part, time);
            let transform = is_visible.then_some(transform);
            let deformed = part.deformed(time, &nodes);
            let placed = &mut self.parts[place];
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
            .filter_map(|(placed, number)| placed.map(|(id, _)| (id, number)));
        self.numbers = seen.collect();
        self.numbers.sort_unstable();
        self.time = time;
        Ok(report)
    }

    /// What is seen, as a file describes it.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The trees of what is seen.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The time that is shown, in seconds.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// What was made do without.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The box around everything that is seen.
    pub fn bounds(&self) -> Aabb {
        self.scene.frame().bounds()
    }

    /// The camera of the scene at this time, or one that sees all of it.
    pub fn camera(&self) -> Camera {
        let own = self.description.camera_at(self.time);
        own.unwrap_or_else(|| Camera::looking_at_whole(self.bounds(), Vec3::Y))
    }

    /// What answers rays, as the scene is now.
    pub fn tracer(&self) -> FrameTracer<'_> {
        FrameTracer {
            frame: self.scene.frame().data(),
            numbers: &self.numbers,
        }
    }

    pub(crate) fn shown(&self, part: usize) -> &ShownPart {
        &self.shown[part]
    }

    pub(crate) fn texture(&self, number: u32) -> Option<&TextureImage> {
        self.textures.get(number as usize)?.as_ref()
    }

    /// The lights, or the first so many of them.
    pub(crate) fn lights(&self, most: usize) -> Vec<ShownLight> {
        let spare = self.spare_light.map(|position| ShownLight {
            position,
            color: Vec3::ONE,
        });
        let own = self.description.lights.iter().map(|light| ShownLight {
            position: light.position_at(self.time),
            color: light.color,
        });
        own.chain(spare).take(most).collect()
    }
}

/// Brings a part to where it is, adds it or, without a transform, takes it out. What has not moved is not touched.
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
    // It is in the scene, whether or not it can be moved.
    *placed = Some((id, before));
    if transform != before {
        scene.set_transform(id, transform).map_err(fail)?;
        *placed = Some((id, transform));
    }
    Ok(())
}

/// What turns normals as a transform turns surfaces; of those that flatten, something.
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
