//! Destinations of results: made, and checked against the inputs, before any work is done.

use std::fs;
use std::path::{Path, PathBuf};

use etendue_files::{
    Ledger, MANIFEST, Transaction, WriteError, prepare_folder, remove_empty_folders,
};

use crate::{Error, records};

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
    Transaction::at_once().create(file).map(drop).map_err(Error::Place)
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
        let why = format!(
            "{path}: is a folder, where a file is to be written\nhint: remove or rename it"
        );
        return Err(Error::Refused(why));
    }
    let files = Transaction::new().keeping(inputs);
    Ok(files.refuse_inputs(outputs.iter().map(PathBuf::as_path))?)
}

/// Runs `write`, and gives the files that it wrote their names when all of them are complete: when it
/// fails, what was there before stays as it was. None of them takes the place of one of `inputs`. What
/// stands in the ledger's manifest from before and was not written again is removed.
///
/// # Errors
///
/// Those of `write`; when a file has become an input's; and when the manifest cannot be written.
pub fn recorded<T, E: From<WriteError>>(
    mut ledger: Ledger,
    inputs: &[PathBuf],
    write: impl FnOnce(&Transaction) -> Result<T, E>,
) -> Result<T, E> {
    let files = Transaction::new().keeping(inputs);
    let written = write(&files).and_then(|written| {
        files.commit()?;
        Ok(written)
    });
    let recorded = ledger.record(&files.finished());
    let written = written?;
    recorded?;
    clear_listed(&mut ledger)?;
    Ok(written)
}

/// Removes what an earlier render wrote into `folder`, as far as it is as it was, and the folder when
/// nothing else is in it.
pub(crate) fn clear(folder: &Path) {
    let manifest = folder.join(MANIFEST);
    if !manifest.is_file() {
        return;
    }
    let mut ledger = Ledger::open(folder, "render");
    // What cannot be removed is nobody's loss: it is marked as what it is.
    if clear_listed(&mut ledger).is_ok() && ledger.is_empty() && fs::remove_file(manifest).is_ok() {
        let _ = fs::remove_dir(folder);
    }
}

/// Removes what a ledger lists from before and not again, also in places below that list files of their own.
fn clear_listed(ledger: &mut Ledger) -> Result<(), WriteError> {
    for place in ledger.stale_below() {
        match records::is_record(&place) {
            true => records::remove_recorded(ledger.folder(), &place),
            false => clear(&place),
        }
        remove_empty_folders(ledger.folder(), &place);
    }
    ledger.clear()
}
