//! The names of sections.

use std::fmt;

/// What the elements of a section are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
#[repr(u32)]
pub enum SectionKind {
    /// What a tree is: layout, root, bounds, options.
    Tree = 1,
    /// The vertices of a mesh, 3 × f32.
    Positions = 2,
    /// The corners of its triangles, 3 × u32.
    Triangles = 3,
    /// Nodes of eight children, 256 bytes.
    WideNodes = 4,
    /// Their blocks of eight triangles, 320 bytes.
    WideBlocks = 5,
    /// Pairs of nodes over blocks, 16 bytes.
    BinaryNodes = 6,
    /// Their blocks of eight triangles, 320 bytes.
    BinaryBlocks = 7,
    /// Pairs of nodes of a kd-tree, 16 bytes.
    KdNodes = 8,
    /// The triangles that its leaves refer to, u32.
    KdReferences = 9,
    /// What a scene is: strategy, options, number of meshes.
    Scene = 10,
    /// The parts of a scene.
    Parts = 11,
}

/// A section: its kind, and the number of the object that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Section {
    pub(crate) kind: u32,
    pub(crate) part: u32,
}

impl Section {
    /// The section of this kind of the object of this number.
    pub const fn new(kind: SectionKind, part: u32) -> Self {
        Self {
            kind: kind as u32,
            part,
        }
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.kind {
            1 => "tree properties",
            2 => "positions",
            3 => "triangles",
            4 => "wide nodes",
            5 => "blocks of wide nodes",
            6 => "binary nodes",
            7 => "blocks of binary nodes",
            8 => "nodes of the kd-tree",
            9 => "references of the kd-tree",
            10 => "scene properties",
            11 => "parts",
            _ => "elements of another kind",
        };
        match self.part {
            0 => f.write_str(name),
            part => write!(f, "{name} ({part})"),
        }
    }
}
