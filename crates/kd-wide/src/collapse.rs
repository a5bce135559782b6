//! Collapse: which nodes of the binary tree of boxes become wide nodes, and which become leaves. Dynamic programming over the
//! surface area heuristic (after H. Ylitie, T. Karras, S. Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs*, 2017,
//! section 3.2).
//!
//! Each subtree has a least cost as at most one, two … eight children of the wide node above it. As one child it is a leaf,
//! or a wide node with up to eight children of its own. As more, its two subtrees share them.

use kd_simd::LANES;

use crate::node::WIDTH;

/// Cost of a wide node that a ray visits.
const NODE: f32 = 1.0;
/// Cost of a block of triangles that a ray visits.
const BLOCK: f32 = 0.5;
/// The largest number of blocks of a leaf, unless its triangles cannot be divided.
const MOST_BLOCKS: usize = 3;
/// The largest number of triangles of a leaf, unless they cannot be divided.
pub(crate) const MOST_TRIANGLES: usize = MOST_BLOCKS * LANES;

/// The least costs of a subtree as at most one child, two, and so on.
pub(crate) type Costs = [f32; WIDTH];

/// How a subtree becomes children at least cost.
///
/// ```text
/// bits 0..21    for 2 to 8 children, how many of them the lower subtree gets, three bits each
/// bits 21..28   for 2 to 8 children, whether one fewer is as good
/// bit 28        whether a single child is a leaf
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Choice(u32);

impl Choice {
    const LEAF: u32 = 1 << 28;

    /// How many of 2 to 8 children the lower subtree gets.
    pub(crate) fn lower(self, children: usize) -> usize {
        (self.0 >> (3 * (children - 2)) & 7) as usize
    }

    fn is_fewer_as_good(self, children: usize) -> bool {
        self.0 >> (21 + children - 2) & 1 != 0
    }

    /// Whether it is a leaf, as a single child.
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The fewest children that cost no more than `children` do.
    pub(crate) fn best(self, mut children: usize) -> usize {
        while children > 1 && self.is_fewer_as_good(children) {
            children -= 1;
        }
        children
    }
}

/// The cost of a visit: of a leaf with this number of blocks, or of a node, for 0.
pub(crate) fn visit(blocks: usize) -> f32 {
    if blocks == 0 {
        NODE
    } else {
        BLOCK * blocks as f32
    }
}

fn leaf_cost(area: f32, triangles: usize) -> f32 {
    area * BLOCK * triangles.div_ceil(LANES) as f32
}

/// The choice and costs of a leaf of this area.
pub(crate) fn leaf(area: f32, triangles: usize) -> (Choice, Costs) {
    let always_one = 0b111_1111 << 21;
    (
        Choice(Choice::LEAF | always_one),
        [leaf_cost(area, triangles); WIDTH],
    )
}

/// The choice and costs of a finished subtree: a single child that costs nothing here.
pub(crate) fn link() -> (Choice, Costs) {
    leaf(0.0, 0)
}

/// The choice and costs of a subtree of this area and number of triangles, from those of its two subtrees. It may become a
/// leaf if it has at most `most_in_leaf` triangles.
pub(crate) fn split(
    area: f32,
    triangles: usize,
    most_in_leaf: usize,
    subtrees: &[Costs; 2],
) -> (Choice, Costs) {
    let [lower, upper] = subtrees;
    let mut choice = 0;
    // At exactly this number of children; index 0 is unused.
    let mut shared = [f32::INFINITY; WIDTH];
    for children in 2..=WIDTH {
        let mut best = (f32::INFINITY, 0);
        for of_lower in 1..children {
            let cost = lower[of_lower - 1] + upper[children - of_lower - 1];
            if cost < best.0 {
                best = (cost, of_lower);
            }
        }
        shared[children - 1] = best.0;
        // Costs that are not finite leave it at 0, which would drop the lower subtree.
        let of_lower = u32::try_from(best.1.max(1)).unwrap_or(1);
        choice |= of_lower << (3 * (children - 2));
    }
    let mut costs = shared;
    costs[0] = area * NODE + shared[WIDTH - 1];
    let as_leaf = leaf_cost(area, triangles);
    if as_leaf <= costs[0] && triangles <= most_in_leaf {
        costs[0] = as_leaf;
        choice |= Choice::LEAF;
    }
    for children in 2..=WIDTH {
        if costs[children - 2] <= shared[children - 1] {
            costs[children - 1] = costs[children - 2];
            choice |= 1 << (21 + children - 2);
        }
    }
    (Choice(choice), costs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least cost of equal leaves in a balanced tree, by exhaustive search.
    fn exhaustive(leaves: usize, children: usize, area: &dyn Fn(usize) -> f32) -> f32 {
        let as_leaf = leaf_cost(area(leaves), 8 * leaves);
        if leaves == 1 {
            return as_leaf;
        }
        let half = leaves / 2;
        let mut least = f32::INFINITY;
        if children > 1 {
            for lower in 1..children {
                let cost = exhaustive(half, lower, area)
                    + exhaustive(leaves - half, children - lower, area);
                least = least.min(cost);
            }
        }
        let as_node = (1..WIDTH)
            .map(|lower| {
                exhaustive(half, lower, area) + exhaustive(leaves - half, WIDTH - lower, area)
            })
            .fold(f32::INFINITY, f32::min);
        least = least.min(area(leaves) * NODE + as_node);
        if leaves <= MOST_BLOCKS {
            least = least.min(as_leaf);
        }
        least
    }

    #[test]
    fn costs_are_the_least_there_are() {
        fn costs(leaves: usize, area: &dyn Fn(usize) -> f32) -> Costs {
            if leaves == 1 {
                return leaf(area(1), 8).1;
            }
            let parts = [costs(leaves / 2, area), costs(leaves - leaves / 2, area)];
            split(area(leaves), 8 * leaves, MOST_TRIANGLES, &parts).1
        }
        for (name, area) in [
            ("flat", &(|n: usize| n as f32) as &dyn Fn(usize) -> f32),
            ("solid", &|n| (n as f32).powf(2.0 / 3.0)),
            ("equal", &|_| 1.0),
        ] {
            for leaves in 1..=9 {
                let found = costs(leaves, area);
                for children in 1..=WIDTH {
                    let expected = exhaustive(leaves, children, area);
                    let cost = found[children - 1];
                    assert!(
                        (cost - expected).abs() <= 1e-5 * expected,
                        "{name}, {leaves} leaves as {children} children: {cost}, not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn choices_add_up() {
        let parts = [leaf(0.4, 8).1, leaf(0.5, 30).1];
        let (choice, costs) = split(1.0, 38, MOST_TRIANGLES, &parts);
        assert!(!choice.is_leaf(), "too many triangles");
        for children in 2..=WIDTH {
            let lower = choice.lower(children);
            assert!(
                (1..children).contains(&lower),
                "each side gets some of {children}"
            );
            assert_eq!(choice.best(children), 2, "leaves need one each");
        }
        assert_eq!(costs[1], parts[0][0] + parts[1][0], "side by side");
        let (choice, _) = split(1.0, 8, MOST_TRIANGLES, &[leaf(0.9, 4).1, leaf(0.9, 4).1]);
        assert!(
            choice.is_leaf() && choice.best(8) == 1,
            "one block is cheaper than two"
        );
        let endless = split(
            f32::INFINITY,
            40,
            MOST_TRIANGLES,
            &[[f32::INFINITY; WIDTH], [f32::NAN; WIDTH]],
        )
        .0;
        assert_eq!(endless.lower(8), 1, "still each side gets some");
    }
}
