//! The opener of what a scene names: it knows where a scene may read, and what was found. The one place
//! that opens files for reading.
//!
//! Only regular files are opened: a named pipe waits for whoever writes into it, and a device may
//! have no end or do something when it is read.

use std::collections::BTreeSet;
use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// The longest path that Linux takes (bytes).
const LONGEST_PATH: usize = 4096;

/// The most bytes of a file that this program has written itself, and reads again.
pub const MOST_OWN_BYTES: u64 = 1 << 30;

/// Reach of a scene: its own folder, or files outside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reach {
    /// No: also not through links.
    #[default]
    OwnFolder,
    /// Yes: the user has said so.
    Anywhere,
}

/// Opener of files: where they may be read, and a record of those that were found, which must not
/// be written over. A clone has the same record.
#[derive(Debug, Clone, Default)]
pub struct Opener {
    reach: Reach,
    found: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl Opener {
    /// An opener with an empty record.
    #[must_use]
    pub fn new(reach: Reach) -> Self {
        Self { reach, found: Arc::default() }
    }

    /// Permission of scenes to read files outside their folders.
    #[must_use]
    pub fn reach(&self) -> Reach {
        self.reach
    }

    /// Records files that were found by other means, such as those that a user names.
    pub fn record(&self, paths: impl IntoIterator<Item = PathBuf>) {
        self.locked().extend(paths);
    }

    /// The files that were found so far, each once.
    #[must_use]
    pub fn found(&self) -> Vec<PathBuf> {
        self.locked().iter().cloned().collect()
    }

    /// The folder that a scene's paths start at.
    ///
    /// # Errors
    ///
    /// When there is none at `path`.
    pub fn folder(&self, path: &Path) -> io::Result<InputFolder> {
        let real = path.canonicalize()?;
        Ok(InputFolder { path: path.to_owned(), real, opener: self.clone() })
    }

    fn locked(&self) -> MutexGuard<'_, BTreeSet<PathBuf>> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The folder that paths start at and, as a rule, may not leave.
#[derive(Debug, Clone)]
pub struct InputFolder {
    path: PathBuf,
    /// Without links.
    real: PathBuf,
    opener: Opener,
}

/// A file that a scene names.
#[derive(Debug, Clone)]
pub struct FoundFile {
    /// As the scene reaches it.
    pub path: PathBuf,
    /// Without links.
    pub real: PathBuf,
}

/// Error of a file that a scene names and that is not opened; the message goes on after the place that names it.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// There is none.
    #[error("no such file: \"{written}\"")]
    Missing {
        /// The name as it is written.
        written: String,
        /// Path where it was looked for.
        path: PathBuf,
    },
    /// It may not be read, or is no file.
    #[error("{0}")]
    Refused(String),
}

impl InputFolder {
    /// The folder that models may not leave either, without links; none when they may.
    #[must_use]
    pub fn limit(&self) -> Option<&Path> {
        (self.opener.reach == Reach::OwnFolder).then_some(self.real.as_path())
    }

    /// Finds the file that `written` names, to be opened and, with links followed, to be compared.
    ///
    /// # Errors
    ///
    /// When there is no such file, or it is none that may be read.
    pub fn find(&self, written: &str) -> Result<FoundFile, FindError> {
        if written.is_empty() {
            return Err(FindError::Refused("is empty\nhint: name a file".to_owned()));
        }
        // Judged by its text first, so that a scene cannot ask which files exist elsewhere.
        if self.limit().is_some() {
            match leaves(Path::new(written)) {
                Some(FolderEscape::Absolute) => {
                    return Err(self.outside(written, "is absolute and may leave "));
                }
                Some(FolderEscape::Upwards) => return Err(self.outside(written, "leaves ")),
                None => {}
            }
        }
        self.found(written, self.path.join(written))
    }

    fn found(&self, written: &str, path: PathBuf) -> Result<FoundFile, FindError> {
        // Nor what lies behind a link out of it.
        if self.limit().is_some() && !is_inside(&self.real, &path) {
            return Err(self.outside(written, "leads through a link out of "));
        }
        let real = path.canonicalize().map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => {
                FindError::Missing { written: written.to_owned(), path: path.clone() }
            }
            _ => FindError::Refused(format!("\"{written}\" cannot be read: {error}")),
        })?;
        if real.is_dir() {
            return Err(FindError::Refused(format!(
                "\"{written}\" is a folder\nhint: name a file"
            )));
        }
        self.opener.record([path.clone()]);
        Ok(FoundFile { path, real })
    }

    fn outside(&self, written: &str, how: &str) -> FindError {
        FindError::Refused(format!(
            "\"{written}\" {how}the scene's folder {}\nhint: move the file there, or pass --allow-outside",
            self.real.display()
        ))
    }

    /// Opener: where files may be read, and what was found.
    #[must_use]
    pub fn opener(&self) -> &Opener {
        &self.opener
    }

    /// `file` as seen from the folder, for names that do not depend on the machine.
    #[must_use]
    pub fn relative(&self, file: &Path) -> String {
        let real = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        let inside = real.strip_prefix(&self.real).map(Path::to_owned);
        let shown = inside.unwrap_or_else(|_| real.file_name().unwrap_or_default().into());
        shown.to_string_lossy().into_owned()
    }
}

/// Tests whether `path` stays inside `root`, which has no links: by its text, and with the links of
/// as much of it as exists. What exists outside does not change the answer.
#[must_use]
pub fn is_inside(root: &Path, path: &Path) -> bool {
    // No file has such a name, wherever it is; taking it apart would be all that it costs.
    if path.as_os_str().len() > LONGEST_PATH {
        return true;
    }
    let Some((real, missing)) = existing(path) else { return false };
    // What does not exist has no links, so its text tells where it would be.
    real.starts_with(root) && without_dots(&real.join(missing)).starts_with(root)
}

/// Resolves `path`, with the links of as much of it as exists.
#[must_use]
pub fn real_place(path: &Path) -> PathBuf {
    match existing(path) {
        Some((real, missing)) => without_dots(&real.join(missing)),
        None => path.to_owned(),
    }
}

/// As much of `path` as exists, without links, and the rest.
fn existing(path: &Path) -> Option<(PathBuf, &Path)> {
    path.ancestors().find_map(|part| {
        let part = if part.as_os_str().is_empty() { Path::new(".") } else { part };
        part.canonicalize().ok().map(|real| (real, path.strip_prefix(part).unwrap_or(path)))
    })
}

/// The path with `.` and `..` worked out by its text alone.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

enum FolderEscape {
    Absolute,
    Upwards,
}

/// True if a path climbs above where it starts, judged by its text.
fn leaves(path: &Path) -> Option<FolderEscape> {
    let mut depth = 0_i64;
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return Some(FolderEscape::Absolute),
        }
        if depth < 0 {
            return Some(FolderEscape::Upwards);
        }
    }
    None
}

/// A file's length, time of change and identity: what tells whether it is as it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    length: u64,
    modified: Option<SystemTime>,
    /// Device and number there.
    #[cfg(unix)]
    node: [u64; 2],
    /// Time of its creation, where the system numbers no files.
    #[cfg(not(unix))]
    created: Option<SystemTime>,
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
        #[cfg(unix)]
        use std::os::unix::fs::MetadataExt;
        Self {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            #[cfg(unix)]
            node: [metadata.dev(), metadata.ino()],
            #[cfg(not(unix))]
            created: metadata.created().ok(),
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

/// Kind of something that is not a regular file, as a sentence says it.
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
