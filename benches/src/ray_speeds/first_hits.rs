//! The first hits of rays: ours, the baselines, and checks of both.

use kd::{Hit, Ray};
use kd_rivals::FIRST;
use kd_trace::RayQuery;

use crate::check::are_close;
use crate::measure::{Pairs, Repeats, in_sure_pairs};

/// The distances of the first hits of a ray, in order; ∞ for missing ones.
pub(super) type Distances = [f32; FIRST];

/// Times `own`, each time after `other`, and returns the hits of both, in that order.
pub(super) fn time(
    repeats: Repeats,
    rays: &[Ray],
    own: &dyn RayQuery<Hit = Hit>,
    other: &dyn RayQuery<Hit = Hit>,
) -> (Pairs, [Vec<Distances>; 2]) {
    let mut found = [(); 2].map(|()| vec![[f32::INFINITY; FIRST]; rays.len()]);
    let [by_own, by_other] = &mut found;
    let trace = |query: &dyn RayQuery<Hit = Hit>, all: &mut [Distances]| {
        let mut hits = Vec::with_capacity(FIRST);
        for (ray, distances) in rays.iter().zip(all) {
            query.hits(ray, FIRST, &mut hits);
            *distances = [f32::INFINITY; FIRST];
            for (distance, hit) in distances.iter_mut().zip(&hits) {
                *distance = hit.t;
            }
        }
    };
    let pairs = in_sure_pairs(repeats, || trace(other, by_other), || trace(own, by_own));
    (pairs, found)
}

/// The finite distances.
fn known(distances: &Distances) -> &[f32] {
    let count = distances.iter().take_while(|t| **t < f32::INFINITY).count();
    &distances[..count]
}

/// Whether hits equal those of restarted rays, to the bit, except several at one distance.
pub(super) fn are_those_of_restarted(hits: &Distances, restarted: &Distances) -> bool {
    let mut different = known(hits).to_vec();
    different.dedup();
    let restarted = known(restarted);
    // Fewer hits than requested must be all hits.
    let is_cut_off = known(hits).len() == FIRST;
    restarted.starts_with(&different) && (is_cut_off || restarted.len() == different.len())
}

/// Whether a rival, whose triangle test is another one, finds the same hits.
pub(super) fn agree(ours: &Distances, theirs: &Distances) -> bool {
    let (ours, theirs) = (known(ours), known(theirs));
    let mut pairs = ours.iter().zip(theirs);
    ours.len() == theirs.len() && pairs.all(|(a, b)| are_close(*a, *b))
}

#[cfg(test)]
mod tests {
    use kd::{BuildOptions, KdTree, Mesh};
    use kd_rivals::Restarting;

    use super::*;

    const END: f32 = f32::INFINITY;

    /// Walls across x at each of these; every triangle of a wall is large.
    fn walls(at: &[f32]) -> KdTree {
        let corners = |x: f32| [[x, -9.0, -9.0], [x, 9.0, -9.0], [x, 0.0, 9.0]];
        let triangles = (0..).step_by(3).take(at.len());
        let mesh = Mesh::new(
            at.iter().copied().flat_map(corners).collect(),
            triangles
                .map(|first| [first, first + 1, first + 2])
                .collect(),
        );
        KdTree::build(mesh.expect("valid"), &BuildOptions::default()).expect("small")
    }

    #[test]
    fn ours_and_restarted_rays_see_the_same_walls() {
        let tree = walls(&[3.0, 1.0, 2.0, 2.0, 5.0, 4.0]);
        let rays = [
            Ray::new([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            Ray::new([3.5, 0.0, 0.0], [1.0, 0.0, 0.0]),
            Ray::new([0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
        ];
        let (pairs, [ours, restarted]) = time(Repeats::all(1), &rays, &tree, &Restarting(&tree));
        assert_eq!((pairs.own.len(), pairs.baseline.len()), (1, 1), "timed");
        assert_eq!(
            ours,
            [[1.0, 2.0, 2.0, 3.0], [0.5, 1.5, END, END], [END; FIRST]],
            "each triangle once"
        );
        assert_eq!(restarted[0], [1.0, 2.0, 3.0, 4.0], "one at each distance");
        assert_eq!(restarted[1..], ours[1..], "no two at one distance");
        for (ours, restarted) in ours.iter().zip(&restarted) {
            assert!(
                are_those_of_restarted(ours, restarted),
                "{ours:?} {restarted:?}"
            );
        }
    }

    #[test]
    fn hits_that_restarted_rays_do_not_find_are_wrong() {
        let restarted = [1.0, 2.0, END, END];
        for (hits, is_right) in [
            ([1.0, 2.0, END, END], true),
            ([1.0, 1.0, 2.0, END], true),
            ([1.0, 1.0, 1.0, 1.0], true),
            ([1.0, END, END, END], false),
            ([1.0, 2.0_f32.next_up(), END, END], false),
            ([1.0, 2.0, 3.0, END], false),
            ([END; FIRST], false),
        ] {
            assert_eq!(
                are_those_of_restarted(&hits, &restarted),
                is_right,
                "{hits:?}"
            );
        }
    }

    #[test]
    fn rivals_may_be_a_little_off_but_not_miss() {
        let ours = [1.0, 2.0, END, END];
        assert!(agree(&ours, &[1.0001, 2.0, END, END]), "near");
        assert!(!agree(&ours, &[1.01, 2.0, END, END]), "off");
        assert!(!agree(&ours, &[1.0, END, END, END]), "one is missing");
        assert!(agree(&[END; FIRST], &[END; FIRST]), "both see nothing");
    }
}
