//! The chunks of binary glTF (glTF 2.0, §4.4).

/// The JSON text of a file and its binary chunk.
#[derive(Debug)]
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) blob: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Splits a file into chunks. A file without the magic number of binary glTF is all JSON.
    ///
    /// # Errors
    ///
    /// A description of the fault.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let Some(rest) = bytes.strip_prefix(b"glTF") else {
            return Ok(Self {
                json: bytes,
                blob: None,
            });
        };
        let cut = "binary glTF ends in its header";
        let (version, rest) = number(rest).ok_or(cut)?;
        if version != 2 {
            return Err(format!(
                "the file is binary glTF {version}, which is not supported; expected 2"
            ));
        }
        // The length of the file is redundant.
        let (_, rest) = number(rest).ok_or(cut)?;
        let (kind, json, rest) = chunk(rest).ok_or(cut)?;
        if kind != *b"JSON" {
            return Err("the first chunk of binary glTF is not JSON".to_owned());
        }
        let blob = match chunk(rest) {
            Some((kind, blob, _)) if kind == *b"BIN\0" => Some(blob),
            _ => None,
        };
        Ok(Self { json, blob })
    }
}

fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk()?;
    Some((u32::from_le_bytes(*number), rest))
}

/// The type and the data of the first chunk, and the bytes after it.
fn chunk(bytes: &[u8]) -> Option<([u8; 4], &[u8], &[u8])> {
    let (length, rest) = number(bytes)?;
    let (kind, rest) = rest.split_first_chunk()?;
    let (data, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
    Some((*kind, data, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_split() {
        let mut file = b"glTF\x02\0\0\0\xff\0\0\0".to_vec();
        for (kind, piece) in [
            (b"JSON", &b"{}  "[..]),
            (b"BIN\0", b"1234567"),
            (b"more", b""),
        ] {
            file.extend(
                u32::try_from(piece.len())
                    .expect("fits in 32 bits")
                    .to_le_bytes(),
            );
            file.extend(kind);
            file.extend(piece);
        }
        let found = Container::read(&file).expect("a complete file");
        assert_eq!(
            (found.json, found.blob),
            (&b"{}  "[..], Some(&b"1234567"[..]))
        );
        let without = Container::read(&file[..24]).expect("JSON alone");
        assert_eq!((without.json, without.blob), (&b"{}  "[..], None));
        for end in 4..24 {
            assert!(Container::read(&file[..end]).is_err(), "{end} bytes");
        }
        file[4] = 1;
        let error = Container::read(&file).expect_err("version 1");
        assert_eq!(
            error,
            "the file is binary glTF 1, which is not supported; expected 2"
        );
    }
}
