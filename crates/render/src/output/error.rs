//! Errors between a render and its files.

use std::path::{Path, PathBuf};
use std::{fmt, io};

use etendue_files::WriteError;
use etendue_report::Refusal;

use crate::memory::NoMemory;

/// Error of layers that do not make a picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The system has less memory than it takes.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// Anything else: no layer, a size, a name or a value that no file may hold.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

impl PictureError {
    /// Error of a picture without layers, or a layer without channels.
    pub(crate) fn empty(what: &str) -> Self {
        Refusal::new(format!("{what} is empty")).hint("ask for at least one").into()
    }

    /// Error of a side of no pixels, or of more pixels than memory has addresses.
    pub(super) fn size([width, height]: [usize; 2]) -> Self {
        let why = format!("a picture of {width} x {height} pixels cannot be");
        Refusal::new(why).hint("give both sides at least one pixel").into()
    }

    /// Error of a name that some file format or file system cannot take, of `what`: a layer, channel, header entry …
    pub(super) fn name(what: &str, name: &str) -> Self {
        let remedy = "use 1 to 64 of the characters A-Z a-z 0-9 _ - (inside, a layer may have dots and an entry \
                      spaces)";
        Refusal::new(format!("\"{name}\" cannot name a {what}")).hint(remedy).into()
    }

    /// Error of a value that is not a number, at a column and row from the top left.
    pub(super) fn not_a_number(channel: &str, [x, y]: [usize; 2]) -> Self {
        let why = format!(
            "channel \"{channel}\" is NaN at column {x}, row {y} (counted from 0 at the top left): \
             a fault of the renderer, please report it together with the scene"
        );
        Refusal::new(why).into()
    }
}

/// Error of a file that was not written. What stood under its name before still does.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The system refused, or the file is an input.
    #[error(transparent)]
    File(#[from] WriteError),
    /// The system has less memory than a file takes while it is made.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// Anything else: the format cannot hold the picture, or the picture has no such layer.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The caller's progress function asked to stop.
    #[error("writing {} was stopped", path.display())]
    Stopped {
        /// The file.
        path: PathBuf,
    },
}

impl OutputError {
    /// The system's refusal of `path`, with what to do about it.
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        WriteError::io(path, source).into()
    }

    /// Error of what `path`'s format cannot hold.
    pub(crate) fn format(path: &Path, message: impl fmt::Display) -> Self {
        let why = format!("{} cannot hold this picture: {message}", path.display());
        Refusal::new(why).into()
    }

    /// Error of a finite number that would become infinite, and so a miss, in 32 bits, at a column and row from the
    /// top left.
    pub(super) fn overflow(channel: &str, value: f64, [x, y]: [usize; 2]) -> Self {
        let why = format!(
            "channel \"{channel}\" is {value:e} at column {x}, row {y}, more than 32-bit floats reach; \
             scale the scene down or write this layer as NPY"
        );
        Refusal::new(why).into()
    }
}
