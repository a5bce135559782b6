//! Conversion of glTF materials to the material model of the renderer.

use glam::{Mat2, Vec2, Vec3};
use serde::de::DeserializeOwned;

use super::Reader;
use super::json::{
    self, Extensions, SpecularGlossiness, Surface as Pbr, TextureInfo, TextureTransform, Whole,
};
use crate::report::WarningCode;
use crate::{AlphaMode, LoadError, Material, Surface};

/// Mirror reflectance of non-metals at normal incidence.
const PLAIN_MIRROR: f32 = 0.04;

/// What triangles need of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// Index in the scene.
    pub(super) material: u32,
    /// Index in the scene, or [`Surface::NO_TEXTURE`].
    pub(super) texture: u32,
    /// The set of texture coordinates.
    pub(super) set: usize,
    /// From the texture coordinates of a vertex to those in the image.
    pub(super) to_image: (Mat2, Vec2),
    /// Whether alpha has a meaning.
    pub(super) has_alpha: bool,
}

impl Look {
    fn plain(material: u32) -> Self {
        Self {
            material,
            texture: Surface::NO_TEXTURE,
            set: 0,
            to_image: (Mat2::IDENTITY, Vec2::ZERO),
            has_alpha: false,
        }
    }

    pub(super) fn uv(&self, uv: [f32; 2]) -> [f32; 2] {
        let (matrix, offset) = self.to_image;
        (matrix * Vec2::from(uv) + offset).to_array()
    }
}

impl Reader<'_> {
    /// The look of a material of the file, or of the default one. A material that cannot be read is the default one.
    pub(super) fn look(&mut self, number: Option<Whole>) -> Look {
        let key = number.map(|number| number.0);
        if let Some(known) = self.looks.get(&key) {
            return *known;
        }
        let look = match number {
            None => Look::plain(self.add_material(Material::default())),
            Some(number) => self.read_look(number).unwrap_or_else(|error| {
                self.warn_of(&error, WarningCode::BadMaterial, "the default material");
                Look::plain(self.add_material(Material::default()))
            }),
        };
        self.looks.insert(key, look);
        look
    }

    fn add_material(&mut self, material: Material) -> u32 {
        let number = self.scene.materials.len();
        self.scene.materials.push(material);
        u32::try_from(number).expect("fewer than 2^32, as each takes bytes of a file")
    }

    fn read_look(&mut self, number: Whole) -> Result<Look, LoadError> {
        let pointer = format!("/materials/{}", number.0);
        let mut material: json::Material = self.document.get("/materials", number)?;
        let extension = |name: &'static str| Of {
            extensions: &material.extensions,
            pointer: &pointer,
            name,
        };
        let glossy: Option<SpecularGlossiness> =
            extension("KHR_materials_pbrSpecularGlossiness").read(self)?;
        let mut converted = match &glossy {
            Some(glossy) => of_glossy(glossy),
            None => of_rough(&material.pbr_metallic_roughness),
        };
        let strength =
            extension("KHR_materials_emissive_strength").number(self, "emissiveStrength")?;
        converted.emission =
            strength.unwrap_or(1.0).max(0.0) * Vec3::from(material.emissive_factor);
        let refraction = extension("KHR_materials_ior").number(self, "ior")?;
        let transmission =
            extension("KHR_materials_transmission").number(self, "transmissionFactor")?;
        if let Some(transmission) = transmission {
            let passed = transmission.clamp(0.0, 1.0);
            converted.transmittance = passed;
            converted.refraction = refraction.unwrap_or(1.5);
            converted.diffuse *= 1.0 - passed;
            converted.ambient *= 1.0 - passed;
        }
        if material.extensions.contains_key("KHR_materials_unlit") {
            let [r, g, b, _] = material
                .pbr_metallic_roughness
                .base_color_factor
                .unwrap_or([1.0; 4]);
            converted = Material {
                ambient: Vec3::new(r, g, b),
                diffuse: Vec3::ZERO,
                transmittance: converted.transmittance,
                refraction: converted.refraction,
                alpha: converted.alpha,
                ..Material::default()
            };
        }
        if material.emissive_texture.is_some() && converted.emission != Vec3::ZERO {
            self.warn(
                &pointer,
                WarningCode::Unused,
                "the emissive texture is not used: the material emits no light",
            );
            converted.emission = Vec3::ZERO;
        }
        let texture = match glossy {
            Some(glossy) => glossy.diffuse_texture,
            None => material.pbr_metallic_roughness.base_color_texture.take(),
        };
        converted.alpha_mode = self.alpha_mode(&material, &pointer);
        let has_alpha = converted.alpha_mode != AlphaMode::Opaque;
        let look = Look {
            has_alpha,
            ..Look::plain(self.add_material(converted))
        };
        let Some(info) = texture else {
            return Ok(look);
        };
        Ok(self
            .textured(look, &info, &pointer)
            .unwrap_or_else(|error| {
                self.warn_of(&error, WarningCode::BadMaterial, "a plain color");
                look
            }))
    }

    fn alpha_mode(&mut self, material: &json::Material, pointer: &str) -> AlphaMode {
        match material.alpha_mode.as_deref() {
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some("MASK") => AlphaMode::Mask {
                cutoff: material.alpha_cutoff.unwrap_or(0.5),
            },
            Some("BLEND") => AlphaMode::Blend,
            Some(other) => {
                let what = format!("the alphaMode `{other}` is unknown; the surface is opaque");
                self.warn(pointer, WarningCode::BadMaterial, what);
                AlphaMode::Opaque
            }
        }
    }

    /// A look with the texture that a material uses.
    fn textured(
        &mut self,
        look: Look,
        info: &TextureInfo,
        pointer: &str,
    ) -> Result<Look, LoadError> {
        let of = Of {
            extensions: &info.extensions,
            pointer,
            name: "KHR_texture_transform",
        };
        let transform: TextureTransform = of.read(self)?.unwrap_or_default();
        let texture: json::Texture = self.document.get("/textures", info.index)?;
        // Some files have their only image in an extension, for a format of its own.
        let mut of_extensions = texture.extensions.iter().filter_map(|(name, value)| {
            let source = value.get("source")?.as_u64()?;
            Some((name, Whole(usize::try_from(source).ok()?)))
        });
        let image = match (texture.source, of_extensions.next()) {
            (Some(image), _) | (None, Some((_, image))) => image,
            (None, None) => {
                let pointer = format!("/textures/{}", info.index.0);
                self.warn(
                    &pointer,
                    WarningCode::MissingFile,
                    "the texture has no image; it is a plain color",
                );
                return Ok(look);
            }
        };
        let (sine, cosine) = libm::sincosf(transform.rotation);
        let [x, y] = transform.scale.unwrap_or([1.0; 2]);
        let turn = Mat2::from_cols(Vec2::new(cosine, -sine), Vec2::new(sine, cosine));
        Ok(Look {
            texture: self.image(image)?,
            set: transform.tex_coord.unwrap_or(info.tex_coord).0,
            to_image: (
                turn * Mat2::from_diagonal(Vec2::new(x, y)),
                Vec2::from(transform.offset),
            ),
            ..look
        })
    }

    /// The index in the scene of an image of the file.
    fn image(&mut self, number: Whole) -> Result<u32, LoadError> {
        if let Some(known) = self.images.get(&number.0) {
            return Ok(*known);
        }
        let texture = self.buffers.texture(&self.document, number)?;
        let index = u32::try_from(self.scene.textures.len());
        let index = index.expect("fewer than 2^32, as each takes bytes of a file");
        self.scene.textures.push(texture);
        self.images.insert(number.0, index);
        Ok(index)
    }
}

