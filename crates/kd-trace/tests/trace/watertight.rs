//! What lies between two triangles belongs to both.

use glam::Vec3;
use kd_core::Ray;
use kd_oracle::watertight::points;

use crate::check::source;
use crate::scenes;

/// Both triangles at an edge report the same place.
#[test]
fn neighbors_agree_about_their_edge() {
    let mesh = scenes::sphere(2);
    let mut hits = Vec::new();
    let (mut shared, mut equal) = (0, 0);
    for origin in points(0.9) {
        for &[i, j, _] in mesh.triangles() {
            let [a, b] = [i, j].map(|i| Vec3::from(mesh.positions()[i as usize]));
            let ray = Ray::new(origin, a.midpoint(b) - origin);
            kd_trace::brute_force::hits(&mesh, &ray, usize::MAX, &mut hits);
            if let [first, second] = hits[..] {
                shared += 1;
                equal += usize::from(first.t == second.t);
                assert!(
                    (first.t - second.t).abs() <= 4.0 * f32::EPSILON * first.t,
                    "{} and {}: {}",
                    first.t,
                    second.t,
                    source(&ray)
                );
                if first.t == second.t {
                    assert!(first.triangle < second.triangle, "{}", source(&ray));
                }
            }
        }
    }
    assert!(shared > 100, "only {shared} rays met both triangles");
    assert!(2 * equal > shared, "{equal} of {shared} at the same t");
}
