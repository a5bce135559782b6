//! The queries of Embree 4, as its headers declare them, tested with 4.4.

use std::ffi::{c_int, c_uint, c_void};
use std::ptr;

use super::shared::{Filter, Handle, NOTHING, Ray1, Ray8, RayHit1, RayHit8, functions};
use super::{FirstHits, Version, keep_first};

functions! {
    /// The functions whose arguments depend on the version.
    Queries;
    intersect1 = b"rtcIntersect1" (Handle, *mut RayHit1, *mut Arguments);
    occluded1 = b"rtcOccluded1" (Handle, *mut Ray1, *mut Arguments);
    intersect8 = b"rtcIntersect8" (*const c_int, Handle, *mut RayHit8, *mut Arguments);
    occluded8 = b"rtcOccluded8" (*const c_int, Handle, *mut Ray8, *mut Arguments);
}

/// Of `RTCRayQueryFlags`: the filter of the arguments serves every geometry.
const FILTER_ALL: c_int = 1 << 1;
/// Of `RTCRayQueryFlags`.
const COHERENT: c_int = 1 << 16;
/// Of `RTCFeatureFlags`.
const ALL_FEATURES: c_uint = u32::MAX;

/// `RTCIntersectArguments`, and `RTCOccludedArguments`, which has the same layout.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Arguments {
    flags: c_int,
    features: c_uint,
    /// What the filter receives; the library has a context of its own where it is null.
    context: *mut Context,
    filter: Option<Filter>,
    /// A function for geometries of users, of which there are none.
    user: *mut c_void,
    /// Read only by a library that is built with `EMBREE_MIN_WIDTH`.
    min_width: f32,
}

/// `RTCRayQueryContext` of a library with one level of instances, as distributions build it.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Context {
    instance: [u32; 1],
    in_instance_array: [u32; 1],
}

impl Version for Queries {
    type Arguments = Arguments;
    type Context = Context;

    #[inline]
    fn arguments(coherent: bool) -> Arguments {
        Arguments {
            flags: if coherent { COHERENT } else { 0 },
            features: ALL_FEATURES,
            context: ptr::null_mut(),
            filter: None,
            user: ptr::null_mut(),
            min_width: 0.0,
        }
    }

    #[inline]
    fn context() -> Context {
        Context {
            instance: [NOTHING],
            in_instance_array: [NOTHING],
        }
    }

    #[inline]
    unsafe fn intersect1(&self, scene: Handle, arguments: &mut Arguments, ray: &mut RayHit1) {
        // SAFETY: the caller guarantees a committed scene; the types are those of the headers, aligned as they say.
        unsafe { (self.intersect1)(scene, ray, arguments) }
    }

    #[inline]
    unsafe fn occluded1(&self, scene: Handle, arguments: &mut Arguments, ray: &mut Ray1) {
        // SAFETY: as for `intersect1`.
        unsafe { (self.occluded1)(scene, ray, arguments) }
    }

    #[inline]
    unsafe fn intersect8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        arguments: &mut Arguments,
        rays: &mut RayHit8,
    ) {
        // SAFETY: as for `intersect1`; the caller guarantees a number for each lane.
        unsafe { (self.intersect8)(lanes, scene, rays, arguments) }
    }

    #[inline]
    unsafe fn occluded8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        arguments: &mut Arguments,
        rays: &mut Ray8,
    ) {
        // SAFETY: as for `intersect8`.
        unsafe { (self.occluded8)(lanes, scene, rays, arguments) }
    }

    #[inline]
    unsafe fn first_hits(&self, scene: Handle, found: &mut FirstHits<Context>, ray: &mut RayHit1) {
        let mut arguments = Arguments {
            flags: FILTER_ALL,
            context: ptr::from_mut(found).cast(),
            filter: Some(keep_first::<Context>),
            ..Self::arguments(false)
        };
        // SAFETY: as for `intersect1`; the context is the first field of the whole `FirstHits` that the filter expects.
        unsafe { (self.intersect1)(scene, ray, &mut arguments) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!(size_of::<Context>(), 8, "bytes");
        if cfg!(target_pointer_width = "64") {
            // 32 and, with a minimal width, 4 more.
            assert_eq!(size_of::<Arguments>(), 40, "bytes");
        }
    }
}
