//! Which format a file has.

use std::path::Path;

use crate::source::Source;
use crate::{LoadError, off, stl};

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// Wavefront OBJ.
    Obj,
    /// The Stanford polygon format.
    Ply,
    /// glTF 2.0 as JSON.
    Gltf,
    /// glTF 2.0 as one binary file.
    Glb,
    /// NFF, and AFF, which extends it.
    Aff,
    /// STL, text or binary.
    Stl,
    /// The object file format of Geomview.
    Off,
    /// The 3D manufacturing format.
    ThreeMf,
}

impl Format {
    /// The format that the content identifies, else the one of the extension.
    pub(crate) fn of(source: &mut Source<'_>, path: &Path) -> Result<Option<Self>, LoadError> {
        /// A binary file has no lines; a text has its first statement early.
        const HEAD: usize = 1 << 16;
        if let Some(format) = Self::of_magic(source.at_least(HEAD)?) {
            return Ok(Some(format));
        }
        if stl::is_binary(source)? || stl::is_text(source)? {
            return Ok(Some(Self::Stl));
        }
        let name = source.name;
        let head = source.at_least(HEAD)?;
        if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
            return Err(LoadError::BadHeader {
                file: name.to_owned(),
                problem: "the text is UTF-16, which is not supported; expected UTF-8".to_owned(),
            });
        }
        let format = Self::of_first_statement(&head[..head.len().min(HEAD)]);
        Ok(format.or_else(|| Self::of_extension(path)))
    }

    fn of_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "obj" => Self::Obj,
            "ply" => Self::Ply,
            "gltf" => Self::Gltf,
            "glb" => Self::Glb,
            "aff" | "nff" => Self::Aff,
            "stl" => Self::Stl,
            "off" | "coff" | "noff" => Self::Off,
            "3mf" => Self::ThreeMf,
            _ => return None,
        })
    }

    fn of_magic(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        if bytes.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        if bytes.starts_with(b"PK\x03\x04") {
            return Some(Self::ThreeMf);
        }
        bytes
            .trim_ascii_start()
            .starts_with(b"{")
            .then_some(Self::Gltf)
    }

    /// OBJ and NFF are lines of words, with the same `v` and `f` for other things: the first line that is no comment
    /// distinguishes them, since the `v` of a view in NFF precedes `from`, and that of a vertex in OBJ its coordinates.
    fn of_first_statement(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        let lines = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        let mut statements = lines.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
        let first = statements.next()?;
        if off::is_header(first) {
            return Some(Self::Off);
        }
        let words = first.split(u8::is_ascii_whitespace);
        let mut words = words.filter(|word| !word.is_empty());
        let keyword = words.next()?;
        match keyword {
            b"v" => match words.next() {
                Some(b"from") => Some(Self::Aff),
                Some(_) => Some(Self::Obj),
                None => (statements.next()?.starts_with(b"from")).then_some(Self::Aff),
            },
            b"vn" | b"vt" | b"mtllib" | b"usemtl" | b"o" | b"g" => Some(Self::Obj),
            _ => None,
        }
    }

    #[cfg(not(feature = "scenes"))]
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::Gltf => "glTF",
            Self::Glb => "binary glTF",
            Self::Aff => "AFF and NFF",
            Self::Stl => "STL",
            Self::Off => "OFF",
            Self::ThreeMf => "3MF",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_where_it_identifies_a_format() {
        let stl = [&[b' '; 80][..], &1_u32.to_le_bytes(), &[0; 50]].concat();
        let rows: [(&[u8], &str, Option<Format>); 24] = [
            (b"ply\nformat", "a.obj", Some(Format::Ply)),
            (b"glTF\x02", "a.ply", Some(Format::Glb)),
            (b"\n { \"asset\": {} }", "a.nff", Some(Format::Gltf)),
            (b"# cube\n\nv 0 0 0\n", "a.nff", Some(Format::Obj)),
            (b"mtllib a.mtl\r\n", "a.aff", Some(Format::Obj)),
            (b"# view\nv\nfrom 0 0 1\n", "a.obj", Some(Format::Aff)),
            (b"v\r\nfrom 0 0 1\r\n", "a", Some(Format::Aff)),
            (b"v  from 0 0 1\n", "a.obj", Some(Format::Aff)),
            (b"f 1 0 0 1 0 0 0 0\n", "a.NFF", Some(Format::Aff)),
            (b"f 1 2 3\n", "a.Obj", Some(Format::Obj)),
            (b"", "a.gltf", Some(Format::Gltf)),
            (b"", "a.glb", Some(Format::Glb)),
            (b"v\n", "a.aff", Some(Format::Aff)),
            (
                b"solid a\n facet normal 0 0 1\n",
                "a.obj",
                Some(Format::Stl),
            ),
            (b"Solid\nEndSolid\n", "a", Some(Format::Stl)),
            (&stl, "a.obj", Some(Format::Stl)),
            (&stl[..83], "a.off", Some(Format::Off)),
            (b"# cube\nOFF\n8 6 12\n", "a.ply", Some(Format::Off)),
            (b"COFF 8 6 12\n", "a", Some(Format::Off)),
            (b"PK\x03\x04", "a", Some(Format::ThreeMf)),
            (b"solid", "a.STL", Some(Format::Stl)),
            (b"", "a.3mf", Some(Format::ThreeMf)),
            (b"solid", "a.txt", None),
            (b"", "none", None),
        ];
        for (bytes, name, format) in rows {
            let text = String::from_utf8_lossy(bytes);
            let found = Format::of(&mut Source::of_bytes(bytes, name), Path::new(name));
            assert_eq!(found.expect("no error"), format, "{name}: {text:?}");
        }
    }
}
