//! Merged trees compared with both meshes: the tree covers them, and rays get the answers of brute force.

use glam::Vec3;
use kd_core::{Aabb, Arena, Axis, CostModel, Mesh, Node, NodeIndex, Pair, Slot, Tree};
use kd_merge::{
    Census, MergeError, MergeOptions, Merged, Placed, bsp_merge, build_clusters, insert, partition,
    partition_trees,
};
use kd_sah::{BuildOptions, build};
use kd_scene::Spd;
use kd_trace::brute_force;
use proptest::prelude::*;

/// Two meshes, their trees in one arena, and one mesh of both whose triangle numbers are the slots of the arena.
struct Two {
    arena: Arena,
    trees: [NodeIndex; 2],
    census: Census,
    meshes: [Mesh; 2],
    both: Mesh,
}

impl Two {
    fn new(still: Mesh, moving: Mesh) -> Self {
        let count = |mesh: &Mesh| u32::try_from(mesh.len()).expect("small");
        let mut arena = Arena::new();
        let mut trees = [NodeIndex(0); 2];
        let mut slots = 0;
        for (root, mesh) in trees.iter_mut().zip([&still, &moving]) {
            let tree = build(mesh, &BuildOptions::best().with_threads(1)).expect("valid");
            *root = arena.append_tree(&tree, slots).expect("small");
            slots += count(mesh);
            arena.freeze(slots).expect("valid");
        }
        let mut census = Census::new();
        census.extend(&arena.nodes()[..trees[1].index()]);
        census.extend(arena.nodes());
        let first = u32::try_from(still.positions().len()).expect("small");
        let renumbered = moving.triangles().iter().map(|t| t.map(|i| i + first));
        let both = Mesh::new(
            [still.positions(), moving.positions()].concat(),
            still
                .triangles()
                .iter()
                .copied()
                .chain(renumbered)
                .collect(),
        );
        Self {
            arena,
            trees,
            census,
            meshes: [still, moving],
            both: both.expect("valid"),
        }
    }

    /// Both trees with their boxes.
    fn placed(&self) -> [Placed; 2] {
        [0, 1].map(|i| Placed {
            root: self.trees[i],
            bounds: self.meshes[i].bounds(),
        })
    }

    /// Builds clusters of `slots` and merges their trees with `trees`.
    fn merge_clusters(
        &self,
        arena: &mut Arena,
        slots: &[Slot],
        mut trees: Vec<Placed>,
        options: &MergeOptions,
    ) -> Result<Merged, MergeError> {
        trees.extend(build_clusters(arena, slots, &self.both, 100, options)?);
        arena.freeze(u32::try_from(self.both.len()).expect("small"))?;
        let mut census = self.census.clone();
        census.extend(arena.nodes());
        partition_trees(arena, &census, &trees, &self.both, options)
    }

    /// The slots of the moving mesh.
    fn moving(&self) -> Vec<Slot> {
        let first = self.meshes[0].len();
        let numbers = first..first + self.meshes[1].len();
        numbers
            .map(|i| Slot(u32::try_from(i).expect("small")))
            .collect()
    }

    /// Merges by `merge`, and checks that the tree covers both meshes and that the source trees are unchanged.
    #[track_caller]
    fn check(
        &self,
        name: &str,
        merge: impl Fn(&mut Arena, &Self) -> Result<Merged, MergeError>,
    ) -> (Merged, Tree) {
        let mut arena = self.arena.clone();
        let before = (arena.nodes().len(), arena.refs().len());
        let merged = merge(&mut arena, self).expect("merged");
        let slots = u32::try_from(self.both.len()).expect("small");
        arena.freeze(slots).expect("valid");
        assert_eq!(
            (&arena.nodes()[..before.0], &arena.refs()[..before.1]),
            (self.arena.nodes(), self.arena.refs()),
            "{name}: frozen nodes and references are unchanged"
        );
        let tree = Tree::from_arena(arena, merged.root, self.both.bounds(), CostModel::PACKED);
        let tree = tree.expect("valid");
        tree.check_coverage(&self.both)
            .unwrap_or_else(|missing| panic!("{name}: {missing}"));
        (merged, tree)
    }

