//! OBJ files as scenes: normals, texture coordinates and materials beside the geometry.

use std::collections::HashMap;
use std::io;
use std::path::Path;

use glam::Vec3;

use super::material::{MtlMaterial, read_mtl};
use super::statements::{numbers, rest, without_comment};
use super::{Beside, read_with};
use crate::error::quoted;
use crate::file_mesh::FileMesh;
use crate::files::read_file;
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::source::Source;
use crate::words::{Words, integer};
use crate::{LoadError, Material, SceneDescription, Surface, Texture, TextureSource};

/// Reads a Wavefront OBJ file as a static scene of one part: the geometry of [`read_obj`](crate::read_obj), normals, texture coordinates and
/// materials. `files` reads the file at a path; names in the file are relative to `path`.
///
/// A material has a diffuse color or texture, highlights, a mirror reflectance if its illumination model is 3 or more, and a
/// transmittance of 1 minus its `d`, or with `map_d` an alpha. A material file that is missing, a statement about materials that has no meaning, a material that no
/// file defines, and normals and texture coordinates that are not there are [warnings](SceneDescription::warnings); triangles without a
/// material are light gray.
///
/// # Errors
///
/// Those of [`read_obj`](crate::read_obj).
pub fn read_obj_scene(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let mut report = Report::new(Strictness::Usual);
    let name = path.display().to_string();
    let bytes = read_file(path, files)?;
    let mut source = Source::of_bytes(&bytes, &name);
    let mut scene = read_obj_scene_with(&mut source, path, files, &mut report)?;
    scene.warnings = report.finish();
    Ok(scene)
}

/// [`read_obj_scene`] of the file `source`, which is at `path`, with its warnings in the report.
pub(crate) fn read_obj_scene_with(
    source: &mut Source<'_>,
    path: &Path,
    files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    report: &mut Report,
) -> Result<SceneDescription, LoadError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut looks = Looks {
        file: source.name,
        folder,
        files,
        materials: vec![Material::default()],
        material_indices: HashMap::new(),
        material_textures: vec![Surface::NO_TEXTURE],
        textures: Vec::new(),
        normals: Vec::new(),
        uvs: Vec::new(),
        current: 0,
        lacks_library: false,
        face: Face::default(),
        surface: Surface::default(),
    };
    let mesh = FileMesh::with_looks(source.name);
    let read = read_with(source, mesh, report, &mut looks)?;
    let surface = looks.finished_surface(read.mesh.len(), &read.left_out);
    let mut scene = read.into_scene();
    scene.materials = looks.materials;
    scene.textures = looks.textures;
    let own = &mut scene.parts[0].surface;
    *own = Surface {
        colors: std::mem::take(&mut own.colors),
        ..surface
    };
    Ok(scene)
}

/// What a scene has beside its geometry.
struct Looks<'a> {
    file: &'a str,
    folder: &'a Path,
    files: &'a mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    materials: Vec<Material>,
    /// Indices of materials by name.
    material_indices: HashMap<String, u32>,
    /// Texture index of each material.
    material_textures: Vec<u32>,
    textures: Vec<Texture>,
    /// `None` for those that have no meaning.
    normals: Vec<Option<Vec3>>,
    uvs: Vec<Option<[f32; 2]>>,
    /// Index of the current material.
    current: u32,
    /// Whether a file of materials could not be read.
    lacks_library: bool,
    /// The face whose triangles are next.
    face: Face,
    /// Of the triangles so far.
    surface: Surface,
}

/// The material of a face, and what its corners have.
#[derive(Debug, Default)]
struct Face {
    material: u32,
    corners: Vec<Corner>,
}

/// The texture coordinates and the normal of a corner of a face.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    uv: Option<[f32; 2]>,
    normal: Option<Vec3>,
}

