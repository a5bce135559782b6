//! The generalized winding number: how often a surface, closed or not, winds around a point.

use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};
use kd_core::{Aabb, Mesh};
use kd_simd::LANES;
use kd_wide::{Block, Child, WIDTH, WideTree};

use crate::tree::PointTree;

/// The largest error of [`WindingNumbers::at`], but for rounding.
pub const WINDING_ERROR: f64 = 0.01;

/// A hierarchy over a mesh that answers winding numbers.
///
/// The winding number of a point is the sum of the solid angles of all triangles, signed by the side that the point sees, over 4π: 1 inside
/// of a closed surface whose triangles are counter-clockwise from outside, 0 outside, −1 inside of a surface turned inside out. Where the
/// surface has holes it changes smoothly across them, so that `winding > 0.5` is a robust *inside* for dirty meshes (A. Jacobson, L. Kavan,
/// O. Sorkine-Hornung, *Robust Inside-Outside Segmentation using Generalized Winding Numbers*, 2013).
///
/// Far groups of triangles count as a dipole with its first and second moments, near triangles one by one (G. Barill, N. Dickson, R. Schmidt, D. Levin,
/// A. Jacobson, *Fast Winding Numbers for Soups and Clouds*, 2018, section 3). Where they take a group as far at twice its radius, here a
/// bound of the error decides: every answer is within [`WINDING_ERROR`] of the sum over all triangles.
///
/// The groups are wide nodes of objects, made for this purpose. Memory: about 100 bytes a triangle. Build time is that of wide nodes of
/// objects, and linear.
///
/// ```
/// use kd_core::{Aabb, Mesh};
/// use kd_points::{WINDING_ERROR, WindingNumbers};
///
/// // A tetrahedron without its face in the plane z = 0.
/// let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let open = Mesh::new(corners, vec![[0, 1, 3], [1, 2, 3], [2, 0, 3]])?;
/// let numbers = WindingNumbers::new(&open);
/// assert!(numbers.at([0.2, 0.2, 0.3]) > 0.5, "inside");
/// assert!(numbers.at([2.0, 2.0, 2.0]).abs() < 0.1 + WINDING_ERROR, "outside");
/// # Ok::<(), kd_core::MeshError>(())
/// ```
#[derive(Clone, Debug)]
pub struct WindingNumbers {
    tree: WideTree,
    /// All triangles.
    whole: Group,
    /// Those of the children of each node.
    groups: Vec<[Group; WIDTH]>,
}

/// Some triangles from far.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// The mean of their points.
    center: DVec3,
    /// No point is further from the center.
    radius: f64,
    area: f64,
    /// The sum of areas times normals.
    dipole: DVec3,
    /// The integral of (x − center) nᵀ over all points x with normals n.
    first: DMat3,
    /// That of (x − center) (x − center) n, made symmetric.
    second: Cubic,
    /// The integral of |x − center|².
    spread: f64,
}

/// A child to visit later.
#[derive(Clone, Copy, Debug)]
struct Pending<'a> {
    child: Child,
    group: &'a Group,
    /// No triangle is closer.
    distance: f64,
}

impl WindingNumbers {
    /// The hierarchy of a mesh, made on the calling thread.
    pub fn new(mesh: &Mesh) -> Self {
        Self::of(WideTree::from_objects(mesh))
    }

    /// [`new`](Self::new) on the threads of the pool in scope (rayon's). The result is the same.
    pub fn new_parallel(mesh: &Mesh) -> Self {
        Self::of(WideTree::from_objects_parallel(mesh))
    }

    fn of(tree: WideTree) -> Self {
        let mut groups = vec![[Group::NONE; WIDTH]; tree.nodes().len()];
        let whole = group_of(&tree, tree.root(), &mut groups);
        Self {
            tree,
            whole,
            groups,
        }
    }

    /// The winding number of a point, within [`WINDING_ERROR`] and the rounding of f64. 0 for a point that is not finite, and
    /// without triangles.
    ///
    /// On the surface it is between those of both sides. Time grows far more slowly than the number of triangles.
    pub fn at(&self, point: impl Into<Vec3>) -> f64 {
        let point = point.into();
        if !point.is_finite() || self.whole.area == 0.0 {
            return 0.0;
        }
        let point = point.as_dvec3();
        let mut sum = 0.0;
        // What groups may err by in all, and the area that is to come. A group may err by twice its share of what is left. The farthest come
        // first, and need less, so that more is left for the near ones.
        let mut error_left = 4.0 * PI * WINDING_ERROR;
        let mut area_left = self.whole.area;
        let mut pending = vec![Pending {
            child: self.tree.root(),
            group: &self.whole,
            distance: self.whole.distance(point, &bounds_of(&self.tree)),
        }];
        while let Some(Pending {
            child,
            group,
            distance,
        }) = pending.pop()
        {
            let share = (2.0 * group.area / area_left).min(1.0);
            if distance > 0.0 && group.error(distance) <= share * error_left {
                sum += group.solid_angle(point);
                error_left -= group.error(distance);
                area_left -= group.area;
            } else if child.is_leaf() {
                sum += angle_of_blocks(&self.tree.blocks()[child.blocks()], point);
                area_left -= group.area;
            } else {
                let node = &self.tree.nodes()[child.index()];
                let groups = &self.groups[child.index()];
                let first = pending.len();
                pending.extend(node.lanes().map(|lane| Pending {
                    child: node.children[lane],
                    group: &groups[lane],
                    distance: groups[lane].distance(point, &node.bounds(lane)),
                }));
                // The farthest last. Stable, so that the order is the same everywhere.
                pending[first..].sort_by(|a, b| a.distance.total_cmp(&b.distance));
            }
        }
        sum / (4.0 * PI)
    }
}

