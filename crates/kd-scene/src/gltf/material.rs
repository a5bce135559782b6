//! Conversion of glTF materials to the material model of the renderer.

use glam::Vec3;
use gltf::material::AlphaMode;

use super::Reader;
use crate::{Material, Surface};

/// Mirror reflectance of non-metals at normal incidence.
const PLAIN_MIRROR: f32 = 0.04;

impl Reader {
    /// Reads all materials and locates all images. The default material, for triangles without one, is the last.
    pub(super) fn materials(&mut self, document: &gltf::Document) {
        let images = 0..self.json.images.len();
        let textures = images.map(|number| self.buffers.texture(&self.json, number, &self.file));
        self.scene.textures = textures.collect();
        self.scene.materials = document
            .materials()
            .map(|material| converted(&material))
            .collect();
        self.scene.materials.push(Material::default());
    }

    /// The indices of a material, of its texture, and of the set of texture coordinates that it uses.
    pub(super) fn material_of(&self, material: &gltf::Material<'_>) -> (u32, u32, u32) {
        let last = self.scene.materials.len() - 1;
        let number = material.index().unwrap_or(last).min(last);
        let number = u32::try_from(number).expect("fewer than 2^32, as each takes bytes of a file");
        let info = material.pbr_metallic_roughness().base_color_texture();
        let image = info.as_ref().map(|info| info.texture().source().index());
        let image = image.filter(|image| *image < self.scene.textures.len());
        let image = image.and_then(|image| u32::try_from(image).ok());
        let set = info.map_or(0, |info| info.tex_coord());
        (number, image.unwrap_or(Surface::NO_TEXTURE), set)
    }
}

fn converted(material: &gltf::Material<'_>) -> Material {
    let surface = material.pbr_metallic_roughness();
    let [r, g, b, alpha] = surface.base_color_factor();
    let base = Vec3::new(r, g, b);
    let metal = surface.metallic_factor().clamp(0.0, 1.0);
    let rough = surface.roughness_factor().clamp(0.0, 1.0);
    let specular = Vec3::splat(PLAIN_MIRROR).lerp(base, metal);
    let diffuse = base * (1.0 - metal);
    // Rough surfaces blur reflections. The renderer has no blur, so reflections fade with roughness instead.
    let smooth = (1.0 - rough) * (1.0 - rough);
    let is_clear = material.alpha_mode() == AlphaMode::Blend;
    Material {
        ambient: 0.25 * (diffuse + metal * base),
        diffuse: diffuse + 0.3 * metal * rough * base,
        specular: specular * smooth,
        mirror: specular * smooth,
        shine: (2.0 / (rough * rough).max(0.05).powi(2) - 2.0).clamp(1.0, 1000.0),
        transmittance: if is_clear {
            (1.0 - alpha).clamp(0.0, 1.0)
        } else {
            0.0
        },
        refraction: 1.0,
    }
}
