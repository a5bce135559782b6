//! Embree through a few functions of its C interface; the library is opened at its first use. Versions 3 and 4 differ in the
//! arguments of queries: see [`Version`].
//!
//! The interface of this module is safe: a [`Scene`] is committed, and its handles are released when it is dropped. The floating
//! point modes of the processor (flush to zero, denormals are zero) stay unchanged: Embree advises to set them, but compiled Rust
//! relies on the defaults.
#![allow(
    unsafe_code,
    reason = "calls of a C library; the interface of this module is safe"
)]

mod library;
mod points;
mod primitives;
mod shared;
mod v3;
mod v4;

use std::ffi::{CString, c_int, c_void};
use std::fmt::Debug;
use std::ptr;
use std::sync::atomic::{AtomicIsize, Ordering};

use kd_core::{Hit, Mesh};

use crate::{FIRST, RivalError};
use library::Functions;
use shared::{FilterArguments, Handle};

pub(super) use library::{Embree, library};
pub(super) use primitives::{Committed, Geometry};
pub(super) use shared::{Hit1, NOTHING, Quality, Ray1, Ray8, RayHit1, RayHit8, SceneFlags};

/// The queries of a version of Embree: its functions whose arguments are those of no other version.
///
/// # Safety
///
/// The unsafe functions are for a committed scene of this version, and for as many active lanes as there are rays.
/// `first_hits` finds none unless the scene is [`SceneFlags::Filtered`].
pub(super) trait Version: Copy + Debug + Send + Sync + 'static {
    /// What a query gets beside its rays.
    type Arguments: Debug;
    /// What a filter gets.
    type Context: Debug;

    /// `coherent` is a hint for the traversal of packets; answers do not depend on it.
    fn arguments(coherent: bool) -> Self::Arguments;
    /// The context of the filter [`keep_first`].
    fn context() -> Self::Context;

    unsafe fn intersect1(&self, scene: Handle, _: &mut Self::Arguments, ray: &mut RayHit1);
    unsafe fn occluded1(&self, scene: Handle, _: &mut Self::Arguments, ray: &mut Ray1);
    unsafe fn intersect8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        _: &mut Self::Arguments,
        rays: &mut RayHit8,
    );
    unsafe fn occluded8(
        &self,
        lanes: *const c_int,
        scene: Handle,
        _: &mut Self::Arguments,
        rays: &mut Ray8,
    );
    unsafe fn first_hits(
        &self,
        scene: Handle,
        found: &mut FirstHits<Self::Context>,
        ray: &mut RayHit1,
    );
}

/// The context of a query for the first hits of a ray, with the hits found.
#[derive(Debug)]
#[repr(C)]
pub(super) struct FirstHits<C> {
    /// First, so that a pointer to it is a pointer to the whole.
    context: C,
    /// In order; `count` of them.
    nearest: [Hit; FIRST],
    count: usize,
}

impl<C> FirstHits<C> {
    fn none(context: C) -> Self {
        let nothing = Hit {
            t: f32::INFINITY,
            u: 0.0,
            v: 0.0,
            triangle: NOTHING,
        };
        Self {
            context,
            nearest: [nothing; FIRST],
            count: 0,
        }
    }

    /// The hits in order.
    pub(super) fn hits(&self) -> &[Hit] {
        &self.nearest[..self.count]
    }

    /// Inserts a hit in order if it is among the nearest so far.
    #[inline]
    fn insert(&mut self, hit: Hit) {
        if self.count < FIRST {
            self.count += 1;
        } else if !hit.is_before(&self.nearest[FIRST - 1]) {
            return;
        }
        let mut place = self.count - 1;
        while place > 0 && hit.is_before(&self.nearest[place - 1]) {
            self.nearest[place] = self.nearest[place - 1];
            place -= 1;
        }
        self.nearest[place] = hit;
    }
}

/// Records a hit. While fewer than [`FIRST`] are recorded, the hit is rejected, and Embree restores the ray's end; from then on it
/// is accepted, and the ray ends at the last recorded hit.
///
/// # Safety
///
/// Only for Embree, with one ray, in a query whose context is the first field of a [`FirstHits`] of this type.
unsafe extern "C" fn keep_first<C>(arguments: *const FilterArguments) {
    // SAFETY: Embree keeps its arguments valid and unchanged during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: the caller guarantees that this is the context of a whole `FirstHits`, and the pointer is derived from one to the
    // whole; nothing else uses it before the query ends.
    let found = unsafe { &mut *arguments.context.cast::<FirstHits<C>>() };
    // SAFETY: this is the ray of the query, which Embree does not use during the call.
    let ray = unsafe { &mut *arguments.ray };
    // SAFETY: this is a hit with the fields of `Hit1`, each aligned.
    let hit = unsafe { &*arguments.hit };
    found.insert(Hit {
        t: ray.t_max,
        u: hit.u,
        v: hit.v,
        triangle: hit.triangle,
    });
    if found.count == FIRST {
        ray.t_max = found.nearest[FIRST - 1].t;
    } else {
        // SAFETY: it points to one writable number, for the one ray.
        unsafe { *arguments.valid = 0 };
    }
}

