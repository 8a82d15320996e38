//! What an import has to say without refusing the file.

use serde::Serialize;

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
