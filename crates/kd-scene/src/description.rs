//! A scene description: parts with materials, lights, a camera, and their animation.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use kd_core::Mesh;

use crate::keys::Keys;
use crate::keys::sampled::Sampled;
use crate::report::Warning;
use crate::{AlphaMode, Camera, SceneSetup};

/// A scene as a file describes it, for any time of its animation. It holds no trees.
#[derive(Clone, Debug, Default)]
pub struct SceneDescription {
    /// Color of rays that hit nothing, as red, green and blue in [`colors`](Self::colors).
    pub background: Vec3,
    /// Ambient light, the same at every point.
    pub ambient: Vec3,
    /// The camera, unless [`camera_keys`](Self::camera_keys) or [`camera_node`](Self::camera_node) move it.
    pub camera: Option<Camera>,
    /// Width and height of the picture in pixels, if the file specifies them.
    pub resolution: Option<[u32; 2]>,
    /// Lights, in file order.
    pub lights: Vec<Light>,
    /// Materials, which [`Surface::materials`] index.
    pub materials: Vec<Material>,
    /// Textures, which [`Surface::textures`] index.
    pub textures: Vec<Texture>,
    /// Transform nodes; each node comes after its parent.
    pub nodes: Vec<Node>,
    /// All triangles, grouped by how they move.
    pub parts: Vec<Part>,
    /// Key frames of the camera. They take precedence over [`camera_node`](Self::camera_node).
    pub camera_keys: Option<Arc<Keys>>,
    /// The node of the camera, which looks along the negative z axis of the node.
    pub camera_node: Option<usize>,
    /// Start, end and number of frames of the animation; `None` for a static scene.
    pub span: Option<Span>,
    /// Color space of all colors, and of the texels as [decoded](ColorSpace::decoded).
    pub colors: ColorSpace,
    /// What the reader has left out or replaced.
    pub warnings: Vec<Warning>,
}

/// The meaning of color values from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSpace {
    /// Values as sent to a display, without conversion. Older formats (AFF, NFF, OBJ) and their textures use it.
    #[default]
    Display,
    /// Linear radiance. Textures and output are sRGB and are converted.
    Linear,
}

impl ColorSpace {
    /// The color of a texel, each channel from 0 to 1.
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

    /// The pixel value of a color. Channels are clamped to 0..=1; NaN becomes 0.
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

/// A light without extent.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// How it emits.
    pub kind: LightKind,
    /// Position without animation, in the coordinates of the node or of the scene.
    pub position: Vec3,
    /// Emitted color, as red, green and blue. It does not fade with distance.
    pub color: Vec3,
    /// Key frames of an offset from [`position`](Self::position).
    pub keys: Option<Arc<Keys>>,
    /// The node of the light. Lights that have a direction emit along the negative z axis of the node.
    pub node: Option<usize>,
}

/// How a light emits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LightKind {
    /// In all directions alike.
    #[default]
    Point,
    /// In one direction, from infinitely far away.
    Directional,
    /// Into a cone.
    Spot {
        /// Angle from the axis up to which the light has its full strength, in radians.
        inner: f32,
        /// Angle from the axis beyond which there is no light, in radians.
        outer: f32,
    },
}

/// Reflection properties of a surface, as in the models of Phong and Whitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Reflectance of ambient light, per channel.
    pub ambient: Vec3,
    /// Diffuse reflectance, per channel.
    pub diffuse: Vec3,
    /// Reflectance of highlights, per channel.
    pub specular: Vec3,
    /// Mirror reflectance, per channel.
    pub mirror: Vec3,
    /// Phong exponent of highlights; 0 for none.
    pub shine: f32,
    /// Share of light that passes through the surface, from 0 to 1.
    pub transmittance: f32,
    /// Index of refraction. 0 and 1 do not change the direction of light.
    pub refraction: f32,
    /// Light that the surface itself sends to the eye, per channel.
    pub emission: Vec3,
    /// A factor on the alpha of the texture and of the vertices.
    pub alpha: f32,
    /// What the alpha means.
    pub alpha_mode: AlphaMode,
    /// Index in [`SceneDescription::textures`] of the picture that has the alpha in place of the one that has the color. A picture without
    /// alpha counts by its brightness.
    pub alpha_texture: Option<u32>,
}

