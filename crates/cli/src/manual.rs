//! The command line for other programs: man pages for `man`, completions for shells.

use std::io::Write as _;
use std::path::Path;

use clap::CommandFactory;
use clap_complete::Shell;
use clap_mangen::Man;
use etendue_files::Transaction;

use crate::arguments::Cli;
use crate::fault::{Fault, print_text};
use crate::progress::say;

/// Writes a man page of the program and of each command into `folder`.
pub(crate) fn write_pages(folder: &Path) -> Result<(), Fault> {
    etendue::places::folder(folder)?;
    let to = Transaction::at_once();
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        let page = Man::new(command.clone());
        let path = folder.join(page.get_filename());
        let mut text = Vec::new();
        page.render(&mut text).map_err(|error| Fault::Failed(error.into()))?;
        to.write(&path, |file| file.write_all(&text))?;
        say(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// Prints the script by which `shell` completes the command line.
pub(crate) fn print_completions(shell: Shell) -> Result<(), Fault> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "etendue", &mut script);
    print_text(&String::from_utf8_lossy(&script))
}
