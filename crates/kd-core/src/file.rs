//! The file format of a mesh and its tree, which loads without a build.
//!
//! ```text
//! offset  bytes   content (numbers are little-endian)
//! 0       8       magic "kd-tree\n"
//! 8       4       version, 1
//! 12      4       CRC-32 of all bytes from offset 16 on
//! 16      4 × 4   numbers of vertices, triangles, node pairs, references
//! 32      6 × 4   bounds: min x y z, max x y z
//! 56      4 × 4   cost model: traverse, intersect, lanes, empty bonus
//! 72      56      zero
//! 128             vertices (3 × f32), triangles (3 × u32), pairs (2 × 8 bytes), references (u32),
//!                 each padded with zeros to a multiple of 16 bytes
//! ```
//! Sections are aligned, so that a file can be mapped into memory and used in place.

use std::io::{self, Write};

use bytemuck::{Pod, cast_slice};
use glam::Vec3;
use thiserror::Error;

use crate::{Aabb, CostModel, Mesh, MeshError, Node, Pair, Slot, Tree, TreeError};

const MAGIC: [u8; 8] = *b"kd-tree\n";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 128;
/// The checksum covers all bytes from this offset on.
const CHECKED_FROM: usize = 16;
const SECTION_ALIGNMENT: usize = 16;

/// The reason why bytes are not a valid tree file. `file` is the name given to [`read_tree`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file could not be opened, read or written.
    #[error("{file}: {source}")]
    Io {
        /// Name of the file.
        file: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The file does not start with the magic bytes.
    #[error("{file}: not a kd-tree file")]
    WrongMagic {
        /// Name of the file.
        file: String,
    },
    /// The file has another version of the format.
    #[error("{file}: format version {version} is not supported, expected {VERSION}")]
    UnsupportedVersion {
        /// Name of the file.
        file: String,
        /// The version in the header.
        version: u32,
    },
    /// The file is shorter or longer than its header requires.
    #[error("{file}: {found} bytes, the header requires {expected}")]
    WrongLength {
        /// Name of the file.
        file: String,
        /// The number of bytes that the header requires, at least the size of a header.
        expected: u64,
        /// The number of bytes of the file.
        found: u64,
    },
    /// The checksum does not match, so the file is damaged.
    #[error("{file}: damaged, the checksum does not match")]
    Damaged {
        /// Name of the file.
        file: String,
    },
    /// The mesh in the file is invalid.
    #[error("{file}: {source}")]
    Mesh {
        /// Name of the file.
        file: String,
        /// The reason.
        source: MeshError,
    },
    /// The tree in the file is invalid.
    #[error("{file}: {source}")]
    Tree {
        /// Name of the file.
        file: String,
        /// The reason.
        source: TreeError,
    },
    /// The box of the tree is not the box of the mesh.
    #[error("{file}: the bounds of the tree differ from those of the mesh")]
    WrongBounds {
        /// Name of the file.
        file: String,
    },
}

/// Writes a mesh and its tree. The bytes are the same on every platform. Linear; the file is assembled in memory first.
///
/// # Errors
///
/// Those of the writer, and [`io::ErrorKind::FileTooLarge`] if a section has 2³² elements or more.
pub fn write_tree(mesh: &Mesh, tree: &Tree, to: &mut impl Write) -> io::Result<()> {
    let mut body = Vec::with_capacity(mesh.bytes() + tree.bytes() + HEADER_BYTES);
    push_count(&mut body, mesh.positions().len())?;
    push_count(&mut body, mesh.len())?;
    push_count(&mut body, tree.nodes().len() / 2)?;
    push_count(&mut body, tree.refs().len())?;
    let Aabb { min, max } = tree.bounds();
    let cost = tree.cost();
    for number in min.to_array().into_iter().chain(max.to_array()) {
        body.extend(number.to_le_bytes());
    }
    body.extend(cost.traverse.to_le_bytes());
    body.extend(cost.intersect.to_le_bytes());
    body.extend(cost.lanes.to_le_bytes());
    body.extend(cost.empty_bonus.to_le_bytes());
    body.resize(HEADER_BYTES - CHECKED_FROM, 0);
    push_section(&mut body, mesh.positions());
    push_section(&mut body, mesh.triangles());
    push_section(&mut body, tree.nodes());
    push_section(&mut body, tree.refs());

    to.write_all(&MAGIC)?;
    to.write_all(&VERSION.to_le_bytes())?;
    to.write_all(&crc32fast::hash(&body).to_le_bytes())?;
    to.write_all(&body)
}