impl Beside for Looks<'_> {
    type Face = Face;

    fn statement(
        &mut self,
        keyword: &[u8],
        statement: &[u8],
        line: usize,
        report: &mut Report,
    ) -> bool {
        match keyword {
            b"vn" => {
                let normal = numbers(statement).map(Vec3::from);
                self.normals.push(normal);
                self.check(normal.is_some(), statement, line, report);
            }
            b"vt" => {
                // `v` is optional and runs from the bottom up in OBJ.
                let uv = match Words::new(statement).count() {
                    2 => numbers(statement).map(|[u]| [u, 1.0]),
                    _ => numbers(statement).map(|[u, v]| [u, 1.0 - v]),
                };
                self.uvs.push(uv);
                self.check(uv.is_some(), statement, line, report);
            }
            b"mtllib" => self.read_libraries(&rest(statement, "mtllib"), line, report),
            b"usemtl" => self.use_material(&rest(statement, "usemtl"), line, report),
            _ => return false,
        }
        true
    }

    fn face(&mut self, statement: &[u8], line: usize, report: &mut Report) {
        self.face.material = self.current;
        self.face.corners.clear();
        let mut are_all_there = true;
        for word in Words::new(statement).skip(1) {
            let mut indices = word.split(|byte| *byte == b'/').skip(1);
            let uv = lookup(indices.next(), &self.uvs);
            let normal = lookup(indices.next(), &self.normals);
            are_all_there &= uv.is_ok() && normal.is_ok();
            self.face.corners.push(Corner {
                uv: uv.unwrap_or(None),
                normal: normal.unwrap_or(None),
            });
        }
        if !are_all_there {
            let what =
                "a face names normals or texture coordinates that are not there; it has none";
            let place = Some(Place::Line(line));
            report.warn(self.file, place, WarningCode::BadAttribute, what);
        }
    }

    fn triangle(&mut self, number: usize, corners: [usize; 3]) {
        let Face {
            material,
            corners: of_face,
        } = &self.face;
        let surface = &mut self.surface;
        set(&mut surface.materials, number, *material, 0);
        let corners = corners.map(|corner| of_face[corner]);
        let texture = self.material_textures[*material as usize];
        let has_alpha = self.materials[*material as usize].alpha_texture.is_some();
        if let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.uv)
            && (texture != Surface::NO_TEXTURE || has_alpha)
        {
            if texture != Surface::NO_TEXTURE {
                set(&mut surface.textures, number, texture, Surface::NO_TEXTURE);
            }
            set(&mut surface.uvs, number, [a, b, c], [[0.0; 2]; 3]);
        }
        if let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.normal) {
            set(&mut surface.normals, number, [a, b, c], [Vec3::ZERO; 3]);
        }
    }

    fn keep(&mut self) -> Face {
        std::mem::take(&mut self.face)
    }

    fn restore(&mut self, face: Face) {
        self.face = face;
    }
}

/// Sets an element of an array, which grows by `default` up to it.
fn set<T: Clone>(all: &mut Vec<T>, number: usize, value: T, default: T) {
    if all.len() <= number {
        all.resize(number, default);
        all.push(value);
    } else {
        all[number] = value;
    }
}

/// An index of a face that leads nowhere.
struct NotThere;

/// The element of `all` at an index from 1, or at a negative index from the end; `None` without an index.
fn lookup<T: Copy>(word: Option<&[u8]>, all: &[Option<T>]) -> Result<Option<T>, NotThere> {
    let Some(word) = word.filter(|word| !word.is_empty()) else {
        return Ok(None);
    };
    let index = integer(word).ok_or(NotThere)?;
    let count = i64::try_from(all.len()).unwrap_or(i64::MAX);
    let number = if index < 0 {
        count.saturating_add(index)
    } else {
        index.wrapping_sub(1)
    };
    let number = usize::try_from(number).ok();
    let found = number.and_then(|number| all.get(number));
    found.copied().ok_or(NotThere)
}

