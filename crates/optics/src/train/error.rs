//! Errors of a lens file.

use crate::glass::GlassError;

/// The most elements that a lens may have: the largest that were built have a hundred.
pub const MOST_ELEMENTS: usize = 1000;

/// Error of a lens file that cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// No JSON, or not that of a lens.
    #[error("{0}")]
    Json(String),
    /// No element at all.
    #[error("the lens has no elements")]
    Empty,
    /// More elements than [`MOST_ELEMENTS`].
    #[error(
        "the lens has {0} elements, and {MOST_ELEMENTS} are the most\nhint: leave out what bends no light"
    )]
    TooMany(usize),
    /// A part that cannot be made.
    #[error("elements[{index}]: {why}")]
    Element {
        /// Index of the element, from 0 on the object side.
        index: usize,
        /// Description of the error.
        why: String,
    },
    /// A glass that is not known.
    #[error("elements[{index}].glass: {source}")]
    Glass {
        /// The surface in front of it.
        index: usize,
        /// Cause of the error.
        source: GlassError,
    },
    /// A key of the whole lens: a catalogue of glasses that cannot be read, a field or wavelength that is none.
    #[error("{key}: {why}")]
    Key {
        /// Name of the key, with its place in a list from 0.
        key: String,
        /// Description of the error.
        why: String,
    },
    /// Two elements marked as the stop.
    #[error("elements[{second}].stop: elements[{first}] is the stop already")]
    Stops {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// A design wavelength that is none.
    #[error("wavelength is {0} nm; it must be a positive length")]
    Wavelength(f64),
    /// A stop whose size cannot be set.
    #[error("elements[{index}] is the stop and its opening cannot be set: {why}")]
    Stop {
        /// Index of the element.
        index: usize,
        /// Description of the error.
        why: String,
    },
}
