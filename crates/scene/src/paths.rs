//! Paths that a scene file writes: relative to it, and inside its folder.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::SceneError;
use crate::error::{did_you_mean, similar_name};

/// The longest path that Linux takes (bytes).
const LONGEST_PATH: usize = 4096;

/// Whether a scene may read files outside its own folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reach {
    /// No: also not through links.
    #[default]
    OwnFolder,
    /// Yes: the user has said so.
    Anywhere,
}

/// The folder that paths start at and, as a rule, may not leave.
#[derive(Debug, Clone)]
pub(crate) struct Folder {
    path: PathBuf,
    /// Without links.
    real: PathBuf,
    reach: Reach,
    /// What was looked for in it and is there.
    found: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl Folder {
    pub(crate) fn open(path: &Path, reach: Reach) -> Result<Self, SceneError> {
        let real = path.canonicalize().map_err(|source| SceneError::unreadable(path, source))?;
        Ok(Self { path: path.to_owned(), real, reach, found: Arc::default() })
    }

    /// The folder that models may not leave either; none when they may.
    pub(crate) fn limit(&self) -> Option<&Path> {
        (self.reach == Reach::OwnFolder).then_some(self.real.as_path())
    }

    /// Where `written` leads, to be opened and, with links followed, to be compared. The error says
    /// what is wrong with it.
    pub(crate) fn find(&self, written: &str) -> Result<FoundFile, String> {
        let outside = |how: &str| {
            format!(
                "\"{written}\" {how}the scene's folder {}; move the file there, or pass \
                 --allow-outside",
                self.real.display()
            )
        };
        if written.is_empty() {
            return Err("is empty; name a file".to_owned());
        }
        // Judged by its text first, so that a scene cannot ask which files exist elsewhere.
        if self.reach == Reach::OwnFolder {
            match leaves(Path::new(written)) {
                Some(Leaving::Absolute) => return Err(outside("is absolute and may leave ")),
                Some(Leaving::Upwards) => return Err(outside("leaves ")),
                None => {}
            }
        }
        let path = self.path.join(written);
        // Nor what lies behind a link out of it.
        if self.reach == Reach::OwnFolder && !is_inside(&self.real, &path) {
            return Err(outside("leads through a link out of "));
        }
        let real = path.canonicalize().map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                let near = similar_name(&path);
                format!("no such file: \"{written}\"{}", did_you_mean(near.as_deref()))
            }
            _ => format!("\"{written}\" cannot be read: {error}"),
        })?;
        if real.is_dir() {
            return Err(format!("\"{written}\" is a folder; name a file"));
        }
        self.found.lock().unwrap_or_else(PoisonError::into_inner).insert(path.clone());
        Ok(FoundFile { path, real })
    }

    /// The files that were found so far, each once.
    pub(crate) fn found(&self) -> Vec<PathBuf> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// `file` as seen from the folder, for names that do not depend on the machine.
    pub(crate) fn relative(&self, file: &Path) -> String {
        let real = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        let inside = real.strip_prefix(&self.real).map(Path::to_owned);
        let shown = inside.unwrap_or_else(|_| real.file_name().unwrap_or_default().into());
        shown.to_string_lossy().into_owned()
    }
}

/// A file that a scene names.
#[derive(Debug, Clone)]
pub(crate) struct FoundFile {
    /// As the scene reaches it.
    pub(crate) path: PathBuf,
    /// Without links.
    pub(crate) real: PathBuf,
}

/// Whether `path` stays inside `root`, which has no links: by its text, and with the links of as much
/// of it as exists. What exists outside does not change the answer.
pub(crate) fn is_inside(root: &Path, path: &Path) -> bool {
    // No file has such a name, wherever it is; taking it apart would be all that it costs.
    if path.as_os_str().len() > LONGEST_PATH {
        return true;
    }
    let real = path.ancestors().find_map(|part| {
        let part = if part.as_os_str().is_empty() { Path::new(".") } else { part };
        part.canonicalize().ok().map(|real| (real, path.strip_prefix(part).unwrap_or(path)))
    });
    let Some((real, missing)) = real else { return false };
    // What does not exist has no links, so its text tells where it would be.
    real.starts_with(root) && without_dots(&real.join(missing)).starts_with(root)
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

enum Leaving {
    Absolute,
    Upwards,
}

/// Whether a path climbs above where it starts, judged by its text.
fn leaves(path: &Path) -> Option<Leaving> {
    let mut depth = 0_i64;
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return Some(Leaving::Absolute),
        }
        if depth < 0 {
            return Some(Leaving::Upwards);
        }
    }
    None
}