    /// Compares `count` rays, aimed at both meshes in turn, with brute force.
    #[track_caller]
    fn trace(&self, name: &str, tree: &Tree, count: usize) {
        let mut rng = fastrand::Rng::with_seed(7);
        let bounds = self.both.bounds();
        let mut point = |within: &Aabb, size: f32| {
            let one = Vec3::new(rng.f32(), rng.f32(), rng.f32());
            within.center() + size * (one - 0.5) * within.extent()
        };
        let (mut hits, mut moving_hits) = (0, 0);
        let (mut all, mut expected) = (Vec::new(), Vec::new());
        for i in 0..count {
            let target = point(&self.meshes[i % 2].bounds(), 1.0);
            let origin = point(&bounds, 2.0);
            let ray = kd_core::Ray::new(origin, target - origin);
            let hit = brute_force::intersect(&self.both, &ray);
            assert_eq!(
                kd_trace::intersect(tree, &self.both, &ray),
                hit,
                "{name}: {ray:?}"
            );
            assert_eq!(
                kd_trace::occluded(tree, &self.both, &ray),
                hit.is_some(),
                "{name}: {ray:?}"
            );
            kd_trace::hits(tree, &self.both, &ray, 5, &mut all);
            brute_force::hits(&self.both, &ray, 5, &mut expected);
            assert_eq!(all, expected, "{name}: {ray:?}");
            hits += usize::from(hit.is_some());
            moving_hits +=
                usize::from(hit.is_some_and(|hit| hit.triangle as usize >= self.meshes[0].len()));
        }
        assert!(
            hits > count / 5 && moving_hits > 0,
            "{name}: {hits} hits, {moving_hits} of the moving mesh"
        );
    }
}

fn scene(spd: Spd, size: u32) -> Mesh {
    spd.generate(size).expect("small").mesh
}

/// A mesh scaled to a box of size `size` around `center`.
fn placed(mesh: &Mesh, center: Vec3, size: f32) -> Mesh {
    let bounds = mesh.bounds();
    let scale = size / bounds.extent().max_element();
    let to = |p: &[f32; 3]| (center + scale * (Vec3::from_array(*p) - bounds.center())).to_array();
    let positions = mesh.positions().iter().map(to).collect();
    Mesh::new(positions, mesh.triangles().to_vec()).expect("valid")
}

/// Balls and gears, from far apart to one inside the other.
fn overlaps() -> Vec<(&'static str, Two)> {
    let still = placed(&scene(Spd::Gears, 1), Vec3::ZERO, 2.0);
    let moving = scene(Spd::Balls, 1);
    [
        ("far apart", Vec3::new(9.0, 1.0, 0.5), 1.0),
        ("side by side", Vec3::new(1.5, 0.0, 0.0), 1.0),
        ("half inside", Vec3::new(1.0, 0.1, 0.2), 0.7),
        ("inside", Vec3::new(0.1, 0.2, -0.1), 0.4),
        ("around", Vec3::ZERO, 6.0),
    ]
    .map(|(name, center, size)| (name, Two::new(still.clone(), placed(&moving, center, size))))
    .into()
}

fn all_options() -> [MergeOptions; 3] {
    [
        MergeOptions::never_resplitting(),
        MergeOptions::default(),
        MergeOptions::resplitting(4, BuildOptions::best()),
    ]
}

#[test]
fn bsp_merge_covers_both_meshes() {
    for (name, two) in overlaps() {
        for options in all_options() {
            let (merged, tree) = two.check(name, |arena, two| {
                bsp_merge(arena, two.trees, &two.both, two.both.bounds(), &options)
            });
            two.trace(name, &tree, 150);
            assert!(merged.links > 0, "{name}: {merged:?}");
        }
    }
}

#[test]
fn insertion_covers_both_meshes() {
    for (name, two) in overlaps() {
        let moving = two.moving();
        for options in all_options() {
            let (merged, tree) = two.check(name, |arena, two| {
                let bounds = two.both.bounds();
                insert(arena, two.trees[0], &moving, &two.both, bounds, &options)
            });
            two.trace(name, &tree, 150);
            assert!(merged.links > 0, "{name}: {merged:?}");
        }
    }
}