/// All lanes of a packet are active.
#[repr(align(32))]
struct Lanes([c_int; 8]);
static ALL_LANES: Lanes = Lanes([-1; 8]);

/// Fails with this text unless `holds`.
fn ensure(holds: bool, why: &str) -> Result<(), RivalError> {
    holds
        .then_some(())
        .ok_or_else(|| RivalError::Failed(why.into()))
}

/// Bytes that all devices have allocated, and their peak since the last [`Input::commit`].
static BYTES_IN_USE: AtomicIsize = AtomicIsize::new(0);
static BYTES_AT_PEAK: AtomicIsize = AtomicIsize::new(0);

extern "C" fn note_memory(_: *mut c_void, bytes: isize, _: bool) -> bool {
    let in_use = BYTES_IN_USE.fetch_add(bytes, Ordering::Relaxed) + bytes;
    BYTES_AT_PEAK.fetch_max(in_use, Ordering::Relaxed);
    true
}

/// A device with a scene of a mesh, in Embree's own buffers.
#[derive(Debug)]
struct Handles<V: Version> {
    functions: &'static Functions<V>,
    device: Handle,
    scene: Handle,
}

/// A mesh in Embree's buffers, ready for a build.
#[derive(Debug)]
pub(super) struct Input<V: Version>(Handles<V>);

/// A scene that is ready to trace.
#[derive(Debug)]
pub(super) struct Scene<V: Version> {
    handles: Handles<V>,
    /// Its bytes, without the mesh's buffers.
    pub(super) bytes: usize,
    /// The peak of allocated bytes of its build, without the mesh's buffers.
    pub(super) peak_bytes: usize,
}

/// A scene with a moving mesh.
#[derive(Debug)]
pub(super) struct Moving<V: Version> {
    pub(super) scene: Scene<V>,
    geometry: Handle,
    vertices: *mut [f32; 3],
    count: usize,
}

// SAFETY: the handles are reference counted objects of a library that is usable from any thread.
unsafe impl<V: Version> Send for Scene<V> {}
// SAFETY: the only calls through a shared scene are queries, which may run on any number of threads after the commit, and nothing
// changes a committed scene.
unsafe impl<V: Version> Sync for Scene<V> {}

impl<V: Version> Input<V> {
    /// Copies a mesh, with a quality of the scene and one of the mesh. Builds run on `threads` threads, or on the greatest number of
    /// any device before: Embree's threads belong to the process and do not become fewer. So a run times one number of threads only.
    pub(super) fn new(
        functions: &'static Functions<V>,
        mesh: &Mesh,
        [of_scene, of_mesh]: [Quality; 2],
        flags: SceneFlags,
        threads: usize,
    ) -> Result<Self, RivalError> {
        let handles = Handles::new(functions, of_scene, flags, threads)?;
        // Embree has no empty buffers.
        if !mesh.is_empty() {
            handles.attach(mesh, of_mesh)?;
        }
        handles.check()?;
        Ok(Self(handles))
    }

    /// Adds another mesh, whose vertices may change.
    pub(super) fn add(self, mesh: &Mesh, quality: Quality) -> Result<Moving<V>, RivalError> {
        let Self(handles) = self;
        let (geometry, vertices) = handles.attach(mesh, quality)?;
        let before = BYTES_IN_USE.load(Ordering::Relaxed);
        let mut moving = Moving {
            scene: Scene {
                handles,
                bytes: 0,
                peak_bytes: 0,
            },
            geometry,
            vertices,
            count: mesh.positions().len(),
        };
        moving.move_to(mesh.positions())?;
        let grown = BYTES_IN_USE.load(Ordering::Relaxed).saturating_sub(before);
        moving.scene.bytes = grown.max(0).unsigned_abs();
        Ok(moving)
    }

