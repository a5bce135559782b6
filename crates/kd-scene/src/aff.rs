//! AFF, the animated scenes of BART, which extend NFF: J. Lext, U. Assarsson, T. Möller, *BART: A Benchmark for Animated Ray
//! Tracing*, 2000.

mod geometry;
mod motion;
mod polygon;
mod words;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::draft::{Draft, Look, Place};
use crate::error::quoted;
use crate::files::opened;
use crate::keys::{Keys, turn};
use crate::tessellate::{RESOLUTION, UnitSphere};
use crate::{
    Camera, Light, LoadError, Material, Node, SceneDescription, Span, Texture, TextureSource,
};
use words::Words;

/// How AFF and NFF files are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AffOptions {
    /// Whether commands that are not known are left out, with a warning, rather than refused.
    pub lenient: bool,
    /// Files that are included for more detail than this are left out, until the scene says otherwise. 0 in BART's scenes.
    pub detail: u32,
    /// Cells along an edge of the six sides of a sphere, and sides of a quarter of a cone; at least 1.
    pub resolution: u32,
    /// More triangles than this are refused: files that include each other can ask for any number.
    pub most_triangles: usize,
}

impl Default for AffOptions {
    /// Refuses what is not known; spheres of 192 triangles, cones of 32; up to 64 million triangles.
    fn default() -> Self {
        Self {
            lenient: false,
            detail: 0,
            resolution: RESOLUTION,
            most_triangles: 1 << 26,
        }
    }
}

/// Blocks and files within each other, at most: BART's have eight.
const MOST_LEVELS: usize = 100;
/// Files that are included, each as often as it is: BART's robots have 835. Files that include others twice could go on for ever.
const MOST_INCLUDES: usize = 1 << 16;

/// Reads an AFF or NFF file, and all that it includes.
///
/// Names of files are relative to the file that names them. Everything that stands still is one part, and everything in
/// one animated block is one part; triangles that change their shape are parts of their own. Spheres and cones are
/// tessellated, polygons may be concave. Textures are not read, only named.
///
/// # Errors
///
/// [`LoadError`] with the file and the line: commands that are not known (unless they are left out:
/// [`AffOptions::lenient`]), numbers that are none, indices out of range, files that include themselves or are not
/// there, tracks of fewer than four keys, too many triangles.
pub fn load_aff(
    path: impl AsRef<Path>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    read_aff(path.as_ref(), &mut |path| std::fs::read(path), options)
}

/// [`load_aff`] from any place that files may come from.
///
/// # Errors
///
/// As [`load_aff`].
pub fn read_aff(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    let file = path.display().to_string();
    let bytes = opened(path, files)?;
    let scene = SceneDescription {
        ambient: Vec3::ONE,
        ..SceneDescription::default()
    };
    let mut reader = Reader {
        options,
        files,
        scene,
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
    let around = Around {
        node: None,
        to_node: DAffine3::IDENTITY,
        levels: 0,
    };
    reader.commands(&mut Words::new(&file, &bytes), around, false)?;
    reader.finish(file)
}

/// Where geometry comes to stand.
#[derive(Clone, Copy, Debug)]
struct Around {
    /// The innermost animated block.
    node: Option<usize>,
    /// From the coordinates here to those of that block.
    to_node: DAffine3,
    /// Blocks and files around.
    levels: usize,
}

struct Reader<'a> {
    options: &'a AffOptions,
    files: &'a mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    scene: SceneDescription,
    detail: u32,
    drafts: Vec<Draft>,
    /// The draft of what is in a node, and of what changes its shape there.
    draft_of: HashMap<(Option<usize>, bool), usize>,
    triangles: usize,
    texture_of: HashMap<PathBuf, u32>,
    keys: HashMap<String, Arc<Keys>>,
    /// Lights and the names of their keys.
    moving_lights: Vec<(usize, String)>,
    /// The files that are being read, from the outermost.
    path: Vec<PathBuf>,
    /// How many have been included.
    includes: usize,
    /// Made for the first sphere.
    unit_sphere: Option<Rc<UnitSphere>>,
}

