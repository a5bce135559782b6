//! Origins of rays that leave a surface.
//!
//! A ray that starts on a triangle hits it again at a `t` near 0, or not, by rounding. So it starts at
//! `o = p + s n`, rounded to f32, where `p` is the point of the hit, `n` the unit normal on the ray's side and `s` the step.
//!
//! # The bound
//!
//! The point is computed in f64 from corners, `u` and `v`. Any weights that add up to 1 give a point in the plane of the corners, so
//! it errs by 2⁻⁵¹ of the coordinates across the plane, at any distance of the ray that found it. ([`Ray::at`](crate::Ray::at)
//! errs with `t`.) Two errors remain, and the step covers their sum:
//!
//! - **Rounding.** Coordinate `k` of `o` errs by at most 2⁻²⁴ |oₖ|, so `o` moves across the plane by at most
//!   `R = 2⁻²⁴ Σ |nₖ pₖ|`, and by 2⁻²⁴ s.
//! - **The triangle test** (`decision.rs` of kd-trace). It shears corners, given from `o`, so that the ray runs along the axis `c` of the
//!   largest component of its direction `d`. It finds a point `P` of the triangle which is at `t d + δ`, where δ is an
//!   error on the axes across. `P` is in the plane, at `n · P = -h` if `o` is at the height `h` above the plane, so
//!   `t (n · d) = -h - n · δ`. A ray that leaves has `n · d > 0`. It finds `t < 0`, hence no hit, if `h > |n · δ|`.
//!
//! Let `x` be the sheared coordinates on one axis `a` across. They are on both sides of 0 where the ray hits. Let `W` be the largest
//! minus the smallest. `E` is the extent of the triangle on each axis, and a shear is at most 1, so `W ≤ E_a + E_c`. On either way to
//! compute `P`, `|δ_a| ≤ 2⁻²⁷ W`, up to a part of 2⁻²⁰ of it:
//!
//! - *Weights of coordinates rounded to 26 bits.* These weights `w`, which add up to 1, are exact up to 2⁻⁵³, so δ is the
//!   weighted error of rounding, at most 2⁻²⁶ Σ wᵢ |xᵢ|. Numbers from -β to α with a mean of 0 have a mean magnitude
//!   of at most 2αβ / (α + β) ≤ W/2.
//! - *Weights of coordinates that are not rounded*, used where their sum σ is at least 2⁻²⁴ M², M being the largest coordinate on
//!   both axes across. The weight of corner `i` is the difference of `xⱼ yₖ` and `xₖ yⱼ`. It errs by 2⁻⁵³ of the three magnitudes,
//!   and is at most σ itself. So `σ |δ_a| ≤ 2⁻⁵³ (2 (|x₁ x₂ y₃| + |x₁ x₃ y₂| + |x₂ x₃ y₁|) + 3 σ M)`. Let `x₃` be the one on its side
//!   of 0. Since `|x₂ y₃| ≤ |x₃ y₂| + σ`, the three products are at most 3 αβM + σM, and αβ ≤ M W/2. So
//!   `|δ_a| ≤ 2⁻⁵³ (3 M² W / σ + 5 M) ≤ ¾ 2⁻²⁷ W`, up to 2⁻⁵⁰ M.
//!
//! With the worst axis `c`, `|n · δ| ≤ T = 2⁻²⁷ max over c of Σ |nₐ| (E_a + E_c)`, the sum over both `a ≠ c`. The step is
//! `s = (1.5 T + R) (1 + 2⁻²⁰)`, so that `h ≥ 1.5 T`.
//!
//! # What the margin of T/2 covers
//!
//! - Larger triangles in or behind the plane. For them `n · P ≤ -h`, and the rest of the proof holds with their extents. So
//!   triangles of 1.4 times the extents are not hit either. In a convex mesh, every triangle is in or behind the plane. T/10
//!   remains. Edges are orthogonal to `n`, so on the axis `m` of the largest extent `|n_m|` is at most the sum of the other two, which
//!   is then at least ½. With `c = m`, `T ≥ 2⁻²⁸ max E`, and T/10 is above 2⁻³²·⁵ max E + 2⁻³³ max E.
//! - The normal errs by at most 2⁻³⁴ if the height of the triangle is at least 2⁻¹⁶ of its longest edge. That adds at most
//!   2⁻⁵⁷ of each coordinate to `R`. An extent that is not 0 is at least 2⁻²⁴ of the coordinates on its axis, so this is up to
//!   2⁻³²·⁵ max E in all. Where an extent is 0, the normal is exact.
//! - Arithmetic in f64: the corners from `o`, shear and `t` err by 2⁻⁴⁸ D, where D is the distance of the corners from `o`. That is
//!   2⁻³³ max E for D up to 2¹⁵ max E.
//!
//! A `t` below 0 could still be rounded to 0. For the triangle of the hit its magnitude is at least 2⁻³² max E / |d|, far above the
//! smallest f32 unless the direction is 2¹⁰⁰ times as long as the triangle.

