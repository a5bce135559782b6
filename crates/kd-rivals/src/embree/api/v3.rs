//! The queries of Embree 3, as its headers declare them, tested with 3.13.

use std::ffi::c_int;
use std::ptr;

use super::shared::{Filter, Handle, NOTHING, Ray1, Ray8, RayHit1, RayHit8, functions};
use super::{FirstHits, Version, keep_first};

functions! {
    /// The functions whose arguments depend on the version.
    Queries;
    intersect1 = b"rtcIntersect1" (Handle, *mut Context, *mut RayHit1);
    occluded1 = b"rtcOccluded1" (Handle, *mut Context, *mut Ray1);
    intersect8 = b"rtcIntersect8" (*const c_int, Handle, *mut Context, *mut RayHit8);
    occluded8 = b"rtcOccluded8" (*const c_int, Handle, *mut Context, *mut Ray8);
}

/// `RTCIntersectContext` of a library with one level of instances, as distributions build it.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Context {
    /// 1 for coherent rays.
    flags: c_int,
    filter: Option<Filter>,
    instance: [u32; 1],
}

impl Version for Queries {
    type Arguments = Context;
    type Context = Context;

    #[inline]
    fn arguments(coherent: bool) -> Context {
        Context {
            flags: c_int::from(coherent),
            filter: None,
            instance: [NOTHING],
        }
    }

    #[inline]
    fn context() -> Context {
        Context {
            filter: Some(keep_first::<Context>),
            ..Self::arguments(false)
        }
    }

    #[inline]
    unsafe fn intersect1(&self, scene: Handle, context: &mut Context, ray: &mut RayHit1) {
        // SAFETY: the caller guarantees a committed scene; the types are those of the headers, aligned as they say.
        unsafe { (self.intersect1)(scene, context, ray) }
    }

    #[inline]
    unsafe fn occluded1(&self, scene: Handle, context: &mut Context, ray: &mut Ray1) {
        // SAFETY: as for `intersect1`.
        unsafe { (self.occluded1)(scene, context, ray) }
    }

    #[inline]
    unsafe fn intersect8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        context: &mut Context,
        rays: &mut RayHit8,
    ) {
        // SAFETY: as for `intersect1`; the caller guarantees a number for each lane.
        unsafe { (self.intersect8)(lanes, scene, context, rays) }
    }

    #[inline]
    unsafe fn occluded8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        context: &mut Context,
        rays: &mut Ray8,
    ) {
        // SAFETY: as for `intersect8`.
        unsafe { (self.occluded8)(lanes, scene, context, rays) }
    }

    #[inline]
    unsafe fn first_hits(&self, scene: Handle, found: &mut FirstHits<Context>, ray: &mut RayHit1) {
        // SAFETY: as for `intersect1`; the pointer is to the whole `FirstHits` that the filter of its context expects.
        unsafe { (self.intersect1)(scene, ptr::from_mut(found).cast(), ray) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_the_header() {
        if cfg!(target_pointer_width = "64") {
            assert_eq!(size_of::<Context>(), 24, "bytes");
        }
    }
}
