//! Sets of files that take their names together, when all of them are complete.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{NamedTempFile, TempPath};

use super::OutputError;
use super::atomic::{Entry, note_finished};

/// Complete files that wait for the others of their set, with the folder of it.
static WAITING: Mutex<Vec<WaitingSet>> = Mutex::new(Vec::new());

/// The files of a [`Together`] of this number.
#[derive(Debug)]
struct WaitingSet {
    number: u64,
    folder: PathBuf,
    files: Vec<Waiting>,
}

fn waiting_sets() -> MutexGuard<'static, Vec<WaitingSet>> {
    WAITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps a complete part file of `target` waiting if a set has that; else gives it back.
pub(super) fn wait(file: NamedTempFile, target: &Path, _entry: Entry) -> Option<NamedTempFile> {
    let mut sets = waiting_sets();
    let Some(set) = sets.iter_mut().rfind(|set| target.starts_with(&set.folder)) else {
        return Some(file);
    };
    let (file, path) = file.into_parts();
    let _lock = (set.files.len() < MOST_OPEN).then_some(file);
    set.files.push(Waiting { path, target: target.to_owned(), _lock, _entry });
    None
}

/// Files that are kept open while they wait: a process may not have many more.
const MOST_OPEN: usize = 200;

/// A complete file without its name.
#[derive(Debug)]
struct Waiting {
    path: TempPath,
    target: PathBuf,
    /// Shows other processes that it is in use.
    _lock: Option<File>,
    _entry: Entry,
}

/// A set of files in one folder and below it, which take their names together: what is finished while
/// this lives waits, and is gone when this is dropped before [`Self::finish`].
#[derive(Debug)]
pub struct Together {
    number: u64,
}

impl Together {
    /// Of the files below `folder`.
    #[must_use]
    pub fn in_folder(folder: &Path) -> Self {
        let mut sets = waiting_sets();
        let number = sets.iter().map(|set| set.number + 1).max().unwrap_or(0);
        sets.push(WaitingSet { number, folder: folder.to_owned(), files: Vec::new() });
        Self { number }
    }

    /// Its files; none when they were taken.
    fn take(&self) -> Vec<Waiting> {
        let mut sets = waiting_sets();
        let found = sets.iter().position(|set| set.number == self.number);
        found.map(|at| sets.remove(at).files).unwrap_or_default()
    }

    /// Gives all files their names.
    ///
    /// # Errors
    ///
    /// [`OutputError::Io`] when one cannot be renamed; it and those after it are removed then.
    pub fn finish(self) -> Result<(), OutputError> {
        let files = self.take();
        // The number may be another set's from now on.
        std::mem::forget(self);
        for Waiting { path, target, .. } in files {
            path.persist(&target).map_err(|failed| OutputError::io(&target, failed.error))?;
            note_finished(target);
        }
        Ok(())
    }
}

impl Drop for Together {
    fn drop(&mut self) {
        drop(self.take());
    }
}
