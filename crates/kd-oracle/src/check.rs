//! Whether a ray is answered as by testing every triangle.

use kd_core::{Hit, Mesh, Ray};
use kd_trace::{RayQuery, brute_force};

/// The queries that are checked, of anything with [`RayQuery`], or of an adapter in a test.
pub trait Answers {
    /// The closest hit.
    fn closest(&self, ray: &Ray) -> Option<Hit>;
    /// Whether there is one.
    fn any(&self, ray: &Ray) -> bool;
    /// The first `max` hits in order; what is in `out` goes.
    fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>);
    /// Axis and place of planes that it divides space by, if it has any: some rays begin or run in them.
    fn planes(&self) -> Vec<(usize, f32)> {
        Vec::new()
    }
}

impl<Q: RayQuery<Hit = Hit>> Answers for Q {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.intersect(ray)
    }

    fn any(&self, ray: &Ray) -> bool {
        self.occluded(ray)
    }

    fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.hits(ray, max, out);
    }
}

/// Asks every query about a ray, of each structure, and expects what brute force returns. Returns the number of hits.
///
/// # Panics
///
/// If an answer is wrong. The message holds the ray as Rust source.
#[track_caller]
pub fn check(scene: &str, mesh: &Mesh, structures: &[&dyn Answers], ray: &Ray) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    let mut found = Vec::new();
    for (number, structure) in structures.iter().enumerate() {
        let place = |way: &str| format!("{scene}, structure {number}, {way}: {}", source(ray));
        let closest = structure.closest(ray);
        assert_eq!(closest, expected.first().copied(), "{}", place("closest"));
        let any = structure.any(ray);
        assert_eq!(any, !expected.is_empty(), "{}", place("any"));
        for max in [2, usize::MAX] {
            structure.first(ray, max, &mut found);
            let first = &expected[..max.min(expected.len())];
            assert_eq!(found, first, "{}", place("first hits"));
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

    /// Answers as brute force does, but for what is wrong with it.
    struct Wrong<'a> {
        mesh: &'a Mesh,
        flaw: Flaw,
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        None,
        Closest,
        Any,
        First,
    }

    impl Answers for Wrong<'_> {
        fn closest(&self, ray: &Ray) -> Option<Hit> {
            let hit = brute_force::intersect(self.mesh, ray);
            hit.filter(|_| self.flaw != Flaw::Closest)
        }
        fn any(&self, ray: &Ray) -> bool {
            brute_force::occluded(self.mesh, ray) && self.flaw != Flaw::Any
        }
        fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
            let max = if self.flaw == Flaw::First {
                max - 1
            } else {
                max
            };
            brute_force::hits(self.mesh, ray, max, out);
        }
    }

    #[test]
    fn wrong_answers_are_noticed() {
        let mesh = crate::scenes::sphere(1);
        let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
        for flaw in [Flaw::None, Flaw::Closest, Flaw::Any, Flaw::First] {
            let asked = std::panic::catch_unwind(|| {
                check("sphere", &mesh, &[&Wrong { mesh: &mesh, flaw }], &ray)
            });
            assert_eq!(asked.is_ok(), flaw == Flaw::None, "only if right");
        }
    }
}
