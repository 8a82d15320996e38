//! Errors of models that cannot be read: refusals that name the file, the place in it, and what to
//! do.
//!
//! What an import has to say without refusing the file.

use std::fmt::Display;
use std::path::Path;

use etendue_report::Refusal;
use serde::Serialize;

use crate::memory::TooMuch;

/// A file that contradicts its format, or itself, at a place in it.
pub(super) fn damaged(file: &Path, place: impl Display, why: impl Into<Refusal>) -> Refusal {
    why.into().at(place).at(file.display())
}

/// A file whose contents take more memory than there may be.
pub(super) fn too_much(file: &Path, place: impl Display, why: TooMuch) -> Refusal {
    damaged(file, place, format!("what it makes {why}"))
}

/// A text that is not what its format prescribes, with the line itself, which may be empty, shortened where it is long.
/// Line and column are counted from 1.
pub(super) fn wrong_text(
    file: &Path,
    line: usize,
    column: usize,
    why: String,
    text: &str,
) -> Refusal {
    let place = format!("{}, line {line}, column {column}", file.display());
    Refusal::new(why).and(&excerpt(text)).at(place)
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
    /// Kind of thing.
    pub kind: NoteKind,
    /// Its subject: an extension, a file, a mesh, a material.
    pub subject: String,
    /// Sentence on what happens, and what to do about it.
    pub message: String,
    /// Number of times.
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

    /// Returns the note counted `count` times.
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
