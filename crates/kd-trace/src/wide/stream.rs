//! Streams: many incoherent rays, sorted into the children of each node.
//!
//! A single ray waits at each node: for the tests that determine the next child, for recovery from mispredicted branches, and
//! for memory. Here all rays that meet a node are tested in one loop without such branches, and the node is loaded once. The loop
//! [divides](BatchRay::divide) a list of rays into eight lists, one for each child; the lists are visited as one ray would visit
//! the children, since all rays of a traversal move in the same octant of directions. A few rays that remain in a list
//! go on [alone](BatchRay::trace_below), and so does each ray in a leaf.
//!
//! (R. Barringer, T. Akenine-Möller, *Dynamic Ray Stream Traversal*, 2014.)
#![allow(
    unsafe_code,
    reason = "children are followed without a check of their indices: see `WideTree::node`"
)]

use kd_core::Ray;
use kd_simd::{Simd, Task};
use kd_wide::{Child, WIDTH, WideTree};

use super::batch_ray::{BatchRay, Entry, IN_LANES};
use super::subtree::Subtree;

const OCTANTS: usize = 8;

/// At most this number of rays is faster one by one. (From 1 to 8 the time differs little.)
const FEW: usize = 4;

/// A child that rays meet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    child: Child,
    /// The list of its rays.
    start: usize,
    len: usize,
    /// From here on, entries are unused while the child is visited.
    free: usize,
}

/// The rays of a stream. It keeps its memory for the next ones.
pub(super) struct Stream<N, R> {
    nodes: Vec<N>,
    rays: Vec<R>,
    /// The caller's numbers of the rays.
    numbers: Vec<u32>,
    by_octant: [Vec<Entry>; OCTANTS],
    /// The lists of pending children.
    entries: Vec<Entry>,
    pending: Vec<Pending>,
}

impl<N, R> Stream<N, R> {
    /// No rays.
    pub(super) fn new() -> Self {
        Self {
            nodes: Vec::new(),
            rays: Vec::new(),
            numbers: Vec::new(),
            by_octant: Default::default(),
            entries: Vec::new(),
            pending: Vec::new(),
        }
    }

    /// Traces the rays of some numbers. Passes the number and the answer of each to `take`, or `None` for a ray that is to be traced
    /// alone.
    #[inline(always)]
    pub(super) fn trace<S: Simd>(
        &mut self,
        simd: S,
        tree: &WideTree,
        all: &[Ray],
        numbers: &[u32],
        mut take: impl FnMut(u32, Option<R::Answer>),
    ) where
        R: BatchRay<S, Nodes = N>,
    {
        self.nodes.clear();
        self.rays.clear();
        self.numbers.clear();
        for number in numbers {
            let Some((nodes, ray)) = R::begin(simd, &all[*number as usize], tree.frame()) else {
                take(*number, None);
                continue;
            };
            self.nodes.push(nodes);
            self.rays.push(ray);
            self.numbers.push(*number);
        }
        // Not while a ray begins: its octant is known late then, and where its entry goes even later.
        for (ray, nodes) in (0..).zip(&self.nodes) {
            self.by_octant[R::octant(nodes) % OCTANTS].push(Entry {
                enter: f32::NEG_INFINITY,
                ray,
            });
        }
        for (octant, list) in self.by_octant.iter_mut().enumerate() {
            if list.is_empty() {
                continue;
            }
            simd.apart(Traversal {
                tree,
                all,
                numbers: &self.numbers,
                octant,
                list,
                nodes: &mut self.nodes,
                rays: &mut self.rays,
                entries: &mut self.entries,
                pending: &mut self.pending,
            });
            list.clear();
        }
        for (number, ray) in self.numbers.iter().zip(&self.rays) {
            take(*number, Some(ray.answer(tree)));
        }
    }
}

/// The traversal of the rays of an octant.
struct Traversal<'s, 'a, N, R> {
    tree: &'a WideTree,
    all: &'s [Ray],
    numbers: &'s [u32],
    octant: usize,
    list: &'s [Entry],
    nodes: &'s mut [N],
    rays: &'s mut [R],
    entries: &'s mut Vec<Entry>,
    pending: &'s mut Vec<Pending>,
}

impl<'a, S: Simd, R: BatchRay<S>> Task<S> for Traversal<'_, 'a, R::Nodes, R> {
    type Output = ();

    #[inline(always)]
    fn run(mut self, simd: S) {
        self.walk(simd);
    }
}

impl<'a, N, R> Traversal<'_, 'a, N, R> {
    #[inline(always)]
    fn walk<S: Simd>(&mut self, simd: S)
    where
        R: BatchRay<S, Nodes = N>,
    {
        let len = self.list.len();
        self.make_room(len);
        self.entries[..len].copy_from_slice(self.list);
        self.pending.push(Pending {
            child: self.tree.root(),
            start: 0,
            len,
            free: len,
        });
        while let Some(pending) = self.pending.pop() {
            if pending.len <= FEW || pending.child.is_leaf() {
                self.trace_alone(&pending);
            } else {
                self.enter(simd, &pending);
            }
        }
    }

    /// Traces the rays of a list one by one.
    #[inline(always)]
    fn trace_alone<S>(&mut self, pending: &Pending)
    where
        R: BatchRay<S, Nodes = N>,
    {
        // SAFETY: the root, or read from a node of the tree.
        let subtree = unsafe { Subtree::below(self.tree, pending.child) };
        for entry in &self.entries[pending.start..][..pending.len] {
            let number = entry.ray as usize;
            let nodes = &mut self.nodes[number];
            if entry.enter <= R::limit(nodes) {
                let ray = &self.all[self.numbers[number] as usize];
                self.rays[number].trace_below(nodes, subtree, ray);
            }
        }
    }

    /// Divides the list of a node, and pushes the children that rays meet, the nearest last.
    #[inline(always)]
    fn enter<S: Simd>(&mut self, simd: S, pending: &Pending)
    where
        R: BatchRay<S, Nodes = N>,
    {
        // SAFETY: no leaf, and the root or read from a node of the tree.
        let node = unsafe { self.tree.node(pending.child) };
        let Pending {
            start, len, free, ..
        } = *pending;
        let end = free + WIDTH * len;
        self.make_room(end);
        let (lists, room) = self.entries.split_at_mut(free);
        let list = &lists[start..start + len];
        let lens = R::divide(simd, self.nodes, list, node, room);
        let order = if R::ANY {
            IN_LANES
        } else {
            node.orders[self.octant]
        };
        for place in 0..WIDTH {
            let lane = (order >> (3 * place)) as usize % WIDTH;
            if lens[lane] > 0 {
                let child = node.children[lane];
                self.tree.prefetch(child);
                self.pending.push(Pending {
                    child,
                    start: free + lane * len,
                    len: lens[lane] as usize,
                    free: end,
                });
            }
        }
    }

    /// Room for this number of entries.
    #[inline(always)]
    fn make_room(&mut self, len: usize) {
        if self.entries.len() < len {
            self.entries.resize(2 * len, Entry::default());
        }
    }
}
