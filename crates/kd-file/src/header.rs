//! The header and the table of sections, as bytes.

use crate::error::FileError;
use crate::section::Section;

const MAGIC: [u8; 8] = *b"kd-tree\n";
pub(crate) const VERSION: u32 = 2;
const BYTE_ORDER: u32 = 0x0403_0201;
pub(crate) const HEADER_BYTES: usize = 64;
const ENTRY_BYTES: usize = 32;
/// Offsets of sections are multiples of it.
pub(crate) const ALIGNMENT: usize = 64;
/// The place of the checksum.
const CHECKSUM: std::ops::Range<usize> = 28..32;
/// More sections than any file has.
const MOST_SECTIONS: u32 = 1 << 28;

/// A section as the table has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) section: Section,
    pub(crate) offset: u64,
    pub(crate) elements: u64,
    pub(crate) element_bytes: u32,
    pub(crate) checksum: u32,
}

impl Entry {
    pub(crate) fn bytes(&self) -> u64 {
        self.elements * u64::from(self.element_bytes)
    }

    /// With the zeros behind the elements.
    pub(crate) fn padded_bytes(&self) -> u64 {
        self.bytes().next_multiple_of(ALIGNMENT as u64)
    }
}

/// Where the first section begins.
pub(crate) fn first_offset(sections: usize) -> u64 {
    (HEADER_BYTES + ENTRY_BYTES * sections).next_multiple_of(ALIGNMENT) as u64
}

