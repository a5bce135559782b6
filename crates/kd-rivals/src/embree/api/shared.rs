//! The part of the binding that is equal in Embree 3 and 4: types, constants and functions of their headers (`rtcore_*.h`).

use std::ffi::{c_char, c_int, c_uint, c_void};

/// Embree's number for no triangle.
pub(crate) const NOTHING: u32 = u32::MAX;

/// The property of a device that is its version, as one number: 31305 is 3.13.5.
pub(crate) const VERSION: c_int = 0;

pub(crate) const TRIANGLES: c_int = 0;
/// Geometries whose primitives are functions of the program.
pub(crate) const PRIMITIVES: c_int = 120;
pub(crate) const INDEX_BUFFER: c_int = 0;
pub(crate) const VERTEX_BUFFER: c_int = 1;
pub(crate) const THREE_UINTS: c_int = 0x5003;
pub(crate) const THREE_FLOATS: c_int = 0x9003;

/// The quality of a build.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Quality {
    /// Morton codes
    Low = 0,
    /// Binned surface area heuristic
    Medium = 1,
    /// The same with spatial splits
    High = 2,
    /// Boxes of an earlier build, refitted to the triangles
    Refit = 3,
}

/// `RTCSceneFlags`.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SceneFlags {
    Usual = 0,
    /// A geometry may change
    Dynamic = 1 << 0,
    /// Rays through edges hit
    Robust = 1 << 2,
    /// Queries may filter hits
    Filtered = 1 << 3,
}

/// A device, a scene or a geometry.
pub(crate) type Handle = *mut c_void;

/// `RTCRay`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Ray1 {
    pub(crate) origin: [f32; 3],
    pub(crate) t_min: f32,
    pub(crate) direction: [f32; 3],
    pub(crate) time: f32,
    /// After a query the distance of the hit; below 0 for an occluded ray.
    pub(crate) t_max: f32,
    pub(crate) mask: u32,
    pub(crate) id: u32,
    pub(crate) flags: u32,
}

/// `RTCHit` of Embree 3, the first words of that of Embree 4. Without its alignment, which the argument of a filter need not have.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Hit1 {
    pub(crate) normal: [f32; 3],
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) triangle: u32,
    pub(crate) geometry: u32,
    pub(crate) instance: u32,
}

/// `RTCRayHit` of Embree 4. Embree 3 uses the part before the last word.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct RayHit1 {
    pub(crate) ray: Ray1,
    pub(crate) hit: Hit1,
    pub(crate) in_instance_array: u32,
}

/// `RTCRay8`: the fields of [`Ray1`] for eight rays.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Ray8 {
    pub(crate) origin: [[f32; 8]; 3],
    pub(crate) t_min: [f32; 8],
    pub(crate) direction: [[f32; 8]; 3],
    pub(crate) time: [f32; 8],
    pub(crate) t_max: [f32; 8],
    pub(crate) mask: [u32; 8],
    pub(crate) id: [u32; 8],
    pub(crate) flags: [u32; 8],
}

/// `RTCRayHit8` of Embree 4. Embree 3 uses the part before the last words.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct RayHit8 {
    pub(crate) ray: Ray8,
    pub(crate) normal: [[f32; 8]; 3],
    pub(crate) u: [f32; 8],
    pub(crate) v: [f32; 8],
    pub(crate) triangle: [u32; 8],
    pub(crate) geometry: [u32; 8],
    pub(crate) instance: [u32; 8],
    pub(crate) in_instance_array: [u32; 8],
}

/// `RTCFilterFunctionN`.
pub(crate) type Filter = unsafe extern "C" fn(*const FilterArguments);

/// `RTCFilterFunctionNArguments`, for one ray.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct FilterArguments {
    /// Set to 0 to reject the hit.
    pub(crate) valid: *mut c_int,
    _geometry_data: *mut c_void,
    /// What the query passes to its filter.
    pub(crate) context: *mut c_void,
    /// Its `t_max` is the distance of the hit.
    pub(crate) ray: *mut Ray1,
    pub(crate) hit: *const Hit1,
    _rays: c_uint,
}

/// `RTCBounds`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Bounds {
    pub(crate) min: [f32; 4],
    pub(crate) max: [f32; 4],
}

/// `RTCBoundsFunction`.
pub(crate) type BoundsOf = unsafe extern "C" fn(*const BoundsArguments);

/// `RTCBoundsFunctionArguments`.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct BoundsArguments {
    pub(crate) geometry_data: *const c_void,
    pub(crate) primitive: c_uint,
    _time_step: c_uint,
    pub(crate) bounds: *mut Bounds,
}

/// `RTCIntersectFunctionN` for `R` = [`RayHit1`], and `RTCOccludedFunctionN` for `R` = [`Ray1`].
pub(crate) type HitOf<R> = unsafe extern "C" fn(*const HitArguments<R>);

/// `RTCIntersectFunctionNArguments` and `RTCOccludedFunctionNArguments`, for one ray.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct HitArguments<R> {
    /// 0 where there is no ray.
    pub(crate) valid: *const c_int,
    pub(crate) geometry_data: *const c_void,
    pub(crate) primitive: c_uint,
    _context: *mut c_void,
    pub(crate) ray: *mut R,
    _rays: c_uint,
    pub(crate) geometry: c_uint,
}

