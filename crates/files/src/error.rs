//! Refusals of files that are to be written.

use std::io;
use std::path::{Path, PathBuf};

/// Error of a file that was not written. What stood under its name before still does.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The system refused.
    #[error("cannot write {}: {source}\nhint: {remedy}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
        /// Remedy.
        remedy: &'static str,
    },
    /// The file is an input.
    #[error(
        "{} would be written over, and is read by this command{}; nothing was written\n\
         hint: choose another folder or name",
        path.display(),
        also_called(path, input)
    )]
    IsInput {
        /// The file that was to be written.
        path: PathBuf,
        /// The name under which it is read.
        input: PathBuf,
    },
}

/// The name that an input is read under, where it is another.
fn also_called(path: &Path, input: &Path) -> String {
    if path == input { String::new() } else { format!(" as {}", input.display()) }
}

impl WriteError {
    /// The system's refusal of `path`, with what to do about it.
    #[must_use]
    pub fn io(path: &Path, source: io::Error) -> Self {
        let remedy = match source.kind() {
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                "make the folder writable or choose another one"
            }
            io::ErrorKind::NotFound => "create the folder first or choose another one",
            io::ErrorKind::AlreadyExists => "it is a file; choose another folder",
            io::ErrorKind::NotADirectory => "a part of the path is a file; choose another folder",
            io::ErrorKind::IsADirectory => "a folder has this name; choose another name",
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space or choose a folder on another disk"
            }
            io::ErrorKind::InvalidFilename => "choose a shorter or simpler name",
            _ => "check the folder and its disk, or choose another one",
        };
        Self::Io { path: path.to_owned(), source, remedy }
    }
}
