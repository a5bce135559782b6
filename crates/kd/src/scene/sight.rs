//! Which rays see which parts: masks, and the sides of mirrored parts.

use std::ops::ControlFlow;

use kd_core::{Culling, Hit, Ray};
use kd_trace::kit::{Collect, TriangleTest};

use super::frame_parts::FrameParts;

/// What decides whether a ray sees a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sight {
    /// A ray sees the part if its mask has one of these bits.
    pub(super) mask: u32,
    /// Whether its transform turns the front of triangles to their back.
    pub(super) is_mirrored: bool,
    /// Whether it shares a tree with other parts.
    pub(super) is_shared: bool,
}

/// What all parts of a group have in common, for a quick answer to most rays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sights {
    /// The bits that all masks have.
    common: u32,
    /// Each mask once; `None` if there are more than [`Self::MOST`].
    masks: Option<Vec<u32>>,
    /// Whether sides are decided part by part: where a part is mirrored, or shares a tree.
    has_own_sides: bool,
}

impl Default for Sights {
    fn default() -> Self {
        Self {
            common: u32::MAX,
            masks: Some(Vec::new()),
            has_own_sides: false,
        }
    }
}

impl Sights {
    /// The most masks that are compared for each ray.
    const MOST: usize = 16;

    pub(super) fn of(sights: &[Sight]) -> Self {
        let mut all = Self::default();
        for sight in sights {
            all.common &= sight.mask;
            all.has_own_sides |= sight.is_mirrored || sight.is_shared;
            all.add_mask(sight.mask);
        }
        all
    }

    /// Of the parts of both.
    pub(super) fn and(mut self, others: &Self) -> Self {
        self.common &= others.common;
        self.has_own_sides |= others.has_own_sides;
        match &others.masks {
            Some(masks) => masks.iter().for_each(|mask| self.add_mask(*mask)),
            None => self.masks = None,
        }
        self
    }

    fn add_mask(&mut self, mask: u32) {
        let Some(masks) = &mut self.masks else { return };
        if masks.contains(&mask) {
            return;
        }
        if masks.len() < Self::MOST {
            masks.push(mask);
        } else {
            self.masks = None;
        }
    }

    /// Whether the ray surely sees all parts, and those sides of all that it sees of their triangles.
    #[inline]
    pub(super) fn sees_all(&self, ray: &Ray) -> bool {
        (ray.mask & self.common != 0 || self.has_bit_of_each(ray.mask))
            && (!self.has_own_sides || ray.culling.is_none())
    }

    fn has_bit_of_each(&self, mask: u32) -> bool {
        let masks = self.masks.as_deref();
        masks.is_some_and(|masks| masks.iter().all(|of_part| of_part & mask != 0))
    }
}

/// Passes on the hits of parts that a ray sees.
pub(super) struct Sieve<'a, C> {
    parts: &'a FrameParts,
    mask: u32,
    /// The triangle test of the ray for parts that are not mirrored, and for those that are; `None` where both sides are seen.
    tests: Option<[TriangleTest; 2]>,
    collector: &'a mut C,
}

impl<'a, C: Collect> Sieve<'a, C> {
    /// The ray must be one that [can hit](Ray::can_hit).
    pub(super) fn new(parts: &'a FrameParts, ray: &Ray, collector: &'a mut C) -> Self {
        let test = |culling: Culling| TriangleTest::new(&ray.with_culling(culling), f32::INFINITY);
        let is_culled = !ray.culling.is_none();
        Self {
            parts,
            mask: ray.mask,
            tests: is_culled.then(|| [test(ray.culling), test(ray.culling.turned())]),
            collector,
        }
    }

    fn sees(&self, hit: &Hit) -> bool {
        let part = self.parts.of_slot(hit.triangle);
        part.sight.mask & self.mask != 0
            && self.tests.as_ref().is_none_or(|tests| {
                let test = &tests[usize::from(part.sight.is_mirrored)];
                let triangle = hit.triangle - part.first_slot;
                test.decide(part.mesh.corners(triangle), triangle).is_some()
            })
    }
}

impl<C: Collect> Collect for Sieve<'_, C> {
    fn limit(&self) -> f32 {
        self.collector.limit()
    }

    fn take(&mut self, hit: Hit) -> ControlFlow<()> {
        if self.sees(&hit) {
            return self.collector.take(hit);
        }
        ControlFlow::Continue(())
    }

    fn is_done(&self) -> bool {
        self.collector.is_done()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_see_all_parts_are_known() {
        let part = |mask: u32, is_mirrored: bool| Sight {
            mask,
            is_mirrored,
            is_shared: false,
        };
        let ray = Ray::new([0.0; 3], [1.0; 3]);
        let sees = |sights: &Sights, mask: u32| sights.sees_all(&ray.with_mask(mask));
        let none = Sights::default();
        assert!(sees(&none, 1), "nothing to see");
        let two = Sights::of(&[part(0b01, false), part(0b10, false)]);
        assert_eq!(
            [1, 2, 3, 7, 12].map(|mask| sees(&two, mask)),
            [false, false, true, true, false]
        );
        let hidden = Sights::of(&[part(0, false), part(1, false)]);
        assert!(!sees(&hidden, u32::MAX), "no ray sees a part without bits");
        let many: Vec<Sight> = (1..20).map(|mask| part(mask, false)).collect();
        let many = Sights::of(&many);
        assert!(!sees(&many, u32::MAX), "unknown");
        assert!(!sees(&many.clone().and(&two), u32::MAX), "still unknown");
        assert!(!sees(&two.and(&many), u32::MAX), "still unknown");
        let mirrored = Sights::of(&[part(1, false), part(1, true)]);
        assert!(mirrored.sees_all(&ray), "both sides");
        assert!(
            !mirrored.sees_all(&ray.with_culling(Culling::BACK)),
            "part by part"
        );
    }
}
