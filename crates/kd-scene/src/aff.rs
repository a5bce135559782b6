//! Reader of AFF, the format of BART's animated scenes, which extends NFF: J. Lext, U. Assarsson, T. Möller, *BART: A Benchmark
//! for Animated Ray Tracing*, 2000.

mod geometry;
mod motion;
mod tokens;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::draft::{MOST_REPEATED, PartDraft, SurfaceIds, Transform};
use crate::error::quoted;
use crate::files::read_file;
use crate::keys::{Keys, rotation_about};
use crate::report::{Report, Strictness, WarningCode};
use crate::tessellate::{RESOLUTION, UnitSphere};
use crate::{
    Camera, Light, LoadError, Material, Node, SceneDescription, Span, Texture, TextureSource,
};
use tokens::Tokens;

/// Options of the reader of AFF and NFF files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AffOptions {
    /// Whether unknown commands are skipped with a warning. Otherwise, they are an error.
    pub lenient: bool,
    /// The initial level of detail: includes of a higher level are skipped, until the scene changes the level. BART's scenes
    /// use 0.
    pub detail: u32,
    /// Tessellation of spheres and cones, at least 1: a sphere has 12 `resolution`² triangles, a cone 8 `resolution`.
    pub resolution: u32,
    /// Maximum number of triangles. Nested includes could produce any number of them.
    pub max_triangles: usize,
}

impl Default for AffOptions {
    /// Unknown commands are errors; spheres have 192 triangles, cones 32; at most 2^26 (67 million) triangles.
    fn default() -> Self {
        Self {
            lenient: false,
            detail: 0,
            resolution: RESOLUTION,
            max_triangles: MOST_REPEATED,
        }
    }
}

/// Maximum nesting of blocks and files. BART's scenes use 8.
const MAX_DEPTH: usize = 100;
/// Maximum number of includes. BART's robots have 835; files that include others twice can grow exponentially.
const MAX_INCLUDES: usize = 1 << 16;

/// Reads an AFF or NFF file, and all files that it includes.
///
/// File names are relative to the file that contains them. All static triangles form one part, and so do the triangles of each
/// animated block; triangles that change their shape form separate parts. Spheres and cones are tessellated. Polygons may be
/// concave. Textures are named, but not read.
///
/// # Errors
///
/// [`LoadError`] with the file and the line: an unknown command (unless [`AffOptions::lenient`]), an invalid number, an index
/// out of range, an include that is missing or recursive, a track of fewer than four keys, more triangles than
/// [`AffOptions::max_triangles`].
pub fn load_aff(
    path: impl AsRef<Path>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    read_aff(path.as_ref(), &mut |path| std::fs::read(path), options)
}

/// [`load_aff`], with `files` to read the file at a path.
///
/// # Errors
///
/// As [`load_aff`].
pub fn read_aff(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    let mut report = Report::new(Strictness::Usual);
    let mut scene = read_aff_with(path, files, options, &mut report)?;
    scene.warnings = report.finish();
    Ok(scene)
}

/// [`read_aff`], with its warnings in the report. A lenient reader skips unknown commands, and leaves out polygons of fewer than three
/// corners.
pub(crate) fn read_aff_with(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    options: &AffOptions,
    report: &mut Report,
) -> Result<SceneDescription, LoadError> {
    let file = path.display().to_string();
    let bytes = read_file(path, files)?;
    let scene = SceneDescription {
        ambient: Vec3::ONE,
        ..SceneDescription::default()
    };
    let mut reader = Reader {
        options,
        files,
        scene,
        report,
        detail: options.detail,
        drafts: Vec::new(),
        draft_of: HashMap::new(),
        triangles: 0,
        texture_of: HashMap::new(),
        keys: HashMap::new(),
        moving_lights: Vec::new(),
        path: vec![path.to_owned()],
        includes: 0,
        unit_sphere: None,
    };
    let enclosing = Enclosing {
        node: None,
        to_node: DAffine3::IDENTITY,
        depth: 0,
    };
    reader.commands(&mut Tokens::new(&file, &bytes), enclosing, false)?;
    reader.finish(file)
}

/// The context of a command: the blocks and files that contain it.
#[derive(Clone, Copy, Debug)]
struct Enclosing {
    /// Node of the innermost animated block.
    node: Option<usize>,
    /// Transform from the current coordinates to those of that node.
    to_node: DAffine3,
    /// Number of enclosing blocks and files.
    depth: usize,
}

