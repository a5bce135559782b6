//! Reading a file, or mapping it into memory.
#![allow(
    unsafe_code,
    reason = "a mapping is memory that other programs may change; the caller promises that they do not"
)]

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use bytemuck::{Pod, cast_slice, cast_slice_mut};
use kd_buffer::{Buffer, advise_large_pages};
use memmap2::Mmap;

use crate::error::FileError;
use crate::header::{self, ALIGNMENT, Entry, HEADER_BYTES};
use crate::section::Section;

/// Whether the sections of a mapped file are compared with their checksums, and what is in them with its rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verify {
    /// Everything is read and checked.
    Everything,
    /// Only the header is read. The rest is read where it is used.
    Header,
}

/// A file whose header is valid.
#[derive(Debug)]
pub struct SavedFile {
    name: String,
    entries: Vec<Entry>,
    bytes: Bytes,
    verify: Verify,
}

/// Where the sections are.
#[derive(Debug)]
enum Bytes {
    File(Mutex<File>),
    Mapped(Arc<Mmap>),
}

impl SavedFile {
    /// Opens a file to read sections from it, each into memory of its own, with its checksum verified.
    ///
    /// # Errors
    ///
    /// [`FileError`] says why the file could not be read, or what is wrong with the header.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let io_error = |source| FileError::Io {
            file: name.clone(),
            source,
        };
        let (mut file, length) = open_file(path).map_err(io_error)?;
        let mut bytes = Vec::new();
        let mut read_to = |end: u64, bytes: &mut Vec<u8>| {
            let more = end - bytes.len() as u64;
            (&mut file).take(more).read_to_end(bytes).map_err(io_error)
        };
        read_to(HEADER_BYTES as u64, &mut bytes)?;
        let end = header::table_end(&bytes, length, &name)?;
        read_to(end, &mut bytes)?;
        if (bytes.len() as u64) < end {
            return Err(FileError::WrongLength {
                file: name,
                expected: length,
                found: bytes.len() as u64,
            });
        }
        Ok(Self {
            entries: header::entries(&bytes, &name)?,
            name,
            bytes: Bytes::File(Mutex::new(file)),
            verify: Verify::Everything,
        })
    }

    /// Maps a file into memory. Sections are used as they lie; with [`Verify::Header`], no byte of them is read until it is used.
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open), and [`FileError::WrongByteOrder`] on a machine that is not little-endian.
    ///
    /// # Safety
    ///
    /// The file does not change, and is not made shorter, as long as this or a buffer of it lives. Replacing it by another one of its
    /// name is allowed.
    pub unsafe fn map(path: impl AsRef<Path>, verify: Verify) -> Result<Self, FileError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let io_error = |source| FileError::Io {
            file: name.clone(),
            source,
        };
        let (file, length) = open_file(path).map_err(io_error)?;
        // Nothing can be mapped of an empty file.
        if length < HEADER_BYTES as u64 {
            let mut bytes = Vec::new();
            (&file).read_to_end(&mut bytes).map_err(io_error)?;
            header::table_end(&bytes, length, &name)?;
        }
        // SAFETY: the caller's.
        let map = unsafe { Mmap::map(&file) }.map_err(io_error)?;
        let end = header::table_end(&map[..map.len().min(HEADER_BYTES)], length, &name)?;
        if cfg!(target_endian = "big") {
            return Err(FileError::WrongByteOrder { file: name });
        }
        #[allow(clippy::cast_possible_truncation, reason = "it is within the mapping")]
        let end = end as usize;
        Ok(Self {
            entries: header::entries(&map[..end], &name)?,
            name,
            bytes: Bytes::Mapped(Arc::new(map)),
            verify,
        })
    }

    /// The name of the file, for errors.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether what is in the sections is checked.
    pub fn verify(&self) -> Verify {
        self.verify
    }

    /// Whether the file has a section.
    pub fn has(&self, section: Section) -> bool {
        self.entry(section).is_some()
    }

    fn entry(&self, section: Section) -> Option<&Entry> {
        let sections = &self.entries;
        let place = sections.binary_search_by_key(&section, |entry| entry.section);
        place.ok().map(|place| &sections[place])
    }

    /// The elements of a section.
    ///
    /// # Errors
    ///
    /// [`FileError::MissingSection`] if there is none, [`FileError::BadSection`] if its elements have another size,
    /// [`FileError::Damaged`] if it does not match its checksum, [`FileError::Io`] if it cannot be read.
    pub fn elements<T: Pod>(&self, section: Section) -> Result<Buffer<T>, FileError> {
        let file = || self.name.clone();
        let Some(entry) = self.entry(section) else {
            let file = file();
            return Err(FileError::MissingSection { file, section });
        };
        let bad = |problem| FileError::BadSection {
            file: file(),
            section,
            problem,
        };
        if entry.element_bytes as usize != size_of::<T>() {
            return Err(bad(format!(
                "elements of {} bytes, expected {}",
                entry.element_bytes,
                size_of::<T>()
            )));
        }
        let (elements, checksum) = match &self.bytes {
            Bytes::Mapped(map) => self.mapped(map, entry).map_err(bad)?,
            Bytes::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                let read = read(&mut file, entry);
                let (elements, checksum) = read.map_err(|source| FileError::Io {
                    file: self.name.clone(),
                    source,
                })?;
                (elements.into(), Some(checksum))
            }
        };
        if checksum.is_some_and(|checksum| checksum != entry.checksum) {
            let file = file();
            return Err(FileError::Damaged { file, section });
        }
        Ok(elements)
    }

    /// The elements of a section in the mapping, and their checksum if it is wanted.
    fn mapped<T: Pod>(
        &self,
        map: &Arc<Mmap>,
        entry: &Entry,
    ) -> Result<(Buffer<T>, Option<u32>), String> {
        let place = |offset: u64| usize::try_from(offset).map_err(|error| error.to_string());
        let start = place(entry.offset)?;
        let end = place(entry.offset + entry.bytes())?;
        let elements = Buffer::shared(map, start..end).map_err(|error| error.to_string())?;
        let checksum = match self.verify {
            Verify::Everything => {
                let end = place(entry.offset + entry.padded_bytes())?;
                Some(crc32fast::hash(&map[start..end]))
            }
            Verify::Header => None,
        };
        Ok((elements, checksum))
    }
}

