//! A tree in a file: what rays traverse is traced as it lies there.
#![allow(
    unsafe_code,
    reason = "`open` maps a file, and takes its nodes for those of a tree; the caller promises both"
)]

use std::path::Path;
use std::sync::{Arc, OnceLock};

use bytemuck::{cast, cast_slice};
use glam::DVec3;
use kd_core::{Aabb, Layout, Mesh, NodeIndex, Pair, Tree};
use kd_file::{Contents, FileError, SavedFile, Section, SectionKind, Verify};
use kd_sah::BuildOptions;
use kd_trace::{PackedTree, WideTree};
use kd_wide::Child;

use crate::KdTree;
use crate::layout::TreeLayout;

/// The section of a kind, of the only tree in a file.
const fn section(kind: SectionKind) -> Section {
    Section::new(kind, 0)
}

/// What a tree is, in words.
struct Properties {
    options: BuildOptions,
    bounds: Aabb,
    /// Of the wide nodes. The root of others is the first node.
    root: Child,
    limited_cells: u64,
    origin: DVec3,
}

impl Properties {
    const SECTION: Section = section(SectionKind::Tree);
    const WORDS: usize = BuildOptions::WORDS + 15;

    fn of(tree: &KdTree) -> Self {
        let limited_cells = tree.known_kd_tree().map_or(0, Tree::limited_cells);
        Self {
            options: tree.options.clone(),
            bounds: tree.mesh.bounds(),
            root: match &tree.layout {
                TreeLayout::Wide(wide) => wide.root(),
                TreeLayout::Binary(_) => Child::NOTHING,
            },
            limited_cells: limited_cells as u64,
            origin: tree.origin,
        }
    }

    fn to_words(&self) -> Vec<u32> {
        let corners = [self.bounds.min, self.bounds.max];
        let corners = corners.iter().flat_map(|corner| corner.to_array());
        let mut words = self.options.to_words().to_vec();
        words.extend(corners.map(f32::to_bits));
        words.push(cast(self.root));
        words.extend(halves(self.limited_cells));
        let origin = self.origin.to_array();
        words.extend(origin.iter().flat_map(|number| halves(number.to_bits())));
        words
    }

    fn read(file: &SavedFile) -> Result<Self, FileError> {
        let words = file.elements::<u32>(Self::SECTION)?;
        let bad = |problem| FileError::BadSection {
            file: file.name().to_owned(),
            section: Self::SECTION,
            problem,
        };
        let (Some((options, rest)), Self::WORDS) = (words.split_first_chunk(), words.len()) else {
            let (found, expected) = (words.len(), Self::WORDS);
            return Err(bad(format!("{found} words, expected {expected}")));
        };
        let options = BuildOptions::from_words(options);
        let number = |place: usize| f32::from_bits(rest[place]);
        let long = |place: usize| whole([rest[place], rest[place + 1]]);
        let origin = DVec3::from_array([9, 11, 13].map(|place| f64::from_bits(long(place))));
        if !origin.is_finite() {
            return Err(bad("the origin is not finite".to_owned()));
        }
        Ok(Self {
            options: options.map_err(|error| bad(error.to_string()))?,
            bounds: Aabb {
                min: [number(0), number(1), number(2)].into(),
                max: [number(3), number(4), number(5)].into(),
            },
            root: cast(rest[6]),
            limited_cells: long(7),
            origin,
        })
    }
}