impl Default for Material {
    /// A diffuse light gray.
    fn default() -> Self {
        Self {
            ambient: Vec3::splat(0.2),
            diffuse: Vec3::splat(0.8),
            specular: Vec3::ZERO,
            mirror: Vec3::ZERO,
            shine: 0.0,
            transmittance: 0.0,
            refraction: 1.0,
            emission: Vec3::ZERO,
            alpha: 1.0,
            alpha_mode: AlphaMode::Opaque,
            alpha_texture: None,
        }
    }
}

/// A texture image that is not decoded yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Name in the file.
    pub name: String,
    /// Location of the image data.
    pub source: TextureSource,
}

/// The location of the data of a texture image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TextureSource {
    /// An image file, which may be missing.
    File(PathBuf),
    /// The content of an image file.
    Bytes(Arc<[u8]>),
}

/// A transform node, which keys may animate.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name in the file.
    pub name: String,
    /// Index of the enclosing node.
    pub parent: Option<usize>,
    /// Static transform to the coordinates of the parent, applied after the keys.
    pub transform: DAffine3,
    /// Animated transform, applied before [`transform`](Self::transform).
    pub keys: Option<Arc<Keys>>,
}

/// Triangles that move together: one mesh of the scene.
#[derive(Clone, Debug)]
pub struct Part {
    /// Names of the enclosing nodes from the outermost, separated by `/`.
    pub name: String,
    /// Index of the innermost enclosing node; `None` for static parts and skins.
    pub node: Option<usize>,
    /// The triangles, in the coordinates of the node, or of the instances.
    pub mesh: Arc<Mesh>,
    /// For each instance, the transform from the coordinates of the mesh to those of the node. Empty for a part that is there once, without
    /// such a transform. The triangles of an instance whose transform mirrors have the reverse order of corners.
    pub instances: Vec<DAffine3>,
    /// Materials, textures, normals and texture coordinates of the triangles.
    pub surface: Surface,
    /// How the shape changes over time; `None` for rigid parts.
    pub deformation: Option<Deformation>,
}

/// Where an instance of a part is at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstancePlace {
    /// The transform from the coordinates of the mesh to those of the scene.
    pub transform: Affine3A,
    /// Whether its triangles have the reverse order of corners, for the sides of surfaces.
    pub is_mirrored: bool,
}

/// How the shape of a part changes over time.
#[derive(Clone, Debug, PartialEq)]
pub enum Deformation {
    /// Every triangle follows its own keys.
    Morph(Morph),
    /// Vertices follow joints.
    Skin(Skin),
    /// The mesh is blended with others of the same vertices.
    Targets(MorphTargets),
}

/// Shapes that a mesh is blended with, each with a weight that changes over time (glTF 2.0, §3.7.2.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTargets {
    /// For each target, an offset for each vertex; those after the last one are zero.
    pub offsets: Vec<Vec<Vec3>>,
    /// For each target, offsets of the normals at the corners of each triangle; those after the last one are zero.
    pub normals: Vec<Vec<[Vec3; 3]>>,
    /// For each target, the curve of its weight.
    pub(crate) weights: Vec<Sampled<f64>>,
    /// The joints that the blended vertices follow.
    pub skin: Option<Skin>,
}

/// Linear blend skinning with up to four joints per vertex (glTF 2.0, §3.7.3).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Indices of the nodes that are joints.
    pub joints: Vec<usize>,
    /// For each joint, the transform from mesh coordinates to joint coordinates.
    pub inverse_binds: Vec<DAffine3>,
    /// For each vertex, indices into [`joints`](Self::joints) and their weights. A vertex whose weights are all 0 does not
    /// move.
    pub influences: Vec<[(u16, f32); 4]>,
}

/// The surface of a part. Every array has one entry per triangle, or is empty where stated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Indices into [`SceneDescription::materials`].
    pub materials: Vec<u32>,
    /// Indices into [`SceneDescription::textures`], or [`Self::NO_TEXTURE`]. Empty if no triangle has a texture.
    pub textures: Vec<u32>,
    /// Vertex normals at the three corners, of any length; zero for flat triangles. Empty if all triangles are flat.
    pub normals: Vec<[Vec3; 3]>,
    /// Texture coordinates `[u, v]` of the three corners, with period 1 and `v` from the top. Empty if no triangle has any.
    pub uvs: Vec<[[f32; 2]; 3]>,
    /// Colors at the three corners, factors on those of the material as textures are. Empty if no triangle has any.
    pub colors: Vec<[Vec3; 3]>,
    /// Alpha at the three corners, a factor on that of the material. Empty if no triangle has any.
    pub alphas: Vec<[f32; 3]>,
}

