//! Wide nodes from binary trees that were made elsewhere.

use glam::Vec3;
use kd_core::{Axis, Mesh, Ray};
use kd_trace::kit::{BinaryNode, BinaryTree};
use kd_trace::{Level, RayQuery, WideTree, brute_force};

use crate::check::source;
use crate::rng::Rng;
use crate::scenes;

/// Triangles divided at random: leaves of any size, and axes that mean nothing.
struct Random {
    triangles: Vec<u32>,
    /// What is below each node: a leaf's first triangle and count, or an axis and children.
    nodes: Vec<Node>,
}

enum Node {
    Leaf(usize, usize),
    Split(Axis, [u32; 2]),
}

impl Random {
    fn new(mesh: &Mesh, rng: &mut Rng) -> Self {
        let mut triangles: Vec<u32> = (0..).take(mesh.len()).collect();
        for place in (1..triangles.len()).rev() {
            triangles.swap(place, rng.below(place + 1));
        }
        let mut tree = Self {
            triangles,
            nodes: Vec::new(),
        };
        if !mesh.is_empty() {
            tree.add(0, mesh.len(), 0, rng);
        }
        tree
    }

    fn add(&mut self, first: usize, count: usize, depth: usize, rng: &mut Rng) -> u32 {
        let place = self.nodes.len();
        self.nodes.push(Node::Leaf(first, count));
        if count > 1 && depth < 40 && rng.chance(0.9) {
            let lower = 1 + rng.below(count - 1);
            let children = [
                self.add(first, lower, depth + 1, rng),
                self.add(first + lower, count - lower, depth + 1, rng),
            ];
            self.nodes[place] = Node::Split(rng.pick(&Axis::ALL), children);
        }
        u32::try_from(place).expect("few")
    }
}

impl BinaryTree for Random {
    fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    fn node(&self, index: u32) -> BinaryNode<'_> {
        match self.nodes[index as usize] {
            Node::Leaf(first, count) => BinaryNode::Leaf(&self.triangles[first..][..count]),
            Node::Split(axis, children) => BinaryNode::Split { axis, children },
        }
    }
}

#[test]
fn any_binary_tree_answers_as_brute_force() {
    let mut rng = Rng(51);
    for (name, mesh) in scenes::all() {
        for level in [Level::portable(), Level::detect()] {
            let tree = Random::new(&mesh, &mut rng);
            let wide = WideTree::from_binary(&tree, &mesh).with_level(level);
            let bounds = mesh.bounds();
            let (mut hit, size) = (0, bounds.extent().max_element());
            for _ in 0..1000 {
                let triangle = u32::try_from(rng.below(mesh.len())).expect("few");
                let [a, b, c] = mesh.corners(triangle);
                let target = rng.pick(&[a, a.midpoint(b), (a + b + c) / 3.0]);
                let origin = bounds.center() + size * rng.vec3();
                let ray = Ray::new(origin, target - origin);
                let closest = brute_force::intersect(&mesh, &ray);
                assert_eq!(wide.intersect(&ray), closest, "{name}: {}", source(&ray));
                let any = wide.occluded(&ray);
                assert_eq!(any, closest.is_some(), "{name}: {}", source(&ray));
                hit += usize::from(any);
            }
            assert!(hit > 500, "{name}: {hit} hit");
        }
    }
}

#[test]
fn a_tree_of_nothing_is_valid() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let wide = WideTree::from_binary(&Random::new(&mesh, &mut Rng(1)), &mesh);
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(wide.intersect(&ray), None, "nothing there");
}

/// A chain of splits with a triangle beside each.
struct Chain;

impl BinaryTree for Chain {
    fn root(&self) -> Option<u32> {
        Some(0)
    }

    fn node(&self, index: u32) -> BinaryNode<'_> {
        if index % 2 == 1 {
            BinaryNode::Leaf(&[0])
        } else {
            let (axis, children) = (Axis::X, [index + 1, index + 2]);
            BinaryNode::Split { axis, children }
        }
    }
}

#[test]
#[should_panic(expected = "at most 64 levels below the root")]
fn a_tree_without_end_is_refused() {
    let _ = WideTree::from_binary(&Chain, &scenes::soup());
}