impl KdTree {
    /// Writes the mesh, its [origin](Self::origin), what rays traverse, the options, and the kd-tree if there is one, to a file that [`load`](Self::load) reads and
    /// [`open`](Self::open) maps: the same bytes on every platform. Nothing is copied in memory.
    ///
    /// The data goes to a file beside it first (`….partial`), which then replaces an existing file as a whole. If the write fails or is
    /// interrupted, an existing file stays as it is.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the error of the system.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let properties = Properties::of(self).to_words();
        let mut contents = Contents::new();
        contents.add(Properties::SECTION, &properties);
        contents.add(section(SectionKind::Positions), self.mesh.positions());
        contents.add(section(SectionKind::Triangles), self.mesh.triangles());
        match &self.layout {
            TreeLayout::Wide(wide) => {
                contents.add(section(SectionKind::WideNodes), wide.nodes());
                contents.add(section(SectionKind::WideBlocks), wide.blocks());
            }
            TreeLayout::Binary(packed) => {
                let pairs = cast_slice::<_, Pair>(packed.nodes());
                contents.add(section(SectionKind::BinaryNodes), pairs);
                contents.add(section(SectionKind::BinaryBlocks), packed.blocks());
            }
        }
        if let Some(tree) = self.known_kd_tree() {
            let pairs = cast_slice::<_, Pair>(tree.nodes());
            contents.add(section(SectionKind::KdNodes), pairs);
            contents.add(section(SectionKind::KdReferences), tree.refs());
        }
        contents.save(path)
    }

    /// Reads a file that [`save`](Self::save) wrote, into memory of its own: the same tree, with the same options, that answers as the
    /// saved one. Takes about the time of reading the file; nothing is built or laid out.
    ///
    /// The file is verified: checksums, the mesh, each child of a node, each triangle of a block. Tracing the result is safe for any
    /// content. Boxes are not compared with what is below them: a file that was forged, with checksums that match, may lose hits.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the problem.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let file = SavedFile::open(path)?;
        // SAFETY: a file that is read, not mapped, is always verified.
        unsafe { Self::from_file(file) }
    }

    /// Maps a file that [`save`](Self::save) wrote into memory, and traces it as it lies: ready in well under a millisecond, whatever the
    /// size of the tree. Memory is taken by what rays touch, and is shared by all processes that open the file.
    ///
    /// Only the header is verified. [`open_verified`](Self::open_verified) verifies everything, and [`load`](Self::load) also needs no
    /// promise.
    ///
    /// ```
    /// use kd::{BuildOptions, KdTree, Mesh, Ray};
    ///
    /// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("triangle.kd");
    /// KdTree::build(mesh, &BuildOptions::balanced())?.save(&path)?;
    ///
    /// // SAFETY: `save` wrote the file, and nothing changes it.
    /// let tree = unsafe { KdTree::open(&path) }?;
    /// assert!(tree.occluded(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the problem. [`FileError::WrongByteOrder`] on a machine that is not little-endian, where
    /// [`load`](Self::load) works.
    ///
    /// # Safety
    ///
    /// [`save`](Self::save) wrote the file, and it does not change or become shorter as long as the tree or a clone of it lives.
    /// Saving another tree under its name is allowed: that replaces the file and leaves the mapped one as it is.
    pub unsafe fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        // SAFETY: the caller's.
        let file = unsafe { SavedFile::map(path, Verify::Header) }?;
        // SAFETY: the caller's.
        unsafe { Self::from_file(file) }
    }

    /// [`open`](Self::open), and verifies all of the file, as [`load`](Self::load) does. Reads it once; takes no memory of its own for it.
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open), and those of [`load`](Self::load).
    ///
    /// # Safety
    ///
    /// The file does not change or become shorter as long as the tree or a clone of it lives. Its contents may be anything.
    pub unsafe fn open_verified(path: impl AsRef<Path>) -> Result<Self, FileError> {
        // SAFETY: the caller's.
        let file = unsafe { SavedFile::map(path, Verify::Everything) }?;
        // SAFETY: it is verified.
        unsafe { Self::from_file(file) }
    }

    /// # Safety
    ///
    /// [`save`](Self::save) wrote the file, or it is one to verify.
    unsafe fn from_file(file: SavedFile) -> Result<Self, FileError> {
        let properties = Properties::read(&file)?;
        let Properties {
            options,
            bounds,
            root,
            ..
        } = &properties;
        let mesh = read_mesh(&file, *bounds)?;
        let is_verified = file.verify() == Verify::Everything;
        let kd_tree = if is_verified && file.has(section(SectionKind::KdNodes)) {
            Some(read_kd_tree(&file, &properties, &mesh)?)
        } else {
            None
        };
        let layout_error = |source| FileError::Layout {
            file: file.name().to_owned(),
            source,
        };
        let layout = match options.layout() {
            Layout::Binary => {
                let pairs = file.elements(section(SectionKind::BinaryNodes))?;
                let blocks = file.elements(section(SectionKind::BinaryBlocks))?;
                TreeLayout::Binary(if is_verified {
                    let tree = kd_tree.as_ref();
                    let tree = tree.ok_or_else(|| FileError::MissingSection {
                        file: file.name().to_owned(),
                        section: section(SectionKind::KdNodes),
                    })?;
                    let packed = PackedTree::from_buffers(pairs, blocks, tree, &mesh);
                    packed.map_err(layout_error)?
                } else {
                    PackedTree::from_trusted_buffers(pairs, blocks, NodeIndex(0), *bounds)
                })
            }
            _ => {
                let nodes = file.elements(section(SectionKind::WideNodes))?;
                let blocks = file.elements(section(SectionKind::WideBlocks))?;
                TreeLayout::Wide(if is_verified {
                    let wide = WideTree::from_buffers(nodes, blocks, *root, &mesh);
                    wide.map_err(layout_error)?
                } else {
                    // SAFETY: the caller's: it is not verified, so `save` wrote it.
                    unsafe { WideTree::from_trusted_buffers(nodes, blocks, *root, bounds) }
                })
            }
        };
        Ok(Self {
            mesh: Arc::new(mesh),
            tree: kd_tree.map_or_else(OnceLock::new, OnceLock::from),
            layout,
            options: properties.options,
            winding: OnceLock::new(),
            saved: (!is_verified).then(|| Arc::new(file)),
            origin: properties.origin,
        })
    }

    /// The kd-tree, if it was built or saved. That of a file that was not verified is read at the first call.
    pub(crate) fn known_kd_tree(&self) -> Option<&Tree> {
        if let Some(tree) = self.tree.get() {
            return Some(tree);
        }
        let file = self.saved.as_ref()?;
        let properties = Properties::read(file).ok()?;
        // A file without a usable kd-tree is as good as one without any: building it gives the same.
        let tree = read_kd_tree(file, &properties, &self.mesh).ok()?;
        Some(self.tree.get_or_init(|| tree))
    }
}

