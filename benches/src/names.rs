//! Names of structures, of their builders and of layouts: the vocabulary of command lines and records.

use std::fmt;

use clap::ValueEnum;
use kd::{BuildOptions, CostModel, Layout, Method};

use crate::arguments::name_of;

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum StructureName {
    /// The kd-tree
    Kd,
    /// The uniform grid
    Grid,
    /// The bounding volume hierarchy; with --peers, also the crate bvh
    Bvh,
    /// A comparator: the octree
    Octree,
    /// A comparator: the BSP tree of planes of triangles
    Bsp,
    /// Embree, one ray at a time
    Embree,
    /// Embree, packets of 8 rays
    Embree8,
    /// Embree with its robust flag, one ray at a time
    EmbreeRobust,
    /// The crate obvhs
    Obvhs,
    /// The crate parry3d
    Parry3d,
    /// The C++ library tinybvh; only if it is named
    Tinybvh,
}

impl StructureName {
    /// The builders of the structure. Embree splits no triangles in a robust scene: its high build would equal its medium one.
    pub(crate) fn builders(self) -> Vec<BuilderName> {
        use BuilderName as B;
        let builders: &[BuilderName] = match self {
            Self::Kd => {
                let all = B::value_variants().iter().copied();
                return all.filter(|name| name.options().is_some()).collect();
            }
            Self::Grid => &[B::Exact, B::Boxes],
            Self::Bvh => &[
                B::Objects,
                B::Binned,
                B::Sweep,
                B::BottomUp,
                B::Midpoint,
                B::EqualCounts,
                B::Default,
            ],
            Self::Octree => &[B::Median],
            Self::Bsp => &[B::Polygon],
            Self::Embree | Self::Embree8 => &[B::Low, B::Medium, B::High],
            Self::EmbreeRobust => &[B::Low, B::Medium],
            Self::Obvhs => &[B::Fastest, B::Medium, B::Slow],
            Self::Parry3d => &[B::Default],
            Self::Tinybvh => &[B::Medium, B::High],
        };
        builders.to_vec()
    }

    /// Whether all its builders are of rival libraries.
    pub(crate) fn is_rival(self) -> bool {
        self.builders().iter().all(|name| name.is_of_rival())
    }

    /// Whether its nodes have several layouts.
    pub(crate) const fn has_layouts(self) -> bool {
        matches!(self, Self::Kd | Self::Bvh)
    }

    /// Whether a rival of this name is compiled with this program, so that compiler flags matter.
    pub(crate) const fn is_rust_rival(self) -> bool {
        matches!(
            self,
            Self::Obvhs | Self::Bvh | Self::Parry3d | Self::Tinybvh
        )
    }
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum BuilderName {
    /// The middle of each cell, axes in turn
    Median,
    /// The plane of least SAH cost, O(N²)
    Naive,
    /// The same plane, O(N log² N)
    Resort,
    /// The same plane, O(N log N), from events sorted once; of a BVH: SAH at every center along an axis
    Sweep,
    /// The same plane, from bins that bound the cost in them; of a grid: the cells that triangles meet
    Exact,
    /// Planes at and beside the boundaries of 32 bins; of a BVH: SAH between bins
    Binned,
    /// Planes of least cost among 16 samples of each axis
    Sampled,
    /// The preset best below one level of medians: one subtree for each of two threads
    MedianTop,
    /// The preset for short builds
    Fast,
    /// The default preset
    Balanced,
    /// The preset for fast rays
    Best,
    /// Of a grid: the cells that boxes of triangles meet
    Boxes,
    /// Wide nodes from object splits, without a binary hierarchy
    Objects,
    /// A hierarchy joined from neighbors
    BottomUp,
    /// A hierarchy split in the middle of the box of its centers
    Midpoint,
    /// A hierarchy split into halves of equal triangle count
    EqualCounts,
    /// Planes of triangles
    Polygon,
    /// Embree's fastest build
    Low,
    /// Embree's default build; the medium build of obvhs, a wide BVH; the build of tinybvh by bins
    Medium,
    /// Embree's build with spatial splits, and that of tinybvh
    High,
    /// The fastest build of obvhs, a binary BVH
    Fastest,
    /// The slow build of obvhs, a wide BVH
    Slow,
    /// The only build of bvh and of parry3d
    Default,
}

impl BuilderName {
    /// The options of a kd-tree; `None` for a builder of another structure.
    pub(crate) fn options(self) -> Option<BuildOptions> {
        let method = match self {
            Self::Median => Method::Median,
            Self::Naive => Method::Naive,
            Self::Resort => Method::Resort,
            Self::Sweep => Method::Sweep,
            Self::Exact => Method::Exact,
            Self::Binned => Method::Binned { bins: 32 },
            Self::Sampled => Method::Sampled { all_axes: true },
            Self::MedianTop => return Some(BuildOptions::best().with_median_levels(1)),
            Self::Fast => return Some(BuildOptions::fast()),
            Self::Balanced => return Some(BuildOptions::balanced()),
            Self::Best => return Some(BuildOptions::best()),
            _ => return None,
        };
        Some(literature(method))
    }

