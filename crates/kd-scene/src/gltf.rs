//! Reader of glTF 2.0, with animated nodes, skins and morph targets.
//!
//! The JSON is read by types of our own: the validation of the crate `gltf` refuses files that all others read (attributes and
//! extensions of applications, odd materials that nothing uses).

mod accessors;
mod buffers;
mod container;
mod extensions;
mod instanced_part;
mod instances;
mod json;
mod lights;
mod material;
mod motion;
mod primitive;
mod skins;

use std::collections::HashMap;
use std::io;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DMat4, DQuat, DVec3, Vec3};
use serde_json::Value;

use crate::description::mirrors;
use crate::draft::{MOST_REPEATED, PartDraft, Transform};
use crate::files::read_file;
use crate::keys::Keys;
use crate::keys::sampled::Sampled;
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::{Camera, ColorSpace, LoadError, Part, SceneDescription};
use accessors::Numbers;
use buffers::Buffers;
use container::Container;
use json::{Document, Whole};
use material::Look;
use primitive::Triangles;
use skins::OwnPart;

/// Reads a glTF file, `.gltf` or `.glb`, and the buffers that it names. `files` reads the file at a path.
///
/// All static triangles form one part, the triangles that move with a node form one part, and every mesh with a skin, with animated
/// morph targets or with several [instances](Part::instances) forms one part. The reader supports the first animation (step, linear and cubic keys of nodes and weights, and the
/// skins that follow them), the first perspective camera, lights (`KHR_lights_punctual`), instances (`EXT_mesh_gpu_instancing`),
/// colors of vertices, and materials by base color, its texture, metalness and roughness; smooth materials reflect. Alpha makes holes and
/// blends as [`AlphaMode`](crate::AlphaMode) says. What the reader does not use is a [warning](SceneDescription::warnings).
///
/// # Errors
///
/// [`LoadError`] with the JSON pointer of the invalid value: the file is not glTF 2.0, it requires an extension that is not supported, a
/// buffer is missing or too short, an index is out of range, a coordinate is not finite.
pub fn read_gltf(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let mut report = Report::new(Strictness::Usual);
    let mut scene = read_gltf_with(path, files, &mut report)?;
    scene.warnings = report.finish();
    Ok(scene)
}

/// [`read_gltf`], with its warnings in the report. A lenient reader leaves out primitives that it cannot read, and single triangles with
/// an index that is out of range or a vertex that is not finite.
pub(crate) fn read_gltf_with(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    report: &mut Report,
) -> Result<SceneDescription, LoadError> {
    let file = path.display().to_string();
    let bytes = read_file(path, files)?;
    let broken = |problem: String| LoadError::BadHeader {
        file: file.clone(),
        problem,
    };
    let Container { json, blob } = Container::read(&bytes).map_err(broken)?;
    let document = Document::parse(json, &file).map_err(broken)?;
    check_version(&document).map_err(broken)?;
    extensions::check(&document, &file, report)?;
    let mut reader = Reader {
        file: &file,
        buffers: Buffers::new(path, files, blob),
        scene: SceneDescription {
            background: Vec3::new(0.45, 0.58, 0.78),
            ambient: Vec3::ONE,
            colors: ColorSpace::Linear,
            ..SceneDescription::default()
        },
        report,
        drafts: Vec::new(),
        draft_of: HashMap::new(),
        own_parts: Vec::new(),
        instanced_parts: Vec::new(),
        node_index: HashMap::new(),
        uses: uses_of_meshes(&document),
        document,
        meshes: HashMap::new(),
        looks: HashMap::new(),
        images: HashMap::new(),
        elements: 0,
        kept: 0,
    };
    reader.read()?;
    reader.finish()
}

