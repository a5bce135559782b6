//! Embree through a few functions of its C interface; the library is opened at its first use.
//!
//! The interface of this module is safe: a [`Scene`] is committed, and its handles are released when it is dropped. The floating
//! point modes of the processor (flush to zero, denormals are zero) stay unchanged: Embree advises to set them, but compiled Rust
//! relies on the defaults.
#![allow(
    unsafe_code,
    reason = "calls of a C library; the interface of this module is safe"
)]

mod v3;

use std::error::Error;
use std::ffi::{CString, OsString, c_int, c_void};
use std::iter;
use std::ptr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicIsize, Ordering};

use kd_core::{Hit, Mesh};
use libloading::Library;

use crate::{FIRST, RivalError};
use v3::{FilterArguments, Functions, Handle};

pub(super) use v3::{
    Hit1, NOTHING, Quality, QueryContext, Ray1, Ray8, RayHit1, RayHit8, SceneFlags,
};

/// The context of a query for the first hits of a ray, with the hits found.
#[derive(Debug)]
#[repr(C)]
pub(super) struct FirstHits {
    /// First, so that a pointer to it is a pointer to the whole.
    context: QueryContext,
    /// In order; `count` of them.
    nearest: [Hit; FIRST],
    count: usize,
}

impl FirstHits {
    pub(super) fn none() -> Self {
        let nothing = Hit {
            t: f32::INFINITY,
            u: 0.0,
            v: 0.0,
            triangle: NOTHING,
        };
        let mut context = QueryContext::new(false);
        context.filter = Some(keep_first);
        Self {
            context,
            nearest: [nothing; FIRST],
            count: 0,
        }
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
/// Only for Embree, with one ray, in a query whose context is the first field of a [`FirstHits`].
unsafe extern "C" fn keep_first(arguments: *const FilterArguments) {
    // SAFETY: Embree keeps its arguments valid and unchanged during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: the caller guarantees that this is the context of a whole `FirstHits`, and the pointer is derived from one to the
    // whole; nothing else uses it before the query ends.
    let found = unsafe { &mut *arguments.context.cast::<FirstHits>() };
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

fn functions() -> Result<&'static Functions, RivalError> {
    static LOADED: OnceLock<Result<Functions, RivalError>> = OnceLock::new();
    let loaded = LOADED.get_or_init(|| load(&v3::library_names().map(OsString::from)));
    loaded.as_ref().map_err(Clone::clone)
}

fn load(names: &[OsString]) -> Result<Functions, RivalError> {
    let mut why = String::from("no name to look for");
    for name in names {
        // SAFETY: opening runs the start-up code of Embree and of its libraries, which have no requirements on the program.
        match unsafe { Library::new(name) }.and_then(Functions::of) {
            Ok(functions) => return Ok(functions),
            Err(error) => why = with_causes(&error),
        }
    }
    Err(RivalError::NotInstalled(why))
}

/// The texts of an error and of its causes.
fn with_causes(error: &dyn Error) -> String {
    let all = iter::successors(Some(error), |&error: &&dyn Error| error.source());
    let texts: Vec<String> = all.map(ToString::to_string).collect();
    texts.join(": ")
}

/// Fails with this text unless `holds`.
fn ensure(holds: bool, why: &str) -> Result<(), RivalError> {
    holds
        .then_some(())
        .ok_or_else(|| RivalError::Failed(why.into()))
}

/// Whether Embree is installed.
pub(crate) fn check_installed() -> Result<(), RivalError> {
    functions().map(|_| ())
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
struct Handles {
    functions: &'static Functions,
    device: Handle,
    scene: Handle,
}

/// A mesh in Embree's buffers, ready for a build.
#[derive(Debug)]
pub(super) struct Input(Handles);

/// A scene that is ready to trace.
#[derive(Debug)]
pub(super) struct Scene {
    handles: Handles,
    /// Its bytes, without the mesh's buffers.
    pub(super) bytes: usize,
    /// The peak of allocated bytes of its build, without the mesh's buffers.
    pub(super) peak_bytes: usize,
}

/// A scene with a moving mesh.
#[derive(Debug)]
pub(super) struct Moving {
    pub(super) scene: Scene,
    geometry: Handle,
    vertices: *mut [f32; 3],
    count: usize,
}

// SAFETY: the handles are reference counted objects of a library that is usable from any thread.
unsafe impl Send for Scene {}
// SAFETY: the only calls through a shared scene are queries, which may run on any number of threads after the commit, and nothing
// changes a committed scene.
unsafe impl Sync for Scene {}

impl Input {
    /// Copies a mesh, with a quality of the scene and one of the mesh. Builds run on `threads` threads, or on the greatest number of
    /// any device before: Embree's threads belong to the process and do not become fewer. So a run times one number of threads only.
    pub(super) fn new(
        mesh: &Mesh,
        [of_scene, of_mesh]: [Quality; 2],
        flags: SceneFlags,
        threads: usize,
    ) -> Result<Self, RivalError> {
        let functions = functions()?;
        let config = CString::new(format!("threads={threads},set_affinity=0"));
        let config = config.expect("no 0 inside");
        // SAFETY: the text ends with 0 and outlives the call, which copies it.
        let device = unsafe { (functions.new_device)(config.as_ptr()) };
        ensure(!device.is_null(), "Embree creates no device")?;
        // SAFETY: the device is valid; the function is callable from any thread and uses no data of its caller.
        unsafe { (functions.monitor_memory)(device, note_memory, ptr::null_mut()) };
        // SAFETY: the device is valid.
        let scene = unsafe { (functions.new_scene)(device) };
        let handles = Handles {
            functions,
            device,
            scene,
        };
        // SAFETY: the scene is valid, and the quality one of its enumeration.
        unsafe { (functions.set_scene_quality)(scene, of_scene as c_int) };
        // SAFETY: the scene is valid, and the flags are of its enumeration.
        unsafe { (functions.set_scene_flags)(scene, flags as c_int) };
        // Embree has no empty buffers.
        if !mesh.is_empty() {
            handles.attach(mesh, of_mesh)?;
        }
        handles.check()?;
        Ok(Self(handles))
    }

    /// Adds another mesh, whose vertices may change.
    pub(super) fn add(self, mesh: &Mesh, quality: Quality) -> Result<Moving, RivalError> {
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
    pub(super) fn commit(self) -> Result<Scene, RivalError> {
        let Self(handles) = self;
        let before = BYTES_IN_USE.load(Ordering::Relaxed);
        BYTES_AT_PEAK.store(before, Ordering::Relaxed);
        // SAFETY: the scene is valid and not shared.
        unsafe { (handles.functions.commit_scene)(handles.scene) };
        handles.check()?;
        let grown = |to: &AtomicIsize| to.load(Ordering::Relaxed).saturating_sub(before).max(0);
        Ok(Scene {
            bytes: grown(&BYTES_IN_USE).unsigned_abs(),
            peak_bytes: grown(&BYTES_AT_PEAK).unsigned_abs(),
            handles,
        })
    }
}

impl Handles {
    /// Adds the mesh to the scene, and returns its geometry, which the scene keeps, and its vertex buffer.
    fn attach(&self, mesh: &Mesh, quality: Quality) -> Result<(Handle, *mut [f32; 3]), RivalError> {
        let functions = self.functions;
        // SAFETY: the device is valid.
        let geometry = unsafe { (functions.new_geometry)(self.device, v3::TRIANGLES) };
        // SAFETY: the geometry is valid, and the quality one of its enumeration.
        unsafe { (functions.set_geometry_quality)(geometry, quality as c_int) };
        let copied = self
            .fill(
                geometry,
                v3::VERTEX_BUFFER,
                v3::THREE_FLOATS,
                mesh.positions(),
            )
            .and_then(|vertices| {
                self.fill(
                    geometry,
                    v3::INDEX_BUFFER,
                    v3::THREE_UINTS,
                    mesh.triangles(),
                )?;
                Ok((geometry, vertices))
            });
        if copied.is_ok() {
            // SAFETY: the geometry is valid and has its two buffers.
            unsafe { (functions.commit_geometry)(geometry) };
            // SAFETY: both are valid and of one device.
            unsafe { (functions.attach_geometry)(self.scene, geometry) };
        }
        // SAFETY: the geometry is valid; the scene keeps a reference of its own.
        unsafe { (functions.release_geometry)(geometry) };
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
        let new_buffer = self.functions.new_buffer;
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
        let code = unsafe { (self.functions.device_error)(self.device) };
        ensure(code == 0, &format!("Embree reports error {code}"))
    }
}

impl Moving {
    /// Moves the vertices of the second mesh and updates the scene: the timed part.
    pub(super) fn move_to(&mut self, positions: &[[f32; 3]]) -> Result<(), RivalError> {
        let count = positions.len();
        ensure(count == self.count, "one position for each vertex")?;
        let Handles {
            functions, scene, ..
        } = self.scene.handles;
        // SAFETY: the buffer has room for `count` positions and lives as long as the geometry, which the scene keeps; no query or
        // build reads it during this exclusive borrow.
        unsafe { ptr::copy_nonoverlapping(positions.as_ptr(), self.vertices, positions.len()) };
        // SAFETY: the geometry has this buffer.
        unsafe { (functions.update_buffer)(self.geometry, v3::VERTEX_BUFFER, 0) };
        // SAFETY: the geometry is valid.
        unsafe { (functions.commit_geometry)(self.geometry) };
        // SAFETY: the scene is valid and not shared.
        unsafe { (functions.commit_scene)(scene) };
        self.scene.handles.check()
    }
}

impl Drop for Handles {
    fn drop(&mut self) {
        // SAFETY: the scene is valid, and this is its one reference.
        unsafe { (self.functions.release_scene)(self.scene) };
        // SAFETY: the device is valid, and this is its one reference.
        unsafe { (self.functions.release_device)(self.device) };
    }
}

impl Scene {
    /// The closest hit of one ray.
    #[inline]
    pub(super) fn intersect_one(&self, context: &mut QueryContext, ray: &mut RayHit1) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: the scene is committed; the types are those of the headers, aligned as they say.
        unsafe { (functions.intersect1)(scene, context, ray) }
    }

    /// The first hits of one ray; none unless the scene is [`SceneFlags::Filtered`].
    #[inline]
    pub(super) fn first_hits<'a>(&self, found: &'a mut FirstHits, ray: &mut RayHit1) -> &'a [Hit] {
        let Handles {
            functions, scene, ..
        } = self.handles;
        found.count = 0;
        // SAFETY: as for `intersect_one`; the pointer is to the whole `FirstHits` that the filter of the context expects.
        unsafe { (functions.intersect1)(scene, ptr::from_mut(found).cast(), ray) };
        &found.nearest[..found.count]
    }

    /// Whether one ray hits anything.
    #[inline]
    pub(super) fn occluded_one(&self, context: &mut QueryContext, ray: &mut Ray1) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: as for `intersect_one`.
        unsafe { (functions.occluded1)(scene, context, ray) }
    }

