//! Sets of files that take their names together, and the inputs that none of them may take the place of.
//!
//! A transaction is a value: whoever writes makes one and hands it down. Two of them, in two threads and
//! over nested folders, do not know of each other.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{NamedTempFile, TempPath};

use crate::WriteError;
use crate::part::{Content, PartRegistration};

/// Files that are kept open while they wait: a process may not have many more.
const MOST_OPEN: usize = 200;

/// A set of files on their way. They take their names with [`Self::commit`], or, of a transaction
/// [`at_once`](Self::at_once), each when it is complete; those that have none when this is dropped are gone.
#[derive(Debug, Default)]
pub struct Transaction {
    /// Files that must not be written over.
    inputs: BTreeSet<PathBuf>,
    /// Complete files do not wait for the others.
    is_at_once: bool,
    state: Mutex<TransactionState>,
}

#[derive(Debug, Default)]
struct TransactionState {
    waiting: Vec<Waiting>,
    /// The files that have their names, in the order in which they took them.
    finished: Vec<PathBuf>,
}

/// A complete file without its name.
#[derive(Debug)]
struct Waiting {
    path: TempPath,
    target: PathBuf,
    /// Shows other processes that it is in use.
    _lock: Option<File>,
    _entry: PartRegistration,
}

impl Transaction {
    /// A set whose files wait for one another.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Files that take their names each when it is complete.
    #[must_use]
    pub fn at_once() -> Self {
        Self { is_at_once: true, ..Self::default() }
    }

    /// Returns the transaction, which then refuses to write over any of `inputs`.
    #[must_use]
    pub fn keeping<'p>(mut self, inputs: impl IntoIterator<Item = &'p PathBuf>) -> Self {
        self.inputs.extend(inputs.into_iter().cloned());
        self
    }

    /// Checks that none of `targets` is an input, under any name and through any link, as files are now.
    ///
    /// # Errors
    ///
    /// [`WriteError::IsInput`] with the first that is.
    pub fn refuse_inputs<'p>(
        &self,
        targets: impl IntoIterator<Item = &'p Path>,
    ) -> Result<(), WriteError> {
        // Looked at once for all targets: a file that was an input and is gone is none any more.
        let mut known: Option<Vec<(FileIdentity, &PathBuf)>> = None;
        for target in targets {
            let Some(found) = identity(target) else { continue };
            let known = known.get_or_insert_with(|| {
                self.inputs.iter().filter_map(|input| Some((identity(input)?, input))).collect()
            });
            if let Some((_, input)) = known.iter().find(|(input, _)| *input == found) {
                let input = (*input).clone();
                return Err(WriteError::IsInput { path: target.to_owned(), input });
            }
        }
        Ok(())
    }

    /// Opens a part file beside `target`. Its permissions are those of any new file.
    ///
    /// # Errors
    ///
    /// [`WriteError`] when the folder does not exist or cannot be written to, a folder already has that
    /// name, or it is an input.
    pub fn create(&self, target: &Path) -> Result<PartFile<'_>, WriteError> {
        self.refuse_inputs([target])?;
        PartFile::create(self, target)
    }

    /// Writes `target` with `write`; nothing changes there unless that and all else succeeds.
    ///
    /// # Errors
    ///
    /// As [`Self::create`], and when the file cannot be written or renamed.
    pub fn write(
        &self,
        target: &Path,
        write: impl FnOnce(&mut PartFile<'_>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        let mut part = self.create(target)?;
        write(&mut part).map_err(|source| WriteError::io(target, source))?;
        part.finish()
    }

    /// Moves `path`, a whole file of the same disk, to `target`, whose folder is made; gives its size (bytes).
    ///
    /// # Errors
    ///
    /// As [`Self::create`], and when it cannot be renamed.
    pub fn move_whole(&self, path: &Path, target: &Path) -> Result<u64, WriteError> {
        self.refuse_inputs([target])?;
        let size = target
            .parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::rename(path, target))
            .and_then(|()| Ok(target.metadata()?.len()))
            .map_err(|source| WriteError::io(target, source))?;
        self.note_finished(target.to_owned());
        Ok(size)
    }

    /// Counts `path`, which was written whole by other means, among the files of the set.
    pub fn note_finished(&self, path: PathBuf) {
        self.state().finished.push(path);
    }

    /// Gives all complete files their names.
    ///
    /// # Errors
    ///
    /// [`WriteError::IsInput`] when one has become an input's, before any is renamed; [`WriteError::Io`]
    /// when one cannot be renamed: it and those after it are removed then.
    pub fn commit(&self) -> Result<(), WriteError> {
        let waiting = std::mem::take(&mut self.state().waiting);
        self.refuse_inputs(waiting.iter().map(|file| &*file.target))?;
        for Waiting { path, target, .. } in waiting {
            path.persist(&target).map_err(|failed| WriteError::io(&target, failed.error))?;
            self.note_finished(target);
        }
        Ok(())
    }

    /// The files that have their names, in the order in which they took them.
    #[must_use]
    pub fn finished(&self) -> Vec<PathBuf> {
        self.state().finished.clone()
    }

    /// Takes a complete part file of `target`.
    fn take(
        &self,
        file: NamedTempFile,
        target: PathBuf,
        entry: PartRegistration,
    ) -> Result<(), WriteError> {
        if self.is_at_once {
            self.refuse_inputs([&*target])?;
            file.persist(&target).map_err(|failed| WriteError::io(&target, failed.error))?;
            drop(entry);
            self.note_finished(target);
            return Ok(());
        }
        let mut state = self.state();
        let (file, path) = file.into_parts();
        // What is written twice has its last content.
        state.waiting.retain(|other| other.target != target);
        let _lock = (state.waiting.len() < MOST_OPEN).then_some(file);
        state.waiting.push(Waiting { path, target, _lock, _entry: entry });
        Ok(())
    }

    fn state(&self) -> MutexGuard<'_, TransactionState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A file on its way. Dropped without [`Self::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct PartFile<'t> {
    content: Content,
    target: PathBuf,
    transaction: &'t Transaction,
}