/// Refuses files of other versions than 2, and other JSON files.
fn check_version(document: &Document) -> Result<(), String> {
    const NOT_SUPPORTED: &str = "which is not supported; expected 2.0";
    let asset = document
        .at("/asset")
        .map(|asset| document.read(asset, "/asset"));
    let asset: json::Asset = asset.and_then(Result::ok).unwrap_or_default();
    let needed = [asset.min_version, asset.version];
    let needed = needed
        .iter()
        .map(|version| version.trim())
        .find(|version| !version.is_empty());
    // The meshes of glTF 1 have names.
    let is_first = document.at("/meshes").is_some_and(Value::is_object);
    match needed {
        Some("2" | "2.0") => Ok(()),
        None if is_first => Err(format!("the file is glTF 1, {NOT_SUPPORTED}")),
        None => Err("`asset.version` is missing; expected 2.0".to_owned()),
        Some(version) => Err(format!("the file is glTF {version}, {NOT_SUPPORTED}")),
    }
}

/// How many nodes have each mesh.
fn uses_of_meshes(document: &Document) -> HashMap<usize, usize> {
    let mut uses = HashMap::new();
    for node in document.all("/nodes") {
        let mesh = node.get("mesh").and_then(Value::as_u64);
        if let Some(mesh) = mesh.and_then(|mesh| usize::try_from(mesh).ok()) {
            *uses.entry(mesh).or_insert(0) += 1;
        }
    }
    uses
}

/// The primitives of a mesh, and the weights of its morph targets.
type MeshData = (Vec<Triangles>, Option<Vec<f64>>);

/// The context of a node: the nearest animated ancestor.
#[derive(Clone, Copy, Debug)]
struct Enclosing {
    /// Index of the innermost animated node.
    moving_node: Option<usize>,
    /// Transform from the current coordinates to those of that node, or of the scene.
    to_moving_node: DAffine3,
    is_visible: bool,
    /// Whether the nodes from the scene on mirror an odd number of times, which reverses the order of corners (glTF 2.0, §3.7.4).
    is_mirrored: bool,
}

/// A node that is still to be read.
struct Pending {
    number: Whole,
    parent: Option<usize>,
    enclosing: Enclosing,
}

struct Reader<'a> {
    file: &'a str,
    document: Document,
    buffers: Buffers<'a>,
    scene: SceneDescription,
    report: &'a mut Report,
    drafts: Vec<PartDraft>,
    /// Index of the draft for an animated node, or for static triangles.
    draft_of: HashMap<Option<usize>, usize>,
    /// Meshes with skins or animated morph targets.
    own_parts: Vec<OwnPart>,
    /// Meshes with several instances.
    instanced_parts: Vec<Part>,
    /// Index in the scene of each node of the file.
    node_index: HashMap<usize, usize>,
    /// The primitives of meshes that several nodes have, by index in the file.
    meshes: HashMap<usize, Rc<MeshData>>,
    /// How many nodes have each mesh.
    uses: HashMap<usize, usize>,
    /// The look of each material of the file that is used; `None` is the default material.
    looks: HashMap<Option<usize>, Look>,
    /// Index in the scene of each image of the file that is used.
    images: HashMap<usize, u32>,
    /// The number of vertices and triangles so far.
    elements: usize,
    /// The number of vertices and triangles in `meshes`.
    kept: usize,
}

