//! Primitives other than triangles, and how a ray asks them for hits.

use std::ops::ControlFlow;
use std::sync::Arc;

use kd_core::{Aabb, Hit, Ray};
use kd_simd::min;

use crate::collect::Collect;
use crate::items::VisitItem;

/// A list of primitives of any kind: their number, their boxes, and where a ray meets one of them.
///
/// `kd::custom::PrimitiveTree` is a tree over such a list, with every query of [`RayQuery`](crate::RayQuery). Its answers equal those of a
/// test of every primitive in turn, to the bit, if three things hold:
///
/// - **The first hit does not depend on `t_max`.** [`intersect`](Self::intersect) returns the first hit at `t_min` or behind it, and `None`
///   only if that is beyond `t_max`. The tree lowers `t_max` to what matters.
/// - **Hits are in boxes.** The point of a hit, `origin + t * direction` without rounding, is at most 2⁻²¹ Q beside the
///   [`bounds`](Self::bounds) on each axis. Q is the largest distance from the ray's origin to a face of the box around all primitives on
///   that axis. This allows for an error of `t` of eight units in its last place, and for none where coordinates are large and distances
///   are small: round boxes outwards.
/// - **Answers do not change.** The same arguments give the same result, on any thread.
///
/// Primitives for which they do not hold are *wrong, and never undefined*: hits may be missed, or a primitive may be reported twice, but
/// every reported hit is one that [`intersect`](Self::intersect) returned for this primitive and ray, in the ray's range, and nothing
/// panics. Boxes that are too large cost time alone.
///
/// # What a hit is
///
/// Each primitive has at most one hit with a ray: the first in its range. So `hits` of a sphere has the point where a ray enters it, and
/// where it leaves it only for a ray that begins inside. [`Hit::triangle`] is the number of the primitive. Equal `t` goes to the lower
/// number.
///
/// A result whose `t` is NaN, infinite, or outside of the range of the ray that was passed is ignored.
///
/// A ray that [cannot hit](Ray::can_hit) anything asks no primitive. Every other ray is passed as it is: [`Ray::culling`] and
/// [`Ray::mask`] are for the primitive to respect, or not.
pub trait Primitives: Sync {
    /// The number of primitives, at most [`MAX_TRIANGLES`](kd_core::MAX_TRIANGLES). It does not change.
    fn count(&self) -> u32;

    /// The box around a primitive, closed and finite. It may be flat or a point. A primitive whose box is empty is never hit.
    ///
    /// `primitive` is below [`count`](Self::count).
    fn bounds(&self, primitive: u32) -> Aabb;

    /// A box inside `cell` around the part of a primitive in `cell`; `None` if they do not meet. By default the part of the
    /// [`bounds`](Self::bounds) in the cell.
    ///
    /// Only kd-trees ask for it. A tighter box saves references. `cell` is infinite towards sides that the primitive is known not to cross.
    fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb> {
        let clipped = self.bounds(primitive).intersection(cell);
        (!clipped.is_empty()).then_some(clipped)
    }

    /// The first hit of a primitive at `ray.t_min <= t <= ray.t_max`, both inclusive.
    ///
    /// `primitive` is below [`count`](Self::count), and the ray [can hit](Ray::can_hit). It is the traced ray, with a `t_max` that is
    /// lowered to the nearest hit so far: a primitive that is certainly behind it need not be computed.
    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<PrimitiveHit>;
}

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// Distance along the ray, in multiples of its direction.
    pub t: f32,
    /// Whatever the primitive wants to know of the place: passed on as [`Hit::u`] and [`Hit::v`], and never read.
    pub u: f32,
    /// As `u`.
    pub v: f32,
}

impl PrimitiveHit {
    /// A hit with `u` and `v` 0.
    pub const fn at(t: f32) -> Self {
        Self { t, u: 0.0, v: 0.0 }
    }
}

