//! Checks of answers: a wrong answer is an error, never a fast result.

use kd::{Hit, Mesh, Ray};
use kd_trace::brute_force;
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::rays::RayKind;
use crate::record::hash_of_ids;

/// The relative error that is allowed in a rival's `t`.
const T_TOLERANCE: f32 = 1e-3;

/// Whether a rival's `t` equals ours within [`T_TOLERANCE`].
pub(crate) fn are_close(ours: f32, theirs: f32) -> bool {
    (ours - theirs).abs() <= T_TOLERANCE * ours.abs()
}

/// The answers of a structure to a list of rays.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Answers {
    Closest(Vec<Option<Hit>>),
    Any(Vec<bool>),
}

impl Answers {
    /// All misses.
    pub(crate) fn none(kind: RayKind, rays: usize) -> Self {
        if kind.is_any_hit() {
            Self::Any(vec![false; rays])
        } else {
            Self::Closest(vec![None; rays])
        }
    }

    pub(crate) fn hits(&self) -> usize {
        match self {
            Self::Closest(hits) => hits.iter().flatten().count(),
            Self::Any(hits) => hits.iter().filter(|hit| **hit).count(),
        }
    }

    /// The record's `hit_hash`.
    pub(crate) fn hash(&self) -> String {
        match self {
            Self::Closest(hits) => hash_of_ids(
                hits.iter()
                    .map(|hit| hit.map_or(u32::MAX, |hit| hit.triangle)),
            ),
            Self::Any(hits) => hash_of_ids(hits.iter().map(|hit| if *hit { 0 } else { u32::MAX })),
        }
    }

    /// The parts of an answer that are compared: hit or miss, and for a closest hit the triangle and the bits of t. The
    /// weights u and v follow from these.
    fn identity(&self, index: usize) -> Option<(u32, u32)> {
        match self {
            Self::Closest(hits) => hits[index].map(|hit| (hit.t.to_bits(), hit.triangle)),
            Self::Any(hits) => hits[index].then_some((0, 0)),
        }
    }

    /// The rays that the two answer differently.
    pub(crate) fn differences(&self, other: &Self) -> Vec<usize> {
        let count = match self {
            Self::Closest(hits) => hits.len(),
            Self::Any(hits) => hits.len(),
        };
        (0..count)
            .filter(|i| self.identity(*i) != other.identity(*i))
            .collect()
    }

    /// The rays that a rival, whose triangle test is another one, answers differently: hit or miss, and for closest hits
    /// `t` within [`T_TOLERANCE`].
    pub(crate) fn disagreements(&self, rival: &Self) -> Vec<usize> {
        let agree = |ours: &Option<Hit>, theirs: &Option<Hit>| match (ours, theirs) {
            (Some(a), Some(b)) => are_close(a.t, b.t),
            (None, None) => true,
            _ => false,
        };
        match (self, rival) {
            (Self::Closest(ours), Self::Closest(theirs)) => {
                let both = ours.iter().zip(theirs).enumerate();
                both.filter(|(_, (a, b))| !agree(a, b))
                    .map(|(i, _)| i)
                    .collect()
            }
            _ => self.differences(rival),
        }
    }
}

/// Answers to some rays of a list, found by testing every triangle.
#[derive(Debug)]
pub(crate) struct BruteForce {
    pub(crate) rays: Vec<usize>,
    answers: Answers,
}

impl BruteForce {
    /// Tests rays spread evenly over the list, as many as `tests` ray-triangle tests allow but at least `least`. Runs on all
    /// cores, since nothing is timed here.
    pub(crate) fn sample(
        mesh: &Mesh,
        kind: RayKind,
        rays: &[Ray],
        tests: usize,
        least: usize,
    ) -> Self {
        let wanted = (tests / mesh.len().max(1)).max(least).min(rays.len());
        let chosen: Vec<usize> = (0..wanted).map(|i| i * rays.len() / wanted).collect();
        let rays = chosen.par_iter().map(|ray| &rays[*ray]);
        let answers = if kind.is_any_hit() {
            Answers::Any(rays.map(|ray| brute_force::occluded(mesh, ray)).collect())
        } else {
            Answers::Closest(rays.map(|ray| brute_force::intersect(mesh, ray)).collect())
        };
        Self {
            rays: chosen,
            answers,
        }
    }

