//! The one place that opens files for reading.
//!
//! Only regular files are opened: a named pipe waits for whoever writes into it, and a device may
//! have no end or do something when it is read.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::SystemTime;

/// A file's length, time of change and identity: what tells whether it is as it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    length: u64,
    modified: Option<SystemTime>,
    /// Device and number there.
    node: [u64; 2],
}

impl Stamp {
    /// `None` when the file is not to be had.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        path.metadata().ok().map(|metadata| Self::from(&metadata))
    }
}

impl From<&Metadata> for Stamp {
    fn from(metadata: &Metadata) -> Self {
        Self {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            node: [metadata.dev(), metadata.ino()],
        }
    }
}

/// Opens the regular file at `path` for reading.
///
/// # Errors
///
/// When it cannot be opened, or is a folder, a named pipe, a socket or a device; these are not
/// touched.
pub fn open(path: &Path) -> io::Result<File> {
    // Asked before it is opened: opening is what waits.
    require_regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    require_regular(&file.metadata()?)?;
    Ok(file)
}

/// The bytes of the regular file at `path`, of which there may be `most`.
///
/// # Errors
///
/// As [`open`]; and when it has more bytes than that.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let len = file.metadata()?.len();
    if len > most {
        let reason = format!("it has {len} bytes, and no more than {most} are read of such files");
        return Err(io::Error::other(reason));
    }
    // A file that grows meanwhile is cut where it may have ended.
    read_up_to(file, most)
}

/// The first bytes of the regular file at `path`, `most` of them where it is longer.
///
/// # Errors
///
/// As [`open`].
pub fn read_head(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    read_up_to(open(path)?, most)
}

fn read_up_to(file: File, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn require_regular(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let reason = format!("it is {}, not a regular file", kind(metadata));
    Err(io::Error::other(reason))
}

/// What it is instead of a regular file, as a sentence says it.
fn kind(metadata: &Metadata) -> &'static str {
    if metadata.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a named pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
    }
    "a device"
}
