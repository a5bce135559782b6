//! The build of a BSP tree.

use std::sync::Arc;

use kd_core::{Aabb, Mesh};

use super::fragments::{Fragments, Sides};
use super::line::PER_SIDE;
use super::plane::{Plane, Side};
use super::{DEPTH, List, Node, PolygonBsp, Subtree};
use crate::CellOptions;
use crate::cells::Spare;

/// Candidates for the plane of a cell. A few are enough: H. Fuchs, G. D. Abram and E. D. Grant, *Near
/// real-time shaded display of rigid objects*, SIGGRAPH 1983.
const CANDIDATES: usize = 8;

/// Fragments that each candidate is judged by, evenly spaced, so that the choice takes less time than the division.
const JURY: usize = 256;

/// The weight of a cut, in fragments of imbalance between the sides.
const CUT: usize = 4;

/// 2⁻²¹, of the largest coordinate in a cell: eight units in its last place. Polygons that were planar before their corners
/// were rounded to f32 are planar up to this tolerance; with a smaller one, each would be cut by the planes of all others.
const TOLERANCE: f64 = 1.0 / (1 << 21) as f64;

/// 2⁻³², of the largest coordinate in the scene: the least tolerance. With it every fragment, of any size, is in the plane of its
/// own triangle, so that each division removes at least one.
const LEAST_TOLERANCE: f64 = 1.0 / (1_u64 << 32) as f64;

/// The BSP tree of a mesh.
pub(super) fn bsp(mesh: Arc<Mesh>, options: &CellOptions) -> PolygonBsp {
    let fragments = Fragments::of(&mesh);
    let mut build = Build {
        mesh: &mesh,
        least_tolerance: LEAST_TOLERANCE * fragments.largest_coordinate(),
        small_leaf: options.small_leaf as usize,
        max_depth: options.depth_limit(DEPTH),
        bsp: PolygonBsp {
            mesh: Arc::clone(&mesh),
            bounds: mesh.bounds(),
            root: Subtree::Leaf(List::default()),
            nodes: Vec::new(),
            refs: Vec::new(),
            leaves: 0,
            depth: 0,
            large_leaves: 0,
        },
    };
    let spare = Spare(options.spare_refs(mesh.len()));
    build.bsp.root = build.subtree(fragments, 0, spare);
    build.bsp
}

/// A build under way.
struct Build<'a> {
    mesh: &'a Mesh,
    /// In scene units.
    least_tolerance: f64,
    small_leaf: usize,
    max_depth: u32,
    bsp: PolygonBsp,
}

/// A cell divided by a plane.
struct Division {
    plane: Plane,
    slack: f64,
    sides: Sides,
    /// The references that may still be added below.
    spare: Spare,
}

impl Build<'_> {
    /// Adds the nodes of a cell with these fragments.
    fn subtree(&mut self, fragments: Fragments, depth: u32, spare: Spare) -> Subtree {
        if fragments.len() == 0 {
            return Subtree::Leaf(List::default());
        }
        self.bsp.depth = self.bsp.depth.max(depth);
        let division = if fragments.len() <= self.small_leaf {
            None
        } else {
            let division = self.divide(&fragments, depth, spare);
            self.bsp.large_leaves += usize::from(division.is_none());
            division
        };
        let Some(Division {
            plane,
            slack,
            sides,
            spare,
        }) = division
        else {
            self.bsp.leaves += 1;
            return Subtree::Leaf(self.list(fragments.triangles()));
        };
        // Frees memory before the recursion: one copy in total, not one per level.
        drop(fragments);
        self.bsp.depth = self.bsp.depth.max(depth + 1);
        let number = self.bsp.nodes.len();
        let on = self.list(&sides.on);
        self.bsp.nodes.push(Node {
            plane,
            slack,
            on,
            children: [Subtree::Leaf(List::default()); 2],
        });
        let children = [sides.behind, sides.in_front];
        let whole = children.iter().map(Fragments::len).sum();
        for (side, child) in children.into_iter().enumerate() {
            let spare = spare.share(child.len(), whole);
            let child = self.subtree(child, depth + 1, spare);
            self.bsp.nodes[number].children[side] = child;
        }
        Subtree::Divided(narrow(number))
    }

    /// Divides a cell; `None` if a limit is reached or no triangle has a plane.
    fn divide(&self, fragments: &Fragments, depth: u32, spare: Spare) -> Option<Division> {
        if depth >= self.max_depth {
            return None;
        }
        let tolerance = (TOLERANCE * fragments.largest_coordinate()).max(self.least_tolerance);
        let plane = self.best_plane(fragments, tolerance)?;
        let sides = fragments.sides_of(&plane, tolerance);
        let (behind, in_front) = (sides.behind.len(), sides.in_front.len());
        let added = (behind + in_front + sides.on.len()).saturating_sub(fragments.len());
        Some(Division {
            plane,
            slack: tolerance + PER_SIDE * self.longest_side(fragments),
            sides,
            spare: spare.after(added)?,
        })
    }

    /// The best candidate; the first among equals.
    fn best_plane(&self, fragments: &Fragments, tolerance: f64) -> Option<Plane> {
        let candidates = self.candidates(fragments);
        let planes = candidates.into_iter();
        planes.min_by_key(|plane| badness(fragments, plane, tolerance))
    }

    /// Planes of triangles that are evenly spaced in the list. A triangle without a plane is replaced by the next one that has a
    /// plane.
    fn candidates(&self, fragments: &Fragments) -> Vec<Plane> {
        let triangles = fragments.triangles();
        let stride = triangles.len().div_ceil(CANDIDATES).max(1);
        let first_with_plane = |chunk: &[u32]| {
            let mut planes = chunk.iter().map(|&t| Plane::of(self.mesh.corners(t)));
            planes.find_map(|plane| plane)
        };
        triangles
            .chunks(stride)
            .filter_map(first_with_plane)
            .collect()
    }

    /// The longest side, along an axis, of the triangles, in scene units.
    fn longest_side(&self, fragments: &Fragments) -> f64 {
        let sides = fragments.triangles().iter().map(|&triangle| {
            let Aabb { min, max } = Aabb::around(self.mesh.corners(triangle));
            (max.as_dvec3() - min.as_dvec3()).max_element()
        });
        sides.fold(0.0, f64::max)
    }

    fn list(&mut self, triangles: &[u32]) -> List {
        if triangles.is_empty() {
            return List::default();
        }
        let first = narrow(self.bsp.refs.len());
        self.bsp.refs.extend_from_slice(triangles);
        List {
            first,
            count: narrow(triangles.len()),
        }
    }
}

