//! Reader of glTF 2.0, with animated nodes and skins.

mod accessors;
mod buffers;
mod container;
mod material;
mod motion;

use std::collections::HashMap;
use std::io;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec3, Vec3};
use gltf::json::Index;
use gltf::json::validation::Checked;
use gltf::mesh::Semantic;

use crate::draft::{PartDraft, SurfaceIds, Transform};
use crate::files::read_file;
use crate::report::{Report, Strictness, WarningCode};
use crate::{
    Camera, ColorSpace, Deformation, LoadError, Node, Part, SceneDescription, Skin, Surface,
};
use accessors::Accessors;
use buffers::Buffers;
use container::Container;

/// Reads a glTF file, `.gltf` or `.glb`, and the buffers that it names. `files` reads the file at a path.
///
/// All static triangles form one part, the triangles that move with a node form one part, and every skinned mesh forms one
/// part. The reader supports the first animation (step, linear and cubic keys of nodes, and the skins that follow them), the
/// first perspective camera, and materials by base color, its texture, metalness and roughness; smooth materials reflect.
/// Other animations, orthographic cameras and morph targets are ignored with a warning; lights are ignored.
///
/// # Errors
///
/// [`LoadError`] with the invalid element: the file is not glTF, a buffer is missing or too short, an index is out of range, a
/// coordinate is not finite.
pub fn read_gltf(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let file = path.display().to_string();
    let bytes = read_file(path, files)?;
    let broken = |problem: String| LoadError::BadHeader {
        file: file.clone(),
        problem,
    };
    let Container { json, blob } =
        Container::read(&bytes).map_err(|problem| broken(problem.to_owned()))?;
    let json = gltf::json::Root::from_slice(json).map_err(|error| broken(error.to_string()))?;
    // The validation of the crate would panic on these indices.
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut attributes = primitives.flat_map(|primitive| primitive.attributes.values());
    if let Some(missing) = attributes.find(|index| index.value() >= json.accessors.len()) {
        return Err(LoadError::BadElement {
            file,
            element: "accessor".to_owned(),
            index: missing.value(),
            problem: "does not exist".to_owned(),
        });
    }
    let document = gltf::Document::from_json(json).map_err(|error| broken(error.to_string()))?;
    let buffers = Buffers::read(&document, blob, path, files)?;
    let mut reader = Reader {
        file,
        json: document.as_json().clone(),
        buffers,
        scene: SceneDescription {
            background: Vec3::new(0.45, 0.58, 0.78),
            ambient: Vec3::ONE,
            colors: ColorSpace::Linear,
            ..SceneDescription::default()
        },
        report: Report::new(Strictness::Usual),
        drafts: Vec::new(),
        draft_of: HashMap::new(),
        skinned: Vec::new(),
        node_index: HashMap::new(),
    };
    reader.read(&document)?;
    reader.finish()
}

/// The context of a node: the nearest animated ancestor.
#[derive(Clone, Copy, Debug)]
struct Enclosing {
    /// Index of the innermost animated node.
    moving_node: Option<usize>,
    /// Transform from the current coordinates to those of that node, or of the scene.
    to_moving_node: DAffine3,
}

/// A skinned part, before the indices of its joints are known.
struct SkinnedPart {
    /// Index of the skin in the file.
    skin: usize,
    part: Part,
    influences: Vec<[(u16, f32); 4]>,
}

struct Reader {
    file: String,
    /// The parsed file.
    json: gltf::json::Root,
    buffers: Buffers,
    scene: SceneDescription,
    report: Report,
    drafts: Vec<PartDraft>,
    /// Index of the draft for an animated node, or for static triangles.
    draft_of: HashMap<Option<usize>, usize>,
    skinned: Vec<SkinnedPart>,
    /// Index in the scene of each node of the file.
    node_index: HashMap<usize, usize>,
}

