//! Errors of the library.

use std::io;

use etendue_accel::BuildError;
use etendue_files::WriteError;
use etendue_render::RenderError;
use etendue_render::annotations::AnnotationError;
use etendue_render::expose::ExposeError;
use etendue_render::light_field::LightFieldError;
use etendue_render::output::{OutputError, PictureError};
use etendue_report::Refusal;
use etendue_scene::SceneError;

impl From<LightFieldError> for Error {
    fn from(error: LightFieldError) -> Self {
        match error {
            LightFieldError::Render(error) => Self::Render(error),
            LightFieldError::Output(error) => Self::Output(error),
            other => Self::LightField(other),
        }
    }
}

impl From<AnnotationError> for Error {
    fn from(error: AnnotationError) -> Self {
        match error {
            AnnotationError::Render(error) => Self::Render(error),
            AnnotationError::Output(error) => Self::Output(error),
            other => Self::Refused(other.to_string()),
        }
    }
}

impl From<WriteError> for Error {
    fn from(error: WriteError) -> Self {
        Self::Output(error.into())
    }
}

/// Error of a scene that could not be opened, changed, rendered or written. The message is a
/// sentence that names the file, the place in it and the remedy, as on the command line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene, or something that it names.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The build or the render.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The sensor's images.
    #[error(transparent)]
    Expose(#[from] ExposeError),
    /// The files of a light-field camera.
    #[error(transparent)]
    LightField(LightFieldError),
    /// A place for results that cannot be written to, known before any work.
    #[error(transparent)]
    Place(WriteError),
    /// Something else that the caller can mend.
    #[error("{0}")]
    Refused(String),
}

impl Error {
    /// Message as the command line prints it: the sentence, behind it those of its causes that it
    /// does not quote, and the remedy on a line of its own.
    #[must_use]
    pub fn message(&self) -> String {
        Refusal::of(self).to_string()
    }

    /// True if it is no fault: the caller asked to stop.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        matches!(
            self,
            Self::Scene(SceneError::Stopped)
                | Self::Render(RenderError::Stopped | RenderError::Build(BuildError::Stopped))
                | Self::Output(OutputError::Stopped { .. })
                | Self::Expose(
                    ExposeError::Stopped | ExposeError::Output(OutputError::Stopped { .. })
                )
        )
    }

    /// True if the caller can mend it by another scene, setting or place. What is left are stops,
    /// full disks and faults of this program.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        match self {
            _ if self.is_stopped() => false,
            Self::Scene(_) | Self::Refused(_) => true,
            Self::Render(error) => match error {
                RenderError::Picture(error) => is_want_of_memory(error),
                RenderError::Denoise(error) => error.is_refused(),
                _ => true,
            },
            // Whether it can be written to was asked before: the disk is full, or the folder gone.
            Self::Output(error) | Self::Expose(ExposeError::Output(error)) => {
                !matches!(error, OutputError::File(WriteError::Io { .. }))
            }
            Self::Expose(ExposeError::Memory(_)) => true,
            Self::Expose(ExposeError::Picture(error)) => is_want_of_memory(error),
            Self::Expose(_) | Self::LightField(_) => false,
            Self::Place(error) => !has_no_room(error),
        }
    }
}

/// A smaller picture would do.
fn is_want_of_memory(error: &PictureError) -> bool {
    matches!(error, PictureError::Memory(_))
}

fn has_no_room(error: &WriteError) -> bool {
    use io::ErrorKind::{QuotaExceeded, StorageFull};
    matches!(error, WriteError::Io { source, .. } if matches!(source.kind(), StorageFull | QuotaExceeded))
}