impl Surface {
    /// Marks a triangle without a texture.
    pub const NO_TEXTURE: u32 = u32::MAX;
}

/// Triangles that move linearly between their own keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Morph {
    /// For each triangle of the part, at least one key, in ascending order of time. Where times go back, the first segment that ends after
    /// a time counts.
    pub keys: Vec<Vec<MorphKey>>,
}

/// The shape of a triangle at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MorphKey {
    /// Time in seconds.
    pub time: f64,
    /// Positions of the corners, in the coordinates of the node.
    pub corners: [Vec3; 3],
    /// Normals at the corners, of any length.
    pub normals: [Vec3; 3],
}

/// The time span of an animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Time of the first frame, in seconds.
    pub start: f64,
    /// Time of the last frame, in seconds.
    pub end: f64,
    /// Number of frames, at least 1.
    pub frames: usize,
}

impl Span {
    /// The time of a frame in seconds. Frames count from 0; a frame after the last has the time of the last.
    pub fn time_of(&self, frame: usize) -> f64 {
        let last = self.frames.saturating_sub(1);
        if last == 0 {
            return self.start;
        }
        #[expect(clippy::cast_precision_loss, reason = "fewer than 2^52 frames")]
        let fraction = frame.min(last) as f64 / last as f64;
        self.start + fraction * (self.end - self.start)
    }
}

impl SceneDescription {
    /// A static mesh in one light gray material, under a bright background.
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
                instances: Vec::new(),
                deformation: None,
            }],
            ..Self::default()
        }
    }

    /// A static generated scene with its camera and lights.
    pub fn of_setup(setup: SceneSetup) -> Self {
        // The lights together are as bright as a single white one.
        let brightness = 1.0 / setup.lights.len().max(1) as f32;
        let color = Vec3::splat(brightness);
        let lights = setup.lights.iter();
        let lights = lights.map(|position| Light::point(*position, color));
        Self {
            lights: lights.collect(),
            camera: Some(setup.camera),
            resolution: Some([512, 512]),
            ..Self::of_mesh(setup.mesh)
        }
    }

    /// For each node, the transform from node coordinates to scene coordinates at `time`, in seconds.
    pub fn placed_nodes(&self, time: f64) -> Vec<DAffine3> {
        let mut placed: Vec<DAffine3> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let parent = node
                .parent
                .map_or(DAffine3::IDENTITY, |parent| placed[parent]);
            let motion = node.keys.as_ref();
            let motion = motion.map_or(DAffine3::IDENTITY, |keys| keys.transform(time));
            placed.push(parent * node.transform * motion);
        }
        placed
    }

    /// The transform of a part to scene coordinates, given the [transforms of the nodes](Self::placed_nodes).
    ///
    /// # Panics
    ///
    /// If the node of the part is not in `nodes`.
    pub fn placed_part(part: &Part, nodes: &[DAffine3]) -> Affine3A {
        part.node
            .map_or(Affine3A::IDENTITY, |node| narrowed(&nodes[node]))
    }

    /// Whether a part is visible at `time`, in seconds: no enclosing node hides it.
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

    /// The camera at `time`, in seconds; `None` if the scene has no camera.
    pub fn camera_at(&self, time: f64) -> Option<Camera> {
        let camera = self.camera?;
        let placed = match (&self.camera_keys, self.camera_node) {
            (Some(keys), _) => keys.transform(time),
            (None, Some(node)) => self.placed_nodes(time)[node],
            (None, None) => return Some(camera),
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
            ..camera
        })
    }
}

impl Part {
    /// Whether the position or the shape of the part can change over time.
    pub fn may_move(&self) -> bool {
        self.node.is_some() || self.deformation.is_some()
    }

    /// How many times the mesh is in the scene: the number of instances, or 1.
    pub fn copies(&self) -> usize {
        self.instances.len().max(1)
    }

