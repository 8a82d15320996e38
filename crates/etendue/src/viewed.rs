//! Kinds of file that somebody wants to look at.

use std::path::Path;

use etendue_scene::file::{FileKind, is_lens};

use crate::lens_view::through;
use crate::{Error, Options, Session, Still};

/// A file that was opened to be looked at, by what it is.
#[derive(Debug)]
pub enum Viewed {
    /// A scene.
    Scene(Box<Session>),
    /// A model, in a scene that frames it.
    Model(Box<Session>),
    /// A lens file or a Zemax file, in a scene that looks through it at a board of squares.
    Lens(Box<Session>),
    /// An image.
    Image(Box<Still>),
}

impl Viewed {
    /// Opens the file at `path`: images and Zemax files are told by their endings, lens files by what is in
    /// them, all others as by [`Session::open_with`]. Settings are of scenes, models and lenses.
    ///
    /// # Errors
    ///
    /// When the file cannot be read or makes no sense as what it is, and when a lens by itself makes no
    /// picture.
    pub fn open(path: &Path, options: Options) -> Result<Self, Error> {
        if Still::is_named(path) {
            return Still::open(path).map(|still| Self::Image(Box::new(still)));
        }
        if is_lens(path) {
            return through(path, options).map(|session| Self::Lens(Box::new(session)));
        }
        let session = Box::new(Session::open_with(path, options)?);
        Ok(match session.file().kind() {
            FileKind::Model => Self::Model(session),
            FileKind::Scene => Self::Scene(session),
        })
    }
}
