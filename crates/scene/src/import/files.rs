//! The files that a model names: where they are, whether they may be read, and their bytes.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use etendue_files::MappedFile;
use etendue_report::Size;

use super::{Options, Refusal, error};
use crate::memory::Budget;
use crate::sniff::what_it_is;

/// Bytes that a model may make appear, however small its files are.
const MADE_OF_NOTHING: u64 = 512 << 20;

/// As many more for each byte of its files: bytes become floats (4), corners of strips triangles (12),
/// and instances transforms of nodes and placements.
const MADE_PER_BYTE: u64 = 64;

/// Opens files beside a model, each once, inside the allowed folder.
#[derive(Debug)]
pub(super) struct Files {
    model: PathBuf,
    folder: PathBuf,
    root: Option<PathBuf>,
    budget: Arc<Budget>,
    copy: bool,
    /// Bytes that the model makes appear, beside what its files hold.
    made: AtomicU64,
    opened: Mutex<BTreeMap<PathBuf, Arc<MappedFile>>>,
}

impl Files {
    /// For the model at `path`, whose relative paths start at its own folder.
    pub(super) fn of_model(path: &Path, options: &Options) -> Result<Self, Refusal> {
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let root = options.root.as_deref().map(canonical).transpose()?;
        Ok(Self {
            model: path.to_owned(),
            folder,
            root,
            budget: Arc::clone(&options.budget),
            copy: options.copy,
            made: AtomicU64::new(0),
            opened: Mutex::default(),
        })
    }

    /// Speaks for `bytes` of memory that `place` of the model makes appear: numbers without data, or
    /// in another form than the file's, instances, names.
    ///
    /// # Errors
    ///
    /// When they are over what there may be, or out of all proportion to the model's files.
    pub(super) fn take(&self, bytes: u64, place: impl FnOnce() -> String) -> Result<(), Refusal> {
        let made = self.made.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes);
        if made > MADE_OF_NOTHING {
            let held: u64 = self.opened().iter().map(|(_, size)| size).sum();
            if made > MADE_OF_NOTHING.saturating_add(held.saturating_mul(MADE_PER_BYTE)) {
                return Err(error::damaged(
                    &self.model,
                    place(),
                    format!(
                        "the model would take {} of memory and has {} of files\nhint: export it again, \
                         with the data in the file and fewer instances",
                        Size(made),
                        Size(held)
                    ),
                ));
            }
        }
        self.budget.take(bytes).map_err(|source| error::too_much(&self.model, place(), source))
    }

    /// The most that [`take`](Self::take) would still grant (bytes), as of now.
    pub(super) fn left(&self) -> u64 {
        let held: u64 = self.opened().iter().map(|(_, size)| size).sum();
        let most = MADE_OF_NOTHING.saturating_add(held.saturating_mul(MADE_PER_BYTE));
        most.saturating_sub(self.made.load(Ordering::Relaxed)).min(self.budget.left())
    }

    /// Refuses what the system has no room for while `place` of `file` is read.
    ///
    /// # Errors
    ///
    /// When it has not so many bytes now.
    pub(super) fn require_room(&self, file: &Path, place: &str, bytes: u64) -> Result<(), Refusal> {
        // Not of the model's own account: it is given back as soon as the place is read.
        Budget::default().take(bytes).map_err(|source| error::too_much(file, place, source))
    }

    /// Path that `written`, a path inside the model, leads to; see [`Self::locate_beside`].
    pub(super) fn locate(&self, written: &str) -> Result<Option<PathBuf>, Refusal> {
        self.locate_in(&self.folder, written)
    }

    /// Path that `written`, a path inside `file`, leads to. Backslashes, which some exporters
    /// write, count as slashes when no file has the name as it is.
    ///
    /// `Ok(None)` when there is no such file.
    pub(super) fn locate_beside(
        &self,
        file: &Path,
        written: &str,
    ) -> Result<Option<PathBuf>, Refusal> {
        self.locate_in(file.parent().unwrap_or(Path::new("")), written)
    }

    fn locate_in(&self, folder: &Path, written: &str) -> Result<Option<PathBuf>, Refusal> {
        let mut spellings = vec![folder.join(written)];
        if written.contains('\\') {
            spellings.push(folder.join(written.replace('\\', "/")));
        }
        // All are judged before anything is said of one: a model must not learn which files exist.
        if let Some(root) = &self.root
            && !spellings.iter().all(|path| etendue_files::is_inside(root, path))
        {
            return Err(Refusal::new(format!(
                "\"{written}\" leads out of the folder {}",
                root.display()
            ))
            .hint("move the file there, or pass --allow-outside")
            .at(self.model.display()));
        }
        Ok(spellings.into_iter().find(|path| path.is_file()))
    }

    /// The bytes of the model at `path`, mapped; an empty file is none.
    pub(super) fn map_model(&self, path: &Path) -> Result<Arc<MappedFile>, Refusal> {
        let map = self.map(path)?;
        if map.bytes().is_empty() {
            return Err(error::damaged(
                path,
                "the file",
                "it is empty\nhint: copy or export it again",
            ));
        }
        Ok(map)
    }

    /// The bytes of the file at `path`, mapped, or copied where that is asked for.
    pub(super) fn map(&self, path: &Path) -> Result<Arc<MappedFile>, Refusal> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = opened.get(path) {
            return Ok(Arc::clone(file));
        }
        let file = if self.copy {
            let length = path.metadata().map_or(0, |about| about.len());
            self.budget
                .take(length)
                .map_err(|source| error::too_much(path, "a copy of it", source))?;
            MappedFile::copy(path)
        } else {
            MappedFile::open(path)
        };
        let file = Arc::new(file.map_err(|source| unreadable(path, &source))?);
        opened.insert(path.to_owned(), Arc::clone(&file));
        Ok(file)
    }

    /// The files opened so far, with their sizes in bytes.
    pub(super) fn opened(&self) -> Vec<(PathBuf, u64)> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.iter().map(|(path, file)| (path.clone(), file.bytes().len() as u64)).collect()
    }
}

fn canonical(folder: &Path) -> Result<PathBuf, Refusal> {
    folder.canonicalize().map_err(|source| unreadable(folder, &source))
}

fn unreadable(path: &Path, source: &io::Error) -> Refusal {
    Refusal::new(format!("cannot be read: {source}")).at(path.display())
}

/// Refuses a file whose bytes are those of something else than `wanted`.
pub(super) fn refuse_other_kind(file: &Path, bytes: &[u8], wanted: &str) -> Result<(), Refusal> {
    match what_it_is(bytes) {
        Some(what) => Err(error::damaged(
            file,
            "the file",
            format!("it is {what}, not {wanted}\nhint: name the model itself"),
        )),
        None => Ok(()),
    }
}