    /// The place of each instance in the scene, given the [transforms of the nodes](SceneDescription::placed_nodes); one place for a part
    /// without instances.
    ///
    /// # Panics
    ///
    /// If the node of the part is not in `nodes`.
    pub fn places(&self, nodes: &[DAffine3]) -> Vec<InstancePlace> {
        if self.instances.is_empty() {
            return vec![InstancePlace {
                transform: SceneDescription::placed_part(self, nodes),
                is_mirrored: false,
            }];
        }
        let of_node = self.node.map_or(DAffine3::IDENTITY, |node| nodes[node]);
        let places = self.instances.iter().map(|instance| InstancePlace {
            transform: narrowed(&(of_node * *instance)),
            is_mirrored: mirrors(instance),
        });
        places.collect()
    }

    /// The positions of the vertices at `time`, in seconds, before the node moves them; `None` for rigid parts. `nodes` are the
    /// [transforms of the nodes](SceneDescription::placed_nodes) at that time.
    pub fn deformed(&self, time: f64, nodes: &[DAffine3]) -> Option<Vec<[f32; 3]>> {
        let positions = || self.mesh.positions().to_vec();
        Some(match self.deformation.as_ref()? {
            Deformation::Morph(morph) => morph.positions_at(time),
            Deformation::Skin(skin) => skin.moved(positions(), nodes),
            Deformation::Targets(targets) => {
                let blended = targets.blended(positions(), time);
                match &targets.skin {
                    Some(skin) => skin.moved(blended, nodes),
                    None => blended,
                }
            }
        })
    }

    /// The normals at the three corners of each triangle at `time`, with the arguments of [`deformed`](Self::deformed); `None`
    /// for rigid parts.
    pub fn deformed_normals(&self, time: f64, nodes: &[DAffine3]) -> Option<Vec<[Vec3; 3]>> {
        let normals = || self.surface.normals.clone();
        let triangles = self.mesh.triangles();
        Some(match self.deformation.as_ref()? {
            Deformation::Morph(morph) => morph.normals_at(time),
            Deformation::Skin(skin) => skin.moved_normals(normals(), triangles, nodes),
            Deformation::Targets(targets) => {
                let blended = targets.blended_normals(normals(), time);
                match &targets.skin {
                    Some(skin) => skin.moved_normals(blended, triangles, nodes),
                    None => blended,
                }
            }
        })
    }
}

impl MorphTargets {
    /// The weights of the targets at `time`, in seconds.
    pub fn weights_at(&self, time: f64) -> Vec<f64> {
        self.weights.iter().map(|curve| curve.at(time)).collect()
    }

    /// The positions of the vertices at `time`, from those without targets.
    fn blended(&self, mut positions: Vec<[f32; 3]>, time: f64) -> Vec<[f32; 3]> {
        for (weight, offsets) in self.weights_at(time).into_iter().zip(&self.offsets) {
            if weight == 0.0 {
                continue;
            }
            for (position, offset) in positions.iter_mut().zip(offsets) {
                let moved = Vec3::from(*position).as_dvec3() + weight * offset.as_dvec3();
                *position = moved.as_vec3().to_array();
            }
        }
        positions
    }

    /// The normals at the corners of the triangles at `time`, from those without targets.
    fn blended_normals(&self, mut normals: Vec<[Vec3; 3]>, time: f64) -> Vec<[Vec3; 3]> {
        for (weight, offsets) in self.weights_at(time).into_iter().zip(&self.normals) {
            for (normal, offset) in normals.iter_mut().flatten().zip(offsets.iter().flatten()) {
                *normal += narrow(weight) * *offset;
            }
        }
        normals
    }
}

/// Whether a transform mirrors.
pub(crate) fn mirrors(transform: &DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}