impl Reader<'_> {
    fn read(&mut self) -> Result<(), LoadError> {
        let motion = self.motion()?;
        let enclosing = Enclosing {
            moving_node: None,
            to_moving_node: DAffine3::IDENTITY,
            is_visible: true,
            is_mirrored: false,
        };
        // An explicit stack, because the depth of a file is unbounded.
        let mut pending: Vec<Pending> = self
            .roots()?
            .into_iter()
            .map(|number| Pending {
                number,
                parent: None,
                enclosing,
            })
            .collect();
        pending.reverse();
        while let Some(next) = pending.pop() {
            let before = pending.len();
            self.node(&next, &motion, &mut pending)?;
            pending[before..].reverse();
        }
        self.finish_own_parts(&motion.weights)
    }

    /// The nodes of the scene.
    fn roots(&mut self) -> Result<Vec<Whole>, LoadError> {
        let scenes = self.document.all("/scenes").len();
        if scenes > 0 {
            let number = self.document.at("/scene").cloned();
            let number = number.map(|number| self.document.read(&number, "/scene"));
            let number = number.transpose()?.unwrap_or(Whole(0));
            let others = self.document.all("/scenes").iter().enumerate();
            let has_nodes = |scene: &Value| scene.pointer("/nodes/0").is_some();
            let mut others = others.filter(|(other, scene)| *other != number.0 && has_nodes(scene));
            if others.next().is_some() {
                let what = format!("of {scenes} scenes, only number {} is read", number.0);
                self.warn("/scenes", WarningCode::Unused, what);
            }
            let scene: json::Scene = self.document.get("/scenes", number)?;
            return Ok(scene.nodes);
        }
        // A library of nodes: all that are in no other one.
        let nodes = self.document.all("/nodes");
        let mut is_child = vec![false; nodes.len()];
        for number in 0..nodes.len() {
            let node: json::Node = self.document.get("/nodes", Whole(number))?;
            for child in node.children {
                if let Some(is_child) = is_child.get_mut(child.0) {
                    *is_child = true;
                }
            }
        }
        let roots = (0..nodes.len())
            .filter(|number| !is_child[*number])
            .map(Whole);
        let roots: Vec<Whole> = roots.collect();
        if !roots.is_empty() {
            self.warn(
                "",
                WarningCode::NoScene,
                "the file has no scene; all of its nodes are read",
            );
        } else if !self.document.all("/meshes").is_empty() {
            let what = "the file has no node that places its meshes; nothing is read";
            self.warn("/meshes", WarningCode::NoScene, what);
        }
        Ok(roots)
    }

    fn node(
        &mut self,
        next: &Pending,
        motion: &motion::Motion,
        pending: &mut Vec<Pending>,
    ) -> Result<(), LoadError> {
        const NODES: &str = "/nodes";
        let Pending {
            number,
            parent,
            enclosing,
        } = *next;
        let node: json::Node = self.document.get(NODES, number)?;
        let pointer = format!("{NODES}/{}", number.0);
        if self.node_index.contains_key(&number.0) {
            return Err(self.document.bad_value(&pointer, "has two parents"));
        }
        let keys = motion.keys.get(&number.0).cloned().map(Arc::new);
        let in_scene = self.scene.nodes.len();
        self.node_index.insert(number.0, in_scene);
        let own = local(&node);
        let hides = |of: &Value| of.get("visible").and_then(Value::as_bool) == Some(false);
        let is_hidden = node
            .extensions
            .get("KHR_node_visibility")
            .is_some_and(hides);
        let is_visible = enclosing.is_visible && !is_hidden;
        // Where keys scale a node, they say whether it mirrors.
        let at_start = keys.as_ref().map(|keys| keys.transform(0.0));
        let is_mirrored = enclosing.is_mirrored ^ mirrors(&at_start.unwrap_or(own));
        let enclosing = if keys.is_some() {
            Enclosing {
                moving_node: Some(in_scene),
                to_moving_node: DAffine3::IDENTITY,
                is_visible,
                is_mirrored,
            }
        } else {
            Enclosing {
                to_moving_node: enclosing.to_moving_node * own,
                is_visible,
                is_mirrored,
                ..enclosing
            }
        };
        self.scene.nodes.push(crate::Node {
            name: node.name.clone(),
            parent,
            transform: if keys.is_some() {
                DAffine3::IDENTITY
            } else {
                own
            },
            keys,
        });
        if enclosing.is_visible {
            if let Some(mesh) = node.mesh {
                let has_weights = motion.weights.contains_key(&number.0);
                self.mesh(&node, number, mesh, enclosing, has_weights)?;
            }
            self.light(&node, in_scene, &pointer)?;
        }
        self.camera(&node, in_scene)?;
        pending.extend(node.children.iter().map(|child| Pending {
            number: *child,
            parent: Some(in_scene),
            enclosing,
        }));
        Ok(())
    }

    fn camera(&mut self, node: &json::Node, in_scene: usize) -> Result<(), LoadError> {
        const CAMERAS: &str = "/cameras";
        let Some(number) = node.camera else {
            return Ok(());
        };
        let camera: json::Camera = self.document.get(CAMERAS, number)?;
        let pointer = format!("{CAMERAS}/{}", number.0);
        let Some(lens) = camera.perspective else {
            let what = "the camera is not perspective; it is not used";
            self.warn(&pointer, WarningCode::Unused, what);
            return Ok(());
        };
        if self.scene.camera.is_some() {
            self.warn(
                &pointer,
                WarningCode::Unused,
                "only the first camera is used",
            );
            return Ok(());
        }
        self.scene.camera = Some(Camera {
            eye: Vec3::ZERO,
            target: Vec3::NEG_Z,
            up: Vec3::Y,
            fov_degrees: lens.yfov.to_degrees().clamp(1.0, 179.0),
        });
        self.scene.camera_node = Some(in_scene);
        Ok(())
    }

    /// Adds the mesh of a node.
    fn mesh(
        &mut self,
        node: &json::Node,
        number: Whole,
        mesh: Whole,
        enclosing: Enclosing,
        has_animated_weights: bool,
    ) -> Result<(), LoadError> {
        let (primitives, default_weights) = &*self.primitives(mesh)?;
        let pointer = format!("/nodes/{}", number.0);
        let weights = node.weights.as_ref().or(default_weights.as_ref());
        let weights = weights.map_or(&[][..], Vec::as_slice);
        let blended: Vec<Triangles>;
        let mut primitives = primitives.as_slice();
        if !has_animated_weights && weights.iter().any(|weight| *weight != 0.0) {
            let blend = |primitive: &Triangles| primitive.blended(weights);
            blended = primitives.iter().map(blend).collect();
            primitives = &blended;
        }
        let elements = elements(primitives);
        if node.skin.is_some() || has_animated_weights {
            if node.extensions.contains_key(instances::NAME) {
                let what = "instances of a mesh that changes its shape are not read; there is one";
                self.warn(&pointer, WarningCode::Unused, what);
            }
            self.count(elements, &pointer)?;
            return self.own_part(node, number, enclosing, primitives);
        }
        let instances = self.instances(node, &pointer)?;
        if instances.len() > 1 {
            return self.instanced_part(node, &pointer, enclosing, primitives, instances);
        }
        let new = self.drafts.len();
        let draft = *self.draft_of.entry(enclosing.moving_node).or_insert(new);
        if draft == new {
            let moving = enclosing.moving_node;
            let name = moving.map(|moving| self.scene.nodes[moving].name.clone());
            let name = name.unwrap_or_default();
            self.drafts.push(PartDraft::new(name, moving, false));
        }
        self.count(instances.len().saturating_mul(elements), &pointer)?;
        for instance in instances {
            let transform = Transform::new(enclosing.to_moving_node * instance);
            let is_mirrored = enclosing.is_mirrored ^ mirrors(&instance);
            for primitive in primitives {
                let draft = &mut self.drafts[draft];
                primitive.add_to(draft, &transform, is_mirrored, self.file, self.report)?;
            }
        }
        Ok(())
    }

    /// Counts vertices and triangles before they are added: a short file may repeat them any number of times.
    fn count(&mut self, elements: usize, pointer: &str) -> Result<(), LoadError> {
        self.elements = self.elements.saturating_add(elements);
        self.check_count(self.elements, pointer)
    }

    /// Refuses more vertices and triangles than a file of this size has without repeating them.
    fn check_count(&self, elements: usize, pointer: &str) -> Result<(), LoadError> {
        if elements <= MOST_REPEATED.saturating_add(self.buffers.bytes()) {
            return Ok(());
        }
        let problem = format!(
            "the file repeats its meshes to more than {MOST_REPEATED} vertices and triangles"
        );
        Err(self.document.bad_value(pointer, problem))
    }

    /// The values of an accessor, `N` numbers each.
    fn numbers<const N: usize>(
        &mut self,
        accessor: Whole,
        is_normalized: bool,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let all = self.all_numbers(accessor, is_normalized)?;
        let width = all.width;
        all.arrays().ok_or_else(|| {
            let problem = format!("has {width} components, expected {N}");
            self.document
                .bad_value(&format!("/accessors/{}", accessor.0), problem)
        })
    }

    /// The values of an accessor, of any width.
    fn all_numbers<T: accessors::Number>(
        &mut self,
        accessor: Whole,
        is_normalized: bool,
    ) -> Result<Numbers<T>, LoadError> {
        accessors::numbers(&self.document, &mut self.buffers, accessor, is_normalized)
    }

    /// Notes something about the value at a pointer; the whole file if it is empty.
    fn warn(&mut self, pointer: &str, code: WarningCode, what: impl AsRef<str>) {
        let place = (!pointer.is_empty()).then(|| Place::Pointer(pointer.to_owned()));
        self.report.warn(self.file, place, code, what);
    }

    /// Notes that something is replaced because of an error.
    fn warn_of(&mut self, error: &LoadError, code: WarningCode, replacement: &str) {
        match error {
            LoadError::BadValue {
                pointer, problem, ..
            } => {
                self.warn(
                    pointer,
                    code,
                    format!("{problem}; using {replacement} instead"),
                );
            }
            other => self.warn("", code, format!("{other}; using {replacement} instead")),
        }
    }

    fn finish(self) -> Result<SceneDescription, LoadError> {
        let mut scene = self.scene;
        let mut parts = Vec::new();
        for draft in self.drafts {
            let part = draft.finish();
            parts.push(part.map_err(|source| LoadError::Mesh {
                file: self.file.to_owned(),
                source,
            })?);
        }
        parts.extend(self.instanced_parts);
        parts.append(&mut scene.parts);
        scene.parts = parts;
        lights::expose(&mut scene);
        Ok(scene)
    }
}

