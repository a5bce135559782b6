//! Writing a file: as a whole or not at all.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::{Pod, cast_slice};

use crate::error::FileError;
use crate::header::{self, ALIGNMENT, Entry};
use crate::section::Section;

/// The sections of a file that is to be written. They are borrowed, and written from where they are.
#[derive(Debug, Default)]
pub struct Contents<'a> {
    sections: Vec<Elements<'a>>,
}

/// The elements of a section, as words in the byte order of this machine.
#[derive(Debug)]
struct Elements<'a> {
    section: Section,
    element_bytes: u32,
    words: &'a [u32],
}

impl<'a> Contents<'a> {
    /// No sections.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a section. `T` consists of 4-byte words.
    ///
    /// # Panics
    ///
    /// If an element has 4 GiB or more.
    pub fn add<T: Pod>(&mut self, section: Section, elements: &'a [T]) {
        const {
            assert!(
                size_of::<T>() > 0 && size_of::<T>().is_multiple_of(4),
                "elements consist of words"
            );
        }
        self.sections.push(Elements {
            section,
            element_bytes: u32::try_from(size_of::<T>()).expect("a small element"),
            words: cast_slice(elements),
        });
    }

    /// Writes the file: the same bytes on every platform. Linear; reads the sections twice, first for their checksums.
    ///
    /// The bytes go to a file beside it first (`….partial`), which then replaces an existing file as a whole. If the write fails or is
    /// interrupted, an existing file stays as it is.
    ///
    /// # Errors
    ///
    /// [`FileError::Io`] names the file and the error of the system.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        let partial = partial_name(path);
        let written = self.write_new(&partial).and_then(|()| {
            std::fs::rename(&partial, path)?;
            sync_folder(path)
        });
        written.map_err(|source| {
            // A leftover that cannot be removed matters less than the first error.
            std::fs::remove_file(&partial).ok();
            FileError::Io {
                file: path.display().to_string(),
                source,
            }
        })
    }

    /// Writes a file that is not there yet.
    fn write_new(&self, path: &Path) -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
        self.write(&mut file)?;
        file.sync_all()
    }

    /// Writes the bytes of the file, in few large pieces.
    ///
    /// # Errors
    ///
    /// Those of the writer.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        let mut offset = header::first_offset(self.sections.len());
        let entries = self.sections.iter().map(|elements| {
            let entry = elements.entry(offset);
            offset += entry.padded_bytes();
            entry
        });
        let entries: Vec<Entry> = entries.collect();
        to.write_all(&header::to_bytes(&entries, offset))?;
        for elements in &self.sections {
            elements.each_piece(|piece| to.write_all(piece))?;
        }
        Ok(())
    }
}

impl Elements<'_> {
    fn entry(&self, offset: u64) -> Entry {
        let mut checksum = crc32fast::Hasher::new();
        let hashed = self.each_piece(|piece| {
            checksum.update(piece);
            Ok(())
        });
        hashed.expect("nothing fails");
        Entry {
            section: self.section,
            offset,
            elements: (size_of_val(self.words) / self.element_bytes as usize) as u64,
            element_bytes: self.element_bytes,
            checksum: checksum.finalize(),
        }
    }

    /// Calls a function with the bytes of the section in order, little-endian, with the zeros behind them.
    fn each_piece(&self, mut call: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        if cfg!(target_endian = "little") {
            call(cast_slice(self.words))?;
        } else {
            const WORDS: usize = 1 << 12;
            let mut piece = Vec::with_capacity(4 * WORDS);
            for words in self.words.chunks(WORDS) {
                piece.clear();
                piece.extend(words.iter().flat_map(|word| word.to_le_bytes()));
                call(&piece)?;
            }
        }
        let bytes = size_of_val(self.words);
        call(&[0; ALIGNMENT][..bytes.next_multiple_of(ALIGNMENT) - bytes])
    }
}

/// A name beside a file that no other write uses meanwhile.
fn partial_name(path: &Path) -> PathBuf {
    static WRITES: AtomicU32 = AtomicU32::new(0);
    let number = WRITES.fetch_add(1, Ordering::Relaxed);
    let mut name: OsString = path.as_os_str().to_owned();
    name.push(format!(".{}-{number}.partial", std::process::id()));
    name.into()
}

/// Makes a rename last, where a folder can be synchronized.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}
