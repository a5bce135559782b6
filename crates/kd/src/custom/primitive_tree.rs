//! A tree over primitives of any kind, with the queries of rays.

use kd_core::{Aabb, Hit, Layout, LayoutBytes, MAX_TRIANGLES, Ray, Tree};
use kd_sah::{BuildError, BuildOptions, BuildProgress};
use kd_trace::kit::{
    Any, AskPrimitives, Closest, Collect, Ordered, VisitItem, WideBoxes, rest_of, walk_boxes,
    walk_references,
};
use kd_trace::{Level, Primitives, RayQuery};

use super::source::WithBoxes;

/// A tree over [`Primitives`], with every query of [`RayQuery`]. Queries take `&self` and may run on any number of threads.
///
/// Every answer equals that of asking all primitives in turn, to the bit, if the primitives keep what [`Primitives`] asks of them.
/// [`Hit::triangle`] is the number of the primitive; each primitive is hit once, at the first hit in the ray's range.
///
/// # Layouts
///
/// - [`Layout::Wide`]: nodes of eight boxes, over blocks with the boxes of eight primitives. Primitives are divided as objects, whatever
///   [`wide_nodes`](BuildOptions::wide_nodes) and methods the options have. About 60 bytes a primitive, besides the primitives themselves.
/// - [`Layout::Binary`]: the kd-tree of the options, whose planes cut primitives by [`clipped_bounds`](Primitives::clipped_bounds).
///   Slower: a ray asks every primitive of a leaf, one by one. The cost model of the presets is for tests of eight at a time; with
///   [`CostModel::CLASSIC`](crate::CostModel::CLASSIC) leaves are smaller, and a ray through spheres asks a third to a tenth of them.
///   (A throw-away program, 100 000 spheres of three sizes, 2026-12-01.)
///
/// Batches and packets trace one ray after another.
#[derive(Clone, Debug)]
pub struct PrimitiveTree<P> {
    primitives: P,
    layout: Nodes,
}

/// What rays traverse.
#[derive(Clone, Debug)]
enum Nodes {
    Wide(WideBoxes),
    Binary {
        tree: Tree,
        /// The primitives that references stand for: those that have a box.
        numbers: Vec<u32>,
    },
}

impl<P: Primitives> PrimitiveTree<P> {
    /// Builds what rays traverse, by default on all cores.
    ///
    /// The same primitives and options give the same tree, bit for bit, at any number of threads. Asks each primitive for its bounds once.
    /// O(N log N).
    ///
    /// # Errors
    ///
    /// [`BuildError::NotFinite`] names the first primitive whose bounds have a NaN, or are infinite and not empty.
    /// [`BuildError::TooManyPrimitives`] beyond [`MAX_TRIANGLES`]. Otherwise [`BuildError`] names the option that is out of range, or says
    /// that the kd-tree outgrew its 30-bit indices.
    pub fn build(primitives: P, options: &BuildOptions) -> Result<Self, BuildError> {
        Self::built(primitives, options, None)
    }

    /// [`build`](Self::build) for long builds: calls `progress` up to 256 times with the fraction that is done, from 0 to 1;
    /// `progress` can cancel the build by breaking. The bounds of primitives are asked for before.
    ///
    /// # Errors
    ///
    /// Those of [`build`](Self::build), and [`BuildError::Cancelled`] soon after `progress` has broken.
    pub fn build_with_progress(
        primitives: P,
        options: &BuildOptions,
        progress: &BuildProgress<'_>,
    ) -> Result<Self, BuildError> {
        Self::built(primitives, options, Some(progress))
    }

    fn built(
        primitives: P,
        options: &BuildOptions,
        progress: Option<&BuildProgress<'_>>,
    ) -> Result<Self, BuildError> {
        options.check()?;
        let count = primitives.count();
        if count as usize > MAX_TRIANGLES {
            return Err(BuildError::TooManyPrimitives { primitives: count });
        }
        let threads = kd_tasks::useful_threads(options.threads(), count as usize);
        let layout = kd_tasks::in_pool_of(threads, || {
            let boxes = boxes_of(&primitives, options.threads() != 1)?;
            match options.layout() {
                Layout::Binary => Nodes::binary(&primitives, &boxes, options, progress),
                _ => {
                    let wide = WideBoxes::new(&boxes, options.threads() != 1, progress)?;
                    Ok(Nodes::Wide(wide))
                }
            }
        })??;
        Ok(Self { primitives, layout })
    }

    /// The primitives.
    pub fn primitives(&self) -> &P {
        &self.primitives
    }

    /// The primitives, without the tree.
    pub fn into_primitives(self) -> P {
        self.primitives
    }

