//! What is in a scene beside its triangles: materials, lights, a camera, and how all of it moves.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use kd_core::{Mesh, MeshError};

use crate::keys::Keys;
use crate::{Camera, SceneSetup};

/// A scene as a file describes it: parts with materials, lights and a camera, at any time of its animation.
#[derive(Clone, Debug, Default)]
pub struct SceneDescription {
    /// What rays see that meet nothing, as red, green and blue ([`colors`](Self::colors) says what these mean).
    pub background: Vec3,
    /// Light that comes from everywhere.
    pub ambient: Vec3,
    /// Where it is seen from, unless the animation says otherwise.
    pub camera: Option<Camera>,
    /// The size of the picture in pixels that the file asks for.
    pub resolution: Option<[u32; 2]>,
    /// Lights that are points.
    pub lights: Vec<Light>,
    /// What surfaces are made of.
    pub materials: Vec<Material>,
    /// Pictures on surfaces.
    pub textures: Vec<Texture>,
    /// Transforms, each after the one it is in.
    pub nodes: Vec<Node>,
    /// Everything that has triangles.
    pub parts: Vec<Part>,
    /// The key frames of the camera.
    pub camera_keys: Option<Arc<Keys>>,
    /// The node that the camera is in, along whose negative z axis it looks.
    pub camera_node: Option<usize>,
    /// When it begins and ends, and in how many frames.
    pub span: Option<Span>,
    /// What the numbers of its colours mean, those of its textures too.
    pub colors: ColorSpace,
    /// What the reader made do without.
    pub warnings: Vec<String>,
}

/// What the numbers of colours mean, from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSpace {
    /// What a display is told. Scenes from before displays were calibrated mean this, and their textures.
    #[default]
    Display,
    /// Amounts of light. Displays, and textures, have them as sRGB.
    Linear,
}

impl ColorSpace {
    /// The colour of a texel.
    pub fn decoded(self, texel: [u8; 3]) -> Vec3 {
        let color = Vec3::from(texel.map(f32::from)) / 255.0;
        match self {
            Self::Display => color,
            Self::Linear => Vec3::from(color.to_array().map(|x| {
                if x <= 0.040_45 {
                    x / 12.92
                } else {
                    libm::powf((x + 0.055) / 1.055, 2.4)
                }
            })),
        }
    }

    /// The pixel of a colour; what is too bright is cut off.
    pub fn encoded(self, color: Vec3) -> [u8; 3] {
        let of_display = |x: f32| match self {
            Self::Display => x,
            Self::Linear if x <= 0.003_130_8 => 12.92 * x,
            Self::Linear => 1.055 * libm::powf(x, 1.0 / 2.4) - 0.055,
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 255.5; NaN is 0"
        )]
        let byte = |x: f32| (of_display(x.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8;
        color.to_array().map(byte)
    }
}

/// A light that is a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Where it is, before it moves.
    pub position: Vec3,
    /// What it gives off, as red, green and blue.
    pub color: Vec3,
    /// By how much it is moved, at any time.
    pub keys: Option<Arc<Keys>>,
}

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// How much of the ambient light it gives back.
    pub ambient: Vec3,
    /// How much light it scatters.
    pub diffuse: Vec3,
    /// The colour of highlights, which are what is mirrored of lights.
    pub specular: Vec3,
    /// How much it mirrors of everything else.
    pub mirror: Vec3,
    /// Phong's exponent of highlights.
    pub shine: f32,
    /// How much light goes through, from 0 to 1.
    pub transmittance: f32,
    /// The index of refraction. 0 and 1 do not bend light.
    pub refraction: f32,
}

impl Default for Material {
    /// Light grey, and dull.
    fn default() -> Self {
        Self {
            ambient: Vec3::splat(0.2),
            diffuse: Vec3::splat(0.8),
            specular: Vec3::ZERO,
            mirror: Vec3::ZERO,
            shine: 0.0,
            transmittance: 0.0,
            refraction: 1.0,
        }
    }
}

