//! The part of the binding that depends on Embree's version: types, constants and functions of the headers of Embree 3
//! (`rtcore_*.h`), tested with 3.13.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

/// File names of the library. The name with a version exists without the files for developers.
pub(crate) fn library_names() -> [String; 2] {
    let plain = format!("{DLL_PREFIX}embree3{DLL_SUFFIX}");
    [format!("{plain}.3"), plain]
}

/// Embree's number for no triangle.
pub(crate) const NOTHING: u32 = u32::MAX;

pub(crate) const TRIANGLES: c_int = 0;
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
    /// Contexts may filter hits
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

/// `RTCHit` without its alignment, which the argument of a filter need not have.
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

/// `RTCRayHit`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct RayHit1 {
    pub(crate) ray: Ray1,
    pub(crate) hit: Hit1,
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

/// `RTCRayHit8`.
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
}

/// `RTCIntersectContext` of a library with one level of instances, as distributions build it.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct QueryContext {
    /// 1 for coherent rays.
    flags: c_int,
    pub(crate) filter: Option<Filter>,
    instance: [u32; 1],
}

impl QueryContext {
    /// `coherent` is a hint for the traversal of packets; answers do not depend on it.
    pub(crate) fn new(coherent: bool) -> Self {
        Self {
            flags: c_int::from(coherent),
            filter: None,
            instance: [NOTHING],
        }
    }
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
    pub(crate) context: *mut QueryContext,
    /// Its `t_max` is the distance of the hit.
    pub(crate) ray: *mut Ray1,
    pub(crate) hit: *const Hit1,
    _rays: c_uint,
}

macro_rules! functions {
    ($($name:ident = $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions of the library.
        #[derive(Debug)]
        pub(crate) struct Functions {
            $(pub(crate) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            /// Keeps the library open, and so the functions valid.
            _library: Library,
        }

        impl Functions {
            pub(crate) fn of(library: Library) -> Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: the headers of Embree 3 declare this symbol with these types.
                    $($name: unsafe { *library.get($symbol)? },)*
                    _library: library,
                })
            }
        }
    };
}

functions! {
    new_device = b"rtcNewDevice" (*const c_char) -> Handle;
    release_device = b"rtcReleaseDevice" (Handle);
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
    set_geometry_quality = b"rtcSetGeometryBuildQuality" (Handle, c_int);
    new_buffer = b"rtcSetNewGeometryBuffer" (Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void;
    commit_geometry = b"rtcCommitGeometry" (Handle);
    update_buffer = b"rtcUpdateGeometryBuffer" (Handle, c_int, c_uint);
    attach_geometry = b"rtcAttachGeometry" (Handle, Handle) -> c_uint;
    intersect1 = b"rtcIntersect1" (Handle, *mut QueryContext, *mut RayHit1);
    occluded1 = b"rtcOccluded1" (Handle, *mut QueryContext, *mut Ray1);
    intersect8 = b"rtcIntersect8" (*const c_int, Handle, *mut QueryContext, *mut RayHit8);
    occluded8 = b"rtcOccluded8" (*const c_int, Handle, *mut QueryContext, *mut Ray8);
}

#[cfg(test)]
mod tests {
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
        assert_eq!(sizes, [48, 32, 80, 384, 640], "bytes");
        if cfg!(target_pointer_width = "64") {
            let sizes = [size_of::<QueryContext>(), size_of::<FilterArguments>()];
            assert_eq!(sizes, [24, 48], "bytes");
        }
    }
}