use glam::{DVec3, Vec3};

use crate::{Hit, Mesh};

impl Mesh {
    /// The point of a hit, from the corners of its triangle, rounded once.
    ///
    /// Its error does not depend on the distance of the ray's origin, as that of [`Hit::point`] does: half a unit in the last place
    /// of each coordinate.
    ///
    /// # Panics
    ///
    /// If the mesh lacks the triangle.
    pub fn surface_point(&self, hit: &Hit) -> Vec3 {
        surface_point_of(self.corners(hit.triangle), hit)
    }

    /// [`surface_point`](Self::surface_point) before it is rounded to f32, to add the origin of a [`WorldMesh`](crate::WorldMesh): in
    /// the plane of the corners up to 2⁻⁵¹ of the coordinates. Along the plane it errs by up to 2⁻²⁴ of the triangle's extent, since a
    /// hit has f32 weights.
    ///
    /// # Panics
    ///
    /// If the mesh lacks the triangle.
    pub fn surface_point_f64(&self, hit: &Hit) -> DVec3 {
        let corners = self.corners(hit.triangle).map(|corner| corner.as_dvec3());
        point_at(corners, hit)
    }

    /// The origin of a ray that leaves the surface at a hit, on the side of its triangle that `side` points to.
    ///
    /// `side` is a vector of any length: the [`normal`](Self::normal), its negative for a ray that continues behind the surface, or
    /// the reversed direction of the ray that was traced. Only its side counts; zero is the side of [`normal`](Self::normal). (At the
    /// silhouette of a closed mesh, a ray from far away can hit a triangle from behind: its reversed direction then points inside.)
    ///
    /// A ray from there to that side, for `t` from 0, does not hit the triangle again, at any scale and any distance
    /// of the ray that found the hit. Neither does it hit triangles that are in the plane of this one or behind it, and extend at most
    /// 1.4 times as far along each axis, up to a distance of 2¹⁵ extents: of a closed convex mesh of such triangles it hits none.
    ///
    /// The origin is above the surface by at most 2⁻²⁴ of the triangle's largest extent plus 2⁻²² of its largest coordinate. A
    /// quarter of that fails at some points of every kind of mesh that was tried. The source has the proof.
    ///
    /// Not proven for triangles whose height is below 2⁻¹⁶ of their longest edge. A triangle of zero area has no plane, and the step is
    /// along `side`.
    ///
    /// ```
    /// use kd_core::{Hit, Mesh};
    ///
    /// let mesh = Mesh::new(vec![[5e5, 5e6, 9.0], [5e5 + 1.0, 5e6, 9.0], [5e5, 5e6 + 1.0, 9.0]], vec![[0, 1, 2]])?;
    /// let hit = Hit { t: 1e9, u: 0.0, v: 0.5, triangle: 0 };
    /// let above = mesh.offset_origin(&hit, mesh.normal(0));
    /// assert_eq!(above.to_array(), [5e5, 5e6 + 0.5, 9.0_f32.next_up()]);
    /// # Ok::<(), kd_core::MeshError>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the mesh lacks the triangle.
    pub fn offset_origin(&self, hit: &Hit, side: Vec3) -> Vec3 {
        offset_origin_of(self.corners(hit.triangle), hit, side)
    }
}

/// [`Mesh::surface_point`] on a triangle that is not in a mesh, for example one after a transform.
pub fn surface_point_of(corners: [Vec3; 3], hit: &Hit) -> Vec3 {
    point_at(corners.map(|corner| corner.as_dvec3()), hit).as_vec3()
}

/// [`Mesh::offset_origin`] on a triangle that is not in a mesh, for example one after a transform.
pub fn offset_origin_of(corners: [Vec3; 3], hit: &Hit, side: Vec3) -> Vec3 {
    let corners = corners.map(|corner| corner.as_dvec3());
    let [a, b, c] = corners;
    let side = side.as_dvec3();
    let normal = (b - a).cross(c - a);
    let normal = normal.normalize_or(side.normalize_or_zero());
    let normal = if normal.dot(side) < 0.0 {
        -normal
    } else {
        normal
    };
    let point = point_at(corners, hit);
    let extent = a.max(b).max(c) - a.min(b).min(c);
    (point + step(point, normal, extent) * normal).as_vec3()
}

/// In f64, so that it is in the plane of the corners.
fn point_at([a, b, c]: [DVec3; 3], hit: &Hit) -> DVec3 {
    a + f64::from(hit.u) * (b - a) + f64::from(hit.v) * (c - a)
}

