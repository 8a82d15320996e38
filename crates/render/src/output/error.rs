//! Errors between a render and its files.

use std::io;
use std::path::{Path, PathBuf};

use etendue_files::WriteError;

use crate::film::NoMemory;

/// Error of layers that do not make a picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// A side of no pixels, or more pixels than memory has addresses.
    #[error(
        "a picture of {width} x {height} pixels cannot be\nhint: give both sides at least one pixel"
    )]
    Size {
        /// Pixels a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The system has less memory than it takes.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// No layer, or a layer of no channels.
    #[error("{what} is empty\nhint: ask for at least one")]
    Empty {
        /// The picture or the layer.
        what: String,
    },
    /// A channel of the wrong length.
    #[error("channel \"{channel}\" has {found} values where the picture has {expected} pixels")]
    Length {
        /// The channel's full name.
        channel: String,
        /// Its values.
        found: usize,
        /// The picture's pixels.
        expected: usize,
    },
    /// A layer whose channels are of different types.
    #[error("layer \"{layer}\" mixes {first} with {other}\nhint: split it into a layer a type")]
    Mixed {
        /// The layer's name.
        layer: String,
        /// The type of the first channel.
        first: &'static str,
        /// The type that differs.
        other: &'static str,
    },
    /// A name that some file format or file system cannot take.
    #[error(
        "\"{name}\" cannot name a {what}\nhint: use 1 to 64 of the characters A-Z a-z 0-9 _ - \
         (inside, a layer may have dots and an entry spaces)"
    )]
    Name {
        /// Layer, channel, header entry …
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A name given twice.
    #[error("the name \"{name}\" is used twice; rename one of the two")]
    Twice {
        /// The name as it would stand in the file.
        name: String,
    },
    /// A header string with a zero byte, which would cut it short.
    #[error("the text of \"{name}\" holds a zero byte\nhint: remove it")]
    ZeroByte {
        /// The entry's name.
        name: String,
    },
    /// Channels that the layer's look cannot show.
    #[error("layer \"{layer}\" looks like {look}, which needs {needs}")]
    Look {
        /// The layer's name.
        layer: String,
        /// The look.
        look: String,
        /// The channels that the look needs.
        needs: &'static str,
    },
    /// A value that is not a number, which no file may hold.
    #[error(
        "channel \"{channel}\" is NaN at column {x}, row {y} (counted from 0 at the top left): \
         a fault of the renderer, please report it together with the scene"
    )]
    NotANumber {
        /// The channel's full name.
        channel: String,
        /// Column, from the left.
        x: usize,
        /// Row, from the top.
        y: usize,
    },
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
    /// The format cannot hold the picture.
    #[error("{} cannot hold this picture: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Reason, which says what the format cannot hold.
        message: String,
    },
    /// A finite number that would become infinite, and so a miss, in 32 bits.
    #[error(
        "channel \"{channel}\" is {value:e} at column {x}, row {y}, more than 32-bit floats reach; \
         scale the scene down or write this layer as NPY"
    )]
    Overflow {
        /// The channel's full name.
        channel: String,
        /// The value.
        value: f64,
        /// Column, from the left.
        x: usize,
        /// Row, from the top.
        y: usize,
    },
    /// A layer that the picture does not have.
    #[error("the picture has no layer \"{name}\"; it has {known}")]
    UnknownLayer {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
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
    pub(crate) fn format(path: &Path, message: impl ToString) -> Self {
        Self::Format { path: path.to_owned(), message: message.to_string() }
    }
}
