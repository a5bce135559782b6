//! Every triangle, one by one: the oracle of all queries. Answers are equal to the bit, but for winding numbers, which are exact here.
//!
//! Time is linear in the number of triangles.

use std::f64::consts::PI;

use glam::Vec3;
use kd_core::{Aabb, Mesh};

use crate::decision::Foot;
use crate::exact::{Crossing, crossing, meets_box};
use crate::nearest::Nearest;
use crate::winding::solid_angle;
use crate::within::is_box;

/// As [`closest_point`](crate::closest_point).
pub fn closest_point(mesh: &Mesh, point: impl Into<Vec3>, max_distance: f32) -> Option<Nearest> {
    let point = point.into();
    let most = f64::from(max_distance);
    if !point.is_finite() || most.is_nan() || most < 0.0 {
        return None;
    }
    let feet = with_area(mesh).map(|(triangle, corners)| (triangle, Foot::new(point, corners)));
    let near = feet.filter(|(_, foot)| foot.squared <= most * most);
    let nearest = near.reduce(|best, other| {
        if other.1.squared < best.1.squared {
            other
        } else {
            best
        }
    });
    nearest.map(|(triangle, foot)| foot.answer(mesh.corners(triangle), triangle))
}

/// As [`contains`](crate::contains).
pub fn contains(mesh: &Mesh, point: impl Into<Vec3>) -> bool {
    let point = point.into();
    if !point.is_finite() {
        return false;
    }
    let mut is_inside = false;
    for (_, corners) in with_area(mesh) {
        match crossing(point, corners) {
            Crossing::None => {}
            Crossing::Beyond => is_inside = !is_inside,
            Crossing::At => return true,
        }
    }
    is_inside
}

/// As [`signed_distance`](crate::signed_distance).
pub fn signed_distance(mesh: &Mesh, point: impl Into<Vec3>) -> Option<f32> {
    let point = point.into();
    let distance = closest_point(mesh, point, f32::INFINITY)?.distance;
    Some(if distance > 0.0 && contains(mesh, point) {
        -distance
    } else {
        distance
    })
}

/// The winding number that [`WindingNumbers::at`](crate::WindingNumbers::at) approximates.
pub fn winding_number(mesh: &Mesh, point: impl Into<Vec3>) -> f64 {
    let point = point.into();
    if !point.is_finite() {
        return 0.0;
    }
    let angles = with_area(mesh)
        .map(|(_, corners)| solid_angle(corners.map(|corner| corner.as_dvec3()), point.as_dvec3()));
    angles.sum::<f64>() / (4.0 * PI)
}

/// As [`triangles_in_box`](crate::triangles_in_box).
pub fn triangles_in_box(mesh: &Mesh, bounds: &Aabb, out: &mut Vec<u32>) {
    out.clear();
    if is_box(bounds) {
        let met = with_area(mesh).filter(|(_, corners)| meets_box(*corners, bounds));
        out.extend(met.map(|(triangle, _)| triangle));
    }
}

/// As [`triangles_in_sphere`](crate::triangles_in_sphere).
pub fn triangles_in_sphere(mesh: &Mesh, center: impl Into<Vec3>, radius: f32, out: &mut Vec<u32>) {
    out.clear();
    let center = center.into();
    let radius = f64::from(radius);
    if center.is_finite() && radius >= 0.0 {
        let met = with_area(mesh)
            .filter(|(_, corners)| Foot::new(center, *corners).squared <= radius * radius);
        out.extend(met.map(|(triangle, _)| triangle));
    }
}

/// The triangles that have an area.
fn with_area(mesh: &Mesh) -> impl Iterator<Item = (u32, [Vec3; 3])> + '_ {
    let numbered = (0..).zip(mesh.triangles());
    let all = numbered.map(|(triangle, _)| (triangle, mesh.corners(triangle)));
    all.filter(|(_, corners)| !kd_core::is_zero_area(*corners))
}