#[test]
fn partition_trees_cover_both_meshes() {
    for (name, two) in overlaps() {
        for options in all_options() {
            let (merged, tree) = two.check(name, |arena, two| {
                partition_trees(arena, &two.census, &two.placed(), &two.both, &options)
            });
            two.trace(name, &tree, 150);
            let is_apart = name == "far apart" || name == "side by side";
            assert!(merged.links > 0, "{name}: {merged:?}");
            assert_eq!(merged.dissolved == 0, is_apart, "{name}: {merged:?}");
            assert!(!is_apart || merged.new_nodes < 20, "{name}: {merged:?}");
        }
    }
}

#[test]
fn partition_trees_accepts_any_number_of_trees() {
    let (_, two) = overlaps().remove(2);
    let [one, _] = two.placed();
    let mut arena = two.arena.clone();
    let options = MergeOptions::default();
    let mut partition = |trees: &[Placed]| {
        partition_trees(&mut arena, &two.census, trees, &two.both, &options).expect("merged")
    };
    let none = partition(&[]);
    assert_eq!((none.new_nodes, none.links), (0, 0), "an empty leaf");
    let alone = partition(&[one]);
    assert_eq!((alone.new_nodes, alone.links), (0, 1), "a link to the tree");
    // The same tree twice: each primitive counts once.
    let twice = partition(&[one, one]);
    let slots = u32::try_from(two.both.len()).expect("small");
    arena.freeze(slots).expect("valid");
    let mesh = &two.meshes[0];
    let tree = Tree::from_arena(arena, twice.root, mesh.bounds(), CostModel::PACKED);
    let covered = tree.expect("valid").check_coverage(mesh);
    covered.unwrap_or_else(|missing| panic!("twice: {missing}"));
}

#[test]
fn clusters_cover_both_meshes() {
    for (name, two) in overlaps() {
        let moving = two.moving();
        for options in all_options() {
            // Clusters of the moving mesh, merged with the static tree.
            let (_, tree) = two.check(name, |arena, two| {
                two.merge_clusters(arena, &moving, vec![two.placed()[0]], &options)
            });
            two.trace(name, &tree, 150);
        }
        // Clusters of both meshes.
        let slots: Vec<Slot> = (0..).map(Slot).take(two.both.len()).collect();
        let (merged, tree) = two.check(name, |arena, two| {
            two.merge_clusters(arena, &slots, Vec::new(), &MergeOptions::default())
        });
        two.trace(name, &tree, 150);
        // If every cluster overlaps others, no subtree is shared.
        assert!(merged.links > 0 || name == "around", "{name}: {merged:?}");
    }
}

