//! Why there is no scene.

use std::io;
use std::path::{Path, PathBuf};

use etendue_files::FindError;

use crate::ImportError;
use crate::file::{Origin, OverrideError, Place};
use crate::memory::TooMuch;
use crate::words::nearest;

/// Why a scene cannot be read or loaded. The message names the file, the place in it, and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file that is not there.
    #[error("{}: no such file{}", file.display(), did_you_mean(near.as_deref()))]
    Missing {
        /// The file.
        file: PathBuf,
        /// The name in its folder that is the most like it.
        near: Option<String>,
    },
    /// A file that cannot be opened.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file that is no JSON text at all.
    #[error(
        "{}: {reason}; give a JSON scene, or a model ending in .gltf, .glb, .obj or .ply",
        file.display()
    )]
    NotAScene {
        /// The file.
        file: PathBuf,
        /// What it is instead.
        reason: String,
    },
    /// A file that holds no lens.
    #[error(
        "{}: {reason}; give a lens file (.json), a file of Zemax (.zmx), CODE V (.seq), OSLO (.len), optiland or ISET \
         (.json), pbrt (.dat) or PhotonsToPhotos (.txt), or a scene whose camera is a lens",
        file.display()
    )]
    NotALens {
        /// The file.
        file: PathBuf,
        /// What it is instead.
        reason: String,
    },
    /// A file of another program that cannot be imported.
    #[error("{}, {source}", file.display())]
    Zemax {
        /// The file.
        file: PathBuf,
        /// Where and why.
        source: etendue_optics::train::ZemaxError,
    },
    /// Broken JSON.
    #[error("{}, line {}, column {}: broken JSON: {reason}\n{excerpt}",
        file.display(), place.line, place.column)]
    Syntax {
        /// The file.
        file: PathBuf,
        /// Where.
        place: Place,
        /// What is wrong.
        reason: String,
        /// The line, with a caret below the place.
        excerpt: String,
    },
    /// A value that the format does not allow.
    #[error("{}", invalid(file, path, place, reason))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The JSON path of the value.
        path: String,
        /// Where it was written.
        place: Origin,
        /// What is wrong and what would do.
        reason: String,
    },
    /// A setting of the command line that leads nowhere.
    #[error("--set {setting}: {source}")]
    Override {
        /// The setting.
        setting: String,
        /// Why.
        source: OverrideError,
    },
    /// A model that cannot be imported.
    #[error("{source}{}", asked_for_by(file, path))]
    Import {
        /// The scene file.
        file: PathBuf,
        /// The JSON path of the object that names the model; empty when the model was given itself.
        path: String,
        /// Why.
        source: Box<ImportError>,
    },
    /// A camera that no model of the scene has.
    #[error("--camera {wanted}: {reason}")]
    NoSuchCamera {
        /// The name or number asked for.
        wanted: String,
        /// The cameras that there are.
        reason: String,
    },
    /// More than the formats inside can number.
    #[error("{}: has more than {limit} {what}; split the scene", file.display())]
    TooMany {
        /// The scene file.
        file: PathBuf,
        /// Of what.
        what: &'static str,
        /// The most.
        limit: u64,
    },
    /// More memory than there may be.
    #[error("{}: {what} {source}", file.display())]
    Memory {
        /// The scene file.
        file: PathBuf,
        /// What needs it.
        what: String,
        /// How much, and how much there is.
        source: TooMuch,
    },
    /// The caller's progress function asked to stop.
    #[error("loading was stopped")]
    Stopped,
}

/// How the reason begins that names a file which is not there.
pub(crate) const NO_SUCH_FILE: &str = "no such file";

impl SceneError {
    /// Whether it is for a file that is not there: the scene, or one that the scene names.
    #[must_use]
    pub fn is_missing_file(&self) -> bool {
        match self {
            Self::Missing { .. } => true,
            Self::Invalid { reason, .. } => reason.contains(NO_SUCH_FILE),
            _ => false,
        }
    }

    /// The error of a file that cannot be opened; with the most similar name when it is missing.
    pub(crate) fn unreadable(file: &Path, source: io::Error) -> Self {
        let file = file.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound => Self::Missing { near: similar_name(&file), file },
            _ => Self::Unreadable { file, source },
        }
    }
}

/// The name in the folder of `file` that is the most like its own.
pub(crate) fn similar_name(file: &Path) -> Option<String> {
    let wrong = file.file_name()?.to_str()?;
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let entries = std::fs::read_dir(folder).ok()?;
    // A folder of a million files is not worth a suggestion.
    let mut names: Vec<String> = entries
        .take(10_000)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort_unstable();
    nearest(wrong, names.iter().map(String::as_str)).map(str::to_owned)
}

/// Why a file that a scene names is not opened, with the most similar name when it is missing.
pub(crate) fn not_found(error: FindError) -> String {
    let near = match &error {
        FindError::Missing { path, .. } => similar_name(path),
        FindError::Refused(_) => None,
    };
    format!("{error}{}", did_you_mean(near.as_deref()))
}

/// `; did you mean …?`
pub(crate) fn did_you_mean(near: Option<&str>) -> String {
    near.map_or_else(String::new, |near| format!("; did you mean \"{near}\"?"))
}

fn invalid(file: &Path, path: &str, place: &Origin, reason: &str) -> String {
    let file = match place {
        Origin::Text(place) => {
            format!("{}, line {}, column {}", file.display(), place.line, place.column)
        }
        Origin::Setting(setting) => setting.clone(),
        Origin::Nowhere => file.display().to_string(),
    };
    if path.is_empty() { format!("{file}: {reason}") } else { format!("{file}: {path}: {reason}") }
}

fn asked_for_by(file: &Path, path: &str) -> String {
    if path.is_empty() { String::new() } else { format!(" (from {}: {path})", file.display()) }
}
