//! Merged trees against both meshes: every reference is where it should be, and every ray is answered as by brute force.

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

/// Two meshes, their trees in one arena, and both meshes as one, numbered as the arena's slots are.
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
        for (place, mesh) in trees.iter_mut().zip([&still, &moving]) {
            let tree = build(mesh, &BuildOptions::best().with_threads(1)).expect("valid");
            *place = arena.append_tree(&tree, slots).expect("small");
            slots += count(mesh);
            arena.freeze(slots).expect("valid");
        }
        let mut census = Census::new();
        census.extend(&arena.nodes()[..trees[1].index()]);
        census.extend(arena.nodes());
        let first = u32::try_from(still.positions().len()).expect("small");
        let moved_on = moving.triangles().iter().map(|t| t.map(|i| i + first));
        let both = Mesh::new(
            [still.positions(), moving.positions()].concat(),
            still.triangles().iter().copied().chain(moved_on).collect(),
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

    /// Makes clusters of some triangles, and merges their trees with others.
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

    /// Numbers of the triangles that move.
    fn moving(&self) -> Vec<Slot> {
        let first = self.meshes[0].len();
        let numbers = first..first + self.meshes[1].len();
        numbers
            .map(|i| Slot(u32::try_from(i).expect("small")))
            .collect()
    }

    /// Merges, and checks what comes out.
    #[track_caller]
    fn check(
        &self,
        what: &str,
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
            "{what}: what was there is as it was"
        );
        let tree = Tree::from_arena(arena, merged.root, self.both.bounds(), CostModel::PACKED);
        let tree = tree.expect("valid");
        tree.check_coverage(&self.both)
            .unwrap_or_else(|missing| panic!("{what}: {missing}"));
        (merged, tree)
    }

    /// Rays from around, aimed at either mesh.
    #[track_caller]
    fn trace(&self, what: &str, tree: &Tree, count: usize) {
        let mut rng = fastrand::Rng::with_seed(7);
        let bounds = self.both.bounds();
        let mut point = |within: &Aabb, size: f32| {
            let one = Vec3::new(rng.f32(), rng.f32(), rng.f32());
            within.center() + size * (one - 0.5) * within.extent()
        };
        let (mut hits, mut ours, mut all, mut expected) = (0, 0, Vec::new(), Vec::new());
        for i in 0..count {
            let target = point(&self.meshes[i % 2].bounds(), 1.0);
            let origin = point(&bounds, 2.0);
            let ray = kd_core::Ray::new(origin, target - origin);
            let hit = brute_force::intersect(&self.both, &ray);
            assert_eq!(
                kd_trace::intersect(tree, &self.both, &ray),
                hit,
                "{what}: {ray:?}"
            );
            assert_eq!(
                kd_trace::occluded(tree, &self.both, &ray),
                hit.is_some(),
                "{what}: {ray:?}"
            );
            kd_trace::hits(tree, &self.both, &ray, 5, &mut all);
            brute_force::hits(&self.both, &ray, 5, &mut expected);
            assert_eq!(all, expected, "{what}: {ray:?}");
            hits += usize::from(hit.is_some());
            ours +=
                usize::from(hit.is_some_and(|hit| hit.triangle as usize >= self.meshes[0].len()));
        }
        assert!(
            hits > count / 5 && ours > 0,
            "{what}: {hits} hits, {ours} of what moves"
        );
    }
}

fn scene(spd: Spd, size: u32) -> Mesh {
    spd.generate(size).expect("small").mesh
}

/// A mesh in a box of another size at another place.
fn placed(mesh: &Mesh, center: Vec3, size: f32) -> Mesh {
    let bounds = mesh.bounds();
    let scale = size / bounds.extent().max_element();
    let to = |p: &[f32; 3]| (center + scale * (Vec3::from_array(*p) - bounds.center())).to_array();
    let positions = mesh.positions().iter().map(to).collect();
    Mesh::new(positions, mesh.triangles().to_vec()).expect("valid")
}

/// From far apart to all inside, in a room of gears.
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
    .map(|(what, center, size)| (what, Two::new(still.clone(), placed(&moving, center, size))))
    .into()
}

fn ways_to_merge() -> [MergeOptions; 3] {
    [
        MergeOptions::never_resplitting(),
        MergeOptions::default(),
        MergeOptions::resplitting(4, BuildOptions::best()),
    ]
}