impl Group {
    const NONE: Self = Self {
        center: DVec3::ZERO,
        radius: 0.0,
        area: 0.0,
        dipole: DVec3::ZERO,
        first: DMat3::ZERO,
        second: Cubic::ZERO,
        spread: 0.0,
    };

    /// A triangle: its first moments about its center are zero.
    fn of_triangle(corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        let center = (a + b + c) / 3.0;
        let dipole = 0.5 * (b - a).cross(c - a);
        let area = dipole.length();
        let ways = corners.map(|corner| corner - center);
        let squares = ways.map(DVec3::length_squared);
        let mut second = Cubic::ZERO;
        for way in ways {
            // The integral of a quadratic form over a triangle is a twelfth of its sum over the corners, times the area.
            second.add_product([dipole / 12.0, way, way]);
        }
        Self {
            center,
            radius: squares.into_iter().fold(0.0, f64::max).sqrt(),
            area,
            dipole,
            first: DMat3::ZERO,
            second,
            spread: area / 12.0 * squares.iter().sum::<f64>(),
        }
    }

    /// All groups together.
    fn of_groups(groups: &[Self]) -> Self {
        let area: f64 = groups.iter().map(|group| group.area).sum();
        if area == 0.0 {
            return Self::NONE;
        }
        let weighted: DVec3 = groups.iter().map(|group| group.center * group.area).sum();
        let mut whole = Self {
            center: weighted / area,
            area,
            ..Self::NONE
        };
        for group in groups.iter().filter(|group| group.area > 0.0) {
            let shift = group.center - whole.center;
            whole.radius = whole.radius.max(shift.length() + group.radius);
            whole.dipole += group.dipole;
            let [x, y, z] = group.dipole.to_array();
            whole.first += group.first + DMat3::from_cols(shift * x, shift * y, shift * z);
            whole.second.add(&group.second);
            whole.second.add_product([group.dipole, shift, shift]);
            let moments = group.first.transpose();
            for (axis, along) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                whole
                    .second
                    .add_product([moments.col(axis), 2.0 * along, shift]);
            }
            // The first moments of its area about its own center are zero.
            whole.spread += group.spread + group.area * shift.length_squared();
        }
        whole
    }

    /// No triangle is closer, and no point between two of them; 0 or negative where the point may be among them. The group is in a box.
    fn distance(&self, point: DVec3, bounds: &Aabb) -> f64 {
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
        let from_box = point.distance(point.clamp(min, max));
        from_box.max(self.center.distance(point) - self.radius)
    }

    /// The sum of solid angles, by the first three terms of the Taylor series of F = R / |R|³ about the center, R being the way from the point.
    fn solid_angle(&self, point: DVec3) -> f64 {
        let way = self.center - point;
        let square = way.length_squared();
        let cube = square * square.sqrt();
        let first = &self.first;
        let trace = first.x_axis.x + first.y_axis.y + first.z_axis.z;
        // ∂F = δ / r³ − 3 R R / r⁵, and ∂∂F = −3 (δ R + δ R + δ R) / r⁵ + 15 R R R / r⁷.
        let of_dipole = self.dipole.dot(way);
        let of_first = trace - 3.0 * way.dot(*first * way) / square;
        let of_second =
            (7.5 * self.second.along(way) / square - 4.5 * self.second.trace().dot(way)) / square;
        (of_dipole + of_first + of_second) / cube
    }

    /// A bound of the error of [`solid_angle`](Self::solid_angle), from a distance at which no point between two triangles is closer.
    ///
    /// R / |R|³ is a gradient of 1 / |R|, so that the next term of the series takes fourth derivatives of 1 / r. Those along one direction are
    /// 24 P(c) / r⁵, P being a Legendre polynomial of its cosine with R, and so at most 24 / r⁵; and a symmetric form is nowhere larger than
    /// along one direction (S. Banach, 1938). The remainder is therefore at most 24 / 6 / r⁵ times the integral of |x − center|³, which is at
    /// most the radius times that of the square.
    fn error(&self, distance: f64) -> f64 {
        let square = distance * distance;
        4.0 * self.radius * self.spread / (square * square * distance)
    }
}

/// A symmetric form of three vectors.
#[derive(Clone, Copy, Debug)]
struct Cubic([f64; 10]);

