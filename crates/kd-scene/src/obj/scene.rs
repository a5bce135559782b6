//! OBJ files as scenes: what their triangles look like, by normals, places in textures and materials.

use std::collections::HashMap;
use std::io;
use std::path::Path;

use glam::Vec3;

use super::{BYTE_ORDER_MARK, Statements, read_obj, words};
use crate::error::quoted;
use crate::files::opened;
use crate::{LoadError, Material, SceneDescription, Surface, Texture, TextureSource};

/// Reads a Wavefront OBJ file as a scene that stands still: its geometry as [`read_obj`] does, and normals, places in textures
/// and materials with it. `path` is used in errors, and to find the files that it names.
///
/// Materials have a diffuse colour or texture, highlights, mirrors where their illumination model is 3 or more, and let light
/// through as far as they are dissolved. Files of materials that are missing or broken, and materials that are in none, are
/// warnings, and light grey.
///
/// # Errors
///
/// As [`read_obj`], and for normals and places in textures as for positions.
pub fn read_obj_scene(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let name = path.display().to_string();
    let bytes = opened(path, files)?;
    let mesh = read_obj(bytes.as_slice(), &name)?;
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes);
    let looks = looks(bytes, path, files)?;
    let mut scene = SceneDescription::of_mesh(mesh);
    scene.materials = looks.materials;
    scene.textures = looks.textures;
    scene.warnings = looks.warnings;
    scene.parts[0].surface = looks.surface;
    Ok(scene)
}

/// What is read beside the geometry.
#[derive(Debug, Default)]
struct Looks {
    surface: Surface,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    warnings: Vec<String>,
}

/// Reads everything but the geometry, which is known to be right; triangles are fans of faces, in file order.
fn looks(
    bytes: &[u8],
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<Looks, LoadError> {
    let mut reader = Reader {
        file: path.display().to_string(),
        folder: path.parent().unwrap_or(Path::new("")),
        files,
        looks: Looks {
            materials: vec![Material::default()],
            ..Looks::default()
        },
        numbers: HashMap::new(),
        textures_of: vec![Surface::NO_TEXTURE],
        normals: Vec::new(),
        uvs: Vec::new(),
        current: 0,
        face: 0,
    };
    let mut statements = Statements::new(bytes);
    let mut statement = Vec::new();
    while let Some(line) = statements.next_into(&mut statement) {
        reader.statement(&statement, line)?;
    }
    Ok(reader.finish())
}

struct Reader<'a> {
    file: String,
    folder: &'a Path,
    files: &'a mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    looks: Looks,
    /// Materials by their names, and the texture of each.
    numbers: HashMap<String, u32>,
    textures_of: Vec<u32>,
    normals: Vec<Vec3>,
    uvs: Vec<[f32; 2]>,
    /// The material in use.
    current: u32,
    face: usize,
}

/// A corner of a face, without its position.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    uv: Option<[f32; 2]>,
    normal: Option<Vec3>,
}