#[test]
fn trees_merge_at_every_overlap() {
    for (what, two) in overlaps() {
        for options in ways_to_merge() {
            let (merged, tree) = two.check(what, |arena, two| {
                bsp_merge(arena, two.trees, &two.both, two.both.bounds(), &options)
            });
            two.trace(what, &tree, 150);
            assert!(merged.links > 0, "{what}: {merged:?}");
        }
    }
}

#[test]
fn primitives_are_inserted_at_every_overlap() {
    for (what, two) in overlaps() {
        let moving = two.moving();
        for options in ways_to_merge() {
            let (merged, tree) = two.check(what, |arena, two| {
                let bounds = two.both.bounds();
                insert(arena, two.trees[0], &moving, &two.both, bounds, &options)
            });
            two.trace(what, &tree, 150);
            assert!(merged.links > 0, "{what}: {merged:?}");
        }
    }
}

#[test]
fn trees_are_partitioned_at_every_overlap() {
    for (what, two) in overlaps() {
        for options in ways_to_merge() {
            let (merged, tree) = two.check(what, |arena, two| {
                partition_trees(arena, &two.census, &two.placed(), &two.both, &options)
            });
            two.trace(what, &tree, 150);
            let is_apart = what == "far apart" || what == "side by side";
            assert!(merged.links > 0, "{what}: {merged:?}");
            assert_eq!(merged.dissolved == 0, is_apart, "{what}: {merged:?}");
            assert!(!is_apart || merged.new_nodes < 20, "{what}: {merged:?}");
        }
    }
}

#[test]
fn any_number_of_trees_is_partitioned() {
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
    assert_eq!((alone.new_nodes, alone.links), (0, 1), "it is linked");
    // The same tree twice: every primitive counts once.
    let twice = partition(&[one, one]);
    let slots = u32::try_from(two.both.len()).expect("small");
    arena.freeze(slots).expect("valid");
    let mesh = &two.meshes[0];
    let tree = Tree::from_arena(arena, twice.root, mesh.bounds(), CostModel::PACKED);
    let covered = tree.expect("valid").check_coverage(mesh);
    covered.unwrap_or_else(|missing| panic!("twice: {missing}"));
}

#[test]
fn clusters_are_merged_at_every_overlap() {
    for (what, two) in overlaps() {
        let moving = two.moving();
        for options in ways_to_merge() {
            // What moves in clusters, with the tree of what stands still.
            let (_, tree) = two.check(what, |arena, two| {
                two.merge_clusters(arena, &moving, vec![two.placed()[0]], &options)
            });
            two.trace(what, &tree, 150);
        }
        // Everything in clusters.
        let slots: Vec<Slot> = (0..).map(Slot).take(two.both.len()).collect();
        let (merged, tree) = two.check(what, |arena, two| {
            two.merge_clusters(arena, &slots, Vec::new(), &MergeOptions::default())
        });
        two.trace(what, &tree, 150);
        // Where every cluster is mixed with others, there is nothing left to share.
        assert!(merged.links > 0 || what == "around", "{what}: {merged:?}");
    }
}

/// Numbers of nodes and references too, whichever thread made them.
#[test]
fn threads_change_nothing() {
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
    for (what, merge) in methods {
        let merged = |is_parallel| {
            let mut arena = two.arena.clone();
            let options = MergeOptions::default().with_parallel(is_parallel);
            let merged = merge(&mut arena, &options).expect("merged");
            (merged, arena.nodes().to_vec(), arena.refs().to_vec())
        };
        let (alone, together) = (merged(false), merged(true));
        assert!(alone.0.new_nodes > 1000, "{what}: enough to do for several");
        assert!(alone == together, "{what}: bit for bit");
    }
}

#[test]
fn leaves_that_are_divided_again_are_not_full() {
    let (_, two) = overlaps().remove(3);
    let moving = two.moving();
    let fullest = |options: MergeOptions| {
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
        leaves.map(|leaf| leaf.count()).max().expect("some")
    };
    let (as_they_come, divided) = (
        fullest(MergeOptions::never_resplitting()),
        fullest(MergeOptions::default()),
    );
    assert!(divided < as_they_come / 2, "{divided} of {as_they_come}");
}

