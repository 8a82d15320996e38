//! The one place that maps files into memory.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A whole file mapped read-only. Nothing is read until it is touched, and the pages are the
/// system's cache, not this process' heap.
///
/// The file must not be truncated while it is mapped: the system then ends a process that reads
/// past the new end. Changing its bytes changes what is rendered.
pub struct MappedFile {
    path: PathBuf,
    map: memmap2::Mmap,
}

impl MappedFile {
    /// Maps the file at `path`.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or mapped (an empty file maps to no bytes), or is no regular
    /// file.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = crate::files::open(path)?;
        #[expect(unsafe_code, reason = "mapping a file is unsafe: another process may change it")]
        // SAFETY: the map is read-only and private, and is only ever read as plain bytes or as
        // numbers, for which every bit pattern is valid. Bytes that change under us can give a
        // wrong picture but no invalid value: indices are checked when the mesh is loaded and
        // again wherever Rust reads through them. Truncation by another process is documented.
        let map = unsafe { memmap2::Mmap::map(&file)? };
        Ok(Self { path: path.to_owned(), map })
    }

    /// Where the file is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }
}

impl fmt::Debug for MappedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MappedFile")
            .field("path", &self.path)
            .field("len", &self.map.len())
            .finish()
    }
}