    /// Whether it is a preset: options that a user gets by name, for the default layout.
    pub(crate) const fn is_preset(self) -> bool {
        matches!(self, Self::Fast | Self::Balanced | Self::Best)
    }

    /// Whether it builds a structure of a rival library.
    pub(crate) const fn is_of_rival(self) -> bool {
        matches!(
            self,
            Self::Low | Self::Medium | Self::High | Self::Fastest | Self::Slow | Self::Default
        )
    }

    /// The number of triangles above which the sweep skips it: a build would take from many seconds to minutes.
    pub(crate) const fn most_triangles(self) -> usize {
        match self {
            Self::Naive => 20_000,
            _ => usize::MAX,
        }
    }
}

/// The constants of the papers, so that costs can be compared: K_T 15, K_I 20, empty space at 0.9, leaves of up to 6
/// triangles, 3 bad refines. The presets have constants of our own.
fn literature(method: Method) -> BuildOptions {
    BuildOptions::best()
        .with_method(method)
        .with_cost(CostModel::CLASSIC)
        .with_small_leaf(6)
        .with_bad_refines(3)
}

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum LayoutName {
    /// The tree's own 8-byte nodes
    Binary,
    /// Nodes of eight children
    Wide,
    /// The only layout of a structure
    #[value(skip)]
    Own,
    /// Tree construction only, without layout
    #[value(skip)]
    Tree,
}

impl LayoutName {
    /// The layout of a kd-tree.
    pub(crate) const fn layout(self) -> Layout {
        match self {
            Self::Binary => Layout::Binary,
            Self::Wide | Self::Own | Self::Tree => Layout::Wide,
        }
    }

    const ALL: [Self; 4] = [Self::Binary, Self::Wide, Self::Own, Self::Tree];

    /// The name in records.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::Wide => "wide",
            Self::Own => "own",
            Self::Tree => "tree",
        }
    }
}

/// A structure, its builder and its layout.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Variant {
    pub(crate) structure: StructureName,
    pub(crate) builder: BuilderName,
    pub(crate) layout: LayoutName,
}

impl Variant {
    pub(crate) const fn new(
        structure: StructureName,
        builder: BuilderName,
        layout: LayoutName,
    ) -> Self {
        Self {
            structure,
            builder,
            layout,
        }
    }

    pub(crate) const fn kd(builder: BuilderName, layout: LayoutName) -> Self {
        Self::new(StructureName::Kd, builder, layout)
    }

    pub(crate) const fn bvh(builder: BuilderName, layout: LayoutName) -> Self {
        Self::new(StructureName::Bvh, builder, layout)
    }

    /// A structure with only one layout.
    pub(crate) const fn own(structure: StructureName, builder: BuilderName) -> Self {
        Self::new(structure, builder, LayoutName::Own)
    }

    /// The variant of a name like `kd/best/wide`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut names = text.split('/');
        let structure = StructureName::from_str(names.next()?, false).ok()?;
        let builder = BuilderName::from_str(names.next()?, false).ok()?;
        let layout = names.next()?;
        let layout = LayoutName::ALL
            .into_iter()
            .find(|known| known.name() == layout)?;
        Some(Self::new(structure, builder, layout))
    }

    /// Whether it is a rival library. Rivals answer by their own rules: see
    /// [`Answers::disagreements`](crate::check::Answers::disagreements).
    pub(crate) const fn is_rival(self) -> bool {
        self.builder.is_of_rival()
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (structure, builder) = (name_of(&self.structure), name_of(&self.builder));
        write!(f, "{structure}/{builder}/{}", self.layout.name())
    }
}

/// The structure that makes the rays and gives the expected answers, and the baseline of wide layouts.
pub(crate) const REFERENCE: Variant = Variant::kd(BuilderName::Balanced, LayoutName::Wide);

/// The baseline where rivals are measured.
pub(crate) const RIVAL: Variant = Variant::own(StructureName::Embree, BuilderName::Medium);
