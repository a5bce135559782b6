//! An array in an NPY file, written row by row.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};

use npyz::{AutoSerialize, Serialize, TypeWrite, WriterBuilder};

/// Rows of an array, in the order of rays.
pub(super) struct ArrayWriter<T: Serialize> {
    file: BufWriter<File>,
    row: T::TypeWriter,
    rows: u64,
    header: Header,
}

/// The header of an array that several files may hold together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Header {
    /// For this number of rows, in this file and in those that follow it.
    Of(u64),
    /// For the rows of this file, whose number is known at the end.
    OfRows,
    /// In another file, before this one.
    Before,
}

impl<T: AutoSerialize> ArrayWriter<T> {
    pub(super) fn new(mut file: BufWriter<File>, header: Header) -> anyhow::Result<Self> {
        match header {
            Header::Of(rows) => file.write_all(&bytes::<T>(rows)?)?,
            // In place of the final one, which has as many bytes.
            Header::OfRows => file.write_all(&bytes::<T>(0)?)?,
            Header::Before => {}
        }
        Ok(Self {
            file,
            row: T::writer(&T::default_dtype()).expect("the type says how it is written"),
            rows: 0,
            header,
        })
    }

    pub(super) fn push(&mut self, row: &T) -> std::io::Result<()> {
        self.rows += 1;
        self.row.write_one(&mut self.file, row)
    }

    /// Writes the rest.
    pub(super) fn finish(mut self) -> anyhow::Result<()> {
        if self.header == Header::OfRows {
            self.file.seek(SeekFrom::Start(0))?;
            self.file.write_all(&bytes::<T>(self.rows)?)?;
        }
        Ok(self.file.flush()?)
    }
}

/// The header of a number of rows. Its length is the same for any number.
fn bytes<T: AutoSerialize>(rows: u64) -> anyhow::Result<Vec<u8>> {
    let header = |rows: u64| -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::<T>::new().default_dtype();
        // The header is written first. Without rows the array stays unfinished.
        drop(options.shape(&[rows]).writer(&mut bytes).begin_nd()?);
        Ok(bytes)
    };
    let mut bytes = header(rows)?;
    let longest = header(u64::MAX)?.len();
    // Magic and version have 8 bytes, the length of the rest 2. The rest is text that ends with blanks and a newline.
    bytes.pop();
    bytes.resize(longest - 1, b' ');
    bytes.push(b'\n');
    let rest = u16::try_from(longest - 10)?;
    bytes[8..10].copy_from_slice(&rest.to_le_bytes());
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_any_number_of_rows_have_one_length() {
        let length = bytes::<bool>(0).expect("valid").len();
        assert!(length.is_multiple_of(64), "{length}");
        for rows in [0, 9, 1_000_000, u64::MAX] {
            let bytes = bytes::<bool>(rows).expect("valid");
            assert_eq!(bytes.len(), length, "{rows}");
            let read = npyz::NpyFile::new(bytes.as_slice()).expect("a header");
            assert_eq!(read.shape(), [rows]);
        }
    }
}