/// A picture on a surface, not read yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// What the file calls it.
    pub name: String,
    /// Where it is.
    pub source: TextureSource,
}

/// Where a picture is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TextureSource {
    /// In a file, which may not be there.
    File(PathBuf),
    /// Here, as a file would have it.
    Bytes(Arc<[u8]>),
}

/// A transform, which may move.
#[derive(Clone, Debug)]
pub struct Node {
    /// What the file calls it.
    pub name: String,
    /// The node that it is in.
    pub parent: Option<usize>,
    /// Where it stands in there, before it moves.
    pub place: DAffine3,
    /// How it moves there, if it does.
    pub keys: Option<Arc<Keys>>,
}

/// Triangles that move together.
#[derive(Clone, Debug)]
pub struct Part {
    /// Names of the nodes that it is in, from the outermost.
    pub name: String,
    /// The innermost node that it is in; none if it stands still.
    pub node: Option<usize>,
    /// Its triangles, where they are before that node moves them.
    pub mesh: Arc<Mesh>,
    /// What its triangles look like.
    pub surface: Surface,
    /// How it changes its shape, if it does.
    pub deformation: Option<Deformation>,
}

/// How a part changes its shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Deformation {
    /// Each triangle goes its own way.
    Morph(Morph),
    /// Vertices follow bones.
    Skin(Skin),
}

/// Vertices that follow bones, each up to four (glTF 2.0, §3.7.3).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Nodes that are bones.
    pub joints: Vec<usize>,
    /// For each bone, from the coordinates of the mesh to its own.
    pub inverse_binds: Vec<DAffine3>,
    /// For each vertex, numbers among the bones and how much they count.
    pub influences: Vec<[(u16, f32); 4]>,
}

/// What triangles look like, one entry for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Numbers in [`SceneDescription::materials`].
    pub materials: Vec<u32>,
    /// Numbers in [`SceneDescription::textures`]; [`Self::NO_TEXTURE`] for none. Empty if there are none at all.
    pub textures: Vec<u32>,
    /// Normals at the corners, not necessarily unit, of smooth surfaces; zero where a triangle is flat. Empty if all are.
    pub normals: Vec<[Vec3; 3]>,
    /// Where the corners lie in the texture, from 0 to 1 and repeated beyond, the second counted from above. Empty without textures.
    pub uvs: Vec<[[f32; 2]; 3]>,
}

impl Surface {
    /// A triangle without a texture.
    pub const NO_TEXTURE: u32 = u32::MAX;
}

/// Triangles of which each goes its own way, straight from key to key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Morph {
    /// For each triangle of the part, its keys in the order of their times; at least one.
    pub keys: Vec<Vec<MorphKey>>,
}

/// A triangle at some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MorphKey {
    /// In seconds.
    pub time: f64,
    /// Where its corners are.
    pub corners: [Vec3; 3],
    /// The normals there, not necessarily unit.
    pub normals: [Vec3; 3],
}

/// When an animation runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The time of the first frame, in seconds.
    pub start: f64,
    /// The time of the last one.
    pub end: f64,
    /// How many frames there are.
    pub frames: usize,
}

impl Span {
    /// The time of a frame, from 0; frames after the last have the time of the last.
    pub fn time_of(&self, frame: usize) -> f64 {
        let last = self.frames.saturating_sub(1);
        if last == 0 {
            return self.start;
        }
        #[expect(
            clippy::cast_precision_loss,
            reason = "there are fewer than 2^52 frames"
        )]
        let part = frame.min(last) as f64 / last as f64;
        self.start + part * (self.end - self.start)
    }
}

impl SceneDescription {
    /// A mesh that stands still, in one light grey material, under a bright sky.
    pub fn of_mesh(mesh: impl Into<Arc<Mesh>>) -> Self {
        let mesh = mesh.into();
        Self {
            background: Vec3::new(0.72, 0.80, 0.92),
            ambient: Vec3::ONE,
            materials: vec![Material::default()],
            parts: vec![Part {
                name: String::new(),
                node: None,
                surface: Surface {
                    materials: vec![0; mesh.len()],
                    ..Surface::default()
                },
                mesh,
                deformation: None,
            }],
            ..Self::default()
        }
    }

