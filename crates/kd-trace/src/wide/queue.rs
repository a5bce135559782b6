//! Incoherent rays, sixteen at a time, in turns.
//!
//! A single ray waits at each step: for its node from memory, for the tests that determine the next child, and for recovery
//! from mispredicted branches. Here every ray takes one step before the first ray takes its next one, so these latencies
//! overlap. Rays at nodes and rays at leaves have a list and a loop each: a step at a node has no branch that depends on the ray,
//! and the next node of a ray is loaded from memory during the steps of the others.
//!
//! (The two loops are those of T. Aila, S. Laine, *Understanding the Efficiency of Ray Traversal on GPUs*, 2009, there for
//! rays that share an instruction.)
#![allow(
    unsafe_code,
    reason = "children are followed without a check of their indices: see `WideTree::node`; and each ray's stack is left and resumed"
)]

use kd_core::Ray;
use kd_simd::Simd;
use kd_wide::{Child, WideTree};

use super::batch_ray::BatchRay;
use super::stack::Stack;
use super::subtree::Subtree;

/// Active rays. (8 and 32 were not faster, on four meshes.)
const SLOTS: usize = 16;

/// While more rays than this are at nodes, the others wait at their leaves.
const FEW: usize = 4;

/// The memory of active rays, which takes some time to make.
pub(super) struct Queue<N, R>(Vec<Slot<N, R>>);

impl<N, R> Queue<N, R> {
    /// No rays.
    pub(super) fn new() -> Self {
        Self(Vec::new())
    }

    /// Traces the rays of some numbers. Passes the number and the answer of each to `take`, in any order; or `None` for a ray that
    /// is to be traced alone.
    #[inline(always)]
    pub(super) fn trace<S: Simd>(
        &mut self,
        simd: S,
        tree: &WideTree,
        rays: &[Ray],
        numbers: &[u32],
        take: impl FnMut(u32, Option<R::Answer>),
    ) where
        R: BatchRay<S, Nodes = N>,
    {
        let Self(slots) = self;
        slots.resize_with(SLOTS, Slot::new);
        let mut waiting = Waiting {
            simd,
            tree,
            rays,
            numbers: numbers.iter(),
            take,
        };
        let mut at_nodes = List::default();
        let mut at_leaves = List::default();
        for (place, slot) in slots.iter_mut().enumerate() {
            if waiting.begin(slot) {
                List::push(slot.child, place, &mut at_nodes, &mut at_leaves);
            }
        }
        loop {
            while at_nodes.len > FEW || (at_leaves.len == 0 && at_nodes.len > 0) {
                for i in 0..at_nodes.restart() {
                    let place = at_nodes.place(i);
                    let slot = &mut slots[place];
                    slot.enter(tree);
                    List::push(slot.child, place, &mut at_nodes, &mut at_leaves);
                }
            }
            if at_leaves.len == 0 {
                return;
            }
            for i in 0..at_leaves.restart() {
                let place = at_leaves.place(i);
                let slot = &mut slots[place];
                if slot.visit(tree, rays) || waiting.next(slot) {
                    List::push(slot.child, place, &mut at_nodes, &mut at_leaves);
                }
            }
        }
    }
}

/// An active ray.
struct Slot<N, R> {
    /// `None` before the first.
    ray: Option<(N, R)>,
    number: u32,
    /// The current node or leaf of the tree.
    child: Child,
    stack: Stack,
    /// The number of entries of the stack.
    pending: usize,
}

impl<N, R> Slot<N, R> {
    fn new() -> Self {
        Self {
            ray: None,
            number: 0,
            child: Child::NOTHING,
            stack: Stack::new(),
            pending: 0,
        }
    }

