//! Rays that go their own ways, sixteen of them in turn.
//!
//! A ray alone waits at each step: for its node to come from memory, for the tests to tell which child is next, and for the
//! processor to come back from the wrong way on. Here every ray takes a step before the first takes its next one, so that
//! they wait together. Those that are at nodes and those that are at leaves have a list each, with a loop of its own: so a
//! step at a node has no branch that depends on the ray, and what the ray comes to next is on its way from memory while the
//! others take their steps.
//!
//! (The two loops are those of T. Aila, S. Laine, *Understanding the Efficiency of Ray Traversal on GPUs*, 2009, there for
//! rays that share an instruction.)
#![allow(
    unsafe_code,
    reason = "children are followed without checking them again: see `WideTree::node`; and each ray's stack is left and taken up"
)]

use kd_core::Ray;
use kd_simd::min;
use kd_wide::{Child, WideTree};

use super::stack::Stack;
use super::walk::WideRay;
use crate::collect::Collect;
use crate::dispatch::TraceSimd;

/// How many rays are on their way. (8 and 32 were not faster, on four meshes.)
const SLOTS: usize = 16;

/// While more rays than these are at nodes, the others wait at their leaves.
const FEW: usize = 4;

/// Traces the rays of these numbers, each with a collector of its own, which `take` gets, in any order.
#[inline(always)]
pub(crate) fn trace<S: TraceSimd, C: Collect + Default>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    numbers: impl Iterator<Item = usize>,
    take: impl FnMut(usize, C),
) {
    let mut slots: [Slot<S::Ray, C>; SLOTS] = std::array::from_fn(|_| Slot::new());
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

/// A ray on its way.
struct Slot<R, C> {
    /// `None` before the first.
    ray: Option<R>,
    number: usize,
    collector: C,
    /// In steps; all that is pending lies before it, or did when it was left for later.
    limit: f32,
    /// Where it is: a node or a leaf of the tree.
    child: Child,
    stack: Stack,
    /// How much of it is written.
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

    /// Goes on from a node.
    #[inline(always)]
    fn enter(&mut self, tree: &WideTree) {
        let Some(ray) = &self.ray else { return };
        // SAFETY: in the list of nodes, so it is one, and it came out of the tree.
        let node = unsafe { tree.node(self.child) };
        // SAFETY: what was left there.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        self.child = ray.enter_or_pop(node, self.limit, &mut pending);
        self.pending = pending.len();
        tree.prefetch(self.child);
    }

    /// Goes on from a leaf; false if the ray is done.
    #[inline(always)]
    fn visit(&mut self, tree: &WideTree) -> bool {
        let Some(ray) = &self.ray else { return false };
        // SAFETY: in the list of leaves, so it is one, and it came out of the tree, or has no blocks.
        let blocks = unsafe { tree.leaf(self.child) };
        let collector = &mut self.collector;
        if ray.visit(blocks, self.limit, collector, &mut ()).is_break() {
            return false;
        }
        self.limit = min(ray.steps(collector.limit()), self.limit);
        // SAFETY: what was left there.
        let mut pending = unsafe { self.stack.resume(self.pending) };
        let next = pending.pop(self.limit);
        self.pending = pending.len();
        // What lies at the bottom is no child.
        let Some(child) = next.filter(|_| self.pending > 0) else {
            return false;
        };
        self.child = child;
        tree.prefetch(child);
        true
    }
}

/// Rays that have not begun, and where those go that are done.
struct Waiting<'a, S, N, T> {
    simd: S,
    tree: &'a WideTree,
    rays: &'a [Ray],
    numbers: N,
    take: T,
}

impl<S: TraceSimd, N: Iterator<Item = usize>, T> Waiting<'_, S, N, T> {
    /// Puts the next ray in a slot where none is; false if there is no other.
    #[inline(always)]
    fn begin<C: Collect + Default>(&mut self, slot: &mut Slot<S::Ray, C>) -> bool
    where
        T: FnMut(usize, C),
    {
        for number in self.numbers.by_ref() {
            if let Some(ray) = self.simd.prepare(&self.rays[number], self.tree.frame()) {
                slot.number = number;
                slot.limit = ray.end();
                slot.ray = Some(ray);
                slot.child = self.tree.root();
                // At the bottom there is always something to pop: a leaf without blocks.
                let mut pending = slot.stack.pending();
                pending.push(f32::NEG_INFINITY, Child::NOTHING);
                slot.pending = pending.len();
                return true;
            }
            (self.take)(number, C::default());
        }
        false
    }

    /// [`begin`](Self::begin) where a ray is done.
    #[inline(always)]
    fn next<C: Collect + Default>(&mut self, slot: &mut Slot<S::Ray, C>) -> bool
    where
        T: FnMut(usize, C),
    {
        (self.take)(slot.number, std::mem::take(&mut slot.collector));
        self.begin(slot)
    }
}

/// Some of the slots.
#[derive(Default)]
struct List {
    places: [u8; SLOTS],
    len: usize,
}

impl List {
    /// Begins again, and gives how many there were. They can still be read, each before as many others are pushed: one by
    /// one, since a copy of them all would wait for those that were written last.
    #[inline(always)]
    fn restart(&mut self) -> usize {
        std::mem::take(&mut self.len)
    }

    #[inline(always)]
    fn place(&self, i: usize) -> usize {
        usize::from(self.places[i % SLOTS]) % SLOTS
    }

    /// Puts a slot in the list where its child belongs, without a branch.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "there are few slots")]
    fn push(child: Child, place: usize, at_nodes: &mut Self, at_leaves: &mut Self) {
        let is_leaf = child.is_leaf();
        at_nodes.places[at_nodes.len % SLOTS] = place as u8;
        at_leaves.places[at_leaves.len % SLOTS] = place as u8;
        at_nodes.len += usize::from(!is_leaf);
        at_leaves.len += usize::from(is_leaf);
    }
}