/// Reads a mesh and its tree in the format of [`write_tree`]. `name` is used in errors only.
///
/// The function verifies the sizes before it allocates memory, the checksum, the mesh by the rules of [`Mesh::new`], and
/// the tree by those of [`Tree::from_parts`]. A traversal of the result is therefore safe and ends, for any bytes. The
/// function does not verify that leaves refer to all triangles in their cells: a forged file may lose hits, which
/// [`Tree::check_coverage`] detects. Linear in the number of bytes.
///
/// # Errors
///
/// [`FileError`] gives the first violation.
pub fn read_tree(bytes: &[u8], name: &str) -> Result<(Mesh, Tree), FileError> {
    let file = || name.to_owned();
    if bytes.get(..MAGIC.len()) != Some(&MAGIC) {
        return Err(FileError::WrongMagic { file: file() });
    }
    let wrong_length = |expected: u64| FileError::WrongLength {
        file: file(),
        expected,
        found: bytes.len() as u64,
    };
    if bytes.len() < HEADER_BYTES {
        return Err(wrong_length(HEADER_BYTES as u64));
    }
    let word = |index: usize| {
        let at = 4 * index;
        u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    };
    let number = |index: usize| f32::from_bits(word(index));
    if word(2) != VERSION {
        let version = word(2);
        return Err(FileError::UnsupportedVersion {
            file: file(),
            version,
        });
    }
    let [vertices, triangles, pairs, refs] = [4, 5, 6, 7].map(word);
    let sizes = [
        section_bytes::<[f32; 3]>(vertices),
        section_bytes::<[u32; 3]>(triangles),
        section_bytes::<Pair>(pairs),
        section_bytes::<Slot>(refs),
    ];
    let expected = HEADER_BYTES as u64 + sizes.iter().sum::<u64>();
    if bytes.len() as u64 != expected {
        return Err(wrong_length(expected));
    }
    if crc32fast::hash(&bytes[CHECKED_FROM..]) != word(3) {
        return Err(FileError::Damaged { file: file() });
    }

    let mut rest = &bytes[HEADER_BYTES..];
    let positions = take_section(&mut rest, vertices);
    let indices = take_section(&mut rest, triangles);
    let pairs: Vec<Pair> = take_section(&mut rest, pairs);
    let refs: Vec<Slot> = take_section(&mut rest, refs);
    let mesh = Mesh::new(positions, indices).map_err(|source| FileError::Mesh {
        file: file(),
        source,
    })?;
    let bounds = Aabb {
        min: Vec3::new(number(8), number(9), number(10)),
        max: Vec3::new(number(11), number(12), number(13)),
    };
    if bounds != mesh.bounds() {
        return Err(FileError::WrongBounds { file: file() });
    }
    let cost = CostModel {
        traverse: number(14),
        intersect: number(15),
        lanes: word(16),
        empty_bonus: number(17),
    };
    let tree = Tree::from_parts(pairs, refs, bounds, triangles, cost).map_err(|source| {
        FileError::Tree {
            file: file(),
            source,
        }
    })?;
    Ok((mesh, tree))
}

fn push_count(body: &mut Vec<u8>, count: usize) -> io::Result<()> {
    let count = u32::try_from(count).map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge))?;
    body.extend(count.to_le_bytes());
    Ok(())
}

/// Appends a section and its padding. All elements consist of 4-byte words, so that one loop handles the byte order.
fn push_section<T: Pod>(body: &mut Vec<u8>, items: &[T]) {
    let words: &[u32] = cast_slice(items);
    body.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    body.resize(body.len().next_multiple_of(SECTION_ALIGNMENT), 0);
}

fn section_bytes<T>(count: u32) -> u64 {
    (u64::from(count) * size_of::<T>() as u64).next_multiple_of(SECTION_ALIGNMENT as u64)
}

/// Reads the next section of `count` elements. The caller has checked the length of `rest`.
fn take_section<T: Pod>(rest: &mut &[u8], count: u32) -> Vec<T> {
    let mut items = vec![T::zeroed(); count as usize];
    let words: &mut [u32] = bytemuck::cast_slice_mut(&mut items);
    let used = size_of_val(words);
    for (word, bytes) in words.iter_mut().zip(rest.as_chunks::<4>().0) {
        *word = u32::from_le_bytes(*bytes);
    }
    *rest = &rest[used.next_multiple_of(SECTION_ALIGNMENT)..];
    items
}