    /// A generated scene, with its camera and lights.
    pub fn of_setup(setup: SceneSetup) -> Self {
        // As bright together as a single one would be.
        let brightness = 1.0 / setup.lights.len().max(1) as f32;
        let lights = setup.lights.iter().map(|position| Light {
            position: *position,
            color: Vec3::splat(brightness),
            keys: None,
        });
        Self {
            lights: lights.collect(),
            camera: Some(setup.camera),
            resolution: Some([512, 512]),
            ..Self::of_mesh(setup.mesh)
        }
    }

    /// Where each node is at a time: from its own coordinates to those of the scene.
    pub fn placed_nodes(&self, time: f64) -> Vec<DAffine3> {
        let mut placed: Vec<DAffine3> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let around = node
                .parent
                .map_or(DAffine3::IDENTITY, |parent| placed[parent]);
            let moves = node.keys.as_ref();
            let moves = moves.map_or(DAffine3::IDENTITY, |keys| keys.transform(time));
            placed.push(around * node.place * moves);
        }
        placed
    }

    /// Where a part is at a time, given [where nodes are](Self::placed_nodes).
    ///
    /// # Panics
    ///
    /// If its node is not among them.
    pub fn placed_part(part: &Part, nodes: &[DAffine3]) -> Affine3A {
        part.node.map_or(Affine3A::IDENTITY, |node| {
            let DAffine3 {
                matrix3,
                translation,
            } = nodes[node];
            Affine3A::from_mat3_translation(matrix3.as_mat3(), translation.as_vec3())
        })
    }

    /// Whether a part is seen at a time.
    pub fn is_visible(&self, part: &Part, time: f64) -> bool {
        let mut node = part.node;
        while let Some(number) = node {
            let of_node = &self.nodes[number];
            if of_node
                .keys
                .as_ref()
                .is_some_and(|keys| !keys.is_visible(time))
            {
                return false;
            }
            node = of_node.parent;
        }
        true
    }

    /// The camera at a time, if the scene has one.
    pub fn camera_at(&self, time: f64) -> Option<Camera> {
        let still = self.camera?;
        let placed = match (&self.camera_keys, self.camera_node) {
            (Some(keys), _) => keys.transform(time),
            (None, Some(node)) => self.placed_nodes(time)[node],
            (None, None) => return Some(still),
        };
        let DAffine3 {
            matrix3,
            translation,
        } = placed;
        let DMat3 { y_axis, z_axis, .. } = matrix3;
        Some(Camera {
            eye: translation.as_vec3(),
            target: (translation - z_axis).as_vec3(),
            up: y_axis.as_vec3(),
            ..still
        })
    }

    /// All triangles at a time, in the order of the parts, those that are not seen included.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if something is moved to where f32 ends, or there are too many.
    pub fn mesh_at(&self, time: f64) -> Result<Mesh, MeshError> {
        let nodes = self.placed_nodes(time);
        let meshes = self.parts.iter().map(|part| {
            let to = Self::placed_part(part, &nodes);
            match part.deformed(time, &nodes) {
                Some(positions) => part.mesh.with_positions(positions)?.transformed(&to),
                None => part.mesh.transformed(&to),
            }
        });
        let meshes = meshes.collect::<Result<Vec<Mesh>, _>>()?;
        Mesh::concatenated(&meshes)
    }
}

impl Part {
    /// Whether it is ever anywhere else, or of another shape.
    pub fn may_move(&self) -> bool {
        self.node.is_some() || self.deformation.is_some()
    }