impl Reader<'_> {
    fn statement(&mut self, statement: &[u8], line: usize) -> Result<(), LoadError> {
        let mut words = words(statement);
        match words.next() {
            Some(b"vn") => {
                let normal = Vec3::from(self.numbers_of(statement, line)?);
                self.normals.push(normal);
            }
            Some(b"vt") => {
                // The second may be left out, and is counted from below there.
                let [u, v] = match words.count() {
                    1 => [self.numbers_of::<1>(statement, line)?[0], 0.0],
                    _ => self.numbers_of(statement, line)?,
                };
                self.uvs.push([u, 1.0 - v]);
            }
            Some(b"mtllib") => {
                let names = rest(statement, b"mtllib");
                // A name may have blanks in it; several names are several words.
                if !self.library(&names) && names.contains(' ') {
                    for name in names.split_whitespace() {
                        self.library(name);
                    }
                }
            }
            Some(b"usemtl") => self.choose(&rest(statement, b"usemtl")),
            Some(b"f" | b"fo") => {
                let corners = words.map(|word| self.corner(word, line));
                let corners = corners.collect::<Result<Vec<Corner>, _>>()?;
                for i in 2..corners.len() {
                    self.triangle([corners[0], corners[i - 1], corners[i]]);
                }
                self.face += 1;
            }
            _ => {}
        }
        Ok(())
    }

    fn numbers_of<const N: usize>(
        &self,
        statement: &[u8],
        line: usize,
    ) -> Result<[f32; N], LoadError> {
        let number = |word| std::str::from_utf8(word).ok()?.parse::<f32>().ok();
        let mut numbers = words(statement).skip(1).map(number);
        let mut all = [0.0; N];
        for one in &mut all {
            let found = numbers.next().flatten().filter(|number| number.is_finite());
            *one = found.ok_or_else(|| LoadError::BadLine {
                file: self.file.clone(),
                line,
                problem: format!("bad numbers: {}", quoted(statement)),
            })?;
        }
        Ok(all)
    }

    /// `position/uv/normal`, of which the latter two may be left out.
    fn corner(&self, word: &[u8], line: usize) -> Result<Corner, LoadError> {
        let mut parts = word.split(|byte| *byte == b'/').skip(1);
        Ok(Corner {
            uv: self.named(parts.next(), &self.uvs, line)?,
            normal: self.named(parts.next(), &self.normals, line)?,
        })
    }

    /// What a number names, from 1 on, or from -1 back.
    fn named<T: Copy>(
        &self,
        word: Option<&[u8]>,
        all: &[T],
        line: usize,
    ) -> Result<Option<T>, LoadError> {
        let Some(word) = word.filter(|word| !word.is_empty()) else {
            return Ok(None);
        };
        let index = std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse::<i64>().ok());
        let Some(index) = index else {
            return Err(LoadError::BadLine {
                file: self.file.clone(),
                line,
                problem: format!("bad face: {} is no index", quoted(word)),
            });
        };
        let count = i64::try_from(all.len()).unwrap_or(i64::MAX);
        let number = if index < 0 { count + index } else { index - 1 };
        let found = usize::try_from(number)
            .ok()
            .and_then(|number| all.get(number));
        found
            .copied()
            .map(Some)
            .ok_or_else(|| LoadError::IndexOutOfRange {
                file: self.file.clone(),
                line: Some(line),
                face: self.face,
                index,
                vertices: all.len(),
            })
    }

    fn triangle(&mut self, corners: [Corner; 3]) {
        let surface = &mut self.looks.surface;
        let before = surface.materials.len();
        surface.materials.push(self.current);
        let texture = self.textures_of[self.current as usize];
        if let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.uv)
            && texture != Surface::NO_TEXTURE
        {
            surface.textures.resize(before, Surface::NO_TEXTURE);
            surface.textures.push(texture);
            surface.uvs.resize(before, [[0.0; 2]; 3]);
            surface.uvs.push([a, b, c]);
        }
        if let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.normal) {
            surface.normals.resize(before, [Vec3::ZERO; 3]);
            surface.normals.push([a, b, c]);
        }
    }

    /// Uses a material. One that is not known is grey.
    fn choose(&mut self, name: &str) {
        let known = self.numbers.get(name).copied();
        self.current = known.unwrap_or_else(|| {
            let warning = format!("{}: no material `{name}`; light grey is used", self.file);
            if !self.looks.warnings.contains(&warning) {
                self.looks.warnings.push(warning);
            }
            0
        });
    }

    /// Reads a file of materials; false if it cannot be read.
    fn library(&mut self, name: &str) -> bool {
        let path = self.folder.join(name);
        let bytes = (self.files)(&path).map_err(|error| error.to_string());
        let loaded = bytes.and_then(|bytes| {
            tobj::load_mtl_buf(&mut bytes.as_slice()).map_err(|error| error.to_string())
        });
        match loaded {
            Ok((materials, _)) => {
                for material in &materials {
                    self.add(material);
                }
                true
            }
            Err(error) => {
                let warning = format!("{}: {error}; light grey is used", path.display());
                self.looks.warnings.push(warning);
                false
            }
        }
    }

    fn add(&mut self, material: &tobj::Material) {
        let color = |color: Option<[f32; 3]>, otherwise: f32| {
            color.map_or(Vec3::splat(otherwise), Vec3::from)
        };
        let texture = material
            .diffuse_texture
            .as_deref()
            .map(|name| self.texture(name));
        // A texture stands for the colour where that is black.
        let diffuse = color(material.diffuse, 0.8);
        let diffuse = if texture.is_some() && diffuse == Vec3::ZERO {
            Vec3::ONE
        } else {
            diffuse
        };
        let specular = color(material.specular, 0.0);
        // Models below 3 have highlights, and no mirrors.
        let is_mirror = material.illumination_model.is_some_and(|model| model >= 3);
        let made = Material {
            // Most files have an ambient colour that means nothing.
            ambient: 0.25 * diffuse,
            diffuse,
            specular,
            mirror: if is_mirror { specular } else { Vec3::ZERO },
            shine: material.shininess.unwrap_or(0.0).max(0.0),
            transmittance: (1.0 - material.dissolve.unwrap_or(1.0)).clamp(0.0, 1.0),
            refraction: material.optical_density.unwrap_or(1.0),
        };
        let number = u32::try_from(self.looks.materials.len()).expect("each takes bytes of a file");
        self.looks.materials.push(made);
        self.textures_of
            .push(texture.unwrap_or(Surface::NO_TEXTURE));
        self.numbers.insert(material.name.clone(), number);
    }

    fn texture(&mut self, name: &str) -> u32 {
        // Options come first, and the name last; some write it with the strokes of another system.
        let name = name
            .rsplit(char::is_whitespace)
            .next()
            .unwrap_or(name)
            .replace('\\', "/");
        let source = TextureSource::File(self.folder.join(&name));
        let textures = &mut self.looks.textures;
        let known = textures.iter().position(|texture| texture.source == source);
        let number = known.unwrap_or_else(|| {
            textures.push(Texture { name, source });
            textures.len() - 1
        });
        u32::try_from(number).expect("each takes bytes of a file")
    }

    fn finish(self) -> Looks {
        let mut looks = self.looks;
        let triangles = looks.surface.materials.len();
        let surface = &mut looks.surface;
        if !surface.textures.is_empty() {
            surface.textures.resize(triangles, Surface::NO_TEXTURE);
            surface.uvs.resize(triangles, [[0.0; 2]; 3]);
        }
        if !surface.normals.is_empty() {
            surface.normals.resize(triangles, [Vec3::ZERO; 3]);
        }
        looks
    }
}

/// What follows the first word of a statement.
fn rest(statement: &[u8], word: &[u8]) -> String {
    let text = statement.trim_ascii();
    let text = text.strip_prefix(word).unwrap_or(text).trim_ascii();
    String::from_utf8_lossy(text).into_owned()
}