struct Reader<'a> {
    options: &'a AffOptions,
    files: &'a mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    scene: SceneDescription,
    report: &'a mut Report,
    detail: u32,
    drafts: Vec<PartDraft>,
    /// Index of the draft for a node, separately for triangles that change their shape.
    draft_of: HashMap<(Option<usize>, bool), usize>,
    triangles: usize,
    texture_of: HashMap<PathBuf, u32>,
    keys: HashMap<String, Arc<Keys>>,
    /// Indices of animated lights, and the names of their key sets.
    moving_lights: Vec<(usize, String)>,
    /// The files that are open, from the outermost.
    path: Vec<PathBuf>,
    /// Number of includes so far.
    includes: usize,
    /// The tessellated unit sphere, made for the first sphere.
    unit_sphere: Option<Rc<UnitSphere>>,
}

impl Reader<'_> {
    /// Reads commands up to the end of the file, or of the block.
    fn commands(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
        is_block: bool,
    ) -> Result<(), LoadError> {
        if enclosing.depth > MAX_DEPTH {
            return Err(tokens.error(format!(
                "blocks and files are nested more than {MAX_DEPTH} deep"
            )));
        }
        while let Some(command) = tokens.next() {
            match command {
                b"}" if is_block => return Ok(()),
                b"v" => self.view(tokens)?,
                b"b" => self.scene.background = color(tokens, "the background")?,
                b"am" => self.scene.ambient = color(tokens, "the ambient light")?,
                b"l" => self.light(tokens, None)?,
                b"la" => {
                    let name = tokens.text("the name of a light's keys")?;
                    self.light(tokens, Some(name))?;
                }
                b"f" => self.simple_material(tokens)?,
                b"fm" => self.material(tokens)?,
                b"s" => self.sphere(tokens, enclosing)?,
                b"c" => self.cone(tokens, enclosing)?,
                b"p" => self.polygon(tokens, enclosing)?,
                b"pp" => self.patch(tokens, enclosing)?,
                b"tt" => self.textured_triangle(tokens, enclosing, false)?,
                b"ttp" => self.textured_triangle(tokens, enclosing, true)?,
                b"m" => self.mesh(tokens, enclosing)?,
                b"tpa" => self.morphing_triangle(tokens, enclosing)?,
                b"i" => self.include(tokens, enclosing)?,
                b"d" => self.detail = level(tokens)?,
                b"xs" => self.static_block(tokens, enclosing)?,
                b"x" => self.animated_block(tokens, enclosing)?,
                b"k" => self.key_set(tokens)?,
                b"a" => self.span(tokens)?,
                b"nff" => {
                    return Err(tokens.error("the NFF format of Sense8 is not supported"));
                }
                _ if self.options.lenient || self.report.is_lenient() => {
                    let what = format!("skipped unknown command {}", quoted(command));
                    self.warn(tokens, WarningCode::Unused, what);
                    tokens.skip_line();
                }
                _ => {
                    let problem = format!("unknown command {}", quoted(command));
                    return Err(tokens.error(problem));
                }
            }
        }
        if is_block {
            return Err(tokens.error("the file ends in a block, `}` is missing"));
        }
        Ok(())
    }

    fn view(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let mut vector = |name| {
            tokens.expect(name)?;
            vector(tokens, name)
        };
        let [eye, target, up] = [vector("from")?, vector("at")?, vector("up")?];
        tokens.expect("angle")?;
        let angle = tokens.number("the angle of view")?;
        if !(angle > 0.0 && angle < 180.0) {
            return Err(tokens.error(format!(
                "the angle of view is {angle} degrees, it must be between 0 and 180"
            )));
        }
        // The near plane has no meaning for rays.
        if tokens.take_if("hither") {
            tokens.number("hither")?;
        }
        if tokens.take_if("resolution") {
            let resolution = [tokens.count("the width")?, tokens.count("the height")?];
            let resolution = resolution.map(|count| u32::try_from(count).ok().filter(|n| *n > 0));
            let [Some(width), Some(height)] = resolution else {
                let problem = "the width and height of the picture must be from 1 to 4294967295";
                return Err(tokens.error(problem));
            };
            self.scene.resolution = Some([width, height]);
        }
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 180")]
        let fov_degrees = angle as f32;
        self.scene.camera = Some(Camera {
            eye: eye.as_vec3(),
            target: target.as_vec3(),
            up: up.as_vec3(),
            fov_degrees,
        });
        Ok(())
    }

    fn light(&mut self, tokens: &mut Tokens<'_>, keys: Option<String>) -> Result<(), LoadError> {
        let position = vector(tokens, "the position of a light")?.as_vec3();
        let color = if tokens.is_number_next() {
            color(tokens, "the color of a light")?
        } else {
            Vec3::ONE
        };
        if let Some(name) = keys {
            self.moving_lights.push((self.scene.lights.len(), name));
        }
        self.scene.lights.push(Light::point(position, color));
        Ok(())
    }

    /// `f` of NFF: one color, its diffuse and specular shares, shine, transmittance and index of refraction. Old files have the color
    /// alone.
    fn simple_material(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let color = color(tokens, "a color")?;
        let mut numbers = [1.0, 0.0, 0.0, 0.0, 1.0];
        let mut count = 0;
        while count < numbers.len() && tokens.is_number_next() {
            numbers[count] = tokens.number("a property of a material")?;
            count += 1;
        }
        if count < numbers.len() {
            let what = "a fill has fewer than eight numbers; the others are those of a diffuse, opaque surface";
            self.warn(tokens, WarningCode::BadMaterial, what);
        }
        let [diffuse, specular, rest @ ..] = numbers;
        let diffuse = color * narrow(diffuse);
        self.add_material(diffuse, diffuse, Vec3::splat(narrow(specular)), rest);
        Ok(())
    }

    /// `fm`: ambient, diffuse and specular colors, shine, transmittance and index of refraction.
    fn material(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let ambient = color(tokens, "an ambient color")?;
        let diffuse = color(tokens, "a diffuse color")?;
        let specular = color(tokens, "a specular color")?;
        let rest = tokens.numbers("shine, transmittance and index of refraction")?;
        self.add_material(ambient, diffuse, specular, rest);
        Ok(())
    }

    fn add_material(
        &mut self,
        ambient: Vec3,
        diffuse: Vec3,
        specular: Vec3,
        [shine, transmittance, refraction]: [f64; 3],
    ) {
        let material = Material {
            ambient,
            diffuse,
            specular,
            mirror: specular,
            shine: narrow(shine.max(0.0)),
            transmittance: narrow(transmittance.clamp(0.0, 1.0)),
            refraction: narrow(refraction),
            ..Material::default()
        };
        // Repeated includes repeat the same material.
        if self.scene.materials.last() != Some(&material) {
            self.scene.materials.push(material);
        }
    }

    /// Notes something at the last token.
    fn warn(&mut self, tokens: &Tokens<'_>, code: WarningCode, what: impl AsRef<str>) {
        let (file, place) = tokens.place();
        self.report.warn(file, place, code, what);
    }

    fn span(&mut self, tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
        let [start, end] = tokens.numbers("the times of an animation")?;
        let frames = tokens.count("the number of frames")?;
        if frames == 0 || end < start {
            return Err(tokens.error(format!(
                "an animation of {frames} frames from {start} to {end} s; at least 1 frame is needed, and an end that is not before the start"
            )));
        }
        self.scene.span = Some(Span { start, end, frames });
        Ok(())
    }

    fn include(&mut self, tokens: &mut Tokens<'_>, enclosing: Enclosing) -> Result<(), LoadError> {
        let level = level(tokens)?;
        let name = tokens.text("the name of a file")?;
        if level > self.detail {
            return Ok(());
        }
        let path = self.resolve(&name);
        if self.path.contains(&path) {
            let problem = format!("`{name}` includes itself, directly or through other files");
            return Err(tokens.error(problem));
        }
        self.includes += 1;
        if self.includes > MAX_INCLUDES {
            return Err(tokens.error(format!("more than {MAX_INCLUDES} includes")));
        }
        let bytes = (self.files)(&path)
            .map_err(|error| tokens.error(format!("cannot include `{name}`: {error}")))?;
        let file = path.display().to_string();
        self.path.push(path);
        let enclosing = Enclosing {
            depth: enclosing.depth + 1,
            ..enclosing
        };
        self.commands(&mut Tokens::new(&file, &bytes), enclosing, false)?;
        self.path.pop();
        Ok(())
    }

    /// The path of a file that the current file names.
    fn resolve(&self, name: &str) -> PathBuf {
        let folder = self.path.last().and_then(|path| path.parent());
        folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name))
    }

    /// `xs`: a block with a static transform: scale, then rotation, then translation.
    fn static_block(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let scale = vector(tokens, "a scale")?;
        let axis = vector(tokens, "an axis")?;
        let degrees = tokens.number("an angle")?;
        let translation = vector(tokens, "a translation")?;
        tokens.expect("{")?;
        let rotation = match axis.try_normalize() {
            Some(axis) => rotation_about(axis, degrees.to_radians()),
            None => DMat3::IDENTITY,
        };
        let own = DAffine3 {
            matrix3: rotation * DMat3::from_diagonal(scale),
            translation,
        };
        let enclosing = Enclosing {
            to_node: enclosing.to_node * own,
            depth: enclosing.depth + 1,
            ..enclosing
        };
        self.commands(tokens, enclosing, true)
    }

    /// `x`: a block that a key set animates.
    fn animated_block(
        &mut self,
        tokens: &mut Tokens<'_>,
        enclosing: Enclosing,
    ) -> Result<(), LoadError> {
        let name = tokens.text("the name of a block")?;
        tokens.expect("{")?;
        self.scene.nodes.push(Node {
            name,
            parent: enclosing.node,
            transform: enclosing.to_node,
            keys: None,
        });
        let enclosing = Enclosing {
            node: Some(self.scene.nodes.len() - 1),
            to_node: DAffine3::IDENTITY,
            depth: enclosing.depth + 1,
        };
        self.commands(tokens, enclosing, true)
    }

    /// The current material, with a texture.
    fn surface_ids(&mut self, texture: u32) -> SurfaceIds {
        if self.scene.materials.is_empty() {
            self.scene.materials.push(Material::default());
        }
        let last = self.scene.materials.len() - 1;
        SurfaceIds {
            material: u32::try_from(last).expect("fewer than 2^32, as each takes bytes of a file"),
            texture,
        }
    }

    fn texture(&mut self, name: String) -> u32 {
        let path = self.resolve(&name);
        let textures = &mut self.scene.textures;
        let number =
            u32::try_from(textures.len()).expect("fewer than 2^32, as each takes bytes of a file");
        *self.texture_of.entry(path.clone()).or_insert_with(|| {
            let source = TextureSource::File(path);
            textures.push(Texture { name, source });
            number
        })
    }

    fn draft(&mut self, enclosing: Enclosing, morphs: bool) -> &mut PartDraft {
        let new = self.drafts.len();
        let nodes = &self.scene.nodes;
        let number = *self.draft_of.entry((enclosing.node, morphs)).or_insert(new);
        if number == new {
            let mut names = Vec::new();
            let mut node = enclosing.node;
            while let Some(number) = node {
                names.push(nodes[number].name.as_str());
                node = nodes[number].parent;
            }
            names.reverse();
            self.drafts
                .push(PartDraft::new(names.join("/"), enclosing.node, morphs));
        }
        &mut self.drafts[number]
    }

    /// Counts triangles against the maximum.
    fn count_triangles(&mut self, tokens: &Tokens<'_>, count: usize) -> Result<(), LoadError> {
        self.triangles = self.triangles.saturating_add(count);
        if self.triangles <= self.options.max_triangles {
            return Ok(());
        }
        let max = self.options.max_triangles;
        Err(tokens.error(format!("more than {max} triangles, the maximum")))
    }

    fn finish(self, file: String) -> Result<SceneDescription, LoadError> {
        let mut scene = self.scene;
        for node in &mut scene.nodes {
            node.keys = self.keys.get(&node.name).cloned();
        }
        for (light, name) in self.moving_lights {
            scene.lights[light].keys = self.keys.get(&name).cloned();
        }
        scene.camera_keys = self.keys.get("camera").cloned();
        for draft in self.drafts {
            let part = draft.finish();
            scene.parts.push(part.map_err(|source| LoadError::Mesh {
                file: file.clone(),
                source,
            })?);
        }
        Ok(scene)
    }
}

fn vector(tokens: &mut Tokens<'_>, what: &str) -> Result<DVec3, LoadError> {
    tokens.numbers(what).map(DVec3::from_array)
}

fn color(tokens: &mut Tokens<'_>, what: &str) -> Result<Vec3, LoadError> {
    vector(tokens, what).map(|color| color.as_vec3())
}

fn level(tokens: &mut Tokens<'_>) -> Result<u32, LoadError> {
    let count = tokens.count("a level of detail")?;
    Ok(u32::try_from(count).unwrap_or(u32::MAX))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "colors and exponents are given in few digits"
)]
fn narrow(number: f64) -> f32 {
    number as f32
}

/// The transform of positions and normals in a block.
fn transform(enclosing: Enclosing) -> Transform {
    Transform::new(enclosing.to_node)
}