    /// Builds: the timed part.
    pub(super) fn commit(self) -> Result<Scene<V>, RivalError> {
        let Self(handles) = self;
        let before = BYTES_IN_USE.load(Ordering::Relaxed);
        BYTES_AT_PEAK.store(before, Ordering::Relaxed);
        // SAFETY: the scene is valid and not shared.
        unsafe { (handles.functions.common.commit_scene)(handles.scene) };
        handles.check()?;
        let grown = |to: &AtomicIsize| to.load(Ordering::Relaxed).saturating_sub(before).max(0);
        Ok(Scene {
            bytes: grown(&BYTES_IN_USE).unsigned_abs(),
            peak_bytes: grown(&BYTES_AT_PEAK).unsigned_abs(),
            handles,
        })
    }
}

impl<V: Version> Handles<V> {
    /// A device with an empty scene.
    fn new(
        functions: &'static Functions<V>,
        quality: Quality,
        flags: SceneFlags,
        threads: usize,
    ) -> Result<Self, RivalError> {
        let common = &functions.common;
        let config = CString::new(format!("threads={threads},set_affinity=0"));
        let config = config.expect("no 0 inside");
        // SAFETY: the text ends with 0 and outlives the call, which copies it.
        let device = unsafe { (common.new_device)(config.as_ptr()) };
        ensure(!device.is_null(), "Embree creates no device")?;
        // SAFETY: the device is valid; the function is callable from any thread and uses no data of its caller.
        unsafe { (common.monitor_memory)(device, note_memory, ptr::null_mut()) };
        // SAFETY: the device is valid.
        let scene = unsafe { (common.new_scene)(device) };
        let handles = Self {
            functions,
            device,
            scene,
        };
        // SAFETY: the scene is valid, and the quality one of its enumeration.
        unsafe { (common.set_scene_quality)(scene, quality as c_int) };
        // SAFETY: the scene is valid, and the flags are of its enumeration.
        unsafe { (common.set_scene_flags)(scene, flags as c_int) };
        Ok(handles)
    }

    /// Adds the mesh to the scene, and returns its geometry, which the scene keeps, and its vertex buffer.
    fn attach(&self, mesh: &Mesh, quality: Quality) -> Result<(Handle, *mut [f32; 3]), RivalError> {
        let common = &self.functions.common;
        // SAFETY: the device is valid.
        let geometry = unsafe { (common.new_geometry)(self.device, shared::TRIANGLES) };
        // SAFETY: the geometry is valid, and the quality one of its enumeration.
        unsafe { (common.set_geometry_quality)(geometry, quality as c_int) };
        // Embree 4 lets a ray hit what shares a bit with its mask, and geometries begin with one bit.
        // SAFETY: the geometry is valid.
        unsafe { (common.set_geometry_mask)(geometry, u32::MAX) };
        let copied = self
            .fill(
                geometry,
                shared::VERTEX_BUFFER,
                shared::THREE_FLOATS,
                mesh.positions(),
            )
            .and_then(|vertices| {
                self.fill(
                    geometry,
                    shared::INDEX_BUFFER,
                    shared::THREE_UINTS,
                    mesh.triangles(),
                )?;
                Ok((geometry, vertices))
            });
        if copied.is_ok() {
            // SAFETY: the geometry is valid and has its two buffers.
            unsafe { (common.commit_geometry)(geometry) };
            // SAFETY: both are valid and of one device.
            unsafe { (common.attach_geometry)(self.scene, geometry) };
        }
        // SAFETY: the geometry is valid; the scene keeps a reference of its own.
        unsafe { (common.release_geometry)(geometry) };
        copied
    }

    /// Adds a buffer to a geometry with a copy of `values`, triples of 4 bytes in the layout `format`, and returns its address.
    fn fill<T: Copy>(
        &self,
        geometry: Handle,
        buffer: c_int,
        format: c_int,
        values: &[[T; 3]],
    ) -> Result<*mut [T; 3], RivalError> {
        const STRIDE: usize = 12;
        assert_eq!(size_of::<[T; 3]>(), STRIDE, "triples of 4 bytes");
        let new_buffer = self.functions.common.new_buffer;
        // SAFETY: the geometry is valid; the buffer is one of triangles, in its only format.
        let place = unsafe { new_buffer(geometry, buffer, 0, format, STRIDE, values.len()) };
        ensure(!place.is_null(), "Embree has no memory for the mesh")?;
        // SAFETY: the buffer is new, so it overlaps nothing, and has room for these values; Embree aligns buffers to 16 bytes or
        // more.
        unsafe { ptr::copy_nonoverlapping(values.as_ptr(), place.cast(), values.len()) };
        Ok(place.cast())
    }