    /// The rays of the list that are answered differently here.
    pub(crate) fn differences(&self, answers: &Answers) -> Vec<usize> {
        let numbered = self.rays.iter().enumerate();
        numbered
            .filter(|(own, ray)| self.answers.identity(*own) != answers.identity(**ray))
            .map(|(_, ray)| *ray)
            .collect()
    }
}

/// A ray as Rust source, ready to be pasted into a test: floats print so that they read back the same.
pub(crate) fn as_source(ray: &Ray) -> String {
    let [origin, direction] = [ray.origin, ray.direction].map(|v| v.to_array());
    let end = if ray.t_max == f32::INFINITY {
        "f32::INFINITY".into()
    } else {
        format!("{:?}", ray.t_max)
    };
    format!(
        "Ray::new({origin:?}, {direction:?}).with_range({:?}, {end})",
        ray.t_min
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32, triangle: u32) -> Option<Hit> {
        Some(Hit {
            t,
            u: 0.0,
            v: 0.0,
            triangle,
        })
    }

    #[test]
    fn differences_are_hit_or_miss_triangle_and_bits_of_t() {
        let right = Answers::Closest(vec![hit(1.0, 3), None, hit(2.0, 4), hit(0.0, 5)]);
        let wrong = Answers::Closest(vec![
            hit(1.0_f32.next_up(), 3),
            hit(1.0, 1),
            hit(2.0, 5),
            hit(0.0, 5),
        ]);
        assert_eq!(
            right.differences(&wrong),
            [0, 1, 2],
            "three kinds of difference"
        );
        assert_eq!(right.differences(&right), [0; 0], "none with itself");
        let (right, wrong) = (
            Answers::Any(vec![true, false]),
            Answers::Any(vec![true, true]),
        );
        assert_eq!(right.differences(&wrong), [1], "any hit: hit or miss");
        assert_ne!(right.hash(), wrong.hash(), "the hash sees it too");
        assert_eq!((right.hits(), wrong.hits()), (1, 2), "counted");
    }

    #[test]
    fn brute_force_finds_wrong_answers() {
        let mesh = Mesh::new(
            vec![[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]],
            vec![[0, 1, 2]],
        )
        .expect("valid");
        let rays: Vec<Ray> = (0..100)
            .map(|i| Ray::new([0.0, 0.0, i as f32 - 50.0], [0.0, 0.0, 1.0]))
            .collect();
        for kind in [RayKind::Primary, RayKind::Shadow] {
            let sample = BruteForce::sample(&mesh, kind, &rays, 20, 16);
            assert_eq!(
                (sample.rays.len(), sample.rays[1]),
                (20, 5),
                "spread evenly"
            );
            let misses = Answers::none(kind, 100);
            // Rays 0, 5, ... 50 start before the triangle.
            assert_eq!(
                sample.differences(&misses).len(),
                11,
                "{kind:?}: all of these hit"
            );
        }
        assert_eq!(
            BruteForce::sample(&mesh, RayKind::Ao, &[], 20, 16).rays,
            [0; 0],
            "no rays, no answers"
        );
    }

    #[test]
    fn rays_print_as_source() {
        let ray = Ray::new([0.1, 2.0, 1e-9], [0.0, -1.0, 0.0]);
        let source = "Ray::new([0.1, 2.0, 1e-9], [0.0, -1.0, 0.0]).with_range(0.0, f32::INFINITY)";
        assert_eq!(as_source(&ray), source, "it compiles");
    }
}
