//! Why a model could not be read.
//!
//! What an import has to say without refusing the file.

use std::io;
use std::path::PathBuf;

use serde::Serialize;

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

/// Something that the file has or asks for and the picture will not show.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// What kind of thing.
    pub kind: NoteKind,
    /// What it is about: an extension, a file, a mesh, a material.
    pub subject: String,
    /// What happens, and what to do about it.
    pub message: String,
    /// How often.
    pub count: u64,
}

/// Kinds of notes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// An extension that is not, or not wholly, supported.
    Extension,
    /// A part of the format that is not supported.
    Unsupported,
    /// A file that is named and not there.
    MissingFile,
    /// Data that was dropped because it is not finite, or replaced.
    NotFinite,
    /// A part of the file that nothing uses.
    Unused,
    /// Something that the file leaves open and was chosen.
    Assumed,
    /// Data that breaks the format's rules and could be read all the same.
    Irregular,
    /// There is nothing to draw.
    Empty,
}

impl Note {
    /// A note about one thing.
    pub(super) fn new(
        kind: NoteKind,
        subject: impl Into<String>,
        message: impl Into<String>,
    ) -> Self {
        Self { kind, subject: subject.into(), message: message.into(), count: 1 }
    }

    /// The same, `count` times.
    pub(super) fn counted(mut self, count: u64) -> Self {
        self.count = count;
        self
    }
}

/// That the image `written` is not there.
pub(super) fn missing_image(written: String) -> Note {
    let message = "the image does not exist; where it is a colour, magenta squares show it";
    Note::new(NoteKind::MissingFile, written, message)
}

/// The most notes of a kind that are kept apart: nobody reads more, and each is compared with all.
const MOST: usize = 200;

/// Adds `note`, or counts it to one that says the same of the same subject. Past [`MOST`] those of
/// one kind are counted together.
pub(super) fn push(notes: &mut Vec<Note>, note: Note) {
    let same = |n: &&mut Note| {
        n.kind == note.kind && n.subject == note.subject && n.message == note.message
    };
    let is_full = notes.iter().filter(|n| n.kind == note.kind).count() >= MOST;
    match notes.iter_mut().find(same) {
        Some(known) => known.count += note.count,
        None if !is_full => notes.push(note),
        None => {
            let rest = Note::new(note.kind, "…", "further notes of this kind are not listed");
            let is_rest = |n: &&mut Note| n.kind == rest.kind && n.subject == rest.subject;
            match notes.iter_mut().find(is_rest) {
                Some(known) => known.count += note.count,
                None => notes.push(rest.counted(note.count)),
            }
        }
    }
}