/// The lower half first.
#[allow(clippy::cast_possible_truncation, reason = "the upper half follows")]
pub(crate) fn halves(bits: u64) -> [u32; 2] {
    [bits as u32, (bits >> 32) as u32]
}

pub(crate) fn whole([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

/// The mesh of a file, checked if the file is to be verified.
fn read_mesh(file: &SavedFile, bounds: Aabb) -> Result<Mesh, FileError> {
    let positions = file.elements(section(SectionKind::Positions))?;
    let triangles = file.elements(section(SectionKind::Triangles))?;
    if file.verify() == Verify::Header {
        return Ok(Mesh::from_trusted_buffers(positions, triangles, bounds));
    }
    let mesh = Mesh::from_buffers(positions, triangles).map_err(|source| FileError::Mesh {
        file: file.name().to_owned(),
        source,
    })?;
    if mesh.bounds() != bounds {
        return Err(FileError::WrongBounds {
            file: file.name().to_owned(),
        });
    }
    Ok(mesh)
}

/// The kd-tree of a file, checked in any case.
fn read_kd_tree(file: &SavedFile, properties: &Properties, mesh: &Mesh) -> Result<Tree, FileError> {
    let pairs = file.elements(section(SectionKind::KdNodes))?;
    let refs = file.elements(section(SectionKind::KdReferences))?;
    let triangles = u32::try_from(mesh.len()).expect("30 bits count triangles");
    let bounds = properties.bounds;
    let cost = properties.options.cost();
    let tree = Tree::from_parts(pairs.into_vec(), refs.into_vec(), bounds, triangles, cost);
    let tree = tree.map_err(|source| FileError::Tree {
        file: file.name().to_owned(),
        source,
    })?;
    let limited_cells = usize::try_from(properties.limited_cells).unwrap_or(usize::MAX);
    Ok(tree.with_limited_cells(limited_cells))
}