fn narrowed(transform: &DAffine3) -> Affine3A {
    let DAffine3 {
        matrix3,
        translation,
    } = transform;
    Affine3A::from_mat3_translation(matrix3.as_mat3(), translation.as_vec3())
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn narrow(number: f64) -> f32 {
    number as f32
}

impl Skin {
    /// The positions of vertices that follow the joints.
    fn moved(&self, mut positions: Vec<[f32; 3]>, nodes: &[DAffine3]) -> Vec<[f32; 3]> {
        let joints = self.placed_joints(nodes);
        for (position, influences) in positions.iter_mut().zip(&self.influences) {
            let at = Vec3::from(*position).as_dvec3();
            if let Some(at) = blended(influences, |joint| joints[joint].transform_point3(at)) {
                *position = at.as_vec3().to_array();
            }
        }
        positions
    }

    /// The normals at the corners of triangles that follow the joints.
    fn moved_normals(
        &self,
        mut normals: Vec<[Vec3; 3]>,
        triangles: &[[u32; 3]],
        nodes: &[DAffine3],
    ) -> Vec<[Vec3; 3]> {
        let joints = self.placed_joints(nodes);
        for (normals, corners) in normals.iter_mut().zip(triangles) {
            for (normal, corner) in normals.iter_mut().zip(corners) {
                let influences = &self.influences[*corner as usize];
                let of = |joint: usize| joints[joint].transform_vector3(normal.as_dvec3());
                if let Some(moved) = blended(influences, of) {
                    *normal = moved.as_vec3();
                }
            }
        }
        normals
    }

    /// For each joint, the transform from mesh coordinates to scene coordinates.
    fn placed_joints(&self, nodes: &[DAffine3]) -> Vec<DAffine3> {
        let joints = self.joints.iter().zip(&self.inverse_binds);
        joints
            .map(|(joint, inverse_bind)| nodes[*joint] * *inverse_bind)
            .collect()
    }
}

/// The weighted mean of `by(joint)` over the influences; `None` if the sum of the weights is 0.
fn blended(influences: &[(u16, f32); 4], by: impl Fn(usize) -> DVec3) -> Option<DVec3> {
    let weight: f64 = influences
        .iter()
        .map(|(_, weight)| f64::from(*weight))
        .sum();
    let nonzero = influences.iter().filter(|(_, weight)| *weight > 0.0);
    let sum: DVec3 = nonzero
        .map(|(joint, weight)| f64::from(*weight) * by(usize::from(*joint)))
        .sum();
    (weight > 0.0).then(|| sum / weight)
}

impl Light {
    /// A point light that does not move.
    pub fn point(position: Vec3, color: Vec3) -> Self {
        Self {
            kind: LightKind::Point,
            position,
            color,
            keys: None,
            node: None,
        }
    }

    /// The position and the unit direction at `time`, in seconds. `nodes` are the
    /// [transforms of the nodes](SceneDescription::placed_nodes) at that time. A light without a node looks along the negative z axis.
    ///
    /// # Panics
    ///
    /// If the node of the light is not in `nodes`.
    pub fn placed(&self, time: f64, nodes: &[DAffine3]) -> (Vec3, Vec3) {
        let keys = self.keys.as_ref();
        let moved = keys.map_or(DVec3::ZERO, |keys| keys.translation(time));
        let to = self.node.map_or(DAffine3::IDENTITY, |node| nodes[node]);
        let position = to.transform_point3(self.position.as_dvec3() + moved);
        let direction = to
            .transform_vector3(DVec3::NEG_Z)
            .normalize_or(DVec3::NEG_Z);
        (position.as_vec3(), direction.as_vec3())
    }
}

impl Morph {
    /// The positions of the corners at `time`, in seconds: three for each triangle.
    pub fn positions_at(&self, time: f64) -> Vec<[f32; 3]> {
        let triangles = self
            .keys
            .iter()
            .flat_map(|keys| interpolated(keys, time).corners);
        triangles.map(|corner| corner.to_array()).collect()
    }

    /// The normals at the three corners of each triangle, at `time` in seconds.
    pub fn normals_at(&self, time: f64) -> Vec<[Vec3; 3]> {
        self.keys
            .iter()
            .map(|keys| interpolated(keys, time).normals)
            .collect()
    }
}

/// The shape of a triangle at a time: linear between two keys, constant before the first and after the last.
fn interpolated(keys: &[MorphKey], time: f64) -> MorphKey {
    // The first segment that ends after the time, also where times go back.
    let after = keys.iter().position(|key| time < key.time);
    let before = keys[after.unwrap_or(keys.len()).saturating_sub(1)];
    let Some(after) = after.map(|after| keys[after]) else {
        return before;
    };
    let length = after.time - before.time;
    if length <= 0.0 || time <= before.time {
        return before;
    }
    let fraction = (time - before.time) / length;
    let mix = |a: [Vec3; 3], b: [Vec3; 3]| -> [Vec3; 3] {
        std::array::from_fn(|i| a[i].as_dvec3().lerp(b[i].as_dvec3(), fraction).as_vec3())
    };
    MorphKey {
        time,
        corners: mix(before.corners, after.corners),
        normals: mix(before.normals, after.normals),
    }
}
