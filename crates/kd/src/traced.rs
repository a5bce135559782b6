//! What rays are traced through, in either layout.

use kd_core::{Hit, Layout, Mesh, Ray, RayPacket8, TracedBytes, Tree};
use kd_sah::{BuildOptions, Method};
use kd_trace::{Level, PackedTree, RayQuery as _, WideTree};

/// A tree and its triangles, laid out for rays.
#[derive(Clone, Debug)]
pub(crate) enum Traced {
    Binary(PackedTree),
    Wide(WideTree),
}

impl Traced {
    /// On the calling thread, or on those of the pool in scope.
    pub(crate) fn new(tree: &Tree, mesh: &Mesh, layout: Layout, is_parallel: bool) -> Self {
        #[cfg(feature = "parallel")]
        if is_parallel {
            return match layout {
                Layout::Binary => Self::Binary(PackedTree::new_parallel(tree, mesh)),
                _ => Self::Wide(WideTree::new_parallel(tree, mesh)),
            };
        }
        let _ = is_parallel;
        match layout {
            Layout::Binary => Self::Binary(PackedTree::new(tree, mesh)),
            _ => Self::Wide(WideTree::new(tree, mesh)),
        }
    }

    /// As a tree is laid out that was built with these options: on one thread if it was built on one, and with as much care.
    pub(crate) fn of_options(tree: &Tree, mesh: &Mesh, options: &BuildOptions) -> Self {
        let is_parallel = options.threads() != 1;
        // All of these give the same tree, and take long.
        let is_exact = matches!(
            options.method(),
            Method::Exact | Method::Sweep | Method::Resort | Method::Naive
        );
        match options.layout() {
            Layout::Wide if is_exact => Self::Wide(WideTree::best(tree, mesh, is_parallel)),
            layout => Self::new(tree, mesh, layout, is_parallel),
        }
    }

    pub(crate) fn layout(&self) -> Layout {
        match self {
            Self::Binary(_) => Layout::Binary,
            Self::Wide(_) => Layout::Wide,
        }
    }

    pub(crate) fn with_level(self, level: Level) -> Self {
        match self {
            Self::Binary(tree) => Self::Binary(tree.with_level(level)),
            Self::Wide(tree) => Self::Wide(tree.with_level(level)),
        }
    }

    #[inline]
    pub(crate) fn borrowed(&self) -> TracedRef<'_> {
        match self {
            Self::Binary(tree) => TracedRef::Binary(tree),
            Self::Wide(tree) => TracedRef::Wide(tree),
        }
    }
}

/// A borrowed [`Traced`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum TracedRef<'a> {
    Binary(&'a PackedTree),
    Wide(&'a WideTree),
}

impl TracedRef<'_> {
    pub(crate) fn bytes(self) -> TracedBytes {
        match self {
            Self::Binary(tree) => tree.bytes(),
            Self::Wide(tree) => tree.bytes(),
        }
    }

    #[inline]
    pub(crate) fn intersect(self, ray: &Ray) -> Option<Hit> {
        match self {
            Self::Binary(tree) => tree.intersect(ray),
            Self::Wide(tree) => tree.intersect(ray),
        }
    }

    #[inline]
    pub(crate) fn occluded(self, ray: &Ray) -> bool {
        match self {
            Self::Binary(tree) => tree.occluded(ray),
            Self::Wide(tree) => tree.occluded(ray),
        }
    }

    pub(crate) fn hits(self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        match self {
            Self::Binary(tree) => tree.hits(ray, max, out),
            Self::Wide(tree) => tree.hits(ray, max, out),
        }
    }

    pub(crate) fn intersect_batch(self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match self {
            Self::Binary(tree) => tree.intersect_batch(rays, hits),
            Self::Wide(tree) => tree.intersect_batch(rays, hits),
        }
    }

    pub(crate) fn occluded_batch(self, rays: &[Ray], occluded: &mut [bool]) {
        match self {
            Self::Binary(tree) => tree.occluded_batch(rays, occluded),
            Self::Wide(tree) => tree.occluded_batch(rays, occluded),
        }
    }

    pub(crate) fn intersect8(self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        match self {
            Self::Binary(tree) => tree.intersect8(packet),
            Self::Wide(tree) => tree.intersect8(packet),
        }
    }

    pub(crate) fn occluded8(self, packet: &RayPacket8) -> [bool; 8] {
        match self {
            Self::Binary(tree) => tree.occluded8(packet),
            Self::Wide(tree) => tree.occluded8(packet),
        }
    }
}
