//! `--glass-catalog`: the user's own catalogues of glasses.

use etendue_optics::glass::{AgfCatalogue, add_catalogues};

use crate::arguments::Command;
use crate::fault::Fault;

/// Opens the catalogues that a command names, for all lenses that it reads.
pub(crate) fn open(command: &Command) -> Result<(), Fault> {
    let mut catalogues = Vec::new();
    for path in command.glass_catalogs() {
        let opened = AgfCatalogue::open(path);
        catalogues.push(opened.map_err(|error| {
            Fault::refused(format!("--glass-catalog: {}: {error}", path.display()))
        })?);
    }
    // One command a process: nothing was added before.
    let _ = add_catalogues(catalogues);
    Ok(())
}
