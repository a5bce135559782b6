//! The buffers and images of a glTF file.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::buffer::Source;
use gltf::json::Root;
use gltf::json::buffer::View;

use crate::{LoadError, Texture, TextureSource};

/// The bytes of all buffers, in file order.
#[derive(Debug)]
pub(super) struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    pub(super) fn read(
        document: &gltf::Document,
        mut blob: Option<&[u8]>,
        path: &Path,
        files: &mut dyn FnMut(&Path) -> io::Result<Vec<u8>>,
    ) -> Result<Self, LoadError> {
        let file = || path.display().to_string();
        let bad = |index: usize, problem: String| LoadError::BadElement {
            file: file(),
            element: "buffer".to_owned(),
            index,
            problem,
        };
        let mut all = Vec::new();
        for buffer in document.buffers() {
            let index = buffer.index();
            let bytes = match buffer.source() {
                Source::Bin => blob
                    .take()
                    .map(<[u8]>::to_vec)
                    .ok_or_else(|| bad(index, "the file has no binary chunk".into()))?,
                Source::Uri(uri) => match inline(uri) {
                    Some(bytes) => bytes.ok_or_else(|| bad(index, "invalid base64 data".into()))?,
                    None => files(&resolve(path, uri))
                        .map_err(|error| bad(index, format!("`{uri}`: {error}")))?,
                },
            };
            if bytes.len() < buffer.length() {
                return Err(LoadError::Truncated {
                    file: file(),
                    element: "buffer byte".to_owned(),
                    index: bytes.len(),
                    count: buffer.length(),
                });
            }
            all.push(bytes);
        }
        Ok(Self(all))
    }

    /// The name and the data of an image. The data are empty if the file does not locate them.
    pub(super) fn texture(&self, json: &Root, number: usize, file: &str) -> Texture {
        let image = &json.images[number];
        let empty = || TextureSource::Bytes(Arc::from([]));
        let source = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match inline(uri) {
                Some(bytes) => TextureSource::Bytes(Arc::from(bytes.unwrap_or_default())),
                None => TextureSource::File(resolve(Path::new(file), uri)),
            },
            (None, Some(view)) => {
                let bytes = json.buffer_views.get(view.value());
                let bytes = bytes.and_then(|view| self.of_view(view));
                bytes.map_or_else(empty, |bytes| TextureSource::Bytes(Arc::from(bytes)))
            }
            (None, None) => empty(),
        };
        Texture {
            name: image
                .name
                .clone()
                .unwrap_or_else(|| format!("image {number}")),
            source,
        }
    }

    /// The bytes of a buffer view; `None` if it exceeds its buffer.
    pub(super) fn of_view(&self, view: &View) -> Option<&[u8]> {
        let buffer = self.0.get(view.buffer.value())?;
        let start = usize::try_from(view.byte_offset.map_or(0, |offset| offset.0)).ok()?;
        let length = usize::try_from(view.byte_length.0).ok()?;
        buffer.get(start..start.checked_add(length)?)
    }

    /// Total number of bytes of all buffers.
    pub(super) fn bytes(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }
}

/// The bytes of a `data:` URI. `None` if `uri` has another scheme, `Some(None)` if its data are not valid base64.
fn inline(uri: &str) -> Option<Option<Vec<u8>>> {
    let data = uri.strip_prefix("data:")?;
    let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
    Some(encoded.and_then(|encoded| STANDARD.decode(encoded).ok()))
}

/// The path of a file that the file at `path` names.
fn resolve(path: &Path, uri: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(decoded(uri))
}

/// Decodes the percent-encoding of a URI.
fn decoded(uri: &str) -> String {
    let digit = |byte: &u8| {
        char::from(*byte)
            .to_digit(16)
            .and_then(|digit| u8::try_from(digit).ok())
    };
    let mut name = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let number = match after {
            [high, low, ..] if *first == b'%' => digit(high).zip(digit(low)),
            _ => None,
        };
        name.push(number.map_or(*first, |(high, low)| 16 * high + low));
        rest = if number.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&name).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_encoding_is_decoded() {
        for (uri, name) in [
            ("a%20b.bin", "a b.bin"),
            ("100%", "100%"),
            ("%zz%4", "%zz%4"),
            ("%c3%b6", "ö"),
        ] {
            assert_eq!(decoded(uri), name);
        }
    }

    #[test]
    fn data_uris_are_decoded() {
        assert_eq!(inline("a.bin"), None);
        assert_eq!(inline("data:;base64,AQID"), Some(Some(vec![1, 2, 3])));
        assert_eq!(inline("data:text/plain,abc"), Some(None));
        assert_eq!(inline("data:;base64,?"), Some(None));
    }
}
