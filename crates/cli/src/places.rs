//! Where results go: made, and checked against the inputs, before any work is done.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use etendue_render::output::{
    Ledger, OutputError, PartFile, prepare_folder, protect_inputs, refuse_inputs,
};

use crate::fault::Fault;

/// Makes `folder` and checks that it can be written to.
pub(crate) fn folder(folder: &Path) -> Result<(), Fault> {
    prepare_folder(folder).map_err(refused)
}

/// Checks that `file` can be written.
pub(crate) fn file(file: &Path) -> Result<(), Fault> {
    PartFile::create(file).map(drop).map_err(refused)
}

/// Refuses to write to any of `outputs` that is one of `inputs`, also through links.
pub(crate) fn keep_apart<'p>(
    inputs: impl IntoIterator<Item = &'p PathBuf>,
    outputs: &[PathBuf],
) -> Result<(), Fault> {
    protect_inputs(inputs.into_iter().map(PathBuf::as_path));
    Ok(refuse_inputs(outputs.iter().map(PathBuf::as_path))?)
}

/// Runs `write`, and sees to it that the files which it wrote into the ledger's folder stand in the
/// manifest, also when it failed half-way. Those that the command wrote there before and not again
/// are removed when it did not.
pub(crate) fn recorded<T>(
    mut ledger: Ledger,
    write: impl FnOnce() -> Result<T, Fault>,
) -> Result<T, Fault> {
    let written = write();
    let recorded = ledger.record();
    let written = written?;
    recorded?;
    ledger.clear()?;
    Ok(written)
}

/// A place that cannot be written to is the caller's to mend, unless there is no room.
fn refused(error: OutputError) -> Fault {
    match error {
        OutputError::Io { ref source, .. }
            if matches!(source.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) =>
        {
            Fault::Failed(error.into())
        }
        error => Fault::Refused(error.into()),
    }
}
