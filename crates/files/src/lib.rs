#![doc = include_str!("../README.md")]
//!
//! Nothing here is of the whole process but the list of part files that a signal handler removes: where files
//! may be read, and what must not be written over, are values that are handed down.
//!
//! | module | idea |
//! |---|---|
//! | `opener` | where a scene may read, and what was found: [`Opener`]; opens regular files, and nothing that waits or has no end |
//! | `mapped` | the one place that maps files |
//! | `transaction` | sets of files that take their names together, and never that of an input: [`Transaction`] |
//! | `part` | files that are whole or not there; devices, pipes and standard streams are written to and not replaced |
//! | `error` | refusals to write, with what to do about them: [`WriteError`] |
//! | `manifest` | what a command wrote into a folder and below it, so that the next run can remove it |
#![allow(clippy::disallowed_methods, reason = "this is where files are written")]

mod error;
mod manifest;
mod mapped;
mod opener;
mod part;
mod transaction;

pub use error::WriteError;
pub use manifest::{Ledger, MANIFEST, remove_empty_folders};
pub use mapped::MappedFile;
pub use opener::{
    FindError, FoundFile, InputFolder, MOST_OWN_BYTES, Opener, Reach, Stamp, is_inside, open, read,
    read_head, real_place,
};
pub use part::{ENDINGS, Temporary, open_parts, prepare_folder, remove_open_parts};
pub use transaction::{PartFile, Transaction};

/// Name and version of the program, for the headers of files.
pub const SOFTWARE: &str = concat!("etendue ", env!("CARGO_PKG_VERSION"));