impl Reader<'_> {
    /// Reads up to the end of the file, or of the block.
    fn commands(
        &mut self,
        words: &mut Words<'_>,
        around: Around,
        is_block: bool,
    ) -> Result<(), LoadError> {
        if around.levels > MOST_LEVELS {
            return Err(words.error(format!(
                "more than {MOST_LEVELS} blocks and files within each other"
            )));
        }
        while let Some(command) = words.next() {
            match command {
                b"}" if is_block => return Ok(()),
                b"v" => self.view(words)?,
                b"b" => self.scene.background = color(words, "the background")?,
                b"am" => self.scene.ambient = color(words, "the ambient light")?,
                b"l" => self.light(words, None)?,
                b"la" => {
                    let name = words.text("the name of a light's keys")?;
                    self.light(words, Some(name))?;
                }
                b"f" => self.simple_material(words)?,
                b"fm" => self.material(words)?,
                b"s" => self.sphere(words, around)?,
                b"c" => self.cone(words, around)?,
                b"p" => self.polygon(words, around)?,
                b"pp" => self.patch(words, around)?,
                b"tt" => self.textured_triangle(words, around, false)?,
                b"ttp" => self.textured_triangle(words, around, true)?,
                b"m" => self.mesh(words, around)?,
                b"tpa" => self.morphing_triangle(words, around)?,
                b"i" => self.include(words, around)?,
                b"d" => self.detail = level(words)?,
                b"xs" => self.still_block(words, around)?,
                b"x" => self.moving_block(words, around)?,
                b"k" => self.key_set(words)?,
                b"a" => self.span(words)?,
                _ if self.options.lenient => {
                    let warning =
                        words.error(format!("{} is not known: left out", quoted(command)));
                    self.scene.warnings.push(warning.to_string());
                    words.skip_line();
                }
                _ => {
                    let problem = format!("{} is not a command of AFF", quoted(command));
                    return Err(words.error(problem));
                }
            }
        }
        if is_block {
            return Err(words.error("the file ends within a block, `}` is missing"));
        }
        Ok(())
    }

    fn view(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let mut vector = |name| {
            words.expect(name)?;
            vector(words, name)
        };
        let [eye, target, up] = [vector("from")?, vector("at")?, vector("up")?];
        words.expect("angle")?;
        let angle = words.number("the angle of view")?;
        if !(angle > 0.0 && angle < 180.0) {
            return Err(words.error(format!("an angle of view of {angle} degrees")));
        }
        // Where pictures begin to show anything does not matter to rays.
        words.expect("hither")?;
        words.number("hither")?;
        words.expect("resolution")?;
        let resolution = [words.count("the width")?, words.count("the height")?];
        let resolution = resolution.map(|count| u32::try_from(count).ok().filter(|n| *n > 0));
        let [Some(width), Some(height)] = resolution else {
            return Err(words.error("a picture without pixels, or with too many"));
        };
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 180")]
        let fov_degrees = angle as f32;
        self.scene.camera = Some(Camera {
            eye: eye.as_vec3(),
            target: target.as_vec3(),
            up: up.as_vec3(),
            fov_degrees,
        });
        self.scene.resolution = Some([width, height]);
        Ok(())
    }

    fn light(&mut self, words: &mut Words<'_>, keys: Option<String>) -> Result<(), LoadError> {
        let position = vector(words, "the position of a light")?.as_vec3();
        let color = if words.is_number_next() {
            color(words, "the colour of a light")?
        } else {
            Vec3::ONE
        };
        if let Some(name) = keys {
            self.moving_lights.push((self.scene.lights.len(), name));
        }
        self.scene.lights.push(Light {
            position,
            color,
            keys: None,
        });
        Ok(())
    }

    /// `f`, of NFF: one colour, and how much of it is dull and how much shines.
    fn simple_material(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let color = color(words, "a colour")?;
        let [dull, shiny] = words.numbers("how a surface reflects")?;
        let diffuse = color * narrow(dull);
        self.add_material(words, diffuse, diffuse, Vec3::splat(narrow(shiny)))
    }

    /// `fm`: colours for everything.
    fn material(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let ambient = color(words, "an ambient colour")?;
        let diffuse = color(words, "a diffuse colour")?;
        let specular = color(words, "a specular colour")?;
        self.add_material(words, ambient, diffuse, specular)
    }

    fn add_material(
        &mut self,
        words: &mut Words<'_>,
        ambient: Vec3,
        diffuse: Vec3,
        specular: Vec3,
    ) -> Result<(), LoadError> {
        let [shine, transmittance, refraction] =
            words.numbers("shine, transmittance and index of refraction")?;
        let material = Material {
            ambient,
            diffuse,
            specular,
            mirror: specular,
            shine: narrow(shine.max(0.0)),
            transmittance: narrow(transmittance.clamp(0.0, 1.0)),
            refraction: narrow(refraction),
        };
        // Files of one look are included again and again.
        if self.scene.materials.last() != Some(&material) {
            self.scene.materials.push(material);
        }
        Ok(())
    }

    fn span(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let [start, end] = words.numbers("the times of an animation")?;
        let frames = words.count("the number of frames")?;
        if frames == 0 || end < start {
            return Err(words.error(format!("{frames} frames from {start} to {end}")));
        }
        self.scene.span = Some(Span { start, end, frames });
        Ok(())
    }

    fn include(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        let level = level(words)?;
        let name = words.text("the name of a file")?;
        if level > self.detail {
            return Ok(());
        }
        let path = self.beside(&name);
        if self.path.contains(&path) {
            let problem = format!("`{name}` is included while it is being read");
            return Err(words.error(problem));
        }
        self.includes += 1;
        if self.includes > MOST_INCLUDES {
            return Err(words.error(format!("more than {MOST_INCLUDES} files are included")));
        }
        let bytes = (self.files)(&path)
            .map_err(|error| words.error(format!("cannot include `{name}`: {error}")))?;
        let file = path.display().to_string();
        self.path.push(path);
        let around = Around {
            levels: around.levels + 1,
            ..around
        };
        self.commands(&mut Words::new(&file, &bytes), around, false)?;
        self.path.pop();
        Ok(())
    }

    /// A file that the one that is being read names.
    fn beside(&self, name: &str) -> PathBuf {
        let folder = self.path.last().and_then(|path| path.parent());
        folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name))
    }

    /// `xs`: scaled, then turned, then moved.
    fn still_block(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        let scale = vector(words, "a scale")?;
        let axis = vector(words, "an axis")?;
        let degrees = words.number("an angle")?;
        let translation = vector(words, "a translation")?;
        words.expect("{")?;
        let rotation = match axis.try_normalize() {
            Some(axis) => turn(axis, degrees.to_radians()),
            None => DMat3::IDENTITY,
        };
        let own = DAffine3 {
            matrix3: rotation * DMat3::from_diagonal(scale),
            translation,
        };
        let around = Around {
            to_node: around.to_node * own,
            levels: around.levels + 1,
            ..around
        };
        self.commands(words, around, true)
    }

    fn moving_block(&mut self, words: &mut Words<'_>, around: Around) -> Result<(), LoadError> {
        let name = words.text("the name of a block")?;
        words.expect("{")?;
        self.scene.nodes.push(Node {
            name,
            parent: around.node,
            place: around.to_node,
            keys: None,
        });
        let around = Around {
            node: Some(self.scene.nodes.len() - 1),
            to_node: DAffine3::IDENTITY,
            levels: around.levels + 1,
        };
        self.commands(words, around, true)
    }

    /// How what is read now looks.
    fn look(&mut self, texture: u32) -> Look {
        if self.scene.materials.is_empty() {
            self.scene.materials.push(Material::default());
        }
        let last = self.scene.materials.len() - 1;
        Look {
            material: u32::try_from(last).expect("each takes more than a byte of a file"),
            texture,
        }
    }

    fn texture(&mut self, name: String) -> u32 {
        let path = self.beside(&name);
        let textures = &mut self.scene.textures;
        let number = u32::try_from(textures.len()).expect("each takes more than a byte of a file");
        *self.texture_of.entry(path.clone()).or_insert_with(|| {
            let source = TextureSource::File(path);
            textures.push(Texture { name, source });
            number
        })
    }

    fn draft(&mut self, around: Around, morphs: bool) -> &mut Draft {
        let new = self.drafts.len();
        let nodes = &self.scene.nodes;
        let number = *self.draft_of.entry((around.node, morphs)).or_insert(new);
        if number == new {
            let mut names = Vec::new();
            let mut node = around.node;
            while let Some(number) = node {
                names.push(nodes[number].name.as_str());
                node = nodes[number].parent;
            }
            names.reverse();
            self.drafts
                .push(Draft::new(names.join("/"), around.node, morphs));
        }
        &mut self.drafts[number]
    }

    /// Refuses more triangles than there may be.
    fn count_triangles(&mut self, words: &Words<'_>, count: usize) -> Result<(), LoadError> {
        self.triangles = self.triangles.saturating_add(count);
        if self.triangles <= self.options.most_triangles {
            return Ok(());
        }
        let most = self.options.most_triangles;
        Err(words.error(format!("more than {most} triangles")))
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

fn vector(words: &mut Words<'_>, what: &str) -> Result<DVec3, LoadError> {
    words.numbers(what).map(DVec3::from_array)
}

fn color(words: &mut Words<'_>, what: &str) -> Result<Vec3, LoadError> {
    vector(words, what).map(|color| color.as_vec3())
}

fn level(words: &mut Words<'_>) -> Result<u32, LoadError> {
    let count = words.count("a level of detail")?;
    Ok(u32::try_from(count).unwrap_or(u32::MAX))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "colours and exponents are given in few digits"
)]
fn narrow(number: f64) -> f32 {
    number as f32
}

/// Where something in a block stands.
fn place(around: Around) -> Place {
    Place::new(around.to_node)
}