    /// Which layout rays traverse.
    pub fn layout(&self) -> Layout {
        match self.layout {
            Nodes::Wide(_) => Layout::Wide,
            Nodes::Binary { .. } => Layout::Binary,
        }
    }

    /// Bytes of nodes, and of the blocks or references of leaves. Without the primitives.
    pub fn bytes(&self) -> LayoutBytes {
        match &self.layout {
            Nodes::Wide(boxes) => boxes.bytes(),
            Nodes::Binary { tree, numbers } => LayoutBytes {
                nodes: size_of_val(tree.nodes()),
                blocks: size_of_val(tree.refs()) + size_of_val(numbers.as_slice()),
            },
        }
    }

    /// The same tree, traced at another level than the fastest of this processor. Answers are the same; for tests and measurements. The
    /// binary layout has one level.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        let layout = match self.layout {
            Nodes::Wide(boxes) => Nodes::Wide(boxes.with_level(level)),
            binary @ Nodes::Binary { .. } => binary,
        };
        Self { layout, ..self }
    }

    /// Gives the collector every hit of `ray` that it may want, of primitives that the ray may meet in the range of `reach`.
    #[inline]
    fn collect<C: Collect>(&self, ray: &Ray, reach: &Ray, collector: &mut C) {
        let mut asking = AskPrimitives::new(&self.primitives, ray, collector);
        match &self.layout {
            Nodes::Wide(boxes) => walk_boxes(boxes, boxes.frame(), reach, &mut asking),
            Nodes::Binary { tree, numbers } => {
                let mut visitor = Renumbered { numbers, asking };
                walk_references(tree, reach, &mut visitor);
            }
        }
    }
}

impl Nodes {
    fn binary<P: Primitives>(
        primitives: &P,
        boxes: &[Aabb],
        options: &BuildOptions,
        progress: Option<&BuildProgress<'_>>,
    ) -> Result<Self, BuildError> {
        let all = (0..).zip(boxes);
        let numbers: Vec<u32> = all
            .filter(|(_, bounds)| !bounds.is_empty())
            .map(|(number, _)| number)
            .collect();
        let source = WithBoxes {
            primitives,
            boxes,
            numbers: &numbers,
        };
        let tree = match progress {
            Some(progress) => kd_sah::build_with_progress(&source, options, progress),
            None => kd_sah::build(&source, options),
        }?;
        Ok(Self::Binary { tree, numbers })
    }
}

/// The boxes of all primitives, each finite or empty.
fn boxes_of(primitives: &impl Primitives, is_parallel: bool) -> Result<Vec<Aabb>, BuildError> {
    const CHUNK: usize = 1 << 12;
    let mut boxes = vec![Aabb::EMPTY; primitives.count() as usize];
    let chunks = (0..).step_by(CHUNK).zip(boxes.chunks_mut(CHUNK));
    let filled = kd_tasks::map(chunks.collect(), is_parallel, |(first, chunk)| {
        for (primitive, to) in (first..).zip(chunk) {
            let bounds = primitives.bounds(primitive);
            let Aabb { min, max } = bounds;
            if min.is_nan() || max.is_nan() {
                return Err(BuildError::NotFinite { primitive });
            }
            if bounds.is_empty() {
                continue;
            }
            if !(min.is_finite() && max.is_finite()) {
                return Err(BuildError::NotFinite { primitive });
            }
            *to = bounds;
        }
        Ok(())
    });
    filled.into_iter().collect::<Result<(), _>>()?;
    Ok(boxes)
}

/// A visitor of primitives, for references to some of them.
struct Renumbered<'a, V> {
    numbers: &'a [u32],
    asking: V,
}

impl<V: VisitItem> VisitItem for Renumbered<'_, V> {
    const ANY: bool = V::ANY;

    #[inline]
    fn limit(&self) -> f32 {
        self.asking.limit()
    }

    #[inline]
    fn visit(&mut self, item: u32) -> std::ops::ControlFlow<()> {
        self.asking.visit(self.numbers[item as usize])
    }
}

impl<P: Primitives> RayQuery for PrimitiveTree<P> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        self.collect(ray, ray, &mut closest);
        closest.0
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        let mut any = Any::default();
        self.collect(ray, ray, &mut any);
        any.0
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Ordered::fill(out, max, |ordered| self.collect(ray, ray, ordered));
    }

    /// Only the primitives along the rest of the ray are asked, but for the hits of the whole ray: a later start would find where the ray
    /// leaves a primitive that it has entered before.
    fn hits_behind(&self, ray: &Ray, last: &Hit, max: usize, out: &mut Vec<Hit>) {
        let rest = rest_of(ray, last);
        Ordered::fill_behind(out, Some(*last), max, |ordered| {
            self.collect(ray, &rest, ordered);
        });
    }
}