impl Looks<'_> {
    fn check(&self, is_read: bool, statement: &[u8], line: usize, report: &mut Report) {
        if !is_read {
            let what = format!("bad numbers, left out: {}", quoted(statement));
            let place = Some(Place::Line(line));
            report.warn(self.file, place, WarningCode::BadAttribute, what);
        }
    }

    /// The surface of the mesh, which lacks the triangles that were left out.
    fn finished_surface(&mut self, triangles: usize, left_out: &[usize]) -> Surface {
        let mut surface = std::mem::take(&mut self.surface);
        let whole = triangles + left_out.len();
        surface.materials.resize(whole, 0);
        remove(&mut surface.materials, left_out);
        if !surface.textures.is_empty() {
            surface.textures.resize(whole, Surface::NO_TEXTURE);
            remove(&mut surface.textures, left_out);
        }
        if !surface.uvs.is_empty() {
            surface.uvs.resize(whole, [[0.0; 2]; 3]);
            remove(&mut surface.uvs, left_out);
        }
        if !surface.normals.is_empty() {
            surface.normals.resize(whole, [Vec3::ZERO; 3]);
            remove(&mut surface.normals, left_out);
        }
        surface
    }

    /// Makes a material current; an unknown name selects light gray.
    fn use_material(&mut self, name: &str, line: usize, report: &mut Report) {
        for name in [name, without_comment(name)] {
            if let Some(known) = self.material_indices.get(name) {
                self.current = *known;
                return;
            }
        }
        self.current = 0;
        // The warning of the missing file says so of all its materials.
        if self.lacks_library {
            return;
        }
        let what = format!("unknown material `{name}`; using light gray");
        let place = Some(Place::Line(line));
        report.warn(self.file, place, WarningCode::UnknownMaterial, what);
    }

    /// Reads the files that a text names: either one name with blanks, or several names.
    fn read_libraries(&mut self, names: &str, line: usize, report: &mut Report) {
        let whole = (self.files)(&self.folder.join(names));
        let failed = match whole {
            Ok(bytes) => return self.add_library(names, &bytes, report),
            Err(error) => error,
        };
        let named = without_comment(names);
        if named != names {
            return self.read_libraries(named, line, report);
        }
        let several: Vec<&str> = names.split_whitespace().collect();
        if several.len() < 2 {
            return self.note_missing(names, &failed, line, report);
        }
        for name in several {
            match (self.files)(&self.folder.join(name)) {
                Ok(bytes) => self.add_library(name, &bytes, report),
                Err(error) => self.note_missing(name, &error, line, report),
            }
        }
    }

    fn note_missing(&mut self, name: &str, error: &io::Error, line: usize, report: &mut Report) {
        let what = format!(
            "cannot read {}: {error}; using light gray",
            quoted(name.as_bytes())
        );
        self.lacks_library = true;
        let place = Some(Place::Line(line));
        report.warn(self.file, place, WarningCode::MissingFile, what);
    }

    fn add_library(&mut self, name: &str, bytes: &[u8], report: &mut Report) {
        for material in read_mtl(bytes, &self.folder.join(name), report) {
            self.add(&material);
        }
    }

    fn add(&mut self, material: &MtlMaterial) {
        let texture = material.texture.as_deref().map(|name| self.texture(name));
        let alpha_texture = material.alpha_texture.as_deref();
        let alpha_texture = alpha_texture.map(|name| self.texture(name));
        let number = to_u32(self.materials.len());
        self.materials.push(Material {
            alpha_texture,
            ..material.material()
        });
        self.material_textures
            .push(texture.unwrap_or(Surface::NO_TEXTURE));
        let short = without_comment(&material.name).to_owned();
        self.material_indices.insert(short, number);
        self.material_indices.insert(material.name.clone(), number);
    }

    fn texture(&mut self, name: &str) -> u32 {
        let source = TextureSource::File(self.folder.join(name));
        let known = self
            .textures
            .iter()
            .position(|texture| texture.source == source);
        to_u32(known.unwrap_or_else(|| {
            let name = name.to_owned();
            self.textures.push(Texture { name, source });
            self.textures.len() - 1
        }))
    }
}

/// Removes the elements with some numbers, which ascend.
fn remove<T>(all: &mut Vec<T>, numbers: &[usize]) {
    let mut numbers = numbers.iter().peekable();
    let mut number = 0;
    all.retain(|_| {
        let is_gone = numbers.next_if_eq(&&number).is_some();
        number += 1;
        !is_gone
    });
}

fn to_u32(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32, as each takes bytes of a file")
}
