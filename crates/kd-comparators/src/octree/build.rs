//! The build of an octree.

use std::sync::Arc;

use glam::Vec3;
use kd_core::{Aabb, Axis, Mesh, clipped_halves};

use super::{DEPTH, Node, Octree};
use crate::cells::Spare;
use crate::{CellOptions, ComparatorError};

/// The octree of a mesh.
pub(super) fn octree(mesh: Arc<Mesh>, options: &CellOptions) -> Result<Octree, ComparatorError> {
    let mut build = Build {
        mesh: &mesh,
        small_leaf: options.small_leaf as usize,
        max_depth: options.depth_limit(DEPTH),
        octree: Octree {
            mesh: Arc::clone(&mesh),
            bounds: mesh.bounds(),
            nodes: Vec::new(),
            refs: Vec::new(),
            depth: 0,
            large_leaves: 0,
        },
    };
    if !mesh.is_empty() {
        let references: Vec<Reference> = (0..)
            .zip(mesh.triangles())
            .map(|(triangle, _)| Reference {
                triangle,
                bounds: Aabb::around(mesh.corners(triangle)),
            })
            .collect();
        let root = Cell {
            bounds: mesh.bounds(),
            depth: 0,
            spare: Spare(options.spare_refs(mesh.len())),
        };
        build.octree.nodes.push(PLACEHOLDER);
        build.fill(0, &root, references)?;
    }
    Ok(build.octree)
}

/// Reserves the index of a child.
const PLACEHOLDER: Node = Node::Leaf { first: 0, count: 0 };

/// A triangle in a cell.
#[derive(Clone, Copy)]
struct Reference {
    triangle: u32,
    /// The box of the triangle's intersection with the cell.
    bounds: Aabb,
}

/// A cell and its limits.
struct Cell {
    bounds: Aabb,
    depth: u32,
    spare: Spare,
}

/// A build under way.
struct Build<'a> {
    mesh: &'a Mesh,
    small_leaf: usize,
    max_depth: u32,
    octree: Octree,
}

impl Build<'_> {
    /// Writes node `node`, of a cell with these references, and all nodes below it.
    fn fill(
        &mut self,
        node: usize,
        cell: &Cell,
        references: Vec<Reference>,
    ) -> Result<(), ComparatorError> {
        self.octree.depth = self.octree.depth.max(cell.depth);
        let division = if references.len() <= self.small_leaf {
            None
        } else {
            let division = self.divide(cell, &references);
            self.octree.large_leaves += usize::from(division.is_none());
            division
        };
        let Some(Division {
            middle,
            octants,
            spare,
        }) = division
        else {
            self.octree.nodes[node] = self.leaf(&references);
            return Ok(());
        };
        // Frees memory before the recursion: one copy in total, not one per level.
        drop(references);
        let present: Vec<(usize, Vec<Reference>)> = (0..)
            .zip(octants)
            .filter(|(_, references)| !references.is_empty())
            .collect();
        let first = self.octree.nodes.len();
        self.octree.nodes.resize(first + present.len(), PLACEHOLDER);
        self.octree.nodes[node] = Node::Divided {
            middle,
            first: index(first)?,
            octants: present
                .iter()
                .fold(0, |bits, (octant, _)| bits | 1 << octant),
        };
        let whole = present.iter().map(|(_, references)| references.len()).sum();
        for (child, (octant, references)) in present.into_iter().enumerate() {
            let cell = Cell {
                bounds: octant_of(&cell.bounds, middle, octant),
                depth: cell.depth + 1,
                spare: spare.share(references.len(), whole),
            };
            self.fill(first + child, &cell, references)?;
        }
        Ok(())
    }

    /// Divides a cell; `None` if a limit is reached or every child would hold all references.
    fn divide(&self, cell: &Cell, references: &[Reference]) -> Option<Division> {
        if cell.depth >= self.max_depth {
            return None;
        }
        let middle = middle_of(&cell.bounds)?;
        let mut octants = [const { Vec::new() }; 8];
        for reference in references {
            self.sort_in(0, 0, *reference, cell.bounds, middle, &mut octants);
        }
        let held = octants.each_ref().map(Vec::len);
        let is_in_one = held.iter().filter(|&&count| count > 0).count() == 1;
        let is_any_smaller = held.iter().any(|&n| 0 < n && n < references.len());
        // A single child that holds all references is a smaller box around them, and adds no references.
        if !(is_in_one || is_any_smaller) {
            return None;
        }
        let added = held.iter().sum::<usize>().saturating_sub(references.len());
        Some(Division {
            middle,
            octants,
            spare: cell.spare.after(added)?,
        })
    }

    /// Adds a reference to the lists of the octants that it overlaps. The cell is divided along the axes before `along` already,
    /// and is `octant` of that division.
    ///
    /// A reference that is in a dividing plane goes to one side, the lower one: rays find it there, since planes are crossed in
    /// an interval.
    fn sort_in(
        &self,
        along: usize,
        octant: usize,
        reference: Reference,
        cell: Aabb,
        middle: Vec3,
        octants: &mut [Vec<Reference>; 8],
    ) {
        let Some(&axis) = Axis::ALL.get(along) else {
            octants[octant].push(reference);
            return;
        };
        let plane = middle[along];
        let halves = if reference.bounds.max[along] <= plane {
            [Some(reference.bounds), None]
        } else if reference.bounds.min[along] >= plane {
            [None, Some(reference.bounds)]
        } else {
            // Clips the original triangle each time, so that rounding errors do not add up.
            clipped_halves(self.mesh.corners(reference.triangle), &cell, axis, plane)
        };
        let (lower, upper) = cell.split(axis, plane);
        for (side, (half, bounds)) in [lower, upper].into_iter().zip(halves).enumerate() {
            if let Some(bounds) = bounds {
                let reference = Reference {
                    bounds,
                    ..reference
                };
                let octant = octant | side << along;
                self.sort_in(along + 1, octant, reference, half, middle, octants);
            }
        }
    }

    fn leaf(&mut self, references: &[Reference]) -> Node {
        let refs = &mut self.octree.refs;
        let first = refs.len();
        refs.extend(references.iter().map(|reference| reference.triangle));
        let narrow = |count| u32::try_from(count).expect("references are limited to 32 bits");
        Node::Leaf {
            first: narrow(first),
            count: narrow(references.len()),
        }
    }
}

