//! The one place that compares a ray's answers, and the one that looks whether a hierarchy is sound.

use kd_bvh::{Bvh, BvhMethod, BvhNodeView, BvhOptions};
use kd_core::{Aabb, CostModel, Hit, MAX_DEPTH, Mesh, Ray};
use kd_oracle::rays::Rays;
use kd_oracle::{Answers, source};
use kd_trace::{Level, RayQuery as _, WideTree};

/// Every method.
pub(crate) const METHODS: [BvhMethod; 5] = [
    BvhMethod::Sweep,
    BvhMethod::Binned { bins: 32 },
    BvhMethod::Midpoint,
    BvhMethod::EqualCounts,
    BvhMethod::BottomUp { radius: 16 },
];

/// Every method, and options that lead to other leaves.
pub(crate) fn option_rows() -> Vec<BvhOptions> {
    let mut rows = METHODS
        .map(|method| BvhOptions::new().with_method(method))
        .to_vec();
    rows.extend([
        BvhOptions::new()
            .with_method(BvhMethod::Binned { bins: 3 })
            .with_max_leaf(1),
        BvhOptions::new()
            .with_method(BvhMethod::BottomUp { radius: 1 })
            .with_max_leaf(100)
            .with_cost(CostModel::PACKED),
    ]);
    rows
}

/// A hierarchy over a mesh and its wide form.
pub(crate) struct Subject<'a> {
    mesh: &'a Mesh,
    pub(crate) options: BvhOptions,
    pub(crate) bvh: Bvh,
    wide: WideTree,
}

impl<'a> Subject<'a> {
    /// Checks that the hierarchy is sound, too.
    pub(crate) fn new(mesh: &'a Mesh, options: &BvhOptions) -> Self {
        let bvh = Bvh::build(mesh, options).expect("valid options");
        Self::of(mesh, bvh, options)
    }

    pub(crate) fn of(mesh: &'a Mesh, bvh: Bvh, options: &BvhOptions) -> Self {
        check_sound(mesh, &bvh, options);
        let level = if options.method() == BvhMethod::Sweep {
            Level::portable()
        } else {
            Level::detect()
        };
        Self {
            mesh,
            wide: bvh.wide(mesh).with_level(level),
            options: options.clone(),
            bvh,
        }
    }

    /// One for each row of options.
    pub(crate) fn all(mesh: &'a Mesh) -> Vec<Self> {
        let rows = option_rows();
        rows.iter().map(|row| Self::new(mesh, row)).collect()
    }
}

/// As the hierarchy does, having made sure that its wide form gives the same.
impl Answers for Subject<'_> {
    #[track_caller]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.bvh.intersect(self.mesh, ray);
        let wide = self.wide.intersect(ray);
        assert_eq!(wide, hit, "wide, closest, {}", self.place(ray));
        hit
    }

    #[track_caller]
    fn any(&self, ray: &Ray) -> bool {
        let any = self.bvh.occluded(self.mesh, ray);
        let wide = self.wide.occluded(ray);
        assert_eq!(wide, any, "wide, any, {}", self.place(ray));
        any
    }

    fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.bvh.hits(self.mesh, ray, max, out);
    }

    /// Faces of boxes.
    fn planes(&self) -> Vec<(usize, f32)> {
        let nodes = self.bvh.nodes().iter();
        let faces = nodes.flat_map(|node| {
            let bounds = node.bounds();
            (0..3).flat_map(move |axis| [(axis, bounds.min[axis]), (axis, bounds.max[axis])])
        });
        faces.collect()
    }
}

impl Subject<'_> {
    fn place(&self, ray: &Ray) -> String {
        format!("{:?}: {}", self.options.method(), source(ray))
    }
}

/// Rays around a mesh and the boxes of hierarchies over it.
pub(crate) fn rays<'a>(mesh: &'a Mesh, subjects: &[Subject<'_>], seed: u64) -> Rays<'a> {
    let faces = subjects.iter().flat_map(Answers::planes);
    Rays::new(mesh, faces.collect(), seed)
}

/// Asks each subject everything about a ray, and expects what brute force says. Gives the number of hits.
#[track_caller]
pub(crate) fn check(name: &str, mesh: &Mesh, subjects: &[Subject<'_>], ray: &Ray) -> usize {
    let answers: Vec<&dyn Answers> = subjects.iter().map(|subject| subject as _).collect();
    kd_oracle::check(name, mesh, &answers, ray)
}

/// Holds a hierarchy to what is promised of each: every triangle once, boxes as small as can be, nodes in depth-first order,
/// depth, and leaves no larger than asked for.
#[track_caller]
pub(crate) fn check_sound(mesh: &Mesh, bvh: &Bvh, options: &BvhOptions) {
    let mut listed = bvh.triangles().to_vec();
    listed.sort_unstable();
    let all = 0..u32::try_from(mesh.len()).expect("few");
    assert!(all.eq(listed), "each triangle once");
    let mut walk = Walk {
        mesh,
        bvh,
        options,
        triangles: 0,
    };
    let end = if mesh.is_empty() {
        0
    } else {
        walk.node(0, 0).1
    };
    assert_eq!(end as usize, bvh.nodes().len(), "no other nodes");
    assert_eq!(walk.triangles as usize, mesh.len(), "no other triangles");
    assert_eq!(bvh.bounds(), mesh.bounds(), "around all");
}

struct Walk<'a> {
    mesh: &'a Mesh,
    bvh: &'a Bvh,
    options: &'a BvhOptions,
    /// How many the leaves so far have.
    triangles: u32,
}

impl Walk<'_> {
    /// The box that a node should have, and the place after its subtree.
    fn node(&mut self, place: u32, depth: usize) -> (Aabb, u32) {
        assert!(depth <= MAX_DEPTH, "{depth} nodes above");
        let node = self.bvh.nodes()[place as usize];
        let (bounds, end) = match node.view() {
            BvhNodeView::Leaf { first, count } => {
                assert_eq!(first, self.triangles, "leaf after leaf");
                self.triangles += count;
                let triangles = &self.bvh.triangles()[first as usize..][..count as usize];
                assert!(triangles.is_sorted(), "in order: {triangles:?}");
                let most = self.options.max_leaf();
                assert!((1..=most).contains(&count), "{count} triangles of {most}");
                let corners = triangles.iter().flat_map(|t| self.mesh.corners(*t));
                (Aabb::around(corners), place + 1)
            }
            BvhNodeView::Interior { second, .. } => {
                let (lower, end_of_first) = self.node(place + 1, depth + 1);
                assert_eq!(second, end_of_first, "the second child follows");
                let (upper, end) = self.node(second, depth + 1);
                (lower.union(&upper), end)
            }
        };
        assert_eq!(node.bounds(), bounds, "the smallest box, node {place}");
        (bounds, end)
    }
}
