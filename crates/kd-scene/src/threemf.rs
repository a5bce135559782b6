//! Reader of 3MF, the 3D manufacturing format: an archive of XML models.

mod limited;
mod model;

use std::collections::{HashMap, HashSet};
use std::io::{Cursor, Read};
use std::path::Path;

use glam::{DAffine3, Vec3};
use zip::ZipArchive;
use zip::result::ZipError;

use crate::draft::{MOST_REPEATED, PartDraft, SurfaceIds, Transform};
use crate::files::read_file;
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::{LoadError, Material, SceneDescription, Surface};
use limited::Limited;
use model::{Color, Item, Model, Object};

/// Reads a 3MF file: the items of its build, as one static part. `files` reads the file at a path.
///
/// Objects of triangles and of components are read, also where they are in other models of the archive (production extension), with the
/// colors of their materials. Lengths are in the unit of the file; the z axis points up.
///
/// # Errors
///
/// [`LoadError`]: the file is no archive or has no model, the model is not well-formed, an object does not exist or contains itself, an
/// index is out of range, a coordinate is not finite, the model requires an extension that is not supported.
pub fn read_3mf(
    path: &Path,
    files: &mut dyn FnMut(&Path) -> std::io::Result<Vec<u8>>,
) -> Result<SceneDescription, LoadError> {
    let mut report = Report::new(Strictness::Usual);
    let bytes = read_file(path, files)?;
    let mut scene = read_3mf_with(bytes, &path.display().to_string(), &mut report)?;
    scene.warnings = report.finish();
    Ok(scene)
}

/// [`read_3mf`] of a file in memory, with its warnings in the report.
pub(crate) fn read_3mf_with(
    bytes: Vec<u8>,
    file: &str,
    report: &mut Report,
) -> Result<SceneDescription, LoadError> {
    let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(file, &error))?;
    let mut reader = Reader {
        file,
        archive,
        report,
        models: HashMap::new(),
        draft: PartDraft::new(String::new(), None, false),
        materials: Materials::default(),
        elements: 0,
        counts: HashMap::new(),
    };
    let root = reader.root()?;
    reader.load(&root)?;
    let mut count: usize = 0;
    for item in reader.items(&root) {
        count = count.saturating_add(reader.count(&item, 1)?.elements);
        if count > MOST_REPEATED.saturating_add(reader.elements) {
            let problem = format!(
                "the file repeats its objects to more than {MOST_REPEATED} vertices and triangles"
            );
            return Err(reader.bad(&item, problem));
        }
        reader.add(&item, DAffine3::IDENTITY)?;
    }
    let part = reader.draft.finish().map_err(|source| LoadError::Mesh {
        file: file.to_owned(),
        source,
    })?;
    let mut scene = SceneDescription::of_mesh(part.mesh);
    scene.parts[0].surface = part.surface;
    scene.materials = reader.materials.all;
    Ok(scene)
}

fn broken(file: &str, error: &ZipError) -> LoadError {
    LoadError::BadHeader {
        file: file.to_owned(),
        problem: format!("not a 3MF archive: {error}"),
    }
}

struct Reader<'a> {
    file: &'a str,
    archive: ZipArchive<Cursor<Vec<u8>>>,
    report: &'a mut Report,
    /// Each model by its path in the archive.
    models: HashMap<String, Model>,
    draft: PartDraft,
    materials: Materials,
    /// The number of vertices and triangles of all objects that were read, each counted once.
    elements: usize,
    /// What [`count`](Self::count) has found for an object, by its model and its id.
    counts: HashMap<(String, u32), Count>,
}

/// What an object has, with all objects in it.
#[derive(Clone, Copy)]
struct Count {
    /// Vertices, triangles and components.
    elements: usize,
    /// Objects in each other, with itself.
    levels: usize,
}

/// The materials of a scene, one for each color.
#[derive(Default)]
struct Materials {
    all: Vec<Material>,
    of_color: HashMap<Option<Color>, u32>,
}