/// Merging costs nodes where trees meet, and none elsewhere: the same object far outside is linked.
#[test]
fn what_is_apart_is_shared() {
    let new_nodes = |(what, two): (&str, Two)| {
        let options = MergeOptions::default();
        let (merged, _) = two.check(what, |arena, two| {
            bsp_merge(arena, two.trees, &two.both, two.both.bounds(), &options)
        });
        (merged.new_nodes, two.arena.nodes().len())
    };
    let (apart, all) = new_nodes(overlaps().remove(0));
    assert!(apart < all / 4, "{apart} new nodes over {all}");
}

#[test]
fn ten_thousand_commits_are_as_large_as_ten() {
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
    assert!(bytes[0] > two.arena.bytes(), "something was written");
    assert!(
        bytes.iter().all(|size| *size == bytes[0]),
        "as large as after one"
    );
}

#[test]
fn either_tree_may_be_empty() {
    let nothing = || Mesh::new(Vec::new(), Vec::new()).expect("valid");
    let something = || scene(Spd::Tetra, 2);
    for (what, two) in [
        ("nothing moves", Two::new(something(), nothing())),
        ("nothing stands", Two::new(nothing(), something())),
        ("nothing at all", Two::new(nothing(), nothing())),
    ] {
        let (merged, _) = two.check(what, |arena, two| {
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
            "{what}: one is linked"
        );
    }
}

#[test]
fn trees_that_are_not_frozen_are_refused() {
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
    let error = refused.expect_err("it is fresh").to_string();
    assert!(error.contains("is not a frozen node"), "{error}");
}

/// Both parts, side by side again, are a tree over the same mesh.
#[track_caller]
fn check_partition(what: &str, mesh: &Mesh, axis: Axis, position: f32) -> [Merged; 2] {
    let tree = build(mesh, &BuildOptions::best().with_threads(1)).expect("valid");
    let slots = u32::try_from(mesh.len()).expect("small");
    let mut arena = Arena::new();
    let root = arena.append_tree(&tree, 0).expect("small");
    arena.freeze(slots).expect("valid");
    let parts = partition(&mut arena, root, mesh, mesh.bounds(), axis, position).expect("cut");
    arena.freeze(slots).expect("valid");
    let [below, above] = parts.map(|part| arena.nodes()[part.root.index()]);
    let place = arena.push(Pair([Node::EMPTY_LEAF; 2])).expect("small");
    let children = arena.push(Pair([below, above])).expect("small");
    arena.set(
        place,
        Node::interior(axis, position, children).expect("small"),
    );
    arena.freeze(slots).expect("valid");
    let joined = Tree::from_arena(arena, place, mesh.bounds(), CostModel::PACKED).expect("valid");
    joined
        .check_coverage(mesh)
        .unwrap_or_else(|missing| panic!("{what}, {axis:?} {position}: {missing}"));
    parts
}

#[test]
fn trees_are_cut_at_planes() {
    for (what, mesh) in [
        ("gears", scene(Spd::Gears, 1)),
        ("tetra", scene(Spd::Tetra, 3)),
    ] {
        let bounds = mesh.bounds();
        let root = build(&mesh, &BuildOptions::best()).expect("valid");
        let root = root.nodes()[root.root().index()];
        let own = (Axis::ALL[root.tag()], root.split());
        let parts = check_partition(what, &mesh, own.0, own.1);
        let written: usize = parts.iter().map(|part| part.new_nodes).sum();
        assert_eq!(
            written, 0,
            "{what}: at the root's plane both sides are there"
        );
        for axis in Axis::ALL {
            let (min, size) = (bounds.min[axis.index()], bounds.extent()[axis.index()]);
            for share in [-0.1, 0.0, 0.123, 0.5, 0.71, 1.0, 1.1] {
                check_partition(what, &mesh, axis, min + share * size);
            }
        }
    }
}

/// Triangles on a lattice, so that they lie in each other's planes, or anywhere.
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
    fn any_two_soups_merge(
        still in soup(),
        moving in soup(),
        (x, size) in (-1.5_f32..1.5, prop::sample::select(vec![0.0_f32, 0.1, 1.0, 3.0])),
    ) {
        let moving = placed(&moving, Vec3::new(x + 0.5, 0.5, 0.4), size);
        let two = Two::new(still, moving);
        let slots = two.moving();
        for options in ways_to_merge() {
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
    fn any_soup_is_cut(mesh in soup(), axis in 0_usize..3, position in prop_oneof![
        (0_u8..5).prop_map(|i| f32::from(i) * 0.25),
        -0.1_f32..1.1,
    ]) {
        check_partition("a soup", &mesh, Axis::ALL[axis], position);
    }
}