/// An extension of an element.
struct Of<'a> {
    extensions: &'a Extensions,
    /// Where the element is.
    pointer: &'a str,
    name: &'static str,
}

impl Of<'_> {
    fn read<T: DeserializeOwned>(&self, reader: &Reader<'_>) -> Result<Option<T>, LoadError> {
        let value = self.extensions.get(self.name);
        let pointer = format!("{}/extensions/{}", self.pointer, self.name);
        value
            .map(|value| reader.document.read(value, &pointer))
            .transpose()
    }

    /// A number of the extension.
    fn number(&self, reader: &Reader<'_>, property: &str) -> Result<Option<f32>, LoadError> {
        let all: Option<std::collections::BTreeMap<String, serde_json::Value>> =
            self.read(reader)?;
        let value = all.as_ref().and_then(|all| all.get(property));
        let pointer = format!("{}/extensions/{}/{property}", self.pointer, self.name);
        value
            .map(|value| reader.document.read(value, &pointer))
            .transpose()
    }
}

/// A material by metalness and roughness.
fn of_rough(surface: &Pbr) -> Material {
    let [r, g, b, alpha] = surface.base_color_factor.unwrap_or([1.0; 4]);
    let base = Vec3::new(r, g, b);
    let metal = surface.metallic_factor.unwrap_or(1.0).clamp(0.0, 1.0);
    let rough = surface.roughness_factor.unwrap_or(1.0).clamp(0.0, 1.0);
    let specular = Vec3::splat(PLAIN_MIRROR).lerp(base, metal);
    let diffuse = base * (1.0 - metal);
    Material {
        ambient: 0.25 * (diffuse + metal * base),
        diffuse: diffuse + 0.3 * metal * rough * base,
        alpha: alpha.clamp(0.0, 1.0),
        ..reflecting(specular, rough)
    }
}

/// A material by specular color and glossiness.
fn of_glossy(surface: &SpecularGlossiness) -> Material {
    let [r, g, b, alpha] = surface.diffuse_factor.unwrap_or([1.0; 4]);
    let diffuse = Vec3::new(r, g, b);
    let rough = 1.0 - surface.glossiness_factor.unwrap_or(1.0).clamp(0.0, 1.0);
    Material {
        ambient: 0.25 * diffuse,
        diffuse,
        alpha: alpha.clamp(0.0, 1.0),
        ..reflecting(
            Vec3::from(surface.specular_factor.unwrap_or([1.0; 3])),
            rough,
        )
    }
}

/// The highlights and mirrors of a surface that reflects `specular`.
fn reflecting(specular: Vec3, rough: f32) -> Material {
    // Rough surfaces blur reflections. The renderer has no blur, so reflections fade with roughness instead.
    let smooth = (1.0 - rough) * (1.0 - rough);
    Material {
        specular: specular * smooth,
        mirror: specular * smooth,
        shine: (2.0 / (rough * rough).max(0.05).powi(2) - 2.0).clamp(1.0, 1000.0),
        ..Material::default()
    }
}
