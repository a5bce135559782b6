//! Where to divide triangles as objects: between bins of their centres, by the surface area heuristic (I. Wald, *On fast
//! Construction of SAH-based Bounding Volume Hierarchies*, 2007).

use glam::Vec3A;
use kd_core::Axis;

use super::box_tree::Item;

/// Parts of an axis, between which a division may be.
const BINS: usize = 16;

/// A division of items by the bins of their centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectSplit {
    pub(crate) axis: Axis,
    bins: Bins,
    /// The first bin of the upper part.
    first_upper: usize,
    cost: f32,
}

/// Equal parts of an axis, measured in twice the coordinates of centres.
#[derive(Clone, Copy, Debug)]
struct Bins {
    start: f32,
    per_unit: f32,
}

/// Items and the box around them.
#[derive(Clone, Copy, Debug)]
struct Group {
    min: Vec3A,
    max: Vec3A,
    count: u32,
}

impl Group {
    const NOTHING: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
        count: 0,
    };

    fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.count += other.count;
    }

    /// Half the area of the box for each item.
    fn cost(&self) -> f32 {
        let d = self.max - self.min;
        if self.count == 0 {
            0.0
        } else {
            (d.x * d.y + d.y * d.z + d.z * d.x) * self.count as f32
        }
    }
}

impl Bins {
    /// Which bin an item is in.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "casts to integers saturate, and NaN goes to 0"
    )]
    fn of(self, item: &Item, along: usize) -> usize {
        let center = item.min[along] + item.max[along];
        (((center - self.start) * self.per_unit) as usize).min(BINS - 1)
    }
}

impl ObjectSplit {
    /// The division of least cost; `None` where all centres are in one place.
    pub(crate) fn best(items: &[Item]) -> Option<Self> {
        let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (least, most) = items.iter().fold(nothing, |(least, most), item| {
            let center = item.min + item.max;
            (least.min(center), most.max(center))
        });
        let mut best: Option<Self> = None;
        for axis in Axis::ALL {
            let (start, end) = (least[axis.index()], most[axis.index()]);
            let per_unit = BINS as f32 / (end - start);
            if start < end && per_unit.is_finite() {
                let split = Self::best_on(items, axis, Bins { start, per_unit });
                if best.is_none_or(|best| split.cost < best.cost) {
                    best = Some(split);
                }
            }
        }
        best
    }

    /// The best on an axis. The first and the last bin are never empty, so neither part is.
    fn best_on(items: &[Item], axis: Axis, bins: Bins) -> Self {
        let mut groups = [Group::NOTHING; BINS];
        for item in items {
            groups[bins.of(item, axis.index())].add(&Group {
                min: item.min,
                max: item.max,
                count: 1,
            });
        }
        let mut upper_costs = [0.0; BINS];
        let mut upper = Group::NOTHING;
        for (cost, group) in upper_costs.iter_mut().zip(&groups).skip(1).rev() {
            upper.add(group);
            *cost = upper.cost();
        }
        let mut best = Self {
            axis,
            bins,
            first_upper: 1,
            cost: f32::INFINITY,
        };
        let mut lower = Group::NOTHING;
        for (last_lower, group) in groups[..BINS - 1].iter().enumerate() {
            lower.add(group);
            let first_upper = last_lower + 1;
            let cost = lower.cost() + upper_costs[first_upper];
            if cost < best.cost {
                (best.first_upper, best.cost) = (first_upper, cost);
            }
        }
        best
    }

    /// Moves the lower part to the front, and tells how many items that are: some, and not all.
    pub(crate) fn apply(&self, items: &mut [Item]) -> usize {
        let mut lower = 0;
        for at in 0..items.len() {
            if self.bins.of(&items[at], self.axis.index()) < self.first_upper {
                items.swap(at, lower);
                lower += 1;
            }
        }
        lower
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn cube_at(center: Vec3, triangle: u32) -> Item {
        let bounds = Aabb {
            min: center - 0.5,
            max: center + 0.5,
        };
        Item::within(bounds, triangle)
    }

    #[test]
    fn two_heaps_are_told_apart() {
        for axis in Axis::ALL {
            let mut items: Vec<Item> = (0..40)
                .map(|i| {
                    let mut center = Vec3::new(0.1, 0.2, 0.3) * (i % 7) as f32;
                    center[axis.index()] += if i % 3 == 0 { 50.0 } else { 0.0 };
                    cube_at(center, i)
                })
                .collect();
            let split = ObjectSplit::best(&items).expect("they differ");
            assert_eq!(split.axis, axis, "the axis they are apart on");
            let middle = split.apply(&mut items);
            assert_eq!(middle, 26, "all of the nearer heap");
            assert!(
                items[..middle].iter().all(|item| item.triangle % 3 != 0),
                "{items:?}"
            );
        }
    }

    #[test]
    fn one_place_is_not_divided_and_huge_ones_are() {
        let pile: Vec<Item> = (0..9).map(|i| cube_at(Vec3::ONE, i)).collect();
        assert!(ObjectSplit::best(&pile).is_none(), "one place");
        let mut far: Vec<Item> = (0..9)
            .map(|i| cube_at(Vec3::X * 1e30 * i as f32, i))
            .collect();
        let split = ObjectSplit::best(&far).expect("areas overflow, places do not");
        let middle = split.apply(&mut far);
        assert!((1..9).contains(&middle), "{middle} of 9");
    }
}