/// The methods of a pointer to primitives.
macro_rules! those_behind {
    () => {
        fn count(&self) -> u32 {
            (**self).count()
        }

        fn bounds(&self, primitive: u32) -> Aabb {
            (**self).bounds(primitive)
        }

        fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb> {
            (**self).clipped_bounds(primitive, cell)
        }

        #[inline]
        fn intersect(&self, primitive: u32, ray: &Ray) -> Option<PrimitiveHit> {
            (**self).intersect(primitive, ray)
        }
    };
}

impl<P: Primitives + ?Sized> Primitives for &P {
    those_behind!();
}

impl<P: Primitives + Send + ?Sized> Primitives for Arc<P> {
    those_behind!();
}

/// Asks the primitives that a walk visits for their hits with a ray, and gives them to a collector.
///
/// ```
/// use kd_core::{Aabb, Ray};
/// use kd_trace::kit::{AskPrimitives, Closest, WideBoxes, walk_boxes};
/// use kd_trace::{PrimitiveHit, Primitives};
///
/// /// Planes across the x axis, as large as their boxes.
/// struct Planes(Vec<f32>);
///
/// impl Primitives for Planes {
///     fn count(&self) -> u32 {
///         self.0.len() as u32
///     }
///
///     fn bounds(&self, plane: u32) -> Aabb {
///         let x = self.0[plane as usize];
///         Aabb { min: [x, -1.0, -1.0].into(), max: [x, 1.0, 1.0].into() }
///     }
///
///     fn intersect(&self, plane: u32, ray: &Ray) -> Option<PrimitiveHit> {
///         let t = (self.0[plane as usize] - ray.origin.x) / ray.direction.x;
///         let [y, z] = [1, 2].map(|axis| ray.at(t)[axis]);
///         let is_hit = t >= ray.t_min && t <= ray.t_max && y.abs() <= 1.0 && z.abs() <= 1.0;
///         is_hit.then(|| PrimitiveHit::at(t))
///     }
/// }
///
/// let planes = Planes(vec![3.0, 1.0, 2.0]);
/// let bounds: Vec<Aabb> = (0..planes.count()).map(|plane| planes.bounds(plane)).collect();
/// let boxes = WideBoxes::new(&bounds, false, None)?;
///
/// let ray = Ray::new([0.0; 3], [1.0, 0.1, 0.0]);
/// let mut closest = Closest::default();
/// let mut asking = AskPrimitives::new(&planes, &ray, &mut closest);
/// walk_boxes(&boxes, boxes.frame(), &ray, &mut asking);
/// assert_eq!(closest.0.expect("straight ahead").triangle, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct AskPrimitives<'a, P: ?Sized, C> {
    primitives: &'a P,
    /// Ends at the limit of the collector.
    ray: Ray,
    collector: &'a mut C,
}

impl<'a, P: Primitives + ?Sized, C: Collect> AskPrimitives<'a, P, C> {
    /// Asks for the hits of `ray`. The walk may visit the primitives along a part of the ray alone.
    #[inline]
    pub fn new(primitives: &'a P, ray: &Ray, collector: &'a mut C) -> Self {
        Self {
            primitives,
            ray: *ray,
            collector,
        }
    }
}

impl<P: Primitives + ?Sized, C: Collect> VisitItem for AskPrimitives<'_, P, C> {
    const ANY: bool = C::ANY;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit(&mut self, primitive: u32) -> ControlFlow<()> {
        let Some(PrimitiveHit { t, u, v }) = self.primitives.intersect(primitive, &self.ray) else {
            return ControlFlow::Continue(());
        };
        // Also false for NaN.
        let is_in_range = t >= self.ray.t_min && t <= self.ray.t_max && t.is_finite();
        if is_in_range {
            let triangle = primitive;
            self.collector.take(Hit { t, u, v, triangle })?;
            self.ray.t_max = min(self.collector.limit(), self.ray.t_max);
        }
        ControlFlow::Continue(())
    }
}
