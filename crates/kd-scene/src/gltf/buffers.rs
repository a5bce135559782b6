//! The buffers and images of a glTF file. A buffer is read when an accessor or an image first needs it.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::json::{Buffer, BufferView, Document, Image, Whole};
use crate::{LoadError, Texture, TextureSource};

/// Access to files, by the caller of the reader.
pub(super) type Files<'a> = &'a mut dyn FnMut(&Path) -> io::Result<Vec<u8>>;

/// Base64 with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The buffers that were read so far.
pub(super) struct Buffers<'a> {
    path: &'a Path,
    files: Files<'a>,
    /// The binary chunk.
    blob: Option<&'a [u8]>,
    /// Each buffer by its index.
    read: HashMap<usize, Bytes<'a>>,
    /// The files that buffers name, each read once.
    of_files: HashMap<PathBuf, Arc<[u8]>>,
}

#[derive(Clone)]
enum Bytes<'a> {
    Blob(&'a [u8]),
    Shared(Arc<[u8]>),
}

impl Bytes<'_> {
    fn as_slice(&self) -> &[u8] {
        match self {
            Self::Blob(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    pub(super) fn new(path: &'a Path, files: Files<'a>, blob: Option<&'a [u8]>) -> Self {
        Self {
            path,
            files,
            blob,
            read: HashMap::new(),
            of_files: HashMap::new(),
        }
    }

    /// The bytes of a buffer view, and the distance of its elements; 0 if they follow each other.
    pub(super) fn view(
        &mut self,
        document: &Document,
        number: Whole,
    ) -> Result<(&[u8], usize), LoadError> {
        const VIEWS: &str = "/bufferViews";
        let view: BufferView = document.get(VIEWS, number)?;
        let bad = |problem: String| document.bad_value(&format!("{VIEWS}/{}", number.0), problem);
        let compression = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
        if let Some(name) = compression
            .iter()
            .find(|it| view.extensions.contains_key(**it))
            && !self.has_data(document, view.buffer)
        {
            return Err(bad(format!(
                "is compressed by {name}, which is not supported"
            )));
        }
        let bytes = self.buffer(document, view.buffer)?;
        let (start, length) = (view.byte_offset.0, view.byte_length.0);
        let end = start.saturating_add(length);
        let found = bytes.get(start..end).ok_or_else(|| {
            bad(format!(
                "ends at byte {end} of buffer {}, which has {}",
                view.buffer.0,
                bytes.len()
            ))
        })?;
        Ok((found, view.byte_stride.0))
    }

    /// Whether a buffer names its data. The fallback of a compressed one does not.
    fn has_data(&self, document: &Document, number: Whole) -> bool {
        let buffer: Result<Buffer, _> = document.get("/buffers", number);
        buffer.is_ok_and(|buffer| buffer.uri.is_some()) || (number.0 == 0 && self.blob.is_some())
    }

    fn buffer(&mut self, document: &Document, number: Whole) -> Result<&[u8], LoadError> {
        const BUFFERS: &str = "/buffers";
        if !self.read.contains_key(&number.0) {
            let buffer: Buffer = document.get(BUFFERS, number)?;
            let pointer = format!("{BUFFERS}/{}", number.0);
            let bytes = self.bytes_of(&buffer, number.0 == 0);
            let bytes = bytes.map_err(|problem| document.bad_value(&pointer, problem))?;
            let found = bytes.as_slice().len();
            let expected = buffer.byte_length.0;
            if found < expected {
                let problem = format!("has {found} bytes, but a byteLength of {expected}");
                return Err(document.bad_value(&pointer, problem));
            }
            self.read.insert(number.0, bytes);
        }
        Ok(self.read[&number.0].as_slice())
    }

    fn bytes_of(&mut self, buffer: &Buffer, is_first: bool) -> Result<Bytes<'a>, String> {
        let Some(uri) = &buffer.uri else {
            let blob = self.blob.filter(|_| is_first).map(Bytes::Blob);
            return blob
                .ok_or_else(|| "has no uri, and the file no binary chunk for it".to_owned());
        };
        if let Some(bytes) = inline(uri) {
            let bytes = bytes.ok_or("has a data URI that is not valid base64")?;
            return Ok(Bytes::Shared(bytes.into()));
        }
        let path = resolve(self.path, uri);
        if let Some(known) = self.of_files.get(&path) {
            return Ok(Bytes::Shared(Arc::clone(known)));
        }
        let bytes = (self.files)(&path);
        let bytes: Arc<[u8]> = bytes.map_err(|error| format!("`{uri}`: {error}"))?.into();
        self.of_files.insert(path, Arc::clone(&bytes));
        Ok(Bytes::Shared(bytes))
    }

    /// The number of bytes of all buffers that were read.
    pub(super) fn bytes(&self) -> usize {
        self.read.values().map(|bytes| bytes.as_slice().len()).sum()
    }

    /// The name and the data of an image.
    pub(super) fn texture(
        &mut self,
        document: &Document,
        number: Whole,
    ) -> Result<Texture, LoadError> {
        let image: Image = document.get("/images", number)?;
        let bad = |problem: &str| document.bad_value(&format!("/images/{}", number.0), problem);
        let source = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match inline(uri) {
                Some(bytes) => {
                    let bytes = bytes.ok_or_else(|| bad("is not valid base64"))?;
                    TextureSource::Bytes(bytes.into())
                }
                None => TextureSource::File(resolve(self.path, uri)),
            },
            (None, Some(view)) => TextureSource::Bytes(self.view(document, view)?.0.into()),
            (None, None) => return Err(bad("has neither a uri nor a bufferView")),
        };
        let name = if image.name.is_empty() {
            format!("image {}", number.0)
        } else {
            image.name
        };
        Ok(Texture { name, source })
    }
}