impl<'t> PartFile<'t> {
    /// A part file beside `target`, for [`Transaction::create`].
    fn create(transaction: &'t Transaction, target: &Path) -> Result<Self, WriteError> {
        let refuse = |source| WriteError::io(target, source);
        if target.is_dir() || target.file_name().is_none() {
            return Err(refuse(io::ErrorKind::IsADirectory.into()));
        }
        let content = Content::begin(target).map_err(refuse)?;
        Ok(Self { content, target: target.to_owned(), transaction })
    }

    /// Says that the file is complete: it takes its name, in place of what had it before, now or with the
    /// others of its transaction.
    ///
    /// # Errors
    ///
    /// [`WriteError`] when it cannot be renamed, or an input has the name by now; the part file is removed
    /// then.
    pub fn finish(self) -> Result<(), WriteError> {
        let Self { content, target, transaction } = self;
        match content {
            Content::Beside { file, entry } => transaction.take(file, target, entry),
            Content::Apart { mut file, to } => {
                to.fill(&target, &mut file).map_err(|source| WriteError::io(&target, source))?;
                transaction.note_finished(target);
                Ok(())
            }
        }
    }
}

impl Write for PartFile<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.content.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.content.file().flush()
    }
}

impl Seek for PartFile<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.content.file().seek(to)
    }
}

/// Identity that two names of one file share, links followed: device and inode.
#[cfg(unix)]
type FileIdentity = (u64, u64);

/// Identity that two names of one file share: its place without links.
#[cfg(not(unix))]
type FileIdentity = PathBuf;

#[cfg(unix)]
fn identity(path: &Path) -> Option<FileIdentity> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|data| (data.dev(), data.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<FileIdentity> {
    fs::canonicalize(path).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(files: &Transaction, path: &Path, text: &str) {
        files.write(path, |part| part.write_all(text.as_bytes())).unwrap();
    }

    #[test]
    #[cfg(unix)]
    fn an_input_is_refused_under_all_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["input", "other"] {
            fs::write(path(name), "").unwrap();
        }
        fs::hard_link(path("input"), path("hard")).unwrap();
        std::os::unix::fs::symlink("input", path("soft")).unwrap();
        std::os::unix::fs::symlink("soft", path("softer")).unwrap();
        fs::create_dir(path("sub")).unwrap();
        let files = Transaction::new().keeping(&[path("input"), path("missing")]);
        for name in ["input", "hard", "soft", "softer", "sub/../input"] {
            let error = files.refuse_inputs([&*path("other"), &path(name)]).unwrap_err();
            let error = error.to_string();
            assert!(error.contains(&*path(name).to_string_lossy()), "{error}");
            assert!(error.contains("is read by this command"), "{error}");
            assert!(files.create(&path(name)).is_err());
        }
        files.refuse_inputs([&*path("other"), &path("missing"), &path("sub")]).unwrap();
    }

    /// A name that becomes an input's while the set is written is found before any file is renamed.
    #[test]
    fn what_becomes_an_input_meanwhile_is_refused_and_nothing_is_renamed() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let files = Transaction::new().keeping(&[path("input")]);
        put(&files, &path("a"), "new");
        put(&files, &path("input"), "new");
        fs::write(path("input"), "mine").unwrap();
        assert!(matches!(files.commit(), Err(WriteError::IsInput { .. })));
        assert!(!path("a").exists());
        assert_eq!(fs::read_to_string(path("input")).unwrap(), "mine");
    }

    /// File systems give the number of a removed file to the next one.
    #[test]
    fn a_file_with_the_inode_of_an_input_that_is_gone_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let [input, output] = ["input", "output"].map(|name| folder.path().join(name));
        for round in 0..1000 {
            fs::write(&input, "").unwrap();
            let files = Transaction::new().keeping([&input]);
            fs::remove_file(&input).unwrap();
            fs::write(&output, "").unwrap();
            put(&files, &output, &round.to_string());
            files.commit().unwrap();
        }
        assert_eq!(fs::read_to_string(output).unwrap(), "999");
    }

    #[test]
    fn sets_of_two_threads_over_nested_folders_keep_their_own_files() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("below");
        fs::create_dir(&below).unwrap();
        let outer = Transaction::new();
        put(&outer, &below.join("outer"), "outer");
        let (inner_target, late_target) = (below.join("inner"), below.join("late"));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let inner = Transaction::new();
                put(&inner, &inner_target, "inner");
                inner.commit().unwrap();
                assert_eq!(inner.finished(), std::slice::from_ref(&inner_target));
                put(&Transaction::at_once(), &late_target, "late");
            });
        });
        assert!(inner_target.exists() && late_target.exists());
        assert!(!below.join("outer").exists());
        drop(outer);
        let mut left: Vec<_> =
            fs::read_dir(&below).unwrap().map(|entry| entry.unwrap().path()).collect();
        left.sort();
        assert_eq!(left, [inner_target, late_target]);
    }

    #[test]
    fn what_is_written_twice_has_its_last_content() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let files = Transaction::new();
        put(&files, &path, "first");
        put(&files, &path, "second");
        files.commit().unwrap();
        assert_eq!(files.finished(), std::slice::from_ref(&path));
        assert_eq!(fs::read_to_string(path).unwrap(), "second");
    }
}