const _: () = assert!(
    (HEADER_BYTES - CHECKED_FROM).is_multiple_of(SECTION_ALIGNMENT)
        && size_of::<Node>().is_multiple_of(4),
    "sections start aligned and consist of 4-byte words"
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeIndex;

    fn example() -> (Mesh, Tree) {
        let positions = vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [3.0, 0.0, 0.0],
            [3.0, 1.0, 0.0],
        ];
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [3, 4, 3]]).expect("valid");
        let root = Node::interior(crate::Axis::X, 2.0, NodeIndex(2)).expect("small");
        let leaf = |first| Node::leaf(first, 1).expect("small");
        let pairs = [Pair([root, Node::EMPTY_LEAF]), Pair([leaf(0), leaf(1)])];
        let tree = Tree::from_parts(
            pairs.to_vec(),
            vec![Slot(0), Slot(1)],
            mesh.bounds(),
            2,
            CostModel::PACKED,
        );
        (mesh, tree.expect("valid"))
    }

    fn bytes_of((mesh, tree): &(Mesh, Tree)) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_tree(mesh, tree, &mut bytes).expect("writing to memory succeeds");
        bytes
    }

    #[test]
    fn a_written_tree_reads_back_unchanged() {
        let (mesh, tree) = example();
        let bytes = bytes_of(&(mesh.clone(), tree.clone()));
        assert_eq!(bytes.len() % 16, 0, "sections are padded");
        let (same_mesh, same_tree) = read_tree(&bytes, "t").expect("just written");
        assert_eq!(same_mesh, mesh, "the mesh");
        assert_eq!(same_tree.nodes(), tree.nodes(), "the nodes");
        assert_eq!(same_tree.refs(), tree.refs(), "the references");
        assert_eq!(
            (same_tree.bounds(), same_tree.cost()),
            (tree.bounds(), tree.cost()),
            "bounds and cost model"
        );
        assert_eq!(
            bytes_of(&(same_mesh, same_tree)),
            bytes,
            "written again, the bytes are the same"
        );
    }

    #[test]
    fn an_empty_tree_can_be_written_and_read() {
        let mesh = Mesh::new(vec![], vec![]).expect("valid");
        let pairs = [Pair([Node::EMPTY_LEAF; 2])];
        let tree = Tree::from_parts(pairs.to_vec(), vec![], mesh.bounds(), 0, CostModel::CLASSIC)
            .expect("valid");
        let (mesh, tree) = read_tree(&bytes_of(&(mesh, tree)), "t").expect("just written");
        assert!(
            mesh.is_empty() && tree.bounds().is_empty(),
            "an empty mesh and an empty box"
        );
    }

    #[test]
    fn every_truncation_and_every_changed_byte_is_detected() {
        let bytes = bytes_of(&example());
        for end in 0..bytes.len() {
            let error = read_tree(&bytes[..end], "t").expect_err("truncated");
            let error = error.to_string();
            assert!(error.starts_with("t: "), "{end}: {error}");
        }
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x40;
            assert!(read_tree(&changed, "t").is_err(), "byte {at}");
        }
    }

    /// With a matching checksum, the later checks must refuse the file.
    #[test]
    fn forged_files_with_a_valid_checksum_are_refused() {
        let bytes = bytes_of(&example());
        let with = |at: usize, word: u32| {
            let mut forged = bytes.clone();
            forged[at..at + 4].copy_from_slice(&word.to_le_bytes());
            let checksum = crc32fast::hash(&forged[CHECKED_FROM..]);
            forged[12..16].copy_from_slice(&checksum.to_le_bytes());
            read_tree(&forged, "t").expect_err("forged").to_string()
        };
        let triangles = HEADER_BYTES + 64;
        let pairs = triangles + 32;
        let refs = pairs + 32;
        for (at, word, message) in [
            (0, 0, "t: not a kd-tree file"),
            (8, 2, "t: format version 2 is not supported, expected 1"),
            (
                28,
                u32::MAX,
                "t: 272 bytes, the header requires 17179869440",
            ),
            (
                HEADER_BYTES,
                f32::NAN.to_bits(),
                "t: vertex 0 is not finite",
            ),
            (
                triangles + 4,
                9,
                "t: triangle 0, corner 1: index 9 is out of range, there are 5 vertices",
            ),
            (pairs + 4, 0, "t: node 0: child 0 is not stored behind it"),
            (
                refs,
                2,
                "t: reference 0: triangle 2 is out of range, there are 2 triangles",
            ),
            (
                32,
                1.0_f32.to_bits(),
                "t: the bounds of the tree differ from those of the mesh",
            ),
        ] {
            assert_eq!(with(at, word), message, "word at {at}");
        }
    }
}
