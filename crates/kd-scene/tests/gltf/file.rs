//! A glTF file in memory.

use std::io;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use kd_scene::{LoadError, SceneDescription, read_gltf};
use serde_json::{Value, json};

/// A file under construction: its buffer, buffer views and accessors.
#[derive(Default)]
pub(crate) struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    pub(crate) accessors: Vec<Value>,
}

impl File {
    pub(crate) fn add(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
        bounds: Option<[Vec<f32>; 2]>,
    ) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }),
        );
        self.bytes.extend_from_slice(bytes);
        let mut accessor = json!({
            "bufferView": self.views.len() - 1, "componentType": component, "type": kind, "count": count,
        });
        if let Some([min, max]) = bounds {
            accessor["min"] = json!(min);
            accessor["max"] = json!(max);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds an accessor of `f32` values, `width` numbers each.
    pub(crate) fn floats(&mut self, kind: &str, width: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let of = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let values = (0..width).map(|i| numbers.iter().skip(i).step_by(width).copied());
            values
                .map(|values| values.reduce(pick).expect("at least one"))
                .collect()
        };
        let bounds = Some([of(f32::min), of(f32::max)]);
        self.add(&bytes, 5126, kind, numbers.len() / width, bounds)
    }

    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.add(&bytes, 5123, "SCALAR", indices.len(), None)
    }

    /// The complete file: `rest` with the buffer, buffer views and accessors.
    pub(crate) fn finish(self, mut rest: Value) -> Value {
        let uri = format!(
            "data:application/octet-stream;base64,{}",
            STANDARD.encode(&self.bytes)
        );
        rest["asset"] = json!({ "version": "2.0" });
        rest["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        rest["bufferViews"] = json!(self.views);
        rest["accessors"] = json!(self.accessors);
        rest
    }
}

pub(crate) fn read(file: &Value) -> Result<SceneDescription, LoadError> {
    read_bytes(file.to_string().into_bytes())
}

pub(crate) fn read_bytes(bytes: Vec<u8>) -> Result<SceneDescription, LoadError> {
    let mut open = |path: &Path| match path.to_str() {
        Some("a/scene.gltf") => Ok(bytes.clone()),
        _ => Err(io::ErrorKind::NotFound.into()),
    };
    read_gltf("a/scene.gltf".as_ref(), &mut open)
}

pub(crate) const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
