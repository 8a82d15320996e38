//! The shares of a render that was divided, read from their files.

use std::path::Path;

use etendue_render::FilmFile;
use serde_json::Value;

use crate::Error;

/// Shares of a render, as [`Session::render_shard`](crate::Session::render_shard) wrote them, for
/// [`Session::merge`](crate::Session::merge).
#[derive(Debug)]
pub struct Shares {
    pub(crate) files: Vec<FilmFile>,
}

impl Shares {
    /// Reads them.
    ///
    /// # Errors
    ///
    /// When a file cannot be read, is no share, or is not whole.
    pub fn read<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self, Error> {
        let read =
            |path: P| FilmFile::read(path.as_ref()).map_err(etendue_render::RenderError::from);
        Ok(Self { files: paths.into_iter().map(read).collect::<Result<_, _>>()? })
    }

    /// True if they are of the samples, and not of the rows.
    pub(crate) fn are_of_samples(&self) -> bool {
        self.files.iter().any(|file| file.header.shard.is_of_samples())
    }

    /// Origin that was given to the first share.
    #[must_use]
    pub fn origin(&self) -> Option<&Value> {
        self.files.first().map(|file| &file.header.origin)
    }
}
