//! Clusters of primitives whose boxes overlap little (Eleftheriades 2010, chapter 5, which names them as future work).
//!
//! An object split by centers divides the primitives in two. It takes the plane with the least sum over both sides of half
//! area times number of primitives. The division repeats until each cluster is small enough.

use kd_core::{Aabb, Axis, PrimSource, Slot};

/// The number of bins per axis, one more than that of candidate planes.
const BINS: usize = 16;

/// A primitive and its box.
#[derive(Clone, Copy, Debug)]
struct BoundedPrim {
    slot: Slot,
    bounds: Aabb,
}

/// Primitives that are close together, and the box around them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cluster {
    pub(crate) slots: Vec<Slot>,
    pub(crate) bounds: Aabb,
}

/// Divides primitives into clusters of at most `max_size`, or more if their centers are equal.
pub(crate) fn clusters(slots: &[Slot], source: &impl PrimSource, max_size: usize) -> Vec<Cluster> {
    let boxed = slots.iter().map(|slot| BoundedPrim {
        slot: *slot,
        bounds: source.bounds(slot.0),
    });
    let mut boxed: Vec<BoundedPrim> = boxed.collect();
    let mut to = Vec::new();
    divide(&mut boxed, max_size.max(1), &mut to);
    to
}

/// Appends the clusters of `primitives` to `to`.
fn divide(primitives: &mut [BoundedPrim], max_size: usize, to: &mut Vec<Cluster>) {
    let plane = (primitives.len() > max_size)
        .then(|| best_plane(primitives))
        .flatten();
    let Some((axis, position)) = plane else {
        if !primitives.is_empty() {
            to.push(Cluster {
                slots: primitives.iter().map(|one| one.slot).collect(),
                bounds: around(primitives),
            });
        }
        return;
    };
    // A stable sort, so that clusters do not depend on its implementation.
    primitives.sort_by_key(|one| one.bounds.center()[axis.index()] >= position);
    let is_below = |one: &BoundedPrim| one.bounds.center()[axis.index()] < position;
    let middle = primitives.partition_point(is_below);
    let (below, above) = primitives.split_at_mut(middle);
    divide(below, max_size, to);
    divide(above, max_size, to);
}

/// The cheapest plane between centers; `None` if no plane separates two of them.
fn best_plane(primitives: &[BoundedPrim]) -> Option<(Axis, f32)> {
    let centers = Aabb::around(primitives.iter().map(|one| one.bounds.center()));
    let planes = Axis::ALL.into_iter().flat_map(|axis| {
        let [min, max] = [centers.min, centers.max].map(|corner| corner[axis.index()]);
        planes(primitives, axis, [min, max])
            .into_iter()
            .map(move |(cost, position)| (cost, axis, position))
    });
    let best = planes.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, axis, position)| (axis, position))
}

/// The cost and position of each candidate plane that has centers on both sides.
fn planes(primitives: &[BoundedPrim], axis: Axis, [min, max]: [f32; 2]) -> Vec<(f64, f32)> {
    // Rounding may make two positions equal.
    let positions: [f32; BINS - 1] = std::array::from_fn(|i| {
        let share = (i + 1) as f32 / BINS as f32;
        min * (1.0 - share) + max * share
    });
    let mut bins = [(0_usize, Aabb::EMPTY); BINS];
    for one in primitives {
        let center = one.bounds.center()[axis.index()];
        let bin = positions.partition_point(|position| *position <= center);
        bins[bin].0 += 1;
        bins[bin].1 = bins[bin].1.union(&one.bounds);
    }
    let cost = |bins: &[(usize, Aabb)]| {
        let nothing = (0, Aabb::EMPTY);
        let (count, bounds) = bins.iter().fold(nothing, |(count, bounds), bin| {
            (count + bin.0, bounds.union(&bin.1))
        });
        (count > 0).then(|| count as f64 * bounds.half_area())
    };
    let planes = positions.iter().zip(1..).filter_map(|(position, below)| {
        let cost = cost(&bins[..below])? + cost(&bins[below..])?;
        Some((cost, *position))
    });
    planes.collect()
}

fn around(primitives: &[BoundedPrim]) -> Aabb {
    let boxes = primitives.iter().map(|one| one.bounds);
    boxes.fold(Aabb::EMPTY, |around, one| around.union(&one))
}

#[cfg(test)]
mod tests {
    use kd_core::Mesh;
    use kd_scene::Spd;

    use super::*;

    #[test]
    fn every_primitive_is_in_one_small_cluster() {
        let mesh = Spd::Gears.generate(1).expect("small").mesh;
        let count = u32::try_from(mesh.len()).expect("small");
        let slots: Vec<Slot> = (0..count).map(Slot).collect();
        for max_size in [1, 50, usize::MAX] {
            let clusters = clusters(&slots, &mesh, max_size);
            let mut all = Vec::new();
            for Cluster { slots, bounds } in &clusters {
                let boxes = slots.iter().map(|slot| PrimSource::bounds(&mesh, slot.0));
                let around = boxes.fold(Aabb::EMPTY, |around, one| around.union(&one));
                assert_eq!(around, *bounds, "{max_size}: the box around its primitives");
                let centers = slots
                    .iter()
                    .map(|slot| PrimSource::bounds(&mesh, slot.0).center());
                let centers = Aabb::around(centers);
                assert!(
                    slots.len() <= max_size || centers.extent().max_element() == 0.0,
                    "{max_size}: {} primitives with centers in {centers:?}",
                    slots.len()
                );
                all.extend_from_slice(slots);
            }
            all.sort_unstable();
            assert_eq!(all, slots, "{max_size}: each primitive once");
        }
    }

    #[test]
    fn separate_groups_become_separate_clusters() {
        // Triangles that alternate between two groups, far apart.
        let corner = |i: u32| [(i % 2 * 100) as f32, i as f32 * 0.1, 0.0];
        let positions = (0..40).flat_map(|i| {
            let [x, y, z] = corner(i);
            [[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]]
        });
        let triangles = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions.collect(), triangles).expect("valid");
        let slots: Vec<Slot> = (0..40).map(Slot).collect();
        let clusters = clusters(&slots, &mesh, 20);
        assert_eq!(clusters.len(), 2, "{clusters:?}");
        let overlap = clusters[0].bounds.intersection(&clusters[1].bounds);
        assert!(overlap.is_empty(), "{overlap:?}");
    }

    #[test]
    fn primitives_of_equal_center_form_one_cluster() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2]; 9]).expect("valid");
        let slots: Vec<Slot> = (0..9).map(Slot).collect();
        assert_eq!(clusters(&slots, &mesh, 4).len(), 1, "equal centers");
        assert_eq!(clusters(&[], &mesh, 4), [], "no primitives");
    }
}