/// The step `s` of the proof above.
fn step(point: DVec3, normal: DVec3, extent: DVec3) -> f64 {
    const TEST: f64 = 1.5 / (1 << 27) as f64;
    const ROUNDING: f64 = 1.0 / (1 << 24) as f64;
    const SECOND_ORDER: f64 = 1.0 / (1 << 20) as f64;
    let normal = normal.abs();
    // T is 2⁻²⁷ times the largest component. Of axis c: the normal's components on other axes, times the extents there and on c.
    let across = DVec3::splat(normal.element_sum()) - normal;
    let test = DVec3::splat(normal.dot(extent)) - normal * extent + across * extent;
    let rounding = normal.dot(point.abs());
    // Subnormal coordinates err by 2⁻¹⁵⁰ each.
    let least = f64::from(f32::from_bits(1));
    (TEST * test.max_element() + ROUNDING * rounding + least) * (1.0 + SECOND_ORDER)
}

/// Moves a point along `normal` by a fixed rule, for surfaces other than a mesh. For a hit of a mesh use
/// [`Mesh::offset_origin`], which is proven to suffice.
///
/// `normal` has unit length and points to the side where the new ray starts. The step is about 256 units in the last
/// place of each coordinate, and 2⁻¹⁶ near the origin of the coordinate system. It knows neither the error of the point nor the
/// size of the surface:
///
/// - It suffices where `point` errs by less than that. [`Hit::point`] errs with `t`: on a unit sphere seen from 1000 radii,
///   some of these points are still inside, and from 10 000 radii about half of them.
/// - At a coordinate of 5 000 000, the step is about 150 units.
/// - Scenes far smaller than 1 need a smaller step than 2⁻¹⁶.
///
/// (C. Wächter and N. Binder, *A Fast and Robust Method for Avoiding Self-Intersection*, Ray Tracing Gems, 2019.)
pub fn offset_origin(point: Vec3, normal: Vec3) -> Vec3 {
    const NEAR_ZERO: f32 = 1.0 / 32.0;
    const FIXED_STEP: f32 = 1.0 / 65_536.0;
    const RELATIVE_STEP: f32 = 256.0 * f32::EPSILON;
    let offset = |p: f32, n: f32| {
        if p.abs() < NEAR_ZERO {
            p + n * FIXED_STEP
        } else {
            p + n * (p.abs() * RELATIVE_STEP)
        }
    };
    Vec3::new(
        offset(point.x, normal.x),
        offset(point.y, normal.y),
        offset(point.z, normal.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const HIT: Hit = Hit {
        t: 1.0,
        u: 0.25,
        v: 0.5,
        triangle: 0,
    };

    fn mesh(corners: [[f32; 3]; 3]) -> Mesh {
        Mesh::new(corners.to_vec(), vec![[0, 1, 2]]).expect("valid")
    }

    #[test]
    fn surface_points_are_weighted_corners() {
        let mesh = mesh([[8.0, 0.0, 2.0], [12.0, 0.0, 2.0], [8.0, 4.0, 4.0]]);
        assert_eq!(mesh.surface_point(&HIT), Vec3::new(9.0, 2.0, 3.0));
    }

    #[test]
    fn the_side_chooses_the_direction_of_the_step_only() {
        let mesh = mesh([[0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [0.0, 4.0, 2.0]]);
        let up = mesh.offset_origin(&HIT, mesh.normal(0));
        assert!(up.z > 2.0 && up.z < 2.0 + 1e-6, "{up}");
        assert_eq!(up.truncate().to_array(), [1.0, 2.0], "straight up");
        for side in [Vec3::new(50.0, -9.0, 1e-3), Vec3::ZERO, 1e30 * Vec3::Z] {
            assert_eq!(mesh.offset_origin(&HIT, side), up, "{side}");
        }
        let down = mesh.offset_origin(&HIT, Vec3::NEG_Z);
        assert!(down.z < 2.0 && down.z > 2.0 - 1e-6, "{down}");
    }

    #[test]
    fn triangles_without_area_have_origins_too() {
        for corners in [[[1.0; 3]; 3], [[0.0; 3], [1.0; 3], [3.0; 3]]] {
            let mesh = mesh(corners);
            let point = mesh.surface_point(&HIT);
            let up = mesh.offset_origin(&HIT, 2.0 * Vec3::Z);
            assert!(up.z > point.z && up.z < point.z + 1e-6, "{up}");
            assert_eq!(mesh.offset_origin(&HIT, Vec3::ZERO), point, "no side");
        }
    }

    #[test]
    fn the_fixed_rule_moves_points_at_every_scale() {
        for p in [0.0, 1e-3, 0.5, 1.0, 1e3, 1e6] {
            let up = offset_origin(Vec3::splat(p), Vec3::Y);
            assert!(up.y > p && up.x == p && up.z == p, "{p}: {up}");
        }
    }
}
