//! The surface point that a ray hits: position, normals and colors.

use kd::glam::{Vec2, Vec3, Vec3A};
use kd::{Hit, Mesh, Ray};
use kd_scene::{Material, Surface};

use crate::stage::Stage;
use crate::tracer::PartHit;

/// A surface point at the hit of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint<'a> {
    /// The mesh that was hit, in scene coordinates.
    mesh: &'a Mesh,
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
    /// `None` if the triangle has no area and thus no normal.
    #[inline]
    pub(crate) fn new(
        stage: &'a Stage,
        with_textures: bool,
        ray: &Ray,
        hit: &PartHit,
    ) -> Option<Self> {
        let part = &stage.description().parts[hit.part];
        let shown = stage.shown(hit.part);
        let triangle = hit.hit.triangle as usize;
        let corners = shown
            .mesh
            .corners(hit.hit.triangle)
            .map(|corner| corner.as_dvec3());
        let [a, b, c] = corners;
        let flat_normal = (b - a).cross(c - a).try_normalize()?.as_vec3();
        let weights = Vec3::new(1.0 - hit.hit.u - hit.hit.v, hit.hit.u, hit.hit.v);
        let normals = if shown.morphed_normals.is_empty() {
            &part.surface.normals
        } else {
            &shown.morphed_normals
        };
        let smooth = normals.get(triangle).map(|[a, b, c]| {
            let normal = weights.x * *a + weights.y * *b + weights.z * *c;
            Vec3::from(shown.inverse_transpose * Vec3A::from(normal)).normalize_or_zero()
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
            mesh: &shown.mesh,
            hit: hit.hit,
            at: shown.mesh.surface_point(&hit.hit),
            flat_normal,
            normal,
            is_outside,
            material: &stage.description().materials[part.surface.materials[triangle] as usize],
            texture: if with_textures {
                texture_at(stage, &part.surface, triangle, weights)
            } else {
                Vec3::ONE
            } * color_at(&part.surface, triangle, weights),
        })
    }

    /// Origin for a ray that leaves on the side of the incoming ray.
    pub(crate) fn above(&self) -> Vec3 {
        self.mesh.offset_origin(&self.hit, self.flat_normal)
    }

    /// Origin for a ray that continues behind the surface.
    pub(crate) fn below(&self) -> Vec3 {
        self.mesh.offset_origin(&self.hit, -self.flat_normal)
    }
}

/// The interpolated color of the vertices; 1 without colors.
#[inline]
fn color_at(surface: &Surface, triangle: usize, weights: Vec3) -> Vec3 {
    let colors = surface.colors.get(triangle);
    colors.map_or(Vec3::ONE, |[a, b, c]| {
        weights.x * *a + weights.y * *b + weights.z * *c
    })
}

#[inline]
fn texture_at(stage: &Stage, surface: &Surface, triangle: usize, weights: Vec3) -> Vec3 {
    let number = surface.textures.get(triangle).copied();
    let texture = number.and_then(|number| stage.texture(number));
    let (Some(texture), Some(uvs)) = (texture, surface.uvs.get(triangle)) else {
        return Vec3::ONE;
    };
    let [a, b, c] = uvs.map(Vec2::from);
    texture.at((weights.x * a + weights.y * b + weights.z * c).to_array())
}