impl Materials {
    fn get(&mut self, color: Option<Color>) -> u32 {
        let next = u32::try_from(self.all.len());
        *self.of_color.entry(color).or_insert_with(|| {
            let material = color.map_or_else(Material::default, |color| {
                let color = rgb(color);
                Material {
                    ambient: 0.25 * color,
                    diffuse: color,
                    ..Material::default()
                }
            });
            self.all.push(material);
            next.expect("fewer than 2^32, as each takes bytes of a file")
        })
    }
}

impl Reader<'_> {
    /// The path of the model that the archive begins with.
    fn root(&mut self) -> Result<String, LoadError> {
        const USUAL: &str = "3D/3dmodel.model";
        let named = match self.archive.by_name("_rels/.rels") {
            Ok(entry) => {
                // A list of relations is short.
                let mut text = Vec::new();
                let read = entry.take(1 << 20).read_to_end(&mut text);
                read.ok().and_then(|_| model::root_of_relations(&text))
            }
            Err(_) => None,
        };
        let path = named.map_or_else(
            || USUAL.to_owned(),
            |path| path.trim_start_matches('/').to_owned(),
        );
        if self.archive.index_for_name(&path).is_some() {
            return Ok(path);
        }
        Err(LoadError::BadHeader {
            file: self.file.to_owned(),
            problem: format!("the archive has no `{path}`"),
        })
    }

    /// Reads a model of the archive, unless it is read already.
    fn load(&mut self, path: &str) -> Result<(), LoadError> {
        if self.models.contains_key(path) {
            return Ok(());
        }
        let file = format!("{}/{path}", self.file);
        let entry = self
            .archive
            .by_name(path)
            .map_err(|error| broken(&file, &error))?;
        // Text of models shrinks to a tenth; a bomb to a thousandth.
        let most = entry
            .compressed_size()
            .saturating_mul(100)
            .saturating_add(1 << 27);
        let model = Model::read(Limited::new(entry, most), &file, self.report)?;
        let elements: usize = model.objects.values().map(Object::elements).sum();
        self.elements = self.elements.saturating_add(elements);
        self.models.insert(path.to_owned(), model);
        Ok(())
    }

    /// The items to build. Without any, all objects that are in no other one.
    fn items(&mut self, root: &str) -> Vec<Item> {
        let model = &self.models[root];
        let here = |item: &Item| Item {
            path: Some(item.path.clone().unwrap_or_else(|| root.to_owned())),
            ..item.clone()
        };
        if !model.items.is_empty() || model.objects.is_empty() {
            return model.items.iter().map(here).collect();
        }
        let components = model.objects.values().flat_map(|object| &object.components);
        let inner: HashSet<u32> = components.map(|component| component.object).collect();
        let outer = model.objects.keys().filter(|id| !inner.contains(id));
        let mut outer: Vec<u32> = outer.copied().collect();
        outer.sort_unstable();
        let what = "the model builds nothing; all of its objects are read";
        self.report
            .warn(self.file, None, WarningCode::NoScene, what);
        let items = outer.into_iter().map(|object| Item {
            object,
            path: Some(root.to_owned()),
            transform: DAffine3::IDENTITY,
        });
        items.collect()
    }

    /// Counts what an object and all objects in it have.
    fn count(&mut self, item: &Item, depth: usize) -> Result<Count, LoadError> {
        /// Files of today use few levels.
        const MAX_DEPTH: usize = 64;
        let path = item.path.clone().unwrap_or_default();
        if let Some(known) = self.counts.get(&(path.clone(), item.object)) {
            return Ok(*known);
        }
        self.load(&path)?;
        let object = self.models[&path].objects.get(&item.object);
        let object = object.ok_or_else(|| self.bad(item, "does not exist".to_owned()))?;
        let mut count = Count {
            elements: object.elements(),
            levels: 1,
        };
        let components = object.components_in(&path);
        for component in components {
            // Objects in each other have no end.
            let of_component = if depth < MAX_DEPTH {
                self.count(&component, depth + 1)?
            } else {
                Count {
                    elements: 0,
                    levels: MAX_DEPTH,
                }
            };
            count.elements = count.elements.saturating_add(1 + of_component.elements);
            count.levels = count.levels.max(1 + of_component.levels);
        }
        if count.levels > MAX_DEPTH {
            let problem = format!("components are nested more than {MAX_DEPTH} deep");
            return Err(self.bad(item, problem));
        }
        self.counts.insert((path, item.object), count);
        Ok(count)
    }

    /// Adds an object and its components, after [`count`](Self::count).
    fn add(&mut self, item: &Item, to_scene: DAffine3) -> Result<(), LoadError> {
        let path = item.path.clone().unwrap_or_default();
        let file = format!("{}/{path}", self.file);
        let object = &self.models[&path].objects[&item.object];
        let to_scene = to_scene * item.transform;
        let (draft, materials) = (&mut self.draft, &mut self.materials);
        add_triangles(
            object,
            &Transform::new(to_scene),
            &file,
            draft,
            materials,
            self.report,
        )?;
        for component in object.components_in(&path) {
            self.add(&component, to_scene)?;
        }
        Ok(())
    }

    fn bad(&self, item: &Item, problem: String) -> LoadError {
        LoadError::BadElement {
            file: format!("{}/{}", self.file, item.path.as_deref().unwrap_or_default()),
            element: "object".to_owned(),
            index: item.object as usize,
            problem,
        }
    }
}

