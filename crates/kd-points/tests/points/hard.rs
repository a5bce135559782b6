//! Trees of every kind over a mesh, and points that are hard for it.

use glam::Vec3;
use kd_core::{Aabb, Mesh};
use kd_oracle::rng::Rng;
use kd_points::PointTree;
use kd_sah::BuildOptions;
use kd_simd::Level;
use kd_trace::PackedTree;
use kd_wide::{Division, WideTree};

/// The same mesh in every layout, at both levels.
pub(crate) struct Trees {
    wide: Vec<(&'static str, WideTree)>,
    packed: Vec<(&'static str, PackedTree)>,
}

impl Trees {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let kd_tree = kd_sah::build(mesh, &BuildOptions::best()).expect("within limits");
        let most_references = u64::MAX;
        let cheapest = Division::Cheapest { most_references };
        let cheapest = WideTree::build(mesh, cheapest, false, None).expect("nothing cancels it");
        let wide = [
            ("objects", WideTree::from_objects(mesh)),
            ("cheapest", cheapest),
            ("planes", WideTree::with_planes_above(&kd_tree, mesh, 0)),
        ];
        let packed = PackedTree::new(&kd_tree, mesh);
        let portable = Level::portable();
        let mut trees = Self {
            wide: Vec::new(),
            packed: vec![
                ("binary, portable", packed.clone().with_level(portable)),
                ("binary", packed),
            ],
        };
        for (name, tree) in wide {
            trees.wide.push((name, tree.clone().with_level(portable)));
            trees.wide.push((name, tree));
        }
        trees
    }

    pub(crate) fn all(&self) -> impl Iterator<Item = (String, [PointTree<'_>; 1])> {
        let wide = self.wide.iter().map(|(name, tree)| {
            let name = format!("{name}, {}", tree.level());
            (name, [PointTree::from(tree)])
        });
        let packed = self
            .packed
            .iter()
            .map(|(name, tree)| ((*name).to_owned(), [PointTree::from(tree)]));
        wide.chain(packed)
    }
}

/// Points on, near and far from a mesh.
pub(crate) fn points(mesh: &Mesh, count: usize, seed: u64) -> Vec<Vec3> {
    let mut rng = Rng(seed);
    let bounds = mesh.bounds();
    (0..count).map(|_| point(mesh, &bounds, &mut rng)).collect()
}

/// A point of one of many kinds. It may be beyond the range of f32.
fn point(mesh: &Mesh, bounds: &Aabb, rng: &mut Rng) -> Vec3 {
    let center = bounds.center();
    let half = 0.5 * bounds.max - 0.5 * bounds.min;
    let mut anywhere = |size: f32| center + size * half * rng.vec3();
    let [inside, around, far] = [1.0, 3.0, 1e4].map(&mut anywhere);
    if mesh.is_empty() {
        return around;
    }
    let triangle = u32::try_from(rng.below(mesh.len())).expect("small");
    let [a, b, c] = mesh.corners(triangle);
    let (u, v) = (rng.unit(), rng.unit());
    let on_face = a + u * (1.0 - v) * (b - a) + v * (c - a);
    let nudge = half * rng.vec3();
    match rng.below(12) {
        0 => a,
        1 => a.midpoint(b),
        2 => a + u * (b - a),
        3 => on_face,
        4 => on_face + 1e-2 * nudge,
        5 => on_face + 1e-5 * nudge,
        6 => around,
        7 => far,
        // In line with corners along axes.
        8 => Vec3::new(inside.x, a.y, a.z),
        9 => Vec3::new(around.x, b.y, a.z),
        10 => center,
        _ => inside,
    }
}

/// Points that get no answer.
pub(crate) fn no_points() -> [Vec3; 4] {
    [
        Vec3::NAN,
        Vec3::INFINITY,
        Vec3::new(0.0, f32::NEG_INFINITY, 0.0),
        Vec3::new(0.0, 0.0, f32::NAN),
    ]
}
