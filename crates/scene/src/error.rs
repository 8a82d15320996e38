//! Errors of scenes that cannot be read or loaded.

use std::io;
use std::path::{Path, PathBuf};

use etendue_files::FindError;
use etendue_report::Refusal;

use crate::file::{Origin, ScenePath};
use crate::words::nearest;

/// Error of a scene that cannot be read or loaded. The message names the file and the place in it,
/// and ends in a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file that is not there.
    #[error(transparent)]
    Missing(Refusal),
    /// A file that is no JSON text at all.
    #[error(
        "{}: {reason}\nhint: give a JSON scene, or a model ending in .gltf, .glb, .obj or .ply",
        file.display()
    )]
    NotAScene {
        /// The file.
        file: PathBuf,
        /// Reason, which says what the file is instead.
        reason: String,
    },
    /// A value that the format does not allow.
    #[error("{}", invalid(file, path, place, why))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The place of the value in the file.
        path: ScenePath,
        /// Place where the value was written.
        place: Origin,
        /// Description of the error, and of what is valid.
        why: Refusal,
    },
    /// Something else.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The caller's progress function asked to stop.
    #[error("loading was stopped")]
    Stopped,
}

/// Beginning of the reason that names a file which is not there.
pub(crate) const NO_SUCH_FILE: &str = "no such file";

impl SceneError {
    /// True if the error is a file that is missing: the scene, or one that the scene names.
    #[must_use]
    pub fn is_missing_file(&self) -> bool {
        match self {
            Self::Missing(_) => true,
            Self::Invalid { why, .. } => why.why().contains(NO_SUCH_FILE),
            Self::NotAScene { .. } | Self::Refused(_) | Self::Stopped => false,
        }
    }

    /// The error of a file that cannot be opened; with the most similar name when it is missing.
    pub(crate) fn unreadable(file: &Path, source: &io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::NotFound => {
                let why = NO_SUCH_FILE.to_owned() + &did_you_mean(similar_name(file).as_deref());
                Self::Missing(Refusal::new(why).at(file.display()))
            }
            _ => Self::refused(file, format!("cannot be read: {source}")),
        }
    }

    /// The error of a whole file.
    pub(crate) fn refused(file: &Path, why: impl Into<Refusal>) -> Self {
        Self::Refused(why.into().at(file.display()))
    }

    /// The error of a file that holds no lens.
    pub(crate) fn not_a_lens(file: &Path, reason: &str) -> Self {
        let remedy = "give a lens file (.json), a file of Zemax (.zmx), CODE V (.seq), OSLO (.len), optiland or ISET \
                      (.json), pbrt (.dat) or PhotonsToPhotos (.txt), or a scene whose camera is a lens";
        Self::refused(file, Refusal::new(reason).hint(remedy))
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

/// Message on a file that a scene names and that is not opened, with the most similar name when it is missing.
pub(crate) fn not_found(error: FindError) -> String {
    let near = match &error {
        FindError::Missing { path, .. } => similar_name(path),
        FindError::Refused(_) => None,
    };
    format!("{error}{}", did_you_mean(near.as_deref()))
}

/// The hint `did you mean …?`
pub(crate) fn did_you_mean(near: Option<&str>) -> String {
    near.map_or_else(String::new, |near| format!("\nhint: did you mean \"{near}\"?"))
}

fn invalid(file: &Path, path: &ScenePath, place: &Origin, why: &Refusal) -> Refusal {
    let why = why.clone().at(path);
    match place {
        Origin::Text(place) => {
            why.at(format_args!("{}, line {}, column {}", file.display(), place.line, place.column))
        }
        Origin::Setting(setting) => why.at(setting),
        Origin::Nowhere => why.at(file.display()),
    }
}
