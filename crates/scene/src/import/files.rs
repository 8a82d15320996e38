//! The files that a model names: where they are, whether they may be read, and their bytes.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use etendue_geometry::MappedFile;

use super::ImportError;
use crate::paths;

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
        let mut spellings = vec![folder.join(written)];
        if written.contains('\\') {
            spellings.push(folder.join(written.replace('\\', "/")));
        }
        // All are judged before anything is said of one: a model must not learn which files exist.
        if let Some(root) = &self.root
            && !spellings.iter().all(|path| paths::is_inside(root, path))
        {
            return Err(ImportError::Outside {
                file: self.model.clone(),
                written: written.to_owned(),
                root: root.clone(),
            });
        }
        Ok(spellings.into_iter().find(|path| path.is_file()))
    }

    /// The bytes of the model at `path`, mapped; an empty file is none.
    pub(super) fn map_model(&self, path: &Path) -> Result<Arc<MappedFile>, ImportError> {
        let map = self.map(path)?;
        if map.bytes().is_empty() {
            return Err(ImportError::Damaged {
                file: path.to_owned(),
                place: "the file".to_owned(),
                reason: "it is empty; copy or export it again".to_owned(),
            });
        }
        Ok(map)
    }

    /// The bytes of the file at `path`, mapped.
    pub(super) fn map(&self, path: &Path) -> Result<Arc<MappedFile>, ImportError> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = opened.get(path) {
            return Ok(Arc::clone(file));
        }
        let file = Arc::new(MappedFile::open(path).map_err(|source| unreadable(path, source))?);
        opened.insert(path.to_owned(), Arc::clone(&file));
        Ok(file)
    }

    /// The files opened so far, with their sizes in bytes.
    pub(super) fn opened(&self) -> Vec<(PathBuf, u64)> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.iter().map(|(path, file)| (path.clone(), file.bytes().len() as u64)).collect()
    }
}

fn canonical(folder: &Path) -> Result<PathBuf, ImportError> {
    folder.canonicalize().map_err(|source| unreadable(folder, source))
}

fn unreadable(path: &Path, source: io::Error) -> ImportError {
    ImportError::Unreadable { file: path.to_owned(), source }
}