impl Reader {
    fn read(&mut self, document: &gltf::Document) -> Result<(), LoadError> {
        self.materials(document);
        let motion = self.motion(document)?;
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        let enclosing = Enclosing {
            moving_node: None,
            to_moving_node: DAffine3::IDENTITY,
        };
        // An explicit stack, because the depth of a file is unbounded.
        let mut pending: Vec<(gltf::Node<'_>, Option<usize>, Enclosing)> = Vec::new();
        if let Some(scene) = scene {
            pending.extend(scene.nodes().map(|node| (node, None, enclosing)));
            pending.reverse();
        }
        while let Some((node, parent, enclosing)) = pending.pop() {
            if self.node_index.contains_key(&node.index()) {
                return Err(self.bad_element("node", node.index(), "has two parents"));
            }
            let keys = motion.get(&node.index()).cloned().map(Arc::new);
            let number = self.scene.nodes.len();
            self.node_index.insert(node.index(), number);
            let own = local(&node);
            let enclosing = if keys.is_some() {
                Enclosing {
                    moving_node: Some(number),
                    to_moving_node: DAffine3::IDENTITY,
                }
            } else {
                Enclosing {
                    to_moving_node: enclosing.to_moving_node * own,
                    ..enclosing
                }
            };
            self.scene.nodes.push(Node {
                name: node.name().unwrap_or("").to_owned(),
                parent,
                transform: if keys.is_some() {
                    DAffine3::IDENTITY
                } else {
                    own
                },
                keys,
            });
            if let Some(mesh) = node.mesh() {
                self.mesh(&node, &mesh, enclosing)?;
            }
            self.camera(&node, number);
            let before = pending.len();
            let children = node.children();
            pending.extend(children.map(|child| (child, Some(number), enclosing)));
            pending[before..].reverse();
        }
        self.skins(document)
    }

    fn camera(&mut self, node: &gltf::Node<'_>, number: usize) {
        let Some(camera) = node.camera() else {
            return;
        };
        let gltf::camera::Projection::Perspective(lens) = camera.projection() else {
            self.warn("orthographic cameras are ignored");
            return;
        };
        if self.scene.camera.is_none() {
            self.scene.camera = Some(Camera {
                eye: Vec3::ZERO,
                target: Vec3::NEG_Z,
                up: Vec3::Y,
                fov_degrees: lens.yfov().to_degrees().clamp(1.0, 179.0),
            });
            self.scene.camera_node = Some(number);
        }
    }

    fn mesh(
        &mut self,
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        if let Some(skin) = node.skin() {
            let name = node.name().unwrap_or("").to_owned();
            let mut draft = PartDraft::new(name, None, false);
            let mut influences = Vec::new();
            for primitive in mesh.primitives() {
                let transform = Transform::new(DAffine3::IDENTITY);
                let vertices = self.primitive(&mut draft, mesh.index(), &primitive, &transform)?;
                self.influences(mesh.index(), &primitive, vertices, &mut influences)?;
            }
            let part = draft.finish().map_err(|source| LoadError::Mesh {
                file: self.file.clone(),
                source,
            })?;
            self.skinned.push(SkinnedPart {
                skin: skin.index(),
                part,
                influences,
            });
            return Ok(());
        }
        let new = self.drafts.len();
        let number = *self.draft_of.entry(enclosing.moving_node).or_insert(new);
        if number == new {
            let name = enclosing
                .moving_node
                .map(|moving_node| self.scene.nodes[moving_node].name.clone());
            self.drafts.push(PartDraft::new(
                name.unwrap_or_default(),
                enclosing.moving_node,
                false,
            ));
        }
        let placeholder = PartDraft::new(String::new(), None, false);
        let mut draft = std::mem::replace(&mut self.drafts[number], placeholder);
        let transform = Transform::new(enclosing.to_moving_node);
        for primitive in mesh.primitives() {
            self.primitive(&mut draft, mesh.index(), &primitive, &transform)?;
        }
        self.drafts[number] = draft;
        Ok(())
    }

    /// Adds the triangles of a primitive, and returns its number of vertices.
    fn primitive(
        &mut self,
        draft: &mut PartDraft,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
        transform: &Transform,
    ) -> Result<usize, LoadError> {
        use gltf::mesh::Mode;

        let Some(positions) = self.attribute::<3>(mesh, primitive, &Semantic::Positions, false)?
        else {
            return Ok(0);
        };
        let mut vertices = Vec::new();
        for position in positions {
            let at = transform.position(DVec3::from(position));
            let vertex = draft.vertex(at);
            vertices.push(
                vertex.ok_or_else(|| self.bad_element("mesh", mesh, "a vertex is not finite"))?,
            );
        }
        let count = vertices.len();
        let corners: Vec<u32> = match self.json_of(mesh, primitive).and_then(|json| json.indices) {
            Some(indices) => {
                let indices = self.numbers::<1>(indices, false)?.into_iter();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "integers have at most 32 bits; other values saturate and are refused as out of range, or become 0"
                )]
                let index = |[index]: [f64; 1]| index as u32;
                indices.map(index).collect()
            }
            None => (0..u32::try_from(count).unwrap_or(u32::MAX)).collect(),
        };
        let corner = |i: usize| corners[i];
        let triangles: Vec<[u32; 3]> = match primitive.mode() {
            Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
            // Every second triangle of a strip is reversed.
            Mode::TriangleStrip => (2..corners.len())
                .map(|i| [corner(i - 2), corner(i - 1 + i % 2), corner(i - i % 2)])
                .collect(),
            Mode::TriangleFan => (2..corners.len())
                .map(|i| [corner(0), corner(i - 1), corner(i)])
                .collect(),
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
        };
        let normals = self.attribute::<3>(mesh, primitive, &Semantic::Normals, false)?;
        let normals: Option<Vec<Vec3>> = normals.map(|normals| {
            let normals = normals.into_iter();
            normals
                .map(|normal| transform.normal(DVec3::from(normal)))
                .collect()
        });
        let (material, texture, set) = self.material_of(&primitive.material());
        let uvs = if texture == Surface::NO_TEXTURE {
            None
        } else {
            self.attribute::<2>(mesh, primitive, &Semantic::TexCoords(set), true)?
        };
        let uvs: Option<Vec<[f32; 2]>> =
            uvs.map(|uvs| uvs.into_iter().map(|uv| uv.map(narrow)).collect());
        let texture = if uvs.is_some() {
            texture
        } else {
            Surface::NO_TEXTURE
        };
        let ids = SurfaceIds { material, texture };
        for (face, corners) in triangles.into_iter().enumerate() {
            let out_of_range = |index: u32| LoadError::IndexOutOfRange {
                file: self.file.clone(),
                line: None,
                face,
                index: i64::from(index),
                vertices: count,
            };
            let mut of_draft = [0; 3];
            for (to, corner) in of_draft.iter_mut().zip(corners) {
                let found = vertices.get(corner as usize);
                *to = *found.ok_or_else(|| out_of_range(corner))?;
            }
            draft.triangle(of_draft, ids);
            let at = corners.map(|corner| corner as usize);
            if let Some(normals) = normals.as_ref().filter(|normals| normals.len() == count) {
                draft.set_normals(at.map(|corner| normals[corner]));
            }
            if let Some(uvs) = uvs.as_ref().filter(|uvs| uvs.len() == count) {
                draft.set_uvs(at.map(|corner| uvs[corner]));
            }
        }
        if primitive.morph_targets().next().is_some() {
            self.warn(format!("mesh {mesh}: morph targets are ignored"));
        }
        Ok(count)
    }

    /// Appends the joints and weights of `vertices` vertices to `to`.
    fn influences(
        &self,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
        vertices: usize,
        to: &mut Vec<[(u16, f32); 4]>,
    ) -> Result<(), LoadError> {
        let end = to.len() + vertices;
        let joints = self.attribute::<4>(mesh, primitive, &Semantic::Joints(0), false)?;
        let weights = self.attribute::<4>(mesh, primitive, &Semantic::Weights(0), true)?;
        if let (Some(joints), Some(weights)) = (joints, weights) {
            let pairs = joints.into_iter().zip(weights).take(vertices);
            to.extend(pairs.map(|(joints, weights)| {
                std::array::from_fn(|i| {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "other values saturate and are refused as out of range, or become 0"
                    )]
                    let joint = joints[i] as u16;
                    let weight = narrow(weights[i]);
                    (
                        joint,
                        if weight.is_finite() {
                            weight.max(0.0)
                        } else {
                            0.0
                        },
                    )
                })
            }));
        }
        // Vertices without weights do not move.
        to.resize(end, [(0, 0.0); 4]);
        Ok(())
    }

    /// A primitive in the parsed file.
    fn json_of(
        &self,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
    ) -> Option<&gltf::json::mesh::Primitive> {
        self.json
            .meshes
            .get(mesh)?
            .primitives
            .get(primitive.index())
    }

    /// The values of a vertex attribute; `None` if the primitive lacks it.
    fn attribute<const N: usize>(
        &self,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
        semantic: &Semantic,
        is_normalized: bool,
    ) -> Result<Option<Vec<[f64; N]>>, LoadError> {
        let attributes = self.json_of(mesh, primitive).map(|json| &json.attributes);
        let index = attributes.and_then(|all| all.get(&Checked::Valid(semantic.clone())));
        index
            .map(|index| self.numbers(*index, is_normalized))
            .transpose()
    }

    /// The values of an accessor, with `N` numbers each.
    fn numbers<const N: usize>(
        &self,
        index: Index<gltf::json::Accessor>,
        is_normalized: bool,
    ) -> Result<Vec<[f64; N]>, LoadError> {
        let accessors = Accessors {
            root: &self.json,
            buffers: &self.buffers,
        };
        let found = accessors.read(index, is_normalized);
        found.map_err(|problem| self.bad_element("accessor", index.value(), problem))
    }

    /// Adds the skinned parts, with the nodes that are their joints.
    fn skins(&mut self, document: &gltf::Document) -> Result<(), LoadError> {
        let skinned = std::mem::take(&mut self.skinned);
        for SkinnedPart {
            skin: number,
            mut part,
            influences,
        } in skinned
        {
            let skin = document.skins().nth(number);
            let skin = skin.ok_or_else(|| self.bad_element("skin", number, "does not exist"))?;
            let mut joints = Vec::new();
            for joint in skin.joints() {
                let node = self.node_index.get(&joint.index()).copied();
                let problem = "a joint is not in the scene";
                joints.push(node.ok_or_else(|| self.bad_element("skin", number, problem))?);
            }
            let json = self.json.skins.get(number);
            let matrices = json.and_then(|skin| skin.inverse_bind_matrices);
            let matrices = matrices.map(|matrices| self.numbers::<16>(matrices, false));
            let matrices = matrices.transpose()?.unwrap_or_default().into_iter();
            let mut inverse_binds: Vec<DAffine3> = matrices
                .map(|matrix| DAffine3::from_mat4(DMat4::from_cols_array(&matrix)))
                .collect();
            inverse_binds.resize(joints.len(), DAffine3::IDENTITY);
            let mut weighted = influences
                .iter()
                .flatten()
                .filter(|(_, weight)| *weight > 0.0);
            if weighted.any(|(joint, _)| usize::from(*joint) >= joints.len()) {
                return Err(self.bad_element(
                    "skin",
                    number,
                    "a vertex refers to a joint that is out of range",
                ));
            }
            part.deformation = Some(Deformation::Skin(Skin {
                joints,
                inverse_binds,
                influences,
            }));
            self.scene.parts.push(part);
        }
        Ok(())
    }

    /// Notes that something is not used.
    fn warn(&mut self, what: impl AsRef<str>) {
        self.report
            .warn(&self.file, None, WarningCode::Unused, what);
    }

    fn bad_element(&self, element: &str, index: usize, problem: &str) -> LoadError {
        LoadError::BadElement {
            file: self.file.clone(),
            element: element.to_owned(),
            index,
            problem: problem.to_owned(),
        }
    }

    fn finish(self) -> Result<SceneDescription, LoadError> {
        let mut scene = self.scene;
        scene.warnings = self.report.finish();
        let mut parts = Vec::new();
        for draft in self.drafts {
            let part = draft.finish();
            parts.push(part.map_err(|source| LoadError::Mesh {
                file: self.file.clone(),
                source,
            })?);
        }
        parts.append(&mut scene.parts);
        scene.parts = parts;
        Ok(scene)
    }
}

/// The static transform of a node to the coordinates of its parent.
fn local(node: &gltf::Node<'_>) -> DAffine3 {
    let columns = node
        .transform()
        .matrix()
        .map(|column| column.map(f64::from));
    DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the file stores f32 or smaller numbers"
)]
fn narrow(number: f64) -> f32 {
    number as f32
}