/// The bytes of a `data:` URI. `None` if `uri` has another scheme, `Some(None)` if its data are not valid base64.
fn inline(uri: &str) -> Option<Option<Vec<u8>>> {
    let data = uri.strip_prefix("data:")?;
    let (kind, data) = data.split_once(',')?;
    if !kind.ends_with(";base64") {
        return Some(Some(decoded(data)));
    }
    let without_blanks: Vec<u8> = data
        .bytes()
        .filter(|byte| !byte.is_ascii_whitespace())
        .collect();
    Some(BASE64.decode(without_blanks).ok())
}

/// The path of a file that the file at `path` names.
fn resolve(path: &Path, uri: &str) -> PathBuf {
    let name = String::from_utf8_lossy(&decoded(uri)).into_owned();
    let folder = path.parent().unwrap_or(Path::new(""));
    // Without `.`, two names of the same file are more often equal.
    folder.join(name).components().collect()
}

/// Decodes the percent-encoding of a URI.
fn decoded(uri: &str) -> Vec<u8> {
    let digit = |byte: &u8| {
        char::from(*byte)
            .to_digit(16)
            .and_then(|digit| u8::try_from(digit).ok())
    };
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let number = match after {
            [high, low, ..] if *first == b'%' => digit(high).zip(digit(low)),
            _ => None,
        };
        bytes.push(number.map_or(*first, |(high, low)| 16 * high + low));
        rest = if number.is_some() { &after[2..] } else { after };
    }
    bytes
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
            assert_eq!(decoded(uri), name.as_bytes());
        }
    }

    #[test]
    fn data_uris_are_decoded() {
        assert_eq!(inline("a.bin"), None);
        let bytes = Some(Some(vec![1, 2, 3, 4]));
        for base64 in ["AQIDBA==", "AQIDBA", "AQID\nBA=="] {
            let uri = format!("data:application/octet-stream;base64,{base64}");
            assert_eq!(inline(&uri), bytes, "{base64}");
        }
        let plain = Some(Some(b"a c".to_vec()));
        assert_eq!(inline("data:text/plain,a%20c"), plain);
        assert_eq!(inline("data:;base64,?"), Some(None));
    }

    #[test]
    fn names_are_relative_to_the_file() {
        let path = resolve(Path::new("a/scene.gltf"), "./b/c%20d.bin");
        assert_eq!(path, Path::new("a/b/c d.bin"));
    }
}