/// The badness of a plane: its cuts and the imbalance of its sides.
fn badness(fragments: &Fragments, plane: &Plane, tolerance: f64) -> usize {
    let stride = fragments.len().div_ceil(JURY).max(1);
    let (mut behind, mut in_front, mut across) = (0_usize, 0_usize, 0_usize);
    for number in (0..fragments.len()).step_by(stride) {
        match plane.side_of(fragments.corners(number), tolerance) {
            Side::Behind => behind += 1,
            Side::InFront => in_front += 1,
            Side::Across => across += 1,
            Side::On => {}
        }
    }
    CUT * across + behind.abs_diff(in_front)
}

/// A number of references, or of nodes: each node lists a triangle at its plane.
fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("references are limited to 32 bits")
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Hills of small triangles, and a huge triangle through them. Where the huge one is cut to a small fragment, the tolerance
    /// is small too, but the error of its hits is not.
    fn hills_and_a_huge_triangle() -> Mesh {
        let mut positions = vec![[-7.0, -9.0, -3.0], [8.0, -6.0, 2.0], [1.0, 9.0, 1.0]];
        let mut triangles = vec![[0, 1, 2]];
        let at = |i: u8, j: u8| {
            let (x, y) = (f32::from(i) - 10.0, f32::from(j) - 10.0);
            1e-4 * Vec3::new(x, y, (0.9 * x).sin() + (0.7 * y).cos())
        };
        for i in 0..20 {
            for j in 0..20 {
                let first = u32::try_from(positions.len()).expect("few");
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                positions.extend(corners.map(|corner| corner.to_array()));
                let [a, b, c, d] = [0, 1, 2, 3].map(|corner| first + corner);
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Mesh::new(positions, triangles).expect("valid")
    }

    /// Checks each node of a subtree. Returns the longest side of its triangles.
    fn longest_below(bsp: &PolygonBsp, mesh: &Mesh, subtree: Subtree) -> f64 {
        let longest_of = |list: List| {
            let refs = &bsp.refs[list.first as usize..][..list.count as usize];
            let sides = refs.iter().map(|&triangle| {
                let bounds = Aabb::around(mesh.corners(triangle));
                f64::from(bounds.extent().max_element())
            });
            sides.fold(0.0, f64::max)
        };
        match subtree {
            Subtree::Leaf(list) => longest_of(list),
            Subtree::Divided(number) => {
                let node = &bsp.nodes[number as usize];
                let below = node.children.map(|child| longest_below(bsp, mesh, child));
                let longest = below.into_iter().fold(longest_of(node.on), f64::max);
                let least = 0.999 * PER_SIDE * longest;
                assert!(node.slack >= least, "{} of {longest}", node.slack);
                longest
            }
        }
    }

    #[test]
    fn every_slack_is_wide_enough_for_the_triangles_below() {
        let mesh = hills_and_a_huge_triangle();
        let bsp = bsp(Arc::new(mesh.clone()), &CellOptions::default());
        assert!(
            bsp.nodes.iter().all(|node| node.on.count > 0),
            "the triangle of each plane"
        );
        let longest = longest_below(&bsp, &mesh, bsp.root);
        assert!(longest > 10.0, "the huge triangle");
        let small = bsp.nodes.iter().filter(|node| node.slack < 1e-8).count();
        assert!(small > 10, "most nodes have small triangles only: {small}");
    }

    #[test]
    fn the_best_plane_divides_evenly_without_a_cut() {
        // Walls across x; the one in the middle is the best plane.
        let wall = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        let positions = [3.0, 0.0, 4.0, 2.0, 1.0].map(wall).concat();
        let triangles = (0..5).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions, triangles).expect("valid");
        let bsp = bsp(Arc::new(mesh), &CellOptions::default().with_small_leaf(2));
        let sizes = bsp.nodes[0].children.map(|child| match child {
            Subtree::Leaf(list) => list.count,
            Subtree::Divided(_) => 0,
        });
        assert_eq!((bsp.nodes.len(), sizes), (1, [2, 2]), "two on each side");
    }
}