/// The number of vertices and triangles of all primitives.
fn elements(primitives: &[Triangles]) -> usize {
    primitives.iter().map(Triangles::elements).sum()
}

/// The static transform of a node to the coordinates of its parent.
fn local(node: &json::Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
    }
    let turn = node.rotation.map_or(DQuat::IDENTITY, rotation);
    let scale = node.scale.map_or(DVec3::ONE, DVec3::from);
    let translation = node.translation.map_or(DVec3::ZERO, DVec3::from);
    DAffine3::from_scale_rotation_translation(scale, turn, translation)
}

fn vector(numbers: [f32; 3]) -> DVec3 {
    DVec3::from(numbers.map(f64::from))
}

/// A rotation of unit length.
fn rotation(numbers: [f64; 4]) -> DQuat {
    let length = DQuat::from_array(numbers).length();
    if length > 0.0 && length.is_finite() {
        DQuat::from_array(numbers.map(|number| number / length))
    } else {
        DQuat::IDENTITY
    }
}

/// The static transform of a node as constant curves.
fn at_rest(node: &json::Node) -> Keys {
    use crate::keys::Curve;

    let (scale, turn, translation) = match node.matrix {
        Some(_) => local(node).to_scale_rotation_translation(),
        None => (
            node.scale.map_or(DVec3::ONE, DVec3::from),
            node.rotation.map_or(DQuat::IDENTITY, rotation),
            node.translation.map_or(DVec3::ZERO, DVec3::from),
        ),
    };
    Keys {
        translation: Some(Curve::Sampled(Sampled::constant(translation))),
        rotation: Some(Curve::Sampled(Sampled::constant(turn))),
        scale: Some(Curve::Sampled(Sampled::constant(scale))),
        visibility: Vec::new(),
    }
}
