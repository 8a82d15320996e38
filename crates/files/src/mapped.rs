//! The one place that maps files into memory.

use std::path::{Path, PathBuf};
use std::{fmt, io};

/// A whole file mapped read-only, or a copy of it. Of a mapped one nothing is read until it is touched,
/// and the pages are the system's cache, not this process' heap.
///
/// A mapped file must not be truncated while it is mapped: the system then ends a process that reads
/// past the new end. Changing its bytes changes what is rendered.
pub struct MappedFile {
    path: PathBuf,
    contents: Contents,
}

enum Contents {
    Mapped(memmap2::Mmap),
    Copied(Vec<u8>),
}

impl MappedFile {
    /// Maps the file at `path`.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or mapped (an empty file maps to no bytes), or is no regular
    /// file.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = crate::opener::open(path)?;
        #[expect(unsafe_code, reason = "mapping a file is unsafe: another process may change it")]
        // SAFETY: the map is read-only and private, and is only ever read as plain bytes or as
        // numbers, for which every bit pattern is valid. Bytes that change under us can give a
        // wrong picture but no invalid value: indices are checked when the mesh is loaded and
        // again wherever Rust reads through them. Truncation by another process is documented.
        let map = unsafe { memmap2::Mmap::map(&file)? };
        Ok(Self { path: path.to_owned(), contents: Contents::Mapped(map) })
    }

    /// Reads the file at `path` into memory: what other programs do to it later changes nothing.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or read, is no regular file, or there is no memory for it.
    pub fn copy(path: &Path) -> io::Result<Self> {
        let bytes = crate::opener::read(path, u64::MAX)?;
        Ok(Self { path: path.to_owned(), contents: Contents::Copied(bytes) })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        match &self.contents {
            Contents::Mapped(map) => map,
            Contents::Copied(bytes) => bytes,
        }
    }
}

impl fmt::Debug for MappedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MappedFile")
            .field("path", &self.path)
            .field("len", &self.bytes().len())
            .finish()
    }
}
