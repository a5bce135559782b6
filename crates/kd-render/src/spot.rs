//! Where on the surface of a part a hit is: its material, color and alpha.

use kd::glam::{Vec2, Vec3};
use kd_scene::{Material, Surface};

use crate::stage::Stage;
use crate::texture::TextureImage;
use crate::tracer::PartHit;

/// The place of a hit on the surface of a part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) triangle: usize,
    /// Weights of the three corners; their sum is 1.
    pub(crate) weights: Vec3,
    pub(crate) material: &'a Material,
}

impl<'a> Spot<'a> {
    #[inline]
    pub(crate) fn new(stage: &'a Stage, hit: &PartHit) -> Self {
        let description = stage.description();
        let surface = &description.parts[hit.part].surface;
        let triangle = hit.hit.triangle as usize;
        Self {
            surface,
            triangle,
            weights: Vec3::new(1.0 - hit.hit.u - hit.hit.v, hit.hit.u, hit.hit.v),
            material: &description.materials[surface.materials[triangle] as usize],
        }
    }

    /// Color of the texture and of the vertices; 1 without any.
    #[inline]
    pub(crate) fn color(&self, stage: &Stage, with_textures: bool) -> Vec3 {
        let number = self.surface.textures.get(self.triangle);
        let number = number.copied().filter(|_| with_textures);
        let texture = number.and_then(|number| self.texture(stage, number));
        let of_texture = texture.map_or(Vec3::ONE, |(texture, uv)| texture.at(uv));
        let colors = self.surface.colors.get(self.triangle);
        let of_vertices = colors.map_or(Vec3::ONE, |[a, b, c]| {
            let Vec3 { x, y, z } = self.weights;
            x * *a + y * *b + z * *c
        });
        of_texture * of_vertices
    }

    /// The product of the alpha of the material, of the texture and of the vertices.
    #[inline]
    pub(crate) fn alpha(&self, stage: &Stage, with_textures: bool) -> f32 {
        let of_texture = if with_textures {
            self.alpha_of_texture(stage).unwrap_or(1.0)
        } else {
            1.0
        };
        let alphas = self.surface.alphas.get(self.triangle);
        let of_vertices = alphas.map_or(1.0, |alphas| self.weights.dot(Vec3::from(*alphas)));
        self.material.alpha * of_texture * of_vertices
    }

    fn alpha_of_texture(&self, stage: &Stage) -> Option<f32> {
        if let Some(number) = self.material.alpha_texture {
            let (mask, uv) = self.texture(stage, number)?;
            return Some(mask.mask_at(uv));
        }
        let number = *self.surface.textures.get(self.triangle)?;
        let (texture, uv) = self.texture(stage, number)?;
        Some(texture.alpha_at(uv))
    }

    /// A texture, and the coordinates in it.
    #[inline]
    fn texture<'b>(&self, stage: &'b Stage, number: u32) -> Option<(&'b TextureImage, [f32; 2])> {
        let texture = stage.texture(number)?;
        let [a, b, c] = self.surface.uvs.get(self.triangle)?.map(Vec2::from);
        let Vec3 { x, y, z } = self.weights;
        Some((texture, (x * a + y * b + z * c).to_array()))
    }
}
