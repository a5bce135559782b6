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
use kd_simd::min;
use kd_wide::{Child, WideTree};

use super::stack::Stack;
use super::subtree::Subtree;
use super::walk::WideRay;
use crate::collect::Collect;
use crate::dispatch::{Search, TraceSimd};

/// Active rays. (8 and 32 were not faster, on four meshes.)
const SLOTS: usize = 16;

/// While more rays than this are at nodes, the others wait at their leaves.
const FEW: usize = 4;

/// The memory of active rays, which takes some time to make.
pub(crate) struct Slots<R, C>(Box<[Slot<R, C>; SLOTS]>);

impl<R: WideRay, C: Collect + Default> Slots<R, C> {
    pub(crate) fn new() -> Self {
        // By a vector, so that no array is made on the stack and copied.
        let slots: Vec<_> = (0..SLOTS).map(|_| Slot::new()).collect();
        Self(slots.try_into().ok().expect("as many"))
    }
}

/// Traces the rays of these numbers, each with its own collector, which is passed to `take`, in any order.
#[inline(always)]
pub(crate) fn trace<S: TraceSimd, C: Search>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    numbers: impl Iterator<Item = usize>,
    Slots(slots): &mut Slots<S::Ray, C>,
    take: impl FnMut(usize, C),
) {
    let mut waiting = Waiting {
        simd,
        tree,
        rays,
        numbers,
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
            if slot.visit(tree) || waiting.next(slot) {
                List::push(slot.child, place, &mut at_nodes, &mut at_leaves);
            }
        }
    }
}

/// An active ray.
struct Slot<R, C> {
    /// `None` before the first.
    ray: Option<R>,
    number: usize,
    collector: C,
    /// In steps. Pending children begin before it, or did when they were pushed.
    limit: f32,
    /// The current node or leaf of the tree.
    child: Child,
    stack: Stack,
    /// The number of entries of the stack.
    pending: usize,
}

impl<R: WideRay, C: Collect + Default> Slot<R, C> {
    fn new() -> Self {
        Self {
            ray: None,
            number: 0,
            collector: C::default(),
            limit: 0.0,
            child: Child::NOTHING,
            stack: Stack::new(),
            pending: 0,
        }
    }

    /// Visits a node.
    #[inline(always)]
    fn enter(&mut self, tree: &WideTree) {
        let Some(ray) = &self.ray else { return };
        // SAFETY: the slot is in the list of nodes, so the child is one; it is the root or was read from a node of the tree.
        let node = unsafe { tree.node(self.child) };
        // SAFETY: this number of entries was written before.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        self.child = ray.enter_or_pop(node, self.limit, &mut pending);
        self.pending = pending.len();
        tree.prefetch(self.child);
    }

    /// Visits a leaf; false if the ray is done.
    #[inline(always)]
    fn visit(&mut self, tree: &WideTree) -> bool {
        let Some(ray) = &self.ray else { return false };
        // SAFETY: the slot is in the list of leaves, so the child is one; it was read from a node of the tree, or has no blocks.
        let blocks = unsafe { tree.leaf(self.child) };
        let collector = &mut self.collector;
        if ray.visit(blocks, self.limit, collector, &mut ()).is_break() {
            return false;
        }
        self.limit = min(ray.steps(collector.limit()), self.limit);
        // SAFETY: this number of entries was written before.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        let next = pending.pop(self.limit);
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
struct Waiting<'a, S, N, T> {
    simd: S,
    tree: &'a WideTree,
    rays: &'a [Ray],
    numbers: N,
    take: T,
}

impl<S: TraceSimd, N: Iterator<Item = usize>, T> Waiting<'_, S, N, T> {
    /// Puts the next ray in an empty slot; false if none is left.
    #[inline(always)]
    fn begin<C: Search>(&mut self, slot: &mut Slot<S::Ray, C>) -> bool
    where
        T: FnMut(usize, C),
    {
        for number in self.numbers.by_ref() {
            let ray = &self.rays[number];
            if let Some(ray) = self.simd.prepare(ray, self.tree.frame()) {
                slot.number = number;
                slot.limit = ray.end();
                slot.ray = Some(ray);
                slot.child = self.tree.root();
                // A leaf without blocks at the bottom, so that a pop always succeeds.
                let mut pending = slot.stack.pending();
                pending.push(f32::NEG_INFINITY, Child::NOTHING);
                slot.pending = pending.len();
                return true;
            }
            let mut collector = C::default();
            collector.search(self.simd, Subtree::whole(self.tree), ray, &mut ());
            (self.take)(number, collector);
        }
        false
    }

    /// Finishes the ray of a slot, and [begins](Self::begin) another one.
    #[inline(always)]
    fn next<C: Search>(&mut self, slot: &mut Slot<S::Ray, C>) -> bool
    where
        T: FnMut(usize, C),
    {
        (self.take)(slot.number, std::mem::take(&mut slot.collector));
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
