//! glTF 2.0, with nodes that move and skins.

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

use crate::draft::{Draft, Look, Place};
use crate::files::opened;
use crate::{
    Camera, ColorSpace, Deformation, LoadError, Node, Part, SceneDescription, Skin, Surface,
};
use accessors::Accessors;
use buffers::Buffers;
use container::Container;

/// Reads a glTF file, `.gltf` or `.glb`, and the files that it names.
///
/// What stands still is one part, everything that moves with one node is one, and every skin is one. The first animation is
/// read: nodes that move, straight, in steps or along cubic splines, and skins that follow them. Materials have their base
/// colour and its texture, and mirror as far as they are smooth; the first camera is read. What is not read, lights and shapes
/// to blend above all, is a warning.
///
/// # Errors
///
/// [`LoadError`] names the element that is wrong: the file is no glTF, a buffer is missing or too short, an index is out of
/// range, a coordinate is not finite.
pub fn read_gltf(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let file = path.display().to_string();
    let bytes = opened(path, files)?;
    let broken = |problem: String| LoadError::BadHeader {
        file: file.clone(),
        problem,
    };
    let Container { json, blob } =
        Container::read(&bytes).map_err(|problem| broken(problem.to_owned()))?;
    let json = gltf::json::Root::from_slice(json).map_err(|error| broken(error.to_string()))?;
    // The crate's own check looks at these before it knows that they are there.
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut attributes = primitives.flat_map(|primitive| primitive.attributes.values());
    if let Some(missing) = attributes.find(|index| index.value() >= json.accessors.len()) {
        return Err(LoadError::BadElement {
            file,
            element: "accessor".to_owned(),
            index: missing.value(),
            problem: "it is not there".to_owned(),
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
        drafts: Vec::new(),
        draft_of: HashMap::new(),
        skinned: Vec::new(),
        number_of: HashMap::new(),
    };
    reader.read(&document)?;
    reader.finish()
}

/// What is around a node.
#[derive(Clone, Copy, Debug)]
struct Around {
    /// The innermost node that moves, and from the coordinates here to its own, or to the scene's.
    mover: Option<usize>,
    to_mover: DAffine3,
}

/// A part whose bones are not known yet.
struct Skinned {
    /// The number of the skin in the file.
    skin: usize,
    part: Part,
    influences: Vec<[(u16, f32); 4]>,
}

struct Reader {
    file: String,
    /// The file as it was written.
    json: gltf::json::Root,
    buffers: Buffers,
    scene: SceneDescription,
    drafts: Vec<Draft>,
    /// The draft of what moves with a node.
    draft_of: HashMap<Option<usize>, usize>,
    skinned: Vec<Skinned>,
    /// The numbers here of the nodes of the file.
    number_of: HashMap<usize, usize>,
}

impl Reader {
    fn read(&mut self, document: &gltf::Document) -> Result<(), LoadError> {
        self.materials(document);
        let motion = self.motion(document)?;
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        let around = Around {
            mover: None,
            to_mover: DAffine3::IDENTITY,
        };
        // Not by recursion: a file may be as deep as it likes.
        let mut open: Vec<(gltf::Node<'_>, Option<usize>, Around)> = Vec::new();
        if let Some(scene) = scene {
            open.extend(scene.nodes().map(|node| (node, None, around)));
            open.reverse();
        }
        while let Some((node, parent, around)) = open.pop() {
            if self.number_of.contains_key(&node.index()) {
                return Err(self.bad("node", node.index(), "it is in two places"));
            }
            let keys = motion.get(&node.index()).cloned().map(Arc::new);
            let number = self.scene.nodes.len();
            self.number_of.insert(node.index(), number);
            let own = local(&node);
            let around = if keys.is_some() {
                Around {
                    mover: Some(number),
                    to_mover: DAffine3::IDENTITY,
                }
            } else {
                Around {
                    to_mover: around.to_mover * own,
                    ..around
                }
            };
            self.scene.nodes.push(Node {
                name: node.name().unwrap_or("").to_owned(),
                parent,
                place: if keys.is_some() {
                    DAffine3::IDENTITY
                } else {
                    own
                },
                keys,
            });
            if let Some(mesh) = node.mesh() {
                self.mesh(&node, &mesh, around)?;
            }
            self.camera(&node, number);
            let before = open.len();
            let children = node.children();
            open.extend(children.map(|child| (child, Some(number), around)));
            open[before..].reverse();
        }
        self.skins(document)
    }

    fn camera(&mut self, node: &gltf::Node<'_>, number: usize) {
        let Some(camera) = node.camera() else {
            return;
        };
        let gltf::camera::Projection::Perspective(lens) = camera.projection() else {
            self.warn("cameras without perspective are not read".to_owned());
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
        around: Around,
    ) -> Result<(), LoadError> {
        if let Some(skin) = node.skin() {
            let name = node.name().unwrap_or("").to_owned();
            let mut draft = Draft::new(name, None, false);
            let mut influences = Vec::new();
            for primitive in mesh.primitives() {
                let place = Place::new(DAffine3::IDENTITY);
                let vertices = self.primitive(&mut draft, mesh.index(), &primitive, &place)?;
                self.influences(mesh.index(), &primitive, vertices, &mut influences)?;
            }
            let part = draft.finish().map_err(|source| LoadError::Mesh {
                file: self.file.clone(),
                source,
            })?;
            self.skinned.push(Skinned {
                skin: skin.index(),
                part,
                influences,
            });
            return Ok(());
        }
        let new = self.drafts.len();
        let number = *self.draft_of.entry(around.mover).or_insert(new);
        if number == new {
            let name = around
                .mover
                .map(|mover| self.scene.nodes[mover].name.clone());
            self.drafts
                .push(Draft::new(name.unwrap_or_default(), around.mover, false));
        }
        let placeholder = Draft::new(String::new(), None, false);
        let mut draft = std::mem::replace(&mut self.drafts[number], placeholder);
        let place = Place::new(around.to_mover);
        for primitive in mesh.primitives() {
            self.primitive(&mut draft, mesh.index(), &primitive, &place)?;
        }
        self.drafts[number] = draft;
        Ok(())
    }

    /// Adds triangles, and tells how many vertices.
    fn primitive(
        &mut self,
        draft: &mut Draft,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
        place: &Place,
    ) -> Result<usize, LoadError> {
        use gltf::mesh::Mode;

        let Some(positions) = self.attribute::<3>(mesh, primitive, &Semantic::Positions, false)?
        else {
            return Ok(0);
        };
        let mut vertices = Vec::new();
        for position in positions {
            let at = place.position(DVec3::from(position));
            let vertex = draft.vertex(at);
            vertices.push(vertex.ok_or_else(|| self.bad("mesh", mesh, "a vertex is not finite"))?);
        }
        let count = vertices.len();
        let corners: Vec<u32> = match self.json_of(mesh, primitive).and_then(|json| json.indices) {
            Some(indices) => {
                let indices = self.numbers::<1>(indices, false)?.into_iter();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "they come from at most 32 bits; what is no index becomes one that is refused, or 0"
                )]
                let index = |[index]: [f64; 1]| index as u32;
                indices.map(index).collect()
            }
            None => (0..u32::try_from(count).unwrap_or(u32::MAX)).collect(),
        };
        let corner = |i: usize| corners[i];
        let triangles: Vec<[u32; 3]> = match primitive.mode() {
            Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
            // Every other one is turned round.
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
                .map(|normal| place.normal(DVec3::from(normal)))
                .collect()
        });
        let (material, texture, set) = self.look_of(&primitive.material());
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
        let look = Look { material, texture };
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
            draft.triangle(of_draft, look);
            let at = corners.map(|corner| corner as usize);
            if let Some(normals) = normals.as_ref().filter(|normals| normals.len() == count) {
                draft.set_normals(at.map(|corner| normals[corner]));
            }
            if let Some(uvs) = uvs.as_ref().filter(|uvs| uvs.len() == count) {
                draft.set_uvs(at.map(|corner| uvs[corner]));
            }
        }
        if primitive.morph_targets().next().is_some() {
            self.warn(format!("mesh {mesh}: shapes to blend are not read"));
        }
        Ok(count)
    }

    /// The bones of so many vertices.
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
                        reason = "what is no number of a bone becomes one that is refused, or 0"
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
        // Those without any stay where they are.
        to.resize(end, [(0, 0.0); 4]);
        Ok(())
    }

    /// What the file says of a primitive.
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

    /// What vertices have, if they do.
    fn attribute<const N: usize>(
        &self,
        mesh: usize,
        primitive: &gltf::Primitive<'_>,
        semantic: &Semantic,
        are_parts: bool,
    ) -> Result<Option<Vec<[f64; N]>>, LoadError> {
        let attributes = self.json_of(mesh, primitive).map(|json| &json.attributes);
        let index = attributes.and_then(|all| all.get(&Checked::Valid(semantic.clone())));
        index
            .map(|index| self.numbers(*index, are_parts))
            .transpose()
    }

    /// The values of an accessor.
    fn numbers<const N: usize>(
        &self,
        index: Index<gltf::json::Accessor>,
        are_parts: bool,
    ) -> Result<Vec<[f64; N]>, LoadError> {
        let accessors = Accessors {
            root: &self.json,
            buffers: &self.buffers,
        };
        let found = accessors.read(index, are_parts);
        found.map_err(|problem| self.bad("accessor", index.value(), problem))
    }

    /// Gives parts with skins their bones.
    fn skins(&mut self, document: &gltf::Document) -> Result<(), LoadError> {
        let skinned = std::mem::take(&mut self.skinned);
        for Skinned {
            skin: number,
            mut part,
            influences,
        } in skinned
        {
            let skin = document.skins().nth(number);
            let skin = skin.ok_or_else(|| self.bad("skin", number, "it is not there"))?;
            let mut joints = Vec::new();
            for joint in skin.joints() {
                let node = self.number_of.get(&joint.index()).copied();
                let problem = "a bone is not in the scene";
                joints.push(node.ok_or_else(|| self.bad("skin", number, problem))?);
            }
            let json = self.json.skins.get(number);
            let matrices = json.and_then(|skin| skin.inverse_bind_matrices);
            let matrices = matrices.map(|matrices| self.numbers::<16>(matrices, false));
            let matrices = matrices.transpose()?.unwrap_or_default().into_iter();
            let mut inverse_binds: Vec<DAffine3> = matrices
                .map(|matrix| DAffine3::from_mat4(DMat4::from_cols_array(&matrix)))
                .collect();
            inverse_binds.resize(joints.len(), DAffine3::IDENTITY);
            let highest = influences
                .iter()
                .flatten()
                .filter(|(_, weight)| *weight > 0.0);
            if highest
                .clone()
                .any(|(joint, _)| usize::from(*joint) >= joints.len())
            {
                return Err(self.bad("skin", number, "a vertex follows a bone that it has not"));
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

    fn warn(&mut self, what: String) {
        let warning = format!("{}: {what}", self.file);
        if !self.scene.warnings.contains(&warning) {
            self.scene.warnings.push(warning);
        }
    }

    fn bad(&self, element: &str, index: usize, problem: &str) -> LoadError {
        LoadError::BadElement {
            file: self.file.clone(),
            element: element.to_owned(),
            index,
            problem: problem.to_owned(),
        }
    }

    fn finish(self) -> Result<SceneDescription, LoadError> {
        let mut scene = self.scene;
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

/// Where a node stands in the one that it is in.
fn local(node: &gltf::Node<'_>) -> DAffine3 {
    let columns = node
        .transform()
        .matrix()
        .map(|column| column.map(f64::from));
    DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "files have them as f32, or fewer bits"
)]
fn narrow(number: f64) -> f32 {
    number as f32
}