/// The trees are equal bit for bit, including the order of nodes and references.
#[test]
fn results_do_not_depend_on_threads() {
    let still = placed(&scene(Spd::Gears, 2), Vec3::ZERO, 2.0);
    let moving = placed(&scene(Spd::Balls, 2), Vec3::new(0.3, 0.1, 0.2), 1.5);
    let two = Two::new(still, moving);
    let moving = two.moving();
    type Merge<'a> = &'a dyn Fn(&mut Arena, &MergeOptions) -> Result<Merged, MergeError>;
    let bounds = two.both.bounds();
    let methods: [(&str, Merge<'_>); 4] = [
        ("BSP merge", &|arena, options| {
            bsp_merge(arena, two.trees, &two.both, bounds, options)
        }),
        ("insertion", &|arena, options| {
            insert(arena, two.trees[0], &moving, &two.both, bounds, options)
        }),
        ("partition trees", &|arena, options| {
            partition_trees(arena, &two.census, &two.placed(), &two.both, options)
        }),
        ("clusters", &|arena, options| {
            two.merge_clusters(arena, &moving, vec![two.placed()[0]], options)
        }),
    ];
    for (name, merge) in methods {
        let merged = |is_parallel| {
            let mut arena = two.arena.clone();
            let options = MergeOptions::default().with_parallel(is_parallel);
            let merged = merge(&mut arena, &options).expect("merged");
            (merged, arena.nodes().to_vec(), arena.refs().to_vec())
        };
        let (sequential, parallel) = (merged(false), merged(true));
        assert!(
            sequential.0.new_nodes > 1000,
            "{name}: enough nodes for several threads"
        );
        assert!(sequential == parallel, "{name}: equal bit for bit");
    }
}

#[test]
fn dividing_leaves_again_makes_them_smaller() {
    let (_, two) = overlaps().remove(3);
    let moving = two.moving();
    let largest_leaf = |options: MergeOptions| {
        let (_, tree) = two.check("inside", |arena, two| {
            insert(
                arena,
                two.trees[0],
                &moving,
                &two.both,
                two.both.bounds(),
                &options,
            )
        });
        let leaves = tree.nodes().iter().filter(|node| node.is_leaf());
        leaves.map(|leaf| leaf.count()).max().expect("some leaves")
    };
    let (undivided, divided) = (
        largest_leaf(MergeOptions::never_resplitting()),
        largest_leaf(MergeOptions::default()),
    );
    assert!(
        divided < undivided / 2,
        "largest leaf {divided}, without division {undivided}"
    );
}

/// Merging writes nodes only where trees overlap: an object far outside is linked.
#[test]
fn separate_trees_are_shared() {
    let new_nodes = |(name, two): (&str, Two)| {
        let options = MergeOptions::default();
        let (merged, _) = two.check(name, |arena, two| {
            bsp_merge(arena, two.trees, &two.both, two.both.bounds(), &options)
        });
        (merged.new_nodes, two.arena.nodes().len())
    };
    let (apart, all) = new_nodes(overlaps().remove(0));
    assert!(apart < all / 4, "{apart} new nodes over {all}");
}

#[test]
fn ten_thousand_merges_do_not_grow_the_arena() {
    let still = scene(Spd::Tetra, 2);
    let center = still.bounds().center();
    let two = Two::new(still, placed(&scene(Spd::Tetra, 1), center, 0.3));
    let mut arena = two.arena.clone();
    let segments = arena.segments();
    let slots = u32::try_from(two.both.len()).expect("small");
    let mut bytes = Vec::new();
    for _ in 0..10_000 {
        arena.truncate(segments);
        let options = MergeOptions::never_resplitting();
        bsp_merge(
            &mut arena,
            two.trees,
            &two.both,
            two.both.bounds(),
            &options,
        )
        .expect("merged");
        arena.freeze(slots).expect("valid");
        bytes.push(arena.bytes());
    }
    assert!(bytes[0] > two.arena.bytes(), "merging writes nodes");
    assert!(
        bytes.iter().all(|size| *size == bytes[0]),
        "the size is that after the first merge"
    );
}

#[test]
fn either_tree_may_be_empty() {
    let nothing = || Mesh::new(Vec::new(), Vec::new()).expect("valid");
    let something = || scene(Spd::Tetra, 2);
    for (name, two) in [
        ("no moving mesh", Two::new(something(), nothing())),
        ("no static mesh", Two::new(nothing(), something())),
        ("no mesh", Two::new(nothing(), nothing())),
    ] {
        let (merged, _) = two.check(name, |arena, two| {
            bsp_merge(
                arena,
                two.trees,
                &two.both,
                two.both.bounds(),
                &MergeOptions::default(),
            )
        });
        assert_eq!(
            (merged.new_nodes, merged.links),
            (0, 1),
            "{name}: a link to one tree"
        );
    }
}

#[test]
fn fresh_trees_are_refused() {
    let (_, two) = overlaps().remove(0);
    let mut arena = two.arena.clone();
    let root = Pair([Node::EMPTY_LEAF; 2]);
    let fresh = arena.push(root).expect("small");
    let trees = [two.trees[0], fresh];
    let refused = bsp_merge(
        &mut arena,
        trees,
        &two.both,
        two.both.bounds(),
        &MergeOptions::never_resplitting(),
    );
    let error = refused.expect_err("the tree is fresh").to_string();
    assert!(error.contains("is not a frozen node"), "{error}");
}

/// Partitions the tree of a mesh at a plane, joins both halves under one node, and checks that this tree covers the mesh.
#[track_caller]
fn check_partition(name: &str, mesh: &Mesh, axis: Axis, position: f32) -> [Merged; 2] {
    let tree = build(mesh, &BuildOptions::best().with_threads(1)).expect("valid");
    let slots = u32::try_from(mesh.len()).expect("small");
    let mut arena = Arena::new();
    let root = arena.append_tree(&tree, 0).expect("small");
    arena.freeze(slots).expect("valid");
    let halves = partition(&mut arena, root, mesh, mesh.bounds(), axis, position).expect("cut");
    arena.freeze(slots).expect("valid");
    let [below, above] = halves.map(|half| arena.nodes()[half.root.index()]);
    let joined = arena.push(Pair([Node::EMPTY_LEAF; 2])).expect("small");
    let children = arena.push(Pair([below, above])).expect("small");
    arena.set(
        joined,
        Node::interior(axis, position, children).expect("small"),
    );
    arena.freeze(slots).expect("valid");
    let joined = Tree::from_arena(arena, joined, mesh.bounds(), CostModel::PACKED).expect("valid");
    joined
        .check_coverage(mesh)
        .unwrap_or_else(|missing| panic!("{name}, {axis:?} {position}: {missing}"));
    halves
}

#[test]
fn both_halves_of_a_partition_cover_the_mesh() {
    for (name, mesh) in [
        ("gears", scene(Spd::Gears, 1)),
        ("tetra", scene(Spd::Tetra, 3)),
    ] {
        let bounds = mesh.bounds();
        let root = build(&mesh, &BuildOptions::best()).expect("valid");
        let root = root.nodes()[root.root().index()];
        let own = (Axis::ALL[root.tag()], root.split());
        let halves = check_partition(name, &mesh, own.0, own.1);
        let written: usize = halves.iter().map(|half| half.new_nodes).sum();
        assert_eq!(
            written, 0,
            "{name}: at the root's plane both halves are links to its children"
        );
        for axis in Axis::ALL {
            let (min, size) = (bounds.min[axis.index()], bounds.extent()[axis.index()]);
            for share in [-0.1, 0.0, 0.123, 0.5, 0.71, 1.0, 1.1] {
                check_partition(name, &mesh, axis, min + share * size);
            }
        }
    }
}

/// Random triangles. Coordinates are on a lattice, so that triangles are coplanar, or arbitrary.
fn soup() -> impl Strategy<Value = Mesh> {
    let coordinate = prop_oneof![(0_u8..5).prop_map(|i| f32::from(i) * 0.25), 0.0_f32..1.0,];
    let corner = [coordinate.clone(), coordinate.clone(), coordinate];
    prop::collection::vec(corner, 3..90).prop_map(|mut positions| {
        positions.truncate(positions.len() / 3 * 3);
        let count = u32::try_from(positions.len() / 3).expect("small");
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh::new(positions, triangles).expect("valid")
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_triangles_merge(
        still in soup(),
        moving in soup(),
        (x, size) in (-1.5_f32..1.5, prop::sample::select(vec![0.0_f32, 0.1, 1.0, 3.0])),
    ) {
        let moving = placed(&moving, Vec3::new(x + 0.5, 0.5, 0.4), size);
        let two = Two::new(still, moving);
        let slots = two.moving();
        for options in all_options() {
            two.check("a soup", |arena, two| {
                bsp_merge(arena, two.trees, &two.both, two.both.bounds(), &options)
            });
            two.check("a soup", |arena, two| {
                insert(arena, two.trees[0], &slots, &two.both, two.both.bounds(), &options)
            });
            two.check("a soup", |arena, two| {
                partition_trees(arena, &two.census, &two.placed(), &two.both, &options)
            });
            two.check("a soup", |arena, two| {
                two.merge_clusters(arena, &slots, vec![two.placed()[0]], &options)
            });
        }
    }

    #[test]
    fn random_triangles_are_partitioned(mesh in soup(), axis in 0_usize..3, position in prop_oneof![
        (0_u8..5).prop_map(|i| f32::from(i) * 0.25),
        -0.1_f32..1.1,
    ]) {
        check_partition("a soup", &mesh, Axis::ALL[axis], position);
    }
}