    /// Where its vertices are at a time, before its node moves them, if it changes its shape; given
    /// [where nodes are](SceneDescription::placed_nodes).
    pub fn deformed(&self, time: f64, nodes: &[DAffine3]) -> Option<Vec<[f32; 3]>> {
        Some(match self.deformation.as_ref()? {
            Deformation::Morph(morph) => morph.positions_at(time),
            Deformation::Skin(skin) => {
                let bones = skin.placed_bones(nodes);
                let moved = self.mesh.positions().iter().zip(&skin.influences);
                let moved = moved.map(|(position, influences)| {
                    let position = Vec3::from(*position).as_dvec3();
                    let at = blended(influences, |bone| bones[bone].transform_point3(position));
                    at.unwrap_or(position).as_vec3().to_array()
                });
                moved.collect()
            }
        })
    }

    /// The normals at the corners of its triangles then.
    pub fn deformed_normals(&self, time: f64, nodes: &[DAffine3]) -> Option<Vec<[Vec3; 3]>> {
        Some(match self.deformation.as_ref()? {
            Deformation::Morph(morph) => morph.normals_at(time),
            Deformation::Skin(skin) => {
                let bones = skin.placed_bones(nodes);
                let triangles = self.mesh.triangles().iter().zip(&self.surface.normals);
                let moved = triangles.map(|(corners, normals)| {
                    std::array::from_fn(|i| {
                        let influences = &skin.influences[corners[i] as usize];
                        let normal = normals[i].as_dvec3();
                        let moved =
                            blended(influences, |bone| bones[bone].transform_vector3(normal));
                        moved.unwrap_or(normal).as_vec3()
                    })
                });
                moved.collect()
            }
        })
    }
}

impl Skin {
    /// For each bone, from the coordinates of the mesh to those of the scene.
    fn placed_bones(&self, nodes: &[DAffine3]) -> Vec<DAffine3> {
        let bones = self.joints.iter().zip(&self.inverse_binds);
        bones
            .map(|(joint, inverse_bind)| nodes[*joint] * *inverse_bind)
            .collect()
    }
}

/// What bones make of something together; nothing if none counts.
fn blended(influences: &[(u16, f32); 4], by: impl Fn(usize) -> DVec3) -> Option<DVec3> {
    let weight: f64 = influences
        .iter()
        .map(|(_, weight)| f64::from(*weight))
        .sum();
    let counting = influences.iter().filter(|(_, weight)| *weight > 0.0);
    let sum: DVec3 = counting
        .map(|(bone, weight)| f64::from(*weight) * by(usize::from(*bone)))
        .sum();
    (weight > 0.0).then(|| sum / weight)
}

impl Light {
    /// Where it is at a time.
    pub fn position_at(&self, time: f64) -> Vec3 {
        let moved = self
            .keys
            .as_ref()
            .map_or(DVec3::ZERO, |keys| keys.translation(time));
        (self.position.as_dvec3() + moved).as_vec3()
    }
}

impl Morph {
    /// Three corners for each triangle, at a time.
    pub fn positions_at(&self, time: f64) -> Vec<[f32; 3]> {
        let triangles = self
            .keys
            .iter()
            .flat_map(|keys| between(keys, time).corners);
        triangles.map(|corner| corner.to_array()).collect()
    }

    /// Normals at the three corners of each triangle, at a time.
    pub fn normals_at(&self, time: f64) -> Vec<[Vec3; 3]> {
        self.keys
            .iter()
            .map(|keys| between(keys, time).normals)
            .collect()
    }
}

/// A triangle at a time: straight on from the key before to the one after, and at rest outside.
fn between(keys: &[MorphKey], time: f64) -> MorphKey {
    let after = keys.partition_point(|key| key.time <= time);
    let before = keys[after.saturating_sub(1)];
    let Some(after) = keys.get(after) else {
        return before;
    };
    let length = after.time - before.time;
    if length <= 0.0 || time <= before.time {
        return before;
    }
    let part = (time - before.time) / length;
    let mix = |a: [Vec3; 3], b: [Vec3; 3]| -> [Vec3; 3] {
        std::array::from_fn(|i| a[i].as_dvec3().lerp(b[i].as_dvec3(), part).as_vec3())
    };
    MorphKey {
        time,
        corners: mix(before.corners, after.corners),
        normals: mix(before.normals, after.normals),
    }
}
