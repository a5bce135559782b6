//! The comparison of a ray's answers with brute force.

use kd_core::{Hit, Mesh, Ray};
use kd_trace::{RayQuery, brute_force};

/// Compares every query of a ray with brute force, in each structure. Returns the number of hits.
///
/// # Panics
///
/// If an answer is wrong. The message holds the ray as Rust source.
#[track_caller]
pub fn check(
    scene: &str,
    mesh: &Mesh,
    structures: &[&dyn RayQuery<Hit = Hit>],
    ray: &Ray,
) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    let mut found = Vec::new();
    for (number, structure) in structures.iter().enumerate() {
        let place = |query: &str| format!("{scene}, structure {number}, {query}: {}", source(ray));
        let closest = structure.intersect(ray);
        assert_eq!(closest, expected.first().copied(), "{}", place("intersect"));
        let occluded = structure.occluded(ray);
        assert_eq!(occluded, !expected.is_empty(), "{}", place("occluded"));
        for max in [2, usize::MAX] {
            structure.hits(ray, max, &mut found);
            let first = &expected[..max.min(expected.len())];
            assert_eq!(found, first, "{}", place("hits"));
        }
    }
    expected.len()
}

/// The ray as Rust source, to paste into a test.
pub fn source(ray: &Ray) -> String {
    let number = |x: f32| {
        if x.is_finite() {
            format!("{x:?}")
        } else {
            format!("f32::from_bits({:#x})", x.to_bits())
        }
    };
    let list = |v: glam::Vec3| v.to_array().map(number).join(", ");
    format!(
        "Ray::new([{}], [{}]).with_range({}, {})",
        list(ray.origin),
        list(ray.direction),
        number(ray.t_min),
        number(ray.t_max)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force with a flaw.
    struct Wrong<'a> {
        mesh: &'a Mesh,
        flaw: Flaw,
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        None,
        Intersect,
        Occluded,
        Hits,
    }

    impl RayQuery for Wrong<'_> {
        type Hit = Hit;

        fn intersect(&self, ray: &Ray) -> Option<Hit> {
            let hit = brute_force::intersect(self.mesh, ray);
            hit.filter(|_| self.flaw != Flaw::Intersect)
        }

        fn occluded(&self, ray: &Ray) -> bool {
            brute_force::occluded(self.mesh, ray) && self.flaw != Flaw::Occluded
        }

        fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
            let max = max - usize::from(self.flaw == Flaw::Hits);
            brute_force::hits(self.mesh, ray, max, out);
        }
    }

    #[test]
    fn wrong_answers_are_noticed() {
        let mesh = crate::scenes::sphere(1);
        let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
        for flaw in [Flaw::None, Flaw::Intersect, Flaw::Occluded, Flaw::Hits] {
            let checked = std::panic::catch_unwind(|| {
                check("sphere", &mesh, &[&Wrong { mesh: &mesh, flaw }], &ray)
            });
            assert_eq!(checked.is_ok(), flaw == Flaw::None, "only without a flaw");
        }
    }
}