/// The axes of each coefficient.
const TERMS: [[usize; 3]; 10] = [
    [0, 0, 0],
    [1, 1, 1],
    [2, 2, 2],
    [0, 0, 1],
    [0, 0, 2],
    [1, 1, 0],
    [1, 1, 2],
    [2, 2, 0],
    [2, 2, 1],
    [0, 1, 2],
];

impl Cubic {
    const ZERO: Self = Self([0.0; 10]);

    fn add(&mut self, other: &Self) {
        for (own, other) in self.0.iter_mut().zip(other.0) {
            *own += other;
        }
    }

    /// Adds the product of three vectors, made symmetric.
    fn add_product(&mut self, factors: [DVec3; 3]) {
        let [a, b, c] = factors.map(|factor| factor.to_array());
        for (own, [i, j, k]) in self.0.iter_mut().zip(TERMS) {
            let orders = a[i] * (b[j] * c[k] + b[k] * c[j])
                + a[j] * (b[i] * c[k] + b[k] * c[i])
                + a[k] * (b[i] * c[j] + b[j] * c[i]);
            *own += orders / 6.0;
        }
    }

    /// The form of one vector, three times.
    fn along(&self, way: DVec3) -> f64 {
        let [xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz] = self.0;
        let [x, y, z] = way.to_array();
        x * x * (xxx * x + 3.0 * (xxy * y + xxz * z))
            + y * y * (yyy * y + 3.0 * (yyx * x + yyz * z))
            + z * z * (zzz * z + 3.0 * (zzx * x + zzy * y))
            + 6.0 * xyz * x * y * z
    }

    fn trace(&self) -> DVec3 {
        let [xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, _] = self.0;
        DVec3::new(xxx + yyx + zzx, yyy + xxy + zzy, zzz + xxz + yyz)
    }
}

/// The box around all triangles.
fn bounds_of(tree: &WideTree) -> Aabb {
    PointTree::from(tree).bounds()
}

/// The group of all triangles below a child. Fills in those of the nodes on the way.
fn group_of(tree: &WideTree, child: Child, groups: &mut [[Group; WIDTH]]) -> Group {
    if child.is_leaf() {
        let blocks = &tree.blocks()[child.blocks()];
        let triangles: Vec<Group> = blocks
            .iter()
            .flat_map(corners_of_block)
            .map(Group::of_triangle)
            .collect();
        return Group::of_groups(&triangles);
    }
    let node = tree.nodes()[child.index()];
    let mut children = [Group::NONE; WIDTH];
    for lane in node.lanes() {
        children[lane] = group_of(tree, node.children[lane], groups);
    }
    groups[child.index()] = children;
    Group::of_groups(&children)
}

/// The triangles of a block that have an area.
fn corners_of_block(block: &Block) -> impl Iterator<Item = [DVec3; 3]> + '_ {
    let all = (0..LANES).map(|lane| block.corners_of(lane));
    let with_area = all.filter(|[a, _, _]| !a.is_nan());
    with_area.map(|corners| corners.map(|corner| corner.as_dvec3()))
}

/// The sum of solid angles of triangles.
///
/// Half of a solid angle is the argument of a complex number, and the argument of a product is the sum of the arguments, while that is below
/// π: one arc tangent serves several triangles.
fn angle_of_blocks(blocks: &[Block], point: DVec3) -> f64 {
    let mut sum = 0.0;
    let mut product = [1.0, 0.0];
    for corners in blocks.iter().flat_map(corners_of_block) {
        let angle = half_angle(corners, point);
        // Both arguments are below π / 2.
        if product[0] > 0.0 && angle[0] > 0.0 {
            let ([a, b], [c, d]) = (product, angle);
            product = [a * c - b * d, a * d + b * c];
        } else {
            sum += argument(product);
            product = angle;
        }
    }
    2.0 * (sum + argument(product))
}

/// The solid angle of a triangle, positive where the point sees its back.
pub(crate) fn solid_angle(corners: [DVec3; 3], point: DVec3) -> f64 {
    2.0 * argument(half_angle(corners, point))
}

/// A complex number of size 1 at most whose argument is half of the solid angle of a triangle, by A. van Oosterom and J. Strackee, *The Solid
/// Angle of a Plane Triangle*, 1983. 0 at a corner.
fn half_angle(corners: [DVec3; 3], point: DVec3) -> [f64; 2] {
    let [a, b, c] = corners.map(|corner| corner - point);
    let [of_a, of_b, of_c] = [a, b, c].map(DVec3::length);
    let volume = a.dot(b.cross(c));
    let product = of_a * of_b * of_c;
    let rest = product + a.dot(b) * of_c + b.dot(c) * of_a + c.dot(a) * of_b;
    if product > 0.0 {
        // Neither is larger than four products.
        [rest, volume].map(|x| 0.25 * x / product)
    } else {
        [0.0; 2]
    }
}

/// The argument of a complex number; 0 for 0.
fn argument([real, imaginary]: [f64; 2]) -> f64 {
    // Not `f64::atan2`, which may differ between platforms.
    libm::atan2(imaginary, real)
}
