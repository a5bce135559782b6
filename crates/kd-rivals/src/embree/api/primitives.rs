//! Scenes of primitives that are functions of the program.

use std::ffi::c_int;
use std::ptr;
use std::sync::Arc;

use glam::Vec3;
use kd_core::Ray;
use kd_trace::{PrimitiveHit, Primitives};

use super::library::Functions;
use super::shared::{self, Bounds, BoundsArguments, HitArguments, NOTHING, Ray1, RayHit1};
use super::{Handles, Input, Quality, Scene, SceneFlags, Version, ensure};
use crate::RivalError;

/// Primitives in a scene, ready for a build.
#[derive(Debug)]
pub(crate) struct Geometry<V: Version, P> {
    input: Input<V>,
    /// The library has a pointer to them.
    primitives: Arc<P>,
}

/// A scene of primitives that is ready to trace.
#[derive(Debug)]
pub(crate) struct Committed<V: Version, P> {
    /// First, so that it is dropped before what it points to.
    pub(crate) scene: Scene<V>,
    _primitives: Arc<P>,
}

impl<V: Version, P: Primitives + Send> Geometry<V, P> {
    /// Takes primitives into a scene of this quality. Threads are those of [`Input::new`].
    pub(crate) fn new(
        functions: &'static Functions<V>,
        primitives: P,
        quality: Quality,
        threads: usize,
    ) -> Result<Self, RivalError> {
        let primitives = Arc::new(primitives);
        let handles = Handles::new(functions, quality, SceneFlags::Usual, threads)?;
        let common = &functions.common;
        // SAFETY: the device is valid.
        let geometry = unsafe { (common.new_geometry)(handles.device, shared::PRIMITIVES) };
        ensure(!geometry.is_null(), "Embree has no geometry of primitives")?;
        // SAFETY: the geometry is valid, and the quality one of its enumeration.
        unsafe { (common.set_geometry_quality)(geometry, quality as c_int) };
        // SAFETY: the geometry is valid.
        unsafe { (common.set_geometry_mask)(geometry, u32::MAX) };
        // SAFETY: the geometry is valid.
        unsafe { (common.set_primitive_count)(geometry, primitives.count()) };
        let data = Arc::as_ptr(&primitives);
        // SAFETY: the geometry is valid; the scene keeps the primitives where they are.
        unsafe { (common.set_geometry_data)(geometry, data.cast()) };
        // SAFETY: the geometry is valid, and its data is of the type that the function expects.
        unsafe { (common.set_bounds)(geometry, bounds_of::<P>, ptr::null_mut()) };
        // SAFETY: the same.
        unsafe { (common.set_intersect)(geometry, intersect::<P>) };
        // SAFETY: the same.
        unsafe { (common.set_occluded)(geometry, occluded::<P>) };
        // SAFETY: the geometry is valid and complete.
        unsafe { (common.commit_geometry)(geometry) };
        // SAFETY: both are valid and of one device.
        unsafe { (common.attach_geometry)(handles.scene, geometry) };
        // SAFETY: the geometry is valid; the scene keeps a reference of its own.
        unsafe { (common.release_geometry)(geometry) };
        handles.check()?;
        Ok(Self {
            input: Input(handles),
            primitives,
        })
    }

    /// Builds: the timed part.
    pub(crate) fn commit(self) -> Result<Committed<V, P>, RivalError> {
        Ok(Committed {
            scene: self.input.commit()?,
            _primitives: self.primitives,
        })
    }
}

/// # Safety
///
/// Only for Embree, with a geometry whose data are primitives of this type.
unsafe extern "C" fn bounds_of<P: Primitives>(arguments: *const BoundsArguments) {
    // SAFETY: Embree keeps its arguments valid and unchanged during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: the data of the geometry, which outlive the scene; shared by all calls, as `Primitives` are `Sync`.
    let primitives = unsafe { &*arguments.geometry_data.cast::<P>() };
    let bounds = primitives.bounds(arguments.primitive);
    let result = Bounds {
        min: bounds.min.extend(0.0).to_array(),
        max: bounds.max.extend(0.0).to_array(),
    };
    // SAFETY: it points to writable bounds.
    unsafe { arguments.bounds.write(result) };
}

/// Reports the hit of a primitive with one ray.
///
/// # Safety
///
/// Only for Embree, with one ray, in a query of a geometry whose data are primitives of this type.
unsafe extern "C" fn intersect<P: Primitives>(arguments: *const HitArguments<RayHit1>) {
    // SAFETY: Embree keeps its arguments valid and unchanged during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: it points to one number, for the one ray.
    if unsafe { *arguments.valid } == 0 {
        return;
    }
    // SAFETY: this is the ray of the query, with its hit, which Embree does not use during the call. It has the fields of Embree 3 at
    // least, and the last word, which only Embree 4 has, is not touched.
    let ray = unsafe { &mut (*arguments.ray).ray };
    // SAFETY: as for `bounds_of`.
    let hit = unsafe { hit_of::<P, _>(arguments, ray) };
    let Some(PrimitiveHit { t, u, v }) = hit else {
        return;
    };
    ray.t_max = t;
    // SAFETY: as for the ray.
    let hit = unsafe { &mut (*arguments.ray).hit };
    hit.u = u;
    hit.v = v;
    hit.triangle = arguments.primitive;
    hit.geometry = arguments.geometry;
    hit.instance = NOTHING;
}

/// Reports whether a primitive is hit by one ray.
///
/// # Safety
///
/// As for [`intersect`].
unsafe extern "C" fn occluded<P: Primitives>(arguments: *const HitArguments<Ray1>) {
    // SAFETY: Embree keeps its arguments valid and unchanged during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: it points to one number, for the one ray.
    if unsafe { *arguments.valid } == 0 {
        return;
    }
    // SAFETY: this is the ray of the query, which Embree does not use during the call.
    let ray = unsafe { &mut *arguments.ray };
    // SAFETY: as for `bounds_of`.
    if unsafe { hit_of::<P, _>(arguments, ray) }.is_some() {
        ray.t_max = f32::NEG_INFINITY;
    }
}

/// # Safety
///
/// The data of the geometry are primitives of this type.
#[inline]
unsafe fn hit_of<P: Primitives, R>(
    arguments: &HitArguments<R>,
    ray: &Ray1,
) -> Option<PrimitiveHit> {
    // SAFETY: the caller guarantees the type; they outlive the scene, and are shared by all calls, as `Primitives` are `Sync`.
    let primitives = unsafe { &*arguments.geometry_data.cast::<P>() };
    let ray = Ray::new(
        Vec3::from_array(ray.origin),
        Vec3::from_array(ray.direction),
    )
    .with_range(ray.t_min, ray.t_max);
    primitives.intersect(arguments.primitive, &ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        if cfg!(target_pointer_width = "64") {
            assert_eq!(size_of::<Bounds>(), 32, "bytes");
            assert_eq!(size_of::<BoundsArguments>(), 24, "bytes");
            assert_eq!(size_of::<HitArguments<Ray1>>(), 48, "bytes");
        }
    }
}
