//! A scene in a file: its parts, their meshes once each, transforms and masks.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3};
use kd_core::Mesh;
use kd_file::{Contents, FileError, SavedFile, Section, SectionKind};
use kd_sah::BuildOptions;

use super::part::{PartId, Role};
use super::placement::Placement;
use super::{MergeMethod, Scene, Strategy};
use crate::saved::{halves, whole};

const SCENE: Section = Section::new(SectionKind::Scene, 0);
const PARTS: Section = Section::new(SectionKind::Parts, 0);

/// A part in words: its number, its mesh, its role, the number of the part that an instance was made from, its mask, the precision of its
/// transform, and the 12 numbers of that, in columns.
type PartWords = [u32; 30];

/// The words of a scene: options, strategy with its own options, ray budget, next number of a part, origin, number of meshes.
const WORDS: usize = 2 * BuildOptions::WORDS + 12;

impl Scene {
    /// Writes the scene to a file that [`load`](Self::load) reads: options, strategy, ray budget, origin, and the parts with their
    /// meshes, transforms and masks, as the next commit would show them. A mesh that parts share is written once. The same bytes on
    /// every platform.
    ///
    /// An existing file is replaced as a whole, or stays as it is.
    ///
    /// ```
    /// use kd::glam::{Affine3A, Vec3};
    /// use kd::{BuildOptions, Mesh, Ray, Scene};
    ///
    /// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let mut scene = Scene::new(BuildOptions::default());
    /// let tile = scene.add_static(mesh)?;
    /// let upper = scene.add_instance(tile, Affine3A::from_translation(Vec3::Z))?;
    /// let folder = tempfile::tempdir()?;
    /// scene.save(folder.path().join("tiles.kd"))?;
    ///
    /// let mut same = Scene::load(folder.path().join("tiles.kd"))?;
    /// same.commit()?;
    /// let hit = same.frame().intersect(&Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]));
    /// assert_eq!(hit.map(|(part, hit)| (part, hit.t)), Some((upper, 2.0)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`FileError::Io`] names the file and the error of the system.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let mut meshes: Vec<&Arc<Mesh>> = Vec::new();
        let mut numbers = HashMap::new();
        let parts = self.parts.all().map(|part| {
            let mesh = *numbers.entry(Arc::as_ptr(&part.mesh)).or_insert_with(|| {
                meshes.push(&part.mesh);
                number_of(meshes.len() - 1)
            });
            let (role, original) = match part.role {
                Role::Static => (0, 0),
                Role::Dynamic => (1, 0),
                Role::Instance(original) => (2, original.number()),
            };
            let mut words: PartWords = [0; 30];
            words[..5].copy_from_slice(&[part.id.number(), mesh, role, original, part.mask]);
            match &part.placement {
                Placement::Single(transform) => {
                    let numbers = transform.to_cols_array().map(f32::to_bits);
                    words[6..18].copy_from_slice(&numbers);
                }
                Placement::Double(transform) => {
                    words[5] = 1;
                    let numbers = transform
                        .to_cols_array()
                        .map(|number| halves(number.to_bits()));
                    words[6..].copy_from_slice(numbers.as_flattened());
                }
            }
            words
        });
        let parts: Vec<PartWords> = parts.collect();
        let words = self.to_words(number_of(meshes.len()));
        let mut contents = Contents::new();
        contents.add(SCENE, &words);
        contents.add(PARTS, &parts);
        for (number, mesh) in (0..).zip(meshes) {
            contents.add(positions(number), mesh.positions());
            contents.add(triangles(number), mesh.triangles());
        }
        contents.save(path)
    }

    /// Reads a scene that [`save`](Self::save) wrote, with the same [ids](PartId) of parts. Its first [`commit`](Self::commit) builds
    /// what rays traverse; before it, the frame is empty.
    ///
    /// The file is verified: checksums, meshes, and each part.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the problem.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let file = SavedFile::open(path)?;
        let words = file.elements::<u32>(SCENE)?;
        let bad = |section, problem| FileError::BadSection {
            file: file.name().to_owned(),
            section,
            problem,
        };
        let read = Self::from_words(&words);
        let (mut scene, next_id, meshes) = read.map_err(|problem| bad(SCENE, problem))?;
        let mesh = |number: u32| {
            let mesh = Mesh::from_buffers(
                file.elements(positions(number))?,
                file.elements(triangles(number))?,
            );
            mesh.map(Arc::new).map_err(|source| FileError::Mesh {
                file: file.name().to_owned(),
                source,
            })
        };
        let meshes: Vec<Arc<Mesh>> = (0..meshes).map(mesh).collect::<Result<_, _>>()?;
        let parts = file.elements::<PartWords>(PARTS)?;
        for (place, words) in parts.iter().enumerate() {
            let added = scene.add_saved(words, &meshes, next_id);
            added.map_err(|problem| bad(PARTS, format!("part {place}: {problem}")))?;
        }
        scene.next_id = next_id;
        Ok(scene)
    }

    fn to_words(&self, meshes: u32) -> [u32; WORDS] {
        let (strategy, method, options) = match &self.strategy {
            Strategy::Auto => (0, 0, None),
            Strategy::Refit => (1, 0, None),
            Strategy::Instances => (2, 0, None),
            Strategy::Dual => (3, 0, None),
            Strategy::Rebuild(options) => (4, 0, Some(options)),
            Strategy::Merge(method) => (5, *method as u32, None),
        };
        let [x, y, z] = self
            .origin
            .to_array()
            .map(|number| halves(number.to_bits()));
        let [low, high] = halves(self.ray_budget);
        let own = self.options.to_words();
        let of_strategy = options.unwrap_or(&self.options).to_words();
        let rest = [
            strategy,
            method,
            low,
            high,
            self.next_id,
            x[0],
            x[1],
            y[0],
            y[1],
            z[0],
            z[1],
            meshes,
        ];
        let mut words = [0; WORDS];
        let all = own.into_iter().chain(of_strategy).chain(rest);
        for (word, value) in words.iter_mut().zip(all) {
            *word = value;
        }
        words
    }

    /// A scene without parts, the next number of a part, and the number of meshes.
    fn from_words(words: &[u32]) -> Result<(Self, u32, u32), String> {
        let words: &[u32; WORDS] = words
            .try_into()
            .map_err(|_| format!("{} words, expected {WORDS}", words.len()))?;
        let (own, rest) = words.split_first_chunk().expect("as many and more");
        let (of_strategy, rest) = rest.split_first_chunk().expect("as many and more");
        let options = |words| BuildOptions::from_words(words).map_err(|error| error.to_string());
        let &[
            strategy,
            method,
            low,
            high,
            next_id,
            x0,
            x1,
            y0,
            y1,
            z0,
            z1,
            meshes,
        ] = rest
        else {
            unreachable!("the rest of all words");
        };
        let mut scene = Self::new(options(own)?);
        scene.strategy = match (strategy, method) {
            (0, 0) => Strategy::Auto,
            (1, 0) => Strategy::Refit,
            (2, 0) => Strategy::Instances,
            (3, 0) => Strategy::Dual,
            (4, 0) => Strategy::Rebuild(options(of_strategy)?),
            (5, method) => {
                let methods = [
                    MergeMethod::Guided,
                    MergeMethod::PartitionTrees,
                    MergeMethod::BspMerge,
                    MergeMethod::Insertion,
                ];
                let method = methods.into_iter().find(|known| *known as u32 == method);
                Strategy::Merge(method.ok_or("an unknown method to merge")?)
            }
            _ => return Err("an unknown strategy".to_owned()),
        };
        scene.ray_budget = whole([low, high]);
        let origin = [[x0, x1], [y0, y1], [z0, z1]].map(|halves| f64::from_bits(whole(halves)));
        let origin = DVec3::from_array(origin);
        if !origin.is_finite() {
            return Err("the origin is not finite".to_owned());
        }
        scene.origin = origin;
        Ok((scene, next_id, meshes))
    }

    fn add_saved(
        &mut self,
        words: &PartWords,
        meshes: &[Arc<Mesh>],
        next_id: u32,
    ) -> Result<(), String> {
        let &[number, mesh, role, original, mask, precision, ..] = words;
        let mesh = meshes.get(mesh as usize).ok_or("its mesh is missing")?;
        let numbers = &words[6..];
        let placement = if precision == 0 {
            let numbers: [u32; 12] = numbers[..12].try_into().expect("twelve");
            let numbers = numbers.map(f32::from_bits);
            Placement::Single(Affine3A::from_cols_array(&numbers))
        } else {
            let (pairs, _) = numbers.as_chunks::<2>();
            let pairs: [[u32; 2]; 12] = pairs.try_into().expect("twelve");
            Placement::Double(DAffine3::from_cols_array(
                &pairs.map(|halves| f64::from_bits(whole(halves))),
            ))
        };
        if !placement.is_finite() {
            return Err("its transform is not finite".to_owned());
        }
        let role = match role {
            0 => Role::Static,
            1 => Role::Dynamic,
            2 => Role::Instance(PartId::new(original, self.number)),
            _ => return Err("its role is unknown".to_owned()),
        };
        if number < self.next_id || number >= next_id {
            return Err(format!("its number, {number}, is not in order"));
        }
        self.next_id = number;
        let id = self.add(role, Arc::clone(mesh), placement);
        let id = id.map_err(|error| error.to_string())?;
        self.set_mask(id, mask).expect("just added");
        if let Role::Instance(original) = role {
            self.note_instance_of(original);
        }
        Ok(())
    }
}

fn positions(mesh: u32) -> Section {
    Section::new(SectionKind::Positions, mesh)
}

fn triangles(mesh: u32) -> Section {
    Section::new(SectionKind::Triangles, mesh)
}

fn number_of(count: usize) -> u32 {
    u32::try_from(count).expect("a scene has fewer than 2^32 parts")
}
