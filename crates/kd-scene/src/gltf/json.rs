//! The JSON of a glTF file, read element by element: what nothing uses cannot be wrong.

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::LoadError;

/// The parsed text of a file.
#[derive(Debug)]
pub(super) struct Document {
    file: String,
    root: Value,
}

/// A whole number. Some exporters write `3.0`, which is the same number in JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Whole(pub(super) usize);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Up to here, `f64` has all whole numbers.
        const EXACT: f64 = 9_007_199_254_740_992.0;
        let number = serde_json::Number::deserialize(deserializer)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number between 0 and 2^53"
        )]
        let of_float = |x: f64| (x.fract() == 0.0 && (0.0..EXACT).contains(&x)).then_some(x as u64);
        let whole = number
            .as_u64()
            .or_else(|| number.as_f64().and_then(of_float));
        let whole = whole.and_then(|whole| usize::try_from(whole).ok());
        let expected = || D::Error::custom(format!("expected a whole number, found {number}"));
        whole.map(Self).ok_or_else(expected)
    }
}

/// A text; anything else is as if it were not there.
fn text<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    Ok(match Value::deserialize(deserializer)? {
        Value::String(text) => text,
        _ => String::new(),
    })
}

/// A text or a number as text; anything else is as if it were not there.
fn plain<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    Ok(match Value::deserialize(deserializer)? {
        Value::String(text) => text,
        Value::Number(number) => number.to_string(),
        _ => String::new(),
    })
}

/// The properties of an element that extensions define, by their names.
pub(super) type Extensions = Map<String, Value>;

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Asset {
    #[serde(deserialize_with = "plain")]
    pub(super) version: String,
    #[serde(deserialize_with = "plain")]
    pub(super) min_version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<Whole>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    #[serde(deserialize_with = "text")]
    pub(super) name: String,
    pub(super) children: Vec<Whole>,
    pub(super) mesh: Option<Whole>,
    pub(super) skin: Option<Whole>,
    pub(super) camera: Option<Whole>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<Vec<f64>>,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Vec<f64>>,
}

