//! The files that a model names: where they are, whether they may be read, and their bytes.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::{fs, io};

use etendue_geometry::MappedFile;

use super::ImportError;

/// Opens files beside a model, each once, inside the allowed folder.
#[derive(Debug)]
pub(super) struct Files {
    model: PathBuf,
    folder: PathBuf,
    root: Option<PathBuf>,
    opened: Mutex<BTreeMap<PathBuf, Arc<MappedFile>>>,
}

impl Files {
    /// For the model at `path`, whose relative paths start at its own folder.
    pub(super) fn beside(path: &Path, root: Option<&Path>) -> Result<Self, ImportError> {
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let root = root.map(canonical).transpose()?;
        Ok(Self { model: path.to_owned(), folder, root, opened: Mutex::default() })
    }

    /// Where `written`, a path inside the model, leads; see [`Self::locate_beside`].
    pub(super) fn locate(&self, written: &str) -> Result<Option<PathBuf>, ImportError> {
        self.locate_in(&self.folder, written)
    }

    /// Where `written`, a path inside `file`, leads. Backslashes, which some exporters write,
    /// count as slashes when no file has the name as it is.
    ///
    /// `Ok(None)` when there is no such file.
    pub(super) fn locate_beside(
        &self,
        file: &Path,
        written: &str,
    ) -> Result<Option<PathBuf>, ImportError> {
        self.locate_in(file.parent().unwrap_or(Path::new("")), written)
    }

    fn locate_in(&self, folder: &Path, written: &str) -> Result<Option<PathBuf>, ImportError> {
        let mut path = folder.join(written);
        if !path.exists() && written.contains('\\') {
            path = folder.join(written.replace('\\', "/"));
        }
        if let Some(root) = &self.root {
            // Judged before anything else is said of it: a model must not learn which files exist.
            let real = path
                .canonicalize()
                .or_else(|_| Ok(without_dots(&canonical(folder)?.join(written))))?;
            if !real.starts_with(root) {
                return Err(ImportError::Outside {
                    file: self.model.clone(),
                    written: written.to_owned(),
                    root: root.clone(),
                });
            }
        }
        Ok(path.is_file().then_some(path))
    }

    /// The bytes of the file at `path`, mapped.
    pub(super) fn map(&self, path: &Path) -> Result<Arc<MappedFile>, ImportError> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = opened.get(path) {
            return Ok(Arc::clone(file));
        }
        let file = Arc::new(open(path).map_err(|source| unreadable(path, source))?);
        opened.insert(path.to_owned(), Arc::clone(&file));
        Ok(file)
    }

    /// The files opened so far, with their sizes in bytes.
    pub(super) fn opened(&self) -> Vec<(PathBuf, u64)> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.iter().map(|(path, file)| (path.clone(), file.bytes().len() as u64)).collect()
    }
}

/// Maps a regular file: opening a pipe would wait for its writer.
fn open(path: &Path) -> io::Result<MappedFile> {
    if fs::metadata(path)?.is_file() {
        MappedFile::open(path)
    } else {
        Err(io::Error::other("it is not a regular file"))
    }
}

fn canonical(folder: &Path) -> Result<PathBuf, ImportError> {
    folder.canonicalize().map_err(|source| unreadable(folder, source))
}

fn unreadable(path: &Path, source: io::Error) -> ImportError {
    ImportError::Unreadable { file: path.to_owned(), source }
}

/// The path with `.` and `..` worked out by its text alone, for files that do not exist.
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
