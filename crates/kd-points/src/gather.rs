//! All triangles of a region, in any order.

use arrayvec::ArrayVec;
use kd_core::{Aabb, MAX_DEPTH, NodeIndex};
use kd_simd::{LANES, Simd, Task};
use kd_wide::{Block, Child, MAX_LEVELS, WIDTH};

use crate::tree::PointTree;

/// All but one of the children on each level of a path, and those of one more node.
const MOST_PENDING: usize = MAX_LEVELS * (WIDTH - 1) + WIDTH;

/// 2⁻²², of the longest side of a tree.
const PER_SIDE: f64 = 1.0 / (1 << 22) as f64;
/// 2⁻⁴⁶, of coordinates.
const PER_COORDINATE: f64 = 1.0 / (1_u64 << 46) as f64;

/// What is asked for, in lanes of a level.
pub(crate) trait Region<S: Simd> {
    /// Which of eight boxes may have a triangle of the region: a bit for each lane.
    fn boxes(&self, simd: S, faces: &[[[f32; LANES]; 2]; 3]) -> u32;
    /// Whether a cell of a kd-tree may have one.
    fn cell(&self, cell: &Aabb) -> bool;
    /// Takes the triangles of a block that are in the region. The same triangle may come several times.
    fn take(&mut self, simd: S, block: &Block);
}

/// Gives a region the blocks of all boxes that it meets: the body of a task.
#[inline(always)]
pub(crate) fn gather<S: Simd, R: Region<S>>(simd: S, tree: PointTree<'_>, region: &mut R) {
    match tree {
        PointTree::Wide(tree) => {
            let mut pending = ArrayVec::<Child, MOST_PENDING>::new();
            pending.push(tree.root());
            while let Some(child) = pending.pop() {
                if child.is_leaf() {
                    for block in &tree.blocks()[child.blocks()] {
                        region.take(simd, block);
                    }
                    continue;
                }
                let node = &tree.nodes()[child.index()];
                let mut met = region.boxes(simd, &node.faces);
                while met != 0 {
                    pending.push(node.children[met.trailing_zeros() as usize]);
                    met &= met - 1;
                }
            }
        }
        PointTree::Packed(tree) => {
            let mut pending = ArrayVec::<(NodeIndex, Aabb), { MAX_DEPTH + 1 }>::new();
            pending.push((tree.root(), tree.bounds()));
            while let Some((place, cell)) = pending.pop() {
                if !region.cell(&cell) {
                    continue;
                }
                let node = tree.nodes()[place.index()];
                if node.is_leaf() {
                    for block in tree.blocks_of(node) {
                        region.take(simd, block);
                    }
                    continue;
                }
                let first = node.first_child();
                let mut halves = [cell; 2];
                halves[0].max[node.tag()] = node.split();
                halves[1].min[node.tag()] = node.split();
                let children = [first, first.sibling()];
                pending.extend(children.into_iter().zip(halves));
            }
        }
    }
}

/// How far a point of a triangle may be outside of all boxes that refer to the triangle: see [`reach`](crate::reach).
pub(crate) fn pad(bounds: &Aabb) -> f64 {
    let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
    let coordinate = min.abs().max(max.abs()).max_element();
    PER_SIDE * (max - min).max_element() + PER_COORDINATE * coordinate
}

/// The nearest f32 that is not higher, or one below it.
#[allow(clippy::cast_possible_truncation, reason = "rounded, then moved down")]
pub(crate) fn rounded_down(x: f64) -> f32 {
    (x as f32).next_down()
}

/// The nearest f32 that is not lower, or one above it.
#[allow(clippy::cast_possible_truncation, reason = "rounded, then moved up")]
pub(crate) fn rounded_up(x: f64) -> f32 {
    (x as f32).next_up()
}

/// Sorts slots, each once.
pub(crate) fn in_order(slots: &mut Vec<u32>) {
    slots.sort_unstable();
    slots.dedup();
}

/// Gathers the triangles of a region of one tree, at the level of the tree.
pub(crate) struct Gather<'a, R> {
    pub(crate) tree: PointTree<'a>,
    pub(crate) region: &'a mut R,
}

impl<S: Simd, R: Region<S>> Task<S> for Gather<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        gather(simd, self.tree, self.region);
    }
}