/// Opens a file, and returns its length. Not a folder, and nothing that has no length, such as a pipe or a device.
fn open_file(path: &Path) -> io::Result<(File, u64)> {
    // Before it is opened: to open a pipe waits for somebody who writes.
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !metadata.is_file() {
        let problem = "not a file of the disk";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    Ok((File::open(path)?, metadata.len()))
}

/// Reads the elements of a section, which is within the file, and computes their checksum.
fn read<T: Pod>(file: &mut File, entry: &Entry) -> io::Result<(Vec<T>, u32)> {
    let count = usize::try_from(entry.elements).map_err(|_| io::ErrorKind::OutOfMemory)?;
    let mut elements = Vec::new();
    elements
        .try_reserve_exact(count)
        .map_err(|_| io::ErrorKind::OutOfMemory)?;
    advise_large_pages(&elements);
    elements.resize(count, T::zeroed());
    file.seek(SeekFrom::Start(entry.offset))?;
    file.read_exact(cast_slice_mut(&mut elements))?;
    let mut padding = [0; ALIGNMENT];
    #[allow(clippy::cast_possible_truncation, reason = "below 64")]
    let padding = &mut padding[..(entry.padded_bytes() - entry.bytes()) as usize];
    file.read_exact(padding)?;
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(cast_slice(&elements));
    checksum.update(padding);
    if cfg!(target_endian = "big") {
        for word in cast_slice_mut::<T, u32>(&mut elements) {
            *word = u32::from_le(*word);
        }
    }
    Ok((elements, checksum.finalize()))
}
