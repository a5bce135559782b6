//! OBJ files as scenes: normals, texture coordinates and materials beside the geometry.

use std::collections::HashMap;
use std::io;
use std::path::Path;

use glam::Vec3;

use super::{BYTE_ORDER_MARK, Statements, read_obj, words};
use crate::error::quoted;
use crate::files::read_file;
use crate::{LoadError, Material, SceneDescription, Surface, Texture, TextureSource};

/// Reads a Wavefront OBJ file as a static scene of one part: the geometry of [`read_obj`], normals, texture coordinates and
/// materials. `files` reads the file at a path; names in the file are relative to `path`.
///
/// A material has a diffuse color or texture, highlights, a mirror reflectance if its illumination model is 3 or more, and a
/// transmittance of 1 minus its `d`. A material file that is missing or invalid, and a material that no file defines, are
/// warnings; their triangles are light gray.
///
/// # Errors
///
/// Those of [`read_obj`]; normals and texture coordinates have the same errors as positions.
pub fn read_obj_scene(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let name = path.display().to_string();
    let bytes = read_file(path, files)?;
    let mesh = read_obj(bytes.as_slice(), &name)?;
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes);
    let appearance = appearance(bytes, path, files)?;
    let mut scene = SceneDescription::of_mesh(mesh);
    scene.materials = appearance.materials;
    scene.textures = appearance.textures;
    scene.warnings = appearance.warnings;
    scene.parts[0].surface = appearance.surface;
    Ok(scene)
}

/// The scene data beside the geometry.
#[derive(Debug, Default)]
struct Appearance {
    surface: Surface,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    warnings: Vec<String>,
}

/// Reads everything but the geometry, which is valid already. Triangles are the fans of the faces, in file order.
fn appearance(
    bytes: &[u8],
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<Appearance, LoadError> {
    let mut reader = Reader {
        file: path.display().to_string(),
        folder: path.parent().unwrap_or(Path::new("")),
        files,
        appearance: Appearance {
            materials: vec![Material::default()],
            ..Appearance::default()
        },
        material_indices: HashMap::new(),
        material_textures: vec![Surface::NO_TEXTURE],
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
    appearance: Appearance,
    /// Indices of materials by name.
    material_indices: HashMap<String, u32>,
    /// Texture index of each material.
    material_textures: Vec<u32>,
    normals: Vec<Vec3>,
    uvs: Vec<[f32; 2]>,
    /// Index of the current material.
    current: u32,
    face: usize,
}

/// The texture coordinates and the normal of a corner of a face.
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
                // `v` is optional and runs from the bottom up in OBJ.
                let [u, v] = match words.count() {
                    1 => [self.numbers_of::<1>(statement, line)?[0], 0.0],
                    _ => self.numbers_of(statement, line)?,
                };
                self.uvs.push([u, 1.0 - v]);
            }
            Some(b"mtllib") => {
                let names = rest(statement, b"mtllib");
                // The text is either one name with blanks, or several names.
                if !self.read_library(&names) && names.contains(' ') {
                    for name in names.split_whitespace() {
                        self.read_library(name);
                    }
                }
            }
            Some(b"usemtl") => self.use_material(&rest(statement, b"usemtl")),
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

    /// Parses `position/uv/normal`, where the last two are optional.
    fn corner(&self, word: &[u8], line: usize) -> Result<Corner, LoadError> {
        let mut indices = word.split(|byte| *byte == b'/').skip(1);
        Ok(Corner {
            uv: self.lookup(indices.next(), &self.uvs, line)?,
            normal: self.lookup(indices.next(), &self.normals, line)?,
        })
    }

    /// The element of `all` at an index from 1, or at a negative index from the end.
    fn lookup<T: Copy>(
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
                problem: format!("bad face: {} is not an index", quoted(word)),
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
        let surface = &mut self.appearance.surface;
        let before = surface.materials.len();
        surface.materials.push(self.current);
        let texture = self.material_textures[self.current as usize];
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

    /// Makes a material current; an unknown name selects light gray.
    fn use_material(&mut self, name: &str) {
        let known = self.material_indices.get(name).copied();
        self.current = known.unwrap_or_else(|| {
            let warning = format!("{}: unknown material `{name}`; using light gray", self.file);
            if !self.appearance.warnings.contains(&warning) {
                self.appearance.warnings.push(warning);
            }
            0
        });
    }

    /// Reads a material file; `false` if it cannot be read.
    fn read_library(&mut self, name: &str) -> bool {
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
                let warning = format!("{}: {error}; using light gray", path.display());
                self.appearance.warnings.push(warning);
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
        // Under a texture, black means that the texture alone gives the color.
        let diffuse = color(material.diffuse, 0.8);
        let diffuse = if texture.is_some() && diffuse == Vec3::ZERO {
            Vec3::ONE
        } else {
            diffuse
        };
        let specular = color(material.specular, 0.0);
        // Illumination models below 3 have highlights, but no mirror reflection.
        let is_mirror = material.illumination_model.is_some_and(|model| model >= 3);
        let made = Material {
            // The ambient color in most files is meaningless.
            ambient: 0.25 * diffuse,
            diffuse,
            specular,
            mirror: if is_mirror { specular } else { Vec3::ZERO },
            shine: material.shininess.unwrap_or(0.0).max(0.0),
            transmittance: (1.0 - material.dissolve.unwrap_or(1.0)).clamp(0.0, 1.0),
            refraction: material.optical_density.unwrap_or(1.0),
        };
        let number = u32::try_from(self.appearance.materials.len())
            .expect("fewer than 2^32, as each takes bytes of a file");
        self.appearance.materials.push(made);
        self.material_textures
            .push(texture.unwrap_or(Surface::NO_TEXTURE));
        self.material_indices.insert(material.name.clone(), number);
    }

    fn texture(&mut self, name: &str) -> u32 {
        // The name follows the options; some files use backslashes in paths.
        let name = name
            .rsplit(char::is_whitespace)
            .next()
            .unwrap_or(name)
            .replace('\\', "/");
        let source = TextureSource::File(self.folder.join(&name));
        let textures = &mut self.appearance.textures;
        let known = textures.iter().position(|texture| texture.source == source);
        let number = known.unwrap_or_else(|| {
            textures.push(Texture { name, source });
            textures.len() - 1
        });
        u32::try_from(number).expect("fewer than 2^32, as each takes bytes of a file")
    }

    fn finish(self) -> Appearance {
        let mut appearance = self.appearance;
        let triangles = appearance.surface.materials.len();
        let surface = &mut appearance.surface;
        if !surface.textures.is_empty() {
            surface.textures.resize(triangles, Surface::NO_TEXTURE);
            surface.uvs.resize(triangles, [[0.0; 2]; 3]);
        }
        if !surface.normals.is_empty() {
            surface.normals.resize(triangles, [Vec3::ZERO; 3]);
        }
        appearance
    }
}

/// The text of a statement after its first word.
fn rest(statement: &[u8], word: &[u8]) -> String {
    let text = statement.trim_ascii();
    let text = text.strip_prefix(word).unwrap_or(text).trim_ascii();
    String::from_utf8_lossy(text).into_owned()
}