    /// The closest hits of eight rays.
    #[inline]
    pub(super) fn intersect_packet(&self, context: &mut QueryContext, rays: &mut RayHit8) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: as for `intersect_one`; there is a lane for each ray, with the same alignment.
        unsafe { (functions.intersect8)(ALL_LANES.0.as_ptr(), scene, context, rays) }
    }

    /// Whether each of eight rays hits anything.
    #[inline]
    pub(super) fn occluded_packet(&self, context: &mut QueryContext, rays: &mut Ray8) {
        let Handles {
            functions, scene, ..
        } = self.handles;
        // SAFETY: as for `intersect_packet`.
        unsafe { (functions.occluded8)(ALL_LANES.0.as_ptr(), scene, context, rays) }
    }
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    #[test]
    fn without_the_library_the_message_says_how_to_install_it() {
        let missing = load(&["libembree-that-is-not-there.so".into()])
            .expect_err("no such library exists")
            .to_string();
        for part in [
            "libembree-that-is-not-there.so",
            "apt-get install libembree-dev",
        ] {
            assert!(missing.contains(part), "{part} in: {missing}");
        }
        assert!(!missing.contains('\n'), "one line: {missing}");
    }

    #[test]
    fn a_pointer_to_the_context_is_one_to_the_whole() {
        assert_eq!(offset_of!(FirstHits, context), 0, "in front");
    }

    #[test]
    fn the_nearest_hits_are_kept_in_order() {
        let mut found = FirstHits::none();
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