/// The bytes of header and table, with the zeros behind them.
pub(crate) fn to_bytes(entries: &[Entry], file_bytes: u64) -> Vec<u8> {
    let count = u32::try_from(entries.len()).expect("few sections");
    let mut bytes = Vec::new();
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(BYTE_ORDER.to_le_bytes());
    bytes.extend(file_bytes.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.resize(HEADER_BYTES, 0);
    for entry in entries {
        bytes.extend(entry.section.kind.to_le_bytes());
        bytes.extend(entry.section.part.to_le_bytes());
        bytes.extend(entry.offset.to_le_bytes());
        bytes.extend(entry.elements.to_le_bytes());
        bytes.extend(entry.element_bytes.to_le_bytes());
        bytes.extend(entry.checksum.to_le_bytes());
    }
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
    let checksum = crc32fast::hash(&bytes);
    bytes[CHECKSUM].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
}

/// The number of bytes of header and table, from the first bytes of a file. Checks all but the table.
pub(crate) fn table_end(header: &[u8], found: u64, file: &str) -> Result<u64, FileError> {
    let file = || file.to_owned();
    if header.get(..MAGIC.len()) != Some(&MAGIC) {
        return Err(FileError::WrongMagic { file: file() });
    }
    if header.len() < HEADER_BYTES {
        return Err(FileError::WrongLength {
            file: file(),
            expected: HEADER_BYTES as u64,
            found,
        });
    }
    // Both are looked at before the version, which is in the byte order that they say.
    let order = word(header, 12);
    if order == BYTE_ORDER.swap_bytes() {
        return Err(FileError::WrongByteOrder { file: file() });
    }
    let version = word(header, 8);
    if version != VERSION {
        return Err(FileError::UnsupportedVersion {
            file: file(),
            version,
        });
    }
    let sections = word(header, 24);
    if order != BYTE_ORDER || sections > MOST_SECTIONS {
        return Err(FileError::DamagedHeader { file: file() });
    }
    let expected = long(header, 16);
    if expected != found {
        return Err(FileError::WrongLength {
            file: file(),
            expected,
            found,
        });
    }
    let end = first_offset(sections as usize);
    if end > found {
        return Err(FileError::DamagedHeader { file: file() });
    }
    Ok(end)
}

/// The sections of the table in `bytes`, which are [`table_end`] long, in the order of their names. Each is within the file.
pub(crate) fn entries(bytes: &[u8], file: &str) -> Result<Vec<Entry>, FileError> {
    let damaged = || FileError::DamagedHeader {
        file: file.to_owned(),
    };
    let mut unsigned = crc32fast::Hasher::new();
    unsigned.update(&bytes[..CHECKSUM.start]);
    unsigned.update(&[0; 4]);
    unsigned.update(&bytes[CHECKSUM.end..]);
    if unsigned.finalize() != word(bytes, CHECKSUM.start) {
        return Err(damaged());
    }
    let sections = word(bytes, 24) as usize;
    let table = &bytes[HEADER_BYTES..HEADER_BYTES + ENTRY_BYTES * sections];
    let mut entries = Vec::with_capacity(sections);
    let mut end = bytes.len() as u64;
    for bytes in table.chunks_exact(ENTRY_BYTES) {
        let entry = Entry {
            section: Section {
                kind: word(bytes, 0),
                part: word(bytes, 4),
            },
            offset: long(bytes, 8),
            elements: long(bytes, 16),
            element_bytes: word(bytes, 24),
            checksum: word(bytes, 28),
        };
        let length = entry
            .elements
            .checked_mul(u64::from(entry.element_bytes))
            .and_then(|bytes| bytes.checked_next_multiple_of(ALIGNMENT as u64));
        let after = length.and_then(|length| entry.offset.checked_add(length));
        match after {
            Some(after) if entry.offset == end && entry.element_bytes > 0 => end = after,
            _ => return Err(damaged()),
        }
        entries.push(entry);
    }
    if end != long(bytes, 16) {
        return Err(damaged());
    }
    entries.sort_by_key(|entry| entry.section);
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::section::SectionKind;

    fn entry(part: u32, offset: u64, elements: u64) -> Entry {
        Entry {
            section: Section::new(SectionKind::Positions, part),
            offset,
            elements,
            element_bytes: 12,
            checksum: 7,
        }
    }

    fn read(entries: &[Entry], file_bytes: u64) -> Result<Vec<Entry>, FileError> {
        let bytes = to_bytes(entries, file_bytes);
        let end = table_end(&bytes[..HEADER_BYTES], file_bytes, "t")?;
        assert_eq!(end, bytes.len() as u64, "header and table");
        super::entries(&bytes, "t")
    }

    #[test]
    fn a_table_reads_as_it_was_written() {
        let table = [entry(2, 192, 5), entry(1, 256, 0), entry(3, 256, 6)];
        let sorted = [table[1], table[0], table[2]];
        assert_eq!(read(&table, 384).expect("valid"), sorted, "by name");
        assert_eq!(read(&[], 64).expect("valid"), [], "no sections");
    }

    #[test]
    fn sections_that_cannot_be_are_refused() {
        let good = entry(1, 128, 5);
        assert!(read(&[good], 192).is_ok(), "the base of the others");
        for (bad, file_bytes) in [
            (entry(1, 64, 5), 192),
            (entry(1, 192, 5), 256),
            (entry(1, 128, 6), 192),
            (entry(1, 128, 4), 256),
            (entry(1, 128, u64::MAX / 12), 192),
            (entry(1, 128, u64::MAX), 192),
            (entry(1, u64::MAX - 63, 5), 192),
            (
                Entry {
                    element_bytes: 0,
                    ..good
                },
                192,
            ),
        ] {
            let error = read(&[bad], file_bytes).expect_err("bad");
            let is_damaged = matches!(error, FileError::DamagedHeader { .. });
            assert!(is_damaged, "{bad:?}: {error}");
        }
    }

    #[test]
    fn a_table_longer_than_its_file_is_refused() {
        let mut bytes = to_bytes(&[], 64);
        bytes[24..28].copy_from_slice(&1000_u32.to_le_bytes());
        let error = table_end(&bytes, 64, "t").expect_err("1000 sections in 64 bytes");
        assert_eq!(error.to_string(), "t: the header is damaged");
    }
}
