//! Makes an octree.

use glam::Vec3;
use kd_core::{Aabb, Axis, Mesh, clipped_halves};

use super::{DEPTH, Node, Octree};
use crate::spare::Spare;
use crate::{BuildError, Options};

/// The octree of a mesh.
pub(super) fn octree(mesh: &Mesh, options: &Options) -> Result<Octree, BuildError> {
    let mut build = Build {
        mesh,
        small_leaf: options.small_leaf as usize,
        max_depth: options.depth_limit(DEPTH),
        octree: Octree {
            bounds: mesh.bounds(),
            nodes: Vec::new(),
            refs: Vec::new(),
            depth: 0,
            large_leaves: 0,
        },
    };
    if !mesh.is_empty() {
        let parts: Vec<Part> = (0..)
            .zip(mesh.triangles())
            .map(|(triangle, _)| Part {
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
        build.fill(0, &root, parts)?;
    }
    Ok(build.octree)
}

/// What stands where a child will be.
const PLACEHOLDER: Node = Node::Leaf { first: 0, count: 0 };

/// The part of a triangle in a cell.
#[derive(Clone, Copy)]
struct Part {
    triangle: u32,
    /// The box around it, within the cell.
    bounds: Aabb,
}

/// Where a node is.
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
    /// Makes node `node` that of a cell with these parts, and all nodes below it.
    fn fill(&mut self, node: usize, cell: &Cell, parts: Vec<Part>) -> Result<(), BuildError> {
        self.octree.depth = self.octree.depth.max(cell.depth);
        let division = if parts.len() <= self.small_leaf {
            None
        } else {
            let division = self.divide(cell, &parts);
            self.octree.large_leaves += usize::from(division.is_none());
            division
        };
        let Some(Division {
            middle,
            octants,
            spare,
        }) = division
        else {
            self.octree.nodes[node] = self.leaf(&parts);
            return Ok(());
        };
        // What waits for its turn is held once, not once for every level.
        drop(parts);
        let present: Vec<(usize, Vec<Part>)> = (0..)
            .zip(octants)
            .filter(|(_, parts)| !parts.is_empty())
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
        let whole = present.iter().map(|(_, parts)| parts.len()).sum();
        for (child, (octant, parts)) in present.into_iter().enumerate() {
            let cell = Cell {
                bounds: octant_of(&cell.bounds, middle, octant),
                depth: cell.depth + 1,
                spare: spare.share(parts.len(), whole),
            };
            self.fill(first + child, &cell, parts)?;
        }
        Ok(())
    }

    /// Divides a cell, unless a limit forbids it or nothing is gained.
    fn divide(&self, cell: &Cell, parts: &[Part]) -> Option<Division> {
        if cell.depth >= self.max_depth {
            return None;
        }
        let middle = middle_of(&cell.bounds)?;
        let mut octants = [const { Vec::new() }; 8];
        for part in parts {
            self.sort_in(0, 0, *part, cell.bounds, middle, &mut octants);
        }
        let held = octants.each_ref().map(Vec::len);
        let is_in_one = held.iter().filter(|&&count| count > 0).count() == 1;
        let is_any_smaller = held.iter().any(|&n| 0 < n && n < parts.len());
        // One child that holds all is a smaller box around the same, and costs no references.
        if !(is_in_one || is_any_smaller) {
            return None;
        }
        let added = held.iter().sum::<usize>().saturating_sub(parts.len());
        Some(Division {
            middle,
            octants,
            spare: cell.spare.after(added)?,
        })
    }

    /// Puts a part into the lists of the octants that it reaches into. The cell is divided along the axes before `along`
    /// already, and is `octant` there as far as that goes.
    ///
    /// What lies in a dividing plane goes to one side of it, the lower one if all of the part does: rays find it there, since
    /// planes are crossed in an interval.
    fn sort_in(
        &self,
        along: usize,
        octant: usize,
        part: Part,
        cell: Aabb,
        middle: Vec3,
        octants: &mut [Vec<Part>; 8],
    ) {
        let Some(&axis) = Axis::ALL.get(along) else {
            octants[octant].push(part);
            return;
        };
        let plane = middle[along];
        let halves = if part.bounds.max[along] <= plane {
            [Some(part.bounds), None]
        } else if part.bounds.min[along] >= plane {
            [None, Some(part.bounds)]
        } else {
            // The whole triangle is clipped to the cell each time, so that rounding does not add up.
            clipped_halves(self.mesh.corners(part.triangle), &cell, axis, plane)
        };
        let (lower, upper) = cell.split(axis, plane);
        for (side, (half, bounds)) in [lower, upper].into_iter().zip(halves).enumerate() {
            if let Some(bounds) = bounds {
                let part = Part { bounds, ..part };
                let octant = octant | side << along;
                self.sort_in(along + 1, octant, part, half, middle, octants);
            }
        }
    }

    fn leaf(&mut self, parts: &[Part]) -> Node {
        let refs = &mut self.octree.refs;
        let first = refs.len();
        refs.extend(parts.iter().map(|part| part.triangle));
        let narrow = |count| u32::try_from(count).expect("references are limited to 32 bits");
        Node::Leaf {
            first: narrow(first),
            count: narrow(parts.len()),
        }
    }
}

/// A cell divided into eight.
struct Division {
    middle: Vec3,
    octants: [Vec<Part>; 8],
    /// What may still be added below.
    spare: Spare,
}

/// Where a cell is divided; `None` if it is too small for that on every axis.
///
/// A side with no number between its ends is not divided: all of it is the lower half, and its plane is the upper face.
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

fn index(node: usize) -> Result<u32, BuildError> {
    u32::try_from(node).map_err(|_| BuildError::TooManyNodes)
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