    /// The first error since the last check.
    fn check(&self) -> Result<(), RivalError> {
        // SAFETY: the device is valid.
        let code = unsafe { (self.functions.common.device_error)(self.device) };
        ensure(code == 0, &format!("Embree reports error {code}"))
    }
}

impl<V: Version> Moving<V> {
    /// Moves the vertices of the second mesh and updates the scene: the timed part.
    pub(super) fn move_to(&mut self, positions: &[[f32; 3]]) -> Result<(), RivalError> {
        let count = positions.len();
        ensure(count == self.count, "one position for each vertex")?;
        let Handles {
            functions, scene, ..
        } = self.scene.handles;
        let common = &functions.common;
        // SAFETY: the buffer has room for `count` positions and lives as long as the geometry, which the scene keeps; no query or
        // build reads it during this exclusive borrow.
        unsafe { ptr::copy_nonoverlapping(positions.as_ptr(), self.vertices, positions.len()) };
        // SAFETY: the geometry has this buffer.
        unsafe { (common.update_buffer)(self.geometry, shared::VERTEX_BUFFER, 0) };
        // SAFETY: the geometry is valid.
        unsafe { (common.commit_geometry)(self.geometry) };
        // SAFETY: the scene is valid and not shared.
        unsafe { (common.commit_scene)(scene) };
        self.scene.handles.check()
    }
}

impl<V: Version> Drop for Handles<V> {
    fn drop(&mut self) {
        // SAFETY: the scene is valid, and this is its one reference.
        unsafe { (self.functions.common.release_scene)(self.scene) };
        // SAFETY: the device is valid, and this is its one reference.
        unsafe { (self.functions.common.release_device)(self.device) };
    }
}

impl<V: Version> Scene<V> {
    /// The closest hit of one ray.
    #[inline]
    pub(super) fn intersect_one(&self, arguments: &mut V::Arguments, ray: &mut RayHit1) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: the scene is committed.
        unsafe { functions.queries.intersect1(scene, arguments, ray) }
    }

    /// The first hits of one ray; none unless the scene is [`SceneFlags::Filtered`].
    #[inline]
    pub(super) fn first_hits(&self, ray: &mut RayHit1) -> FirstHits<V::Context> {
        let Handles {
            functions, scene, ..
        } = self.handles;
        let mut found = FirstHits::none(V::context());
        // SAFETY: the scene is committed.
        unsafe { functions.queries.first_hits(scene, &mut found, ray) };
        found
    }

    /// Whether one ray hits anything.
    #[inline]
    pub(super) fn occluded_one(&self, arguments: &mut V::Arguments, ray: &mut Ray1) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: the scene is committed.
        unsafe { functions.queries.occluded1(scene, arguments, ray) }
    }

    /// The closest hits of eight rays.
    #[inline]
    pub(super) fn intersect_packet(&self, arguments: &mut V::Arguments, rays: &mut RayHit8) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        let lanes = ALL_LANES.0.as_ptr();
        // SAFETY: the scene is committed, and there are eight lanes, aligned like the rays.
        unsafe { functions.queries.intersect8(lanes, scene, arguments, rays) }
    }

    /// Whether each of eight rays hits anything.
    #[inline]
    pub(super) fn occluded_packet(&self, arguments: &mut V::Arguments, rays: &mut Ray8) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        let lanes = ALL_LANES.0.as_ptr();
        // SAFETY: as for `intersect_packet`.
        unsafe { functions.queries.occluded8(lanes, scene, arguments, rays) }
    }
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    #[test]
    fn a_pointer_to_the_context_is_one_to_the_whole() {
        assert_eq!(offset_of!(FirstHits<[u32; 2]>, context), 0, "in front");
    }

    #[test]
    fn the_nearest_hits_are_kept_in_order() {
        let mut found = FirstHits::none(());
        let mut noted = |distances: &[f32]| {
            for (triangle, t) in (0..).zip(distances) {
                found.insert(Hit {
                    t: *t,
                    u: 0.0,
                    v: 0.0,
                    triangle,
                });
            }
            let kept = &found.nearest[..found.count];
            kept.iter().map(|hit| hit.t).collect::<Vec<_>>()
        };
        assert_eq!(noted(&[3.0, 1.0]), [1.0, 3.0], "room for more");
        assert_eq!(
            noted(&[9.0, 2.0, 8.0]),
            [1.0, 2.0, 3.0, 8.0],
            "9 is too far"
        );
        assert_eq!(noted(&[8.5, 0.5]), [0.5, 1.0, 2.0, 3.0], "8 makes room");
    }
}