fn add_triangles(
    object: &Object,
    transform: &Transform,
    file: &str,
    draft: &mut PartDraft,
    materials: &mut Materials,
    report: &mut Report,
) -> Result<(), LoadError> {
    let mut vertices = Vec::with_capacity(object.positions.len());
    for (number, position) in object.positions.iter().enumerate() {
        let at = transform.position(Vec3::from(*position).as_dvec3());
        if at.as_vec3().is_finite() {
            vertices.push(draft.vertex(at));
            continue;
        }
        let error = LoadError::NotFinite {
            file: file.to_owned(),
            line: None,
            vertex: number,
        };
        let place = Some(Place::Element("vertex".to_owned(), number));
        let what = "a vertex is not finite; it is left out";
        report.leave_out(error, place, WarningCode::NotFinite, what)?;
        vertices.push(None);
    }
    let is_mirrored = transform.is_mirroring();
    for (number, triangle) in object.triangles.iter().enumerate() {
        let corners = triangle
            .corners
            .map(|corner| vertices.get(corner as usize).copied());
        let place = || Some(Place::Element("triangle".to_owned(), number));
        if corners.contains(&Some(None)) {
            let what = "a triangle uses a vertex that is not finite; it is left out";
            report.warn(file, place(), WarningCode::NotFinite, what);
            continue;
        }
        let [Some(Some(a)), Some(Some(b)), Some(Some(c))] = corners else {
            let bad = triangle
                .corners
                .iter()
                .find(|corner| **corner as usize >= vertices.len());
            let error = LoadError::IndexOutOfRange {
                file: file.to_owned(),
                line: None,
                face: number,
                index: bad.copied().unwrap_or_default().into(),
                vertices: vertices.len(),
            };
            let place = place();
            let what = "a triangle has an index out of range; it is left out";
            report.leave_out(error, place, WarningCode::BadIndex, what)?;
            continue;
        };
        let mut colors = triangle.colors;
        let mut corners = [a, b, c];
        if is_mirrored {
            corners.swap(1, 2);
            colors.swap(1, 2);
        }
        let is_plain = colors.iter().all(|color| *color == colors[0]);
        let ids = SurfaceIds {
            material: materials.get(if is_plain {
                colors[0]
            } else {
                Some(Color::WHITE)
            }),
            texture: Surface::NO_TEXTURE,
        };
        draft.triangle(corners, ids);
        if !is_plain {
            draft.set_colors(colors.map(|color| rgb(color.unwrap_or(Color::WHITE))));
        }
    }
    Ok(())
}

fn rgb(color: Color) -> Vec3 {
    Vec3::from(color.0.map(f32::from)) / 255.0
}
