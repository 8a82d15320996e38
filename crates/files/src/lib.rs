//! Every file that is read or written.
//!
//! Nothing here is of the whole process but the list of part files that a signal handler removes: where files
//! may be read, and what must not be written over, are values that are handed down.
//!
//! | module | idea |
//! |---|---|
//! | `opener` | where a scene may read, and what was found: [`Opener`] |
//! | `regular` | opens regular files, and nothing that waits or has no end |
//! | `mapped` | the one place that maps files |
//! | `transaction` | sets of files that take their names together, and never that of an input: [`Transaction`] |
//! | `part` | files that are whole or not there |
//! | `special` | devices, pipes and standard streams, which are written to and not replaced |
//! | `manifest` | what a command wrote into a folder and below it, so that the next run can remove it |

mod error;
mod manifest;
mod mapped;
mod opener;
mod part;
mod regular;
mod special;
mod transaction;

pub use error::WriteError;
pub use manifest::{Ledger, MANIFEST, remove_empty_folders};
pub use mapped::MappedFile;
pub use opener::{FindError, FoundFile, InputFolder, Opener, Reach, is_inside, real_place};
pub use part::{PartFile, Temporary, open_parts, prepare_folder, remove_open_parts};
pub use regular::{Stamp, open, read, read_head};
pub use transaction::Transaction;

/// Name and version of the program, for the headers of files.
pub const SOFTWARE: &str = concat!("etendue ", env!("CARGO_PKG_VERSION"));
