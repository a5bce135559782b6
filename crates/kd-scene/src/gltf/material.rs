//! Materials of glTF, as far as Whitted's light knows them.

use glam::Vec3;
use gltf::material::AlphaMode;

use super::Reader;
use crate::{Material, Surface};

/// How much every surface that is no metal gives back straight on.
const PLAIN_MIRROR: f32 = 0.04;

impl Reader {
    /// Reads all materials and names all pictures. After those of the file comes the one of triangles that have none.
    pub(super) fn materials(&mut self, document: &gltf::Document) {
        let images = 0..self.json.images.len();
        let textures = images.map(|number| self.buffers.texture(&self.json, number, &self.file));
        self.scene.textures = textures.collect();
        self.scene.materials = document
            .materials()
            .map(|material| made(&material))
            .collect();
        self.scene.materials.push(Material::default());
    }

    /// The number of a material, that of its picture, and which of its places in it corners have.
    pub(super) fn look_of(&self, material: &gltf::Material<'_>) -> (u32, u32, u32) {
        let last = self.scene.materials.len() - 1;
        let number = material.index().unwrap_or(last).min(last);
        let number = u32::try_from(number).expect("each takes bytes of a file");
        let info = material.pbr_metallic_roughness().base_color_texture();
        let picture = info.as_ref().map(|info| info.texture().source().index());
        let picture = picture.filter(|picture| *picture < self.scene.textures.len());
        let picture = picture.and_then(|picture| u32::try_from(picture).ok());
        let set = info.map_or(0, |info| info.tex_coord());
        (number, picture.unwrap_or(Surface::NO_TEXTURE), set)
    }
}

fn made(material: &gltf::Material<'_>) -> Material {
    let surface = material.pbr_metallic_roughness();
    let [r, g, b, alpha] = surface.base_color_factor();
    let base = Vec3::new(r, g, b);
    let metal = surface.metallic_factor().clamp(0.0, 1.0);
    let rough = surface.roughness_factor().clamp(0.0, 1.0);
    let specular = Vec3::splat(PLAIN_MIRROR).lerp(base, metal);
    let diffuse = base * (1.0 - metal);
    // Rough surfaces blur what they mirror, which is not done here: it fades instead.
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
