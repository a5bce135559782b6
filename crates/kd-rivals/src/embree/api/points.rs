//! Closest points by Embree's point query, which calls a function for each triangle whose box is near enough.

use std::ffi::c_void;
use std::ptr;

use glam::Vec3;
use kd_core::Mesh;

use super::shared::{PointQuery, PointQueryArguments, PointQueryContext};
use super::{Scene, Version};

/// What a query passes to its function.
struct Search<'a> {
    mesh: &'a Mesh,
    point: Vec3,
}

impl<V: Version> Scene<V> {
    /// The distance of a point from a mesh, which is the one that the scene was made from.
    #[inline]
    pub(in crate::embree) fn distance(&self, mesh: &Mesh, point: [f32; 3]) -> f32 {
        let mut query = PointQuery {
            point,
            time: 0.0,
            radius: f32::INFINITY,
        };
        let mut context = PointQueryContext::NEW;
        let mut search = Search {
            mesh,
            point: point.into(),
        };
        let data: *mut c_void = ptr::from_mut(&mut search).cast();
        let point_query = self.handles.functions.common.point_query;
        // SAFETY: the scene is committed; query, context and data outlive the call, and the function expects such data.
        unsafe {
            point_query(
                self.handles.scene,
                &raw mut query,
                &raw mut context,
                visit,
                data,
            )
        };
        query.radius
    }
}

/// Makes the radius smaller if the triangle is closer.
///
/// # Safety
///
/// Only for Embree, in a query whose data is a [`Search`].
unsafe extern "C" fn visit(arguments: *mut PointQueryArguments) -> bool {
    // SAFETY: Embree keeps its arguments valid during the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: the caller guarantees that the data is a search, which nothing changes during the query.
    let search = unsafe { &*arguments.data.cast::<Search<'_>>() };
    // SAFETY: this is the query, which Embree does not use during the call.
    let query = unsafe { &mut *arguments.query };
    let nearest = closest(search.point, search.mesh.corners(arguments.triangle));
    let distance = nearest.distance(search.point);
    let is_closer = distance < query.radius;
    if is_closer {
        query.radius = distance;
    }
    is_closer
}

/// The closest point of a triangle, in f32: C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5, as in Embree's tutorial and in
/// Open3D.
#[inline]
fn closest(p: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + d1 / (d1 - d3) * ab;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + d2 / (d2 - d6) * ac;
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    }
    let scale = 1.0 / (va + vb + vc);
    a + vb * scale * ab + vc * scale * ac
}