/// Accessors by the names of attributes.
pub(super) type Attributes = std::collections::BTreeMap<String, Whole>;

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<Whole>,
    pub(super) material: Option<Whole>,
    pub(super) mode: Option<Whole>,
    pub(super) targets: Vec<Attributes>,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<Whole>,
    pub(super) byte_offset: Whole,
    pub(super) component_type: Whole,
    pub(super) normalized: bool,
    pub(super) count: Whole,
    pub(super) r#type: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sparse {
    pub(super) count: Whole,
    pub(super) indices: SparseArray,
    pub(super) values: SparseArray,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SparseArray {
    pub(super) buffer_view: Whole,
    pub(super) byte_offset: Whole,
    pub(super) component_type: Whole,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: Whole,
    pub(super) byte_offset: Whole,
    pub(super) byte_length: Whole,
    pub(super) byte_stride: Whole,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: Whole,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Image {
    #[serde(deserialize_with = "text")]
    pub(super) name: String,
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<Whole>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Texture {
    pub(super) source: Option<Whole>,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Material {
    pub(super) pbr_metallic_roughness: Surface,
    pub(super) emissive_factor: [f32; 3],
    pub(super) emissive_texture: Option<Value>,
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f32>,
    pub(super) extensions: Extensions,
}

/// `pbrMetallicRoughness` of a material.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Surface {
    pub(super) base_color_factor: Option<[f32; 4]>,
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: Option<f32>,
    pub(super) roughness_factor: Option<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: Whole,
    pub(super) tex_coord: Whole,
    pub(super) extensions: Extensions,
}

/// `KHR_texture_transform` of a use of a texture.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub(super) offset: [f32; 2],
    pub(super) rotation: f32,
    pub(super) scale: Option<[f32; 2]>,
    pub(super) tex_coord: Option<Whole>,
}

/// `KHR_materials_pbrSpecularGlossiness` of a material.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: Option<[f32; 4]>,
    pub(super) diffuse_texture: Option<TextureInfo>,
    pub(super) specular_factor: Option<[f32; 3]>,
    pub(super) glossiness_factor: Option<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Camera {
    pub(super) perspective: Option<Perspective>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Perspective {
    pub(super) yfov: f32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) joints: Vec<Whole>,
    pub(super) inverse_bind_matrices: Option<Whole>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub(super) sampler: Whole,
    pub(super) target: Target,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    pub(super) node: Option<Whole>,
    pub(super) path: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sampler {
    pub(super) input: Whole,
    pub(super) output: Whole,
    pub(super) interpolation: Option<String>,
}

/// A light of `KHR_lights_punctual`.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Light {
    pub(super) r#type: String,
    pub(super) color: Option<[f32; 3]>,
    pub(super) intensity: Option<f32>,
    pub(super) spot: Option<Spot>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Spot {
    pub(super) inner_cone_angle: f32,
    pub(super) outer_cone_angle: Option<f32>,
}

impl Document {
    /// Parses the text of a file.
    ///
    /// # Errors
    ///
    /// A description of the fault.
    pub(super) fn parse(text: &[u8], file: &str) -> Result<Self, String> {
        let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(text);
        // Some exporters pad the text of a binary file with zeros, not with blanks.
        let end = text
            .iter()
            .rposition(|byte| *byte != 0)
            .map_or(0, |last| last + 1);
        let mut root: Value =
            serde_json::from_slice(&text[..end]).map_err(|error| error.to_string())?;
        remove_nulls(&mut root);
        if !root.is_object() {
            return Err("expected a JSON object".to_owned());
        }
        Ok(Self {
            file: file.to_owned(),
            root,
        })
    }

    /// The value at a pointer.
    pub(super) fn at(&self, pointer: &str) -> Option<&Value> {
        self.root.pointer(pointer)
    }

    /// The elements of an array; none if it is not there.
    pub(super) fn all(&self, pointer: &str) -> &[Value] {
        let array = self.at(pointer).and_then(Value::as_array);
        array.map_or(&[], Vec::as_slice)
    }

    /// An element of the array at a pointer, such as `/meshes`.
    ///
    /// # Errors
    ///
    /// [`LoadError::BadValue`] if there is none, or if one of its values has a wrong type.
    pub(super) fn get<T: DeserializeOwned>(
        &self,
        pointer: &str,
        index: Whole,
    ) -> Result<T, LoadError> {
        let all = self.all(pointer);
        let pointer = format!("{pointer}/{}", index.0);
        let value = all.get(index.0).ok_or_else(|| {
            let problem = format!("does not exist, there are {}", all.len());
            self.bad_value(&pointer, problem)
        })?;
        self.read(value, &pointer)
    }

    /// A value, which is at a pointer.
    ///
    /// # Errors
    ///
    /// [`LoadError::BadValue`] if it, or a part of it, has a wrong type.
    pub(super) fn read<T: DeserializeOwned>(
        &self,
        value: &Value,
        pointer: &str,
    ) -> Result<T, LoadError> {
        serde_path_to_error::deserialize(value).map_err(|error| {
            let path = error.path().to_string();
            let path = match path.as_str() {
                "." => String::new(),
                // The path is in the notation of JavaScript: `targets[0].POSITION`.
                path => format!(
                    "/{}",
                    path.replace('[', ".").replace(']', "").replace('.', "/")
                ),
            };
            self.bad_value(&format!("{pointer}{path}"), error.into_inner().to_string())
        })
    }

    /// The error of the value at a pointer.
    pub(super) fn bad_value(&self, pointer: &str, problem: impl Into<String>) -> LoadError {
        LoadError::BadValue {
            file: self.file.clone(),
            pointer: pointer.to_owned(),
            problem: problem.into(),
        }
    }
}

/// Removes members without a value: they are as if they were not there. The depth of a parsed text is limited.
fn remove_nulls(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|_, member| !member.is_null());
            members.values_mut().for_each(remove_nulls);
        }
        Value::Array(elements) => elements.iter_mut().for_each(remove_nulls),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str) -> Document {
        Document::parse(text.as_bytes(), "a.gltf").expect("valid")
    }

    #[test]
    fn whole_numbers_may_have_a_point() {
        let document = document(
            "\u{feff}{\"views\": [{\"buffer\": 1, \"byteOffset\": 3.0, \"byteLength\": null}]}\0\0",
        );
        let view: BufferView = document.get("/views", Whole(0)).expect("valid");
        assert_eq!((view.buffer, view.byte_offset), (Whole(1), Whole(3)));
        assert_eq!(view.byte_length, Whole(0), "the default");
    }

    #[test]
    fn errors_have_the_pointer_of_the_value() {
        let text =
            r#"{"meshes": [{"primitives": [{"attributes": {"POSITION": 1.5}}]}], "nodes": 3}"#;
        let document = document(text);
        let mesh = document.get::<Mesh>("/meshes", Whole(0));
        let missing = document.get::<Mesh>("/meshes", Whole(1));
        let nodes = document.get::<Node>("/nodes", Whole(0));
        for (error, expected) in [
            (
                mesh.err(),
                "a.gltf: /meshes/0/primitives/0/attributes/POSITION: expected a whole number, found 1.5",
            ),
            (
                missing.err(),
                "a.gltf: /meshes/1: does not exist, there are 1",
            ),
            (nodes.err(), "a.gltf: /nodes/0: does not exist, there are 0"),
        ] {
            assert_eq!(error.expect(expected).to_string(), expected);
        }
    }
}
