//! The surface point that a ray hits: position, normals and colors.

use kd::glam::{Vec3, Vec3A};
use kd::scene::{offset_origin_of, surface_point_of};
use kd::{Hit, Ray};
use kd_scene::Material;

use crate::spot::Spot;
use crate::stage::Stage;
use crate::tracer::PartHit;

/// A surface point at the hit of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint<'a> {
    /// The corners of the triangle that was hit, in scene coordinates.
    corners: [Vec3; 3],
    hit: Hit,
    /// Position in scene coordinates.
    pub(crate) at: Vec3,
    /// Unit normal of the triangle, towards the origin of the ray.
    pub(crate) flat_normal: Vec3,
    /// Unit shading normal, interpolated where the surface is smooth, on the same side as `flat_normal`.
    pub(crate) normal: Vec3,
    /// Whether the ray arrives from the outside of the surface.
    pub(crate) is_outside: bool,
    pub(crate) material: &'a Material,
    /// Color of the texture and of the vertices, a factor on the colors of the material; 1 without any.
    pub(crate) texture: Vec3,
}

impl<'a> SurfacePoint<'a> {
    /// `None` if the triangle has no area and thus no normal, or if its part is invisible.
    #[inline]
    pub(crate) fn new(
        stage: &'a Stage,
        with_textures: bool,
        ray: &Ray,
        hit: &PartHit,
    ) -> Option<Self> {
        let spot = Spot::new(stage, hit);
        let shown = stage.shown(hit.part);
        let instance = shown.instances[hit.instance as usize];
        let corners = stage.corners(hit)?;
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let flat_normal = (b - a).cross(c - a).try_normalize()?.as_vec3();
        let flat_normal = if instance.is_mirrored {
            -flat_normal
        } else {
            flat_normal
        };
        let weights = spot.weights;
        let normals = if shown.morphed_normals.is_empty() {
            &spot.surface.normals
        } else {
            &shown.morphed_normals
        };
        let smooth = normals.get(spot.triangle).map(|[a, b, c]| {
            let normal = weights.x * *a + weights.y * *b + weights.z * *c;
            Vec3::from(instance.inverse_transpose * Vec3A::from(normal)).normalize_or_zero()
        });
        let smooth = smooth.filter(|normal| *normal != Vec3::ZERO);
        // Vertex normals of the file decide which side is outside; without them, the order of the corners does.
        let outwards = smooth.unwrap_or(flat_normal);
        let flat_outwards = if outwards.dot(flat_normal) < 0.0 {
            -flat_normal
        } else {
            flat_normal
        };
        let is_outside = ray.direction.dot(flat_outwards) < 0.0;
        let side = if is_outside { 1.0 } else { -1.0 };
        let flat_normal = side * flat_outwards;
        let mut normal = side * outwards;
        // Near a silhouette, an interpolated normal may point away from the origin of the ray.
        if normal.dot(ray.direction) > 0.0 {
            normal = (normal - normal.project_onto(ray.direction)).normalize_or(flat_normal);
        }
        Some(Self {
            corners,
            hit: hit.hit,
            at: surface_point_of(corners, &hit.hit),
            flat_normal,
            normal,
            is_outside,
            material: spot.material,
            texture: spot.color(stage, with_textures),
        })
    }

    /// Origin for a ray that leaves on the side of the incoming ray.
    pub(crate) fn above(&self) -> Vec3 {
        offset_origin_of(self.corners, &self.hit, self.flat_normal)
    }

    /// Origin for a ray that continues behind the surface.
    pub(crate) fn below(&self) -> Vec3 {
        offset_origin_of(self.corners, &self.hit, -self.flat_normal)
    }
}
