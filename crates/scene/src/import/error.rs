//! Why a model could not be read.

use std::io;
use std::path::PathBuf;

use crate::memory::TooMuch;

/// Why a model could not be read. The message names the file, the place in it, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be opened.
    #[error("cannot read {}: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The ending is none that is known.
    #[error("{}: not a format that can be read; use .gltf, .glb, .obj or .ply", file.display())]
    UnknownFormat {
        /// The file.
        file: PathBuf,
    },
    /// A path inside the model leads out of the allowed folder.
    #[error(
        "{}: \"{written}\" leads out of the folder {}; move the file there, or pass --allow-outside",
        file.display(), root.display()
    )]
    Outside {
        /// The file that names the path.
        file: PathBuf,
        /// The path as the file has it.
        written: String,
        /// The folder it may not leave.
        root: PathBuf,
    },
    /// The text is not what its format prescribes.
    #[error("{}, line {line}, column {column}: {reason}{}", file.display(), excerpt(text))]
    Text {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
        /// What is wrong.
        reason: String,
        /// The line itself, shortened where it is long; may be empty.
        text: String,
    },
    /// Something in the file contradicts its format or itself.
    #[error("{}: {place}: {reason}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// Where in the file.
        place: String,
        /// What is wrong and what to do about it.
        reason: String,
    },
    /// More memory than there may be.
    #[error("{}: {place}: what it makes {source}", file.display())]
    Memory {
        /// The file.
        file: PathBuf,
        /// Where in the file.
        place: String,
        /// How much, and how much there is.
        source: TooMuch,
    },
    /// The file needs an extension that is not supported.
    #[error("{}: needs {name}, not supported: {remedy}", file.display())]
    UnsupportedExtension {
        /// The file.
        file: PathBuf,
        /// The extension.
        name: String,
        /// What to do about it.
        remedy: String,
    },
}

impl ImportError {
    /// Two unsupported extensions of one file as one error; of other errors the first.
    pub(crate) fn and(mut self, other: Self) -> Self {
        if let (
            Self::UnsupportedExtension { remedy, .. },
            Self::UnsupportedExtension { name, remedy: other, .. },
        ) = (&mut self, other)
        {
            *remedy = format!("{remedy}\n    and {name}, not supported: {other}");
        }
        self
    }
}

/// The offending line below the message; nothing when it is no text that one could read.
fn excerpt(text: &str) -> String {
    let is_odd = |c: &char| c.is_control() || *c == char::REPLACEMENT_CHARACTER;
    match text.chars().filter(is_odd).count() {
        0 if text.is_empty() => String::new(),
        0 => format!("\n    {text}"),
        odd if odd * 8 > text.chars().count() => String::new(),
        _ => format!("\n    {}", text.replace(char::is_control, " ")),
    }
}