    /// Visits a node.
    #[inline(always)]
    fn enter<S>(&mut self, tree: &WideTree)
    where
        R: BatchRay<S, Nodes = N>,
    {
        let Some((nodes, _)) = &self.ray else { return };
        // SAFETY: the slot is in the list of nodes, so the child is one; it is the root or was read from a node of the tree.
        let node = unsafe { tree.node(self.child) };
        // SAFETY: this number of entries was written before.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        self.child = R::enter_or_pop(nodes, node, &mut pending);
        self.pending = pending.len();
        tree.prefetch(self.child);
    }

    /// Visits a leaf; false if the ray is done.
    #[inline(always)]
    fn visit<S>(&mut self, tree: &WideTree, rays: &[Ray]) -> bool
    where
        R: BatchRay<S, Nodes = N>,
    {
        let Some((nodes, ray)) = &mut self.ray else {
            return false;
        };
        // SAFETY: the root, or read from a node of the tree, or a leaf without blocks.
        let subtree = unsafe { Subtree::below(tree, self.child) };
        ray.trace_below(nodes, subtree, &rays[self.number as usize]);
        // SAFETY: this number of entries was written before.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        let next = pending.pop(R::limit(nodes));
        self.pending = pending.len();
        // The entry at the bottom is no child.
        let Some(child) = next.filter(|_| self.pending > 0) else {
            return false;
        };
        self.child = child;
        tree.prefetch(child);
        true
    }
}

/// Rays that have not begun, and the receiver of finished ones.
struct Waiting<'r, 'a, S, T> {
    simd: S,
    tree: &'a WideTree,
    rays: &'r [Ray],
    numbers: std::slice::Iter<'r, u32>,
    take: T,
}

impl<'a, S, T> Waiting<'_, 'a, S, T> {
    /// Puts the next ray in an empty slot; false if none is left.
    #[inline(always)]
    fn begin<R>(&mut self, slot: &mut Slot<R::Nodes, R>) -> bool
    where
        S: Simd,
        R: BatchRay<S>,
        T: FnMut(u32, Option<R::Answer>),
    {
        for number in self.numbers.by_ref() {
            let ray = &self.rays[*number as usize];
            slot.ray = R::begin(self.simd, ray, self.tree.frame());
            if slot.ray.is_none() {
                (self.take)(*number, None);
                continue;
            }
            slot.number = *number;
            slot.child = self.tree.root();
            // A leaf without blocks at the bottom, so that a pop always succeeds.
            let mut pending = slot.stack.pending();
            pending.push(f32::NEG_INFINITY, Child::NOTHING);
            slot.pending = pending.len();
            return true;
        }
        false
    }

    /// Finishes the ray of a slot, and [begins](Self::begin) another one.
    #[inline(always)]
    fn next<R>(&mut self, slot: &mut Slot<R::Nodes, R>) -> bool
    where
        S: Simd,
        R: BatchRay<S>,
        T: FnMut(u32, Option<R::Answer>),
    {
        if let Some((_, ray)) = &slot.ray {
            (self.take)(slot.number, Some(ray.answer(self.tree)));
        }
        self.begin(slot)
    }
}

/// A list of slots.
#[derive(Default)]
struct List {
    places: [u8; SLOTS],
    len: usize,
}

impl List {
    /// Empties the list and returns its length. The entries can still be read, each before as many others are pushed. (They are
    /// read one by one: a copy of all would wait for the last writes.)
    #[inline(always)]
    fn restart(&mut self) -> usize {
        std::mem::take(&mut self.len)
    }

    #[inline(always)]
    fn place(&self, i: usize) -> usize {
        usize::from(self.places[i % SLOTS]) % SLOTS
    }

    /// Puts a slot in the list of its child's kind, without a branch.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "fewer than 256 slots")]
    fn push(child: Child, place: usize, at_nodes: &mut Self, at_leaves: &mut Self) {
        let is_leaf = child.is_leaf();
        at_nodes.places[at_nodes.len % SLOTS] = place as u8;
        at_leaves.places[at_leaves.len % SLOTS] = place as u8;
        at_nodes.len += usize::from(!is_leaf);
        at_leaves.len += usize::from(is_leaf);
    }
}
