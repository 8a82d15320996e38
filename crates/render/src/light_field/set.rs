//! The set of a light field: its files, and why it may not be complete.

use std::path::{Path, PathBuf};

use etendue_files::{Transaction, WriteError, prepare_folder};

use crate::RenderError;
use crate::output::{OutputError, Outputs, Picture, PictureError, exr, npy, png};

/// Error of a light-field set that is not complete.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightFieldError {
    /// The reference views could not be rendered, or it was stopped.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl From<WriteError> for LightFieldError {
    fn from(error: WriteError) -> Self {
        Self::Output(error.into())
    }
}

impl From<PictureError> for LightFieldError {
    fn from(error: PictureError) -> Self {
        Self::Render(error.into())
    }
}

/// Files that were written.
#[derive(Debug, Default)]
pub struct LightFieldSet {
    /// The files, in the order they were written.
    pub files: Vec<PathBuf>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Writer of the set, with its destination.
pub(super) struct SetWriter<'a> {
    pub(super) files: &'a Transaction,
    pub(super) folder: &'a Path,
    pub(super) outputs: Outputs,
    pub(super) written: LightFieldSet,
}

impl SetWriter<'_> {
    pub(super) fn place(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.written.files.push(path.clone());
        path
    }

    /// A picture in all formats that are wanted.
    pub(super) fn picture(&mut self, stem: &str, picture: &Picture) -> Result<(), LightFieldError> {
        if self.outputs.exr {
            exr::write(
                self.files,
                &self.place(&format!("{stem}.exr")),
                picture,
                &exr::Options::default(),
            )?;
        }
        if self.outputs.png {
            png::write(
                self.files,
                &self.place(&format!("{stem}.png")),
                picture,
                "",
                png::Bits::Eight,
            )?;
        }
        if self.outputs.npy {
            npy::write(self.files, &self.place(&format!("{stem}.npy")), picture, "")?;
        }
        Ok(())
    }

    /// Fills a folder in the folder.
    pub(super) fn below(
        &mut self,
        name: &str,
        fill: impl FnOnce(&mut Self, &Path) -> Result<(), LightFieldError>,
    ) -> Result<(), LightFieldError> {
        let folder = self.folder.join(name);
        prepare_folder(&folder)?;
        fill(self, &folder)?;
        Ok(())
    }
}