/// A cell divided into eight.
struct Division {
    middle: Vec3,
    octants: [Vec<Reference>; 8],
    /// The references that may still be added below.
    spare: Spare,
}

/// The dividing planes of a cell; `None` if no axis can be divided.
///
/// A side without a number between its ends is not divided: the plane is the upper face, and all of the side is the lower half.
fn middle_of(cell: &Aabb) -> Option<Vec3> {
    let center = cell.center();
    let is_between = center.cmpgt(cell.min) & center.cmplt(cell.max);
    is_between
        .any()
        .then(|| Vec3::select(is_between, center, cell.max))
}

fn octant_of(cell: &Aabb, middle: Vec3, octant: usize) -> Aabb {
    let mut bounds = *cell;
    for axis in Axis::ALL {
        let (lower, upper) = bounds.split(axis, middle[axis.index()]);
        let is_upper = octant & (1 << axis.index()) != 0;
        bounds = if is_upper { upper } else { lower };
    }
    bounds
}

fn index(node: usize) -> Result<u32, ComparatorError> {
    u32::try_from(node).map_err(|_| ComparatorError::TooManyNodes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_that_cannot_be_halved_stay_whole() {
        let (low, high) = (
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(1.0, 1.0_f32.next_up(), 4.0),
        );
        let cell = Aabb::around([low, high]);
        let middle = middle_of(&cell).expect("one side is long");
        assert_eq!(
            middle,
            Vec3::new(1.0, 1.0_f32.next_up(), 2.0),
            "upper faces"
        );
        let lower = octant_of(&cell, middle, 0);
        assert_eq!((lower.min, lower.max), (low, high.with_z(2.0)), "half of z");
        assert_eq!(middle_of(&Aabb::around([low])), None, "a point");
    }

    #[test]
    fn octants_fill_the_cell() {
        let cell = Aabb::around([Vec3::ZERO, Vec3::new(2.0, 4.0, 8.0)]);
        let middle = middle_of(&cell).expect("large");
        let octants = [0, 1, 2, 3, 4, 5, 6, 7].map(|octant| octant_of(&cell, middle, octant));
        for (number, octant) in octants.iter().enumerate() {
            assert_eq!(octant.extent(), 0.5 * cell.extent(), "octant {number}");
            let above = octant.center().cmpgt(middle).bitmask();
            assert_eq!(above as usize, number, "a bit for each axis");
        }
    }
}