/// `RTCPointQuery`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct PointQuery {
    pub(crate) point: [f32; 3],
    pub(crate) time: f32,
    /// What is further away is of no interest.
    pub(crate) radius: f32,
}

/// `RTCPointQueryContext`, which is a little shorter in every version.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct PointQueryContext {
    _transforms: [[f32; 16]; 2],
    _instance: u32,
    /// The size of the stack of instances is one of these.
    _zeros: [u32; 31],
}

impl PointQueryContext {
    /// In no instance.
    pub(crate) const NEW: Self = Self {
        _transforms: [[0.0; 16]; 2],
        _instance: NOTHING,
        _zeros: [0; 31],
    };
}

/// `RTCPointQueryFunctionArguments`.
#[derive(Debug)]
#[repr(C, align(16))]
pub(crate) struct PointQueryArguments {
    /// The query; its radius may become smaller.
    pub(crate) query: *mut PointQuery,
    /// What the query passes to its function.
    pub(crate) data: *mut c_void,
    pub(crate) triangle: c_uint,
    _geometry: c_uint,
    _context: *mut c_void,
    _similarity_scale: f32,
}

/// `RTCPointQueryFunction`: returns whether the radius has changed.
pub(crate) type PointQueryFunction = unsafe extern "C" fn(*mut PointQueryArguments) -> bool;

/// A table of functions of the library.
macro_rules! functions {
    (
        $(#[$about:meta])* $table:ident;
        $($name:ident = $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)*
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $table {
            $(pub(crate) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl $table {
            /// The functions are valid while the library is open.
            ///
            /// # Safety
            ///
            /// Only for a version of Embree whose headers declare these symbols with these types.
            pub(crate) unsafe fn of(library: &libloading::Library) -> Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: the caller guarantees that the headers declare this symbol with this type.
                    $($name: unsafe { *library.get($symbol)? },)*
                })
            }
        }
    };
}
pub(crate) use functions;

functions! {
    /// The functions that both versions have.
    Common;
    new_device = b"rtcNewDevice" (*const c_char) -> Handle;
    release_device = b"rtcReleaseDevice" (Handle);
    device_property = b"rtcGetDeviceProperty" (Handle, c_int) -> isize;
    device_error = b"rtcGetDeviceError" (Handle) -> c_int;
    monitor_memory = b"rtcSetDeviceMemoryMonitorFunction"
        (Handle, extern "C" fn(*mut c_void, isize, bool) -> bool, *mut c_void);
    new_scene = b"rtcNewScene" (Handle) -> Handle;
    release_scene = b"rtcReleaseScene" (Handle);
    set_scene_quality = b"rtcSetSceneBuildQuality" (Handle, c_int);
    set_scene_flags = b"rtcSetSceneFlags" (Handle, c_int);
    commit_scene = b"rtcCommitScene" (Handle);
    new_geometry = b"rtcNewGeometry" (Handle, c_int) -> Handle;
    release_geometry = b"rtcReleaseGeometry" (Handle);
    set_geometry_mask = b"rtcSetGeometryMask" (Handle, c_uint);
    set_geometry_quality = b"rtcSetGeometryBuildQuality" (Handle, c_int);
    new_buffer = b"rtcSetNewGeometryBuffer" (Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void;
    commit_geometry = b"rtcCommitGeometry" (Handle);
    update_buffer = b"rtcUpdateGeometryBuffer" (Handle, c_int, c_uint);
    attach_geometry = b"rtcAttachGeometry" (Handle, Handle) -> c_uint;
    set_primitive_count = b"rtcSetGeometryUserPrimitiveCount" (Handle, c_uint);
    set_geometry_data = b"rtcSetGeometryUserData" (Handle, *const c_void);
    set_bounds = b"rtcSetGeometryBoundsFunction" (Handle, BoundsOf, *mut c_void);
    set_intersect = b"rtcSetGeometryIntersectFunction" (Handle, HitOf<RayHit1>);
    set_occluded = b"rtcSetGeometryOccludedFunction" (Handle, HitOf<Ray1>);
    point_query = b"rtcPointQuery"
        (Handle, *mut PointQuery, *mut PointQueryContext, PointQueryFunction, *mut c_void) -> bool;
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        let sizes = [
            size_of::<Ray1>(),
            size_of::<Hit1>(),
            size_of::<RayHit1>(),
            size_of::<Ray8>(),
            size_of::<RayHit8>(),
        ];
        assert_eq!(sizes, [48, 32, 96, 384, 672], "bytes");
        let of_point_queries = [size_of::<PointQuery>(), size_of::<PointQueryArguments>()];
        assert_eq!(of_point_queries, [32, 48], "bytes");
        let of_version_3 = [
            offset_of!(RayHit1, in_instance_array),
            offset_of!(RayHit8, in_instance_array),
        ];
        assert_eq!(of_version_3, [80, 640], "bytes");
        if cfg!(target_pointer_width = "64") {
            assert_eq!(size_of::<FilterArguments>(), 48, "bytes");
        }
    }
}
