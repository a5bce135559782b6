//! What decides about hits, against other mathematics: Möller and Trumbore 1997, in f64, with an honest error bar.

use glam::{DVec3, Vec3};
use kd_core::{Mesh, Ray};
use kd_trace::brute_force;

use crate::check::{self, source};
use crate::rng::Rng;
use crate::scenes::{self, Soup};

/// A triangle as the reference sees it.
struct Reference {
    t: f64,
    u: f64,
    v: f64,
    /// How far inside the ray passes, as seen along it, as a fraction of the distance to the furthest corner.
    margin: f64,
}

/// Line against triangle. `None` for a triangle of which the ray sees so little that f64 is not sure of anything, or
/// that rounding its corners may turn over.
fn reference(corners: [Vec3; 3], ray: &Ray) -> Option<Reference> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (ab, ac, to_origin) = (b - a, c - a, origin - a);
    let p = direction.cross(ac);
    let det = ab.dot(p);
    let u = to_origin.dot(p) / det;
    let q = to_origin.cross(ab);
    let v = direction.dot(q) / det;
    let t = ac.dot(q) / det;

    let unit = direction.normalize();
    let across = |e: DVec3| e.cross(unit).length();
    let largest = [a, b, c]
        .into_iter()
        .map(|p| across(p - origin))
        .fold(0.0, f64::max);
    let area = (ab.cross(ac).dot(unit)).abs();
    // The products above are of this size, and each is rounded.
    let longest = ab.length().max(ac.length()).max(to_origin.length());
    if area < 1e-7 * longest * longest || area < 1e-5 * largest * largest {
        return None;
    }
    let inside = [
        (1.0 - u - v, across(c - b)),
        (u, across(ac)),
        (v, across(ab)),
    ]
    .into_iter()
    .map(|(weight, edge)| weight * area / edge)
    .fold(f64::INFINITY, f64::min);
    Some(Reference {
        t,
        u,
        v,
        margin: inside / largest,
    })
}

/// How sure the reference must be. Corners are moved by 2⁻²⁶ of their distance from the ray, as it is measured on two
/// axes; seen along the ray either grows or shrinks by at most the root of 3.
const SURE: f64 = 1.0 / (1 << 24) as f64;

/// Compares one ray with all triangles. Gives how often the reference was sure of a hit, and how often not sure.
fn compare(name: &str, mesh: &Mesh, ray: &Ray) -> (usize, usize) {
    let (mut sure, mut unsure) = (0, 0);
    let mut hits = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut hits);
    let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for triangle in 0..u32::try_from(mesh.len()).expect("small") {
        let hit = hits.iter().find(|h| h.triangle == triangle);
        let place = || format!("{name}, triangle {triangle}, {}", source(ray));
        let Some(reference) = reference(mesh.corners(triangle), ray) else {
            continue;
        };
        let (t, margin) = (reference.t, reference.margin);
        if margin < -SURE {
            assert_eq!(hit, None, "outside by {margin}, {}", place());
        } else if margin < SURE {
            unsure += 1;
        } else {
            let bound = 1.5 * 2.0_f64.powi(-24) * t.abs() + 1e-12;
            if t - bound >= t_min && t + bound <= t_max {
                let hit = hit.unwrap_or_else(|| panic!("inside by {margin}, {}", place()));
                let close = |a: f32, b: f64, bound: f64| (f64::from(a) - b).abs() <= bound;
                assert!(close(hit.t, t, bound), "{hit:?}, not {t}, {}", place());
                let are_close = close(hit.u, reference.u, 1e-7) && close(hit.v, reference.v, 1e-7);
                assert!(
                    are_close,
                    "{hit:?}, not {}, {}, {}",
                    reference.u,
                    reference.v,
                    place()
                );
                sure += 1;
            } else if t + bound < t_min || t - bound > t_max {
                assert_eq!(hit, None, "out of range at {t}, {}", place());
            }
        }
    }
    (sure, unsure)
}

/// Rays that are not bent by rounding in some other way: aimed anywhere from nearby, of ordinary length.
#[test]
fn hits_are_those_of_other_mathematics() {
    for (name, mesh) in scenes::all() {
        let mut rng = Rng(12);
        let bounds = mesh.bounds();
        let (mut sure, mut unsure) = (0, 0);
        for _ in 0..3000 {
            let mut point = || bounds.center() + 0.4 * rng.vec3() * bounds.extent();
            let (origin, target) = (point() + 0.1 * bounds.diagonal(), point());
            let (s, n) = compare(name, &mesh, &Ray::new(origin, target - origin));
            sure += s;
            unsure += n;
        }
        assert!(sure > 500, "{name}: sure of {sure} hits only");
        assert!(
            100 * unsure < sure,
            "{name}: sure of {sure} hits, not of {unsure}"
        );
    }
}

/// All the nasty rays: the reference may be unsure more often, but never contradicts.
#[test]
fn nasty_rays_are_not_contradicted() {
    for (name, mesh) in scenes::all() {
        let mut rays = check::rays(&mesh, &[], 13);
        let mut sure = 0;
        for _ in 0..3000 {
            let ray = rays.draw();
            // The reference's own error grows with the distance, and with t.
            let is_near =
                (ray.origin - mesh.bounds().center()).length() < 10.0 * mesh.bounds().diagonal();
            let is_ordinary = (1e-3..1e6).contains(&ray.direction.length());
            if is_near && is_ordinary {
                sure += compare(name, &mesh, &ray).0;
            }
        }
        assert!(sure > 500, "{name}: sure of {sure} hits only");
    }
}

/// A huge triangle does not blur the hits on it: rounding its corners to f32 would move them by 0.06, to 26 bits by 0.015.
#[test]
fn a_huge_floor_is_sharp() {
    let mut soup = Soup::default();
    soup.triangle([
        Vec3::new(-1e6, 0.0, -1e6),
        Vec3::new(1e6, 0.0, -1e6),
        Vec3::new(0.0, 0.0, 1e6),
    ]);
    let mesh = soup.mesh();
    let mut rng = Rng(14);
    for _ in 0..10_000 {
        let origin = rng.vec3() + 2.0 * Vec3::Y;
        let direction = rng.direction();
        if direction.y > -0.01 {
            continue;
        }
        let ray = Ray::new(origin, direction);
        let hit = brute_force::intersect(&mesh, &ray).expect("the floor is everywhere");
        let t = f64::from(-origin.y) / f64::from(direction.y);
        let error = (f64::from(hit.t) - t).abs() / t;
        assert!(error < 1e-7, "{hit:?}, not {t}: {}", source(&ray));
    }
}
