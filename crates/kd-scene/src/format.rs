//! Which format a file has.

use std::path::Path;

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
}

impl Format {
    /// The format that the content identifies, else the one of the extension.
    pub(crate) fn of(bytes: &[u8], path: &Path) -> Option<Self> {
        Self::of_content(bytes).or_else(|| Self::of_extension(path))
    }

    fn of_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "obj" => Self::Obj,
            "ply" => Self::Ply,
            "gltf" => Self::Gltf,
            "glb" => Self::Glb,
            "aff" | "nff" => Self::Aff,
            _ => return None,
        })
    }

    fn of_content(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        if bytes.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        if bytes.trim_ascii_start().starts_with(b"{") {
            return Some(Self::Gltf);
        }
        Self::of_first_statement(bytes)
    }

    /// OBJ and NFF are lines of words, with the same `v` and `f` for other things: the first line that is no comment
    /// distinguishes them, since the `v` of a view in NFF precedes `from`, and that of a vertex in OBJ its coordinates.
    fn of_first_statement(bytes: &[u8]) -> Option<Self> {
        /// A binary file has no lines; a text has its first statement early.
        const HEAD: usize = 1 << 16;
        let head = &bytes[..bytes.len().min(HEAD)];
        let lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        let mut statements = lines.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
        let first = statements.next()?;
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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_where_it_identifies_a_format() {
        let rows: [(&[u8], &str, Option<Format>); 15] = [
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
            (b"solid", "a.stl", None),
            (b"", "none", None),
        ];
        for (bytes, name, format) in rows {
            let text = String::from_utf8_lossy(bytes);
            assert_eq!(
                Format::of(bytes, Path::new(name)),
                format,
                "{name}: {text:?}"
            );
        }
    }
}
