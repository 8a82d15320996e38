//! Where results go: made, and checked against the inputs, before any work is done.

use std::fs;
use std::path::{Path, PathBuf};

use etendue_render::output::{
    Ledger, MANIFEST, OutputError, PartFile, Together, prepare_folder, protect_inputs,
    refuse_inputs,
};

use crate::Error;

/// Makes `folder` and checks that it can be written to.
///
/// # Errors
///
/// When it cannot.
pub fn folder(folder: &Path) -> Result<(), Error> {
    prepare_folder(folder).map_err(Error::Place)
}

/// Checks that `file` can be written.
///
/// # Errors
///
/// When it cannot.
pub fn file(file: &Path) -> Result<(), Error> {
    PartFile::create(file).map(drop).map_err(Error::Place)
}

/// Refuses to write to any of `outputs` that is one of `inputs`, also through links.
///
/// # Errors
///
/// When one is; the message names it.
pub fn keep_apart<'p>(
    inputs: impl IntoIterator<Item = &'p PathBuf>,
    outputs: &[PathBuf],
) -> Result<(), Error> {
    if let Some(path) = outputs.iter().find(|path| path.is_dir()) {
        let path = path.display();
        let why =
            format!("{path}: is a folder, where a file is to be written; remove or rename it");
        return Err(Error::Refused(why));
    }
    protect_inputs(inputs.into_iter().map(PathBuf::as_path));
    Ok(refuse_inputs(outputs.iter().map(PathBuf::as_path))?)
}

/// Runs `write`, and gives the files that it wrote into the ledger's folder their names when all of them
/// are complete: when it fails, what was there before stays as it was. Those that stand in the manifest
/// from before and were not written again are removed.
///
/// # Errors
///
/// Those of `write`, and when the manifest cannot be written.
pub fn recorded<T, E: From<OutputError>>(
    mut ledger: Ledger,
    write: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let set = Together::in_folder(ledger.folder());
    let written = write().and_then(|written| {
        set.finish()?;
        Ok(written)
    });
    let recorded = ledger.record();
    let written = written?;
    recorded?;
    ledger.clear()?;
    Ok(written)
}

/// Removes what an earlier render wrote into `folder`, as far as it is as it was, and the folder when
/// nothing else is in it.
pub(crate) fn clear(folder: &Path) {
    let manifest = folder.join(MANIFEST);
    // What cannot be removed is nobody's loss: it is marked as what it is.
    if manifest.is_file() && Ledger::open(folder, "render").clear().is_ok() {
        let is_left_alone = fs::read_dir(folder).is_ok_and(|entries| entries.count() == 1);
        if is_left_alone && fs::remove_file(manifest).is_ok() {
            let _ = fs::remove_dir(folder);
        }
    }
}
