//! The `etendue` command.
#![forbid(unsafe_code)]

mod arguments;
mod check;
mod fault;
mod plan;
mod progress;
mod render;
mod sensor;
mod stop;
mod version;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use arguments::{Cli, Command};
use fault::Fault;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if cli.version {
        version::print();
        return ExitCode::SUCCESS;
    }
    let done = match cli.command {
        Some(Command::Render(arguments)) => render::run(&arguments),
        Some(Command::Check(arguments)) => check::run(&arguments),
        Some(Command::Plan(arguments)) => plan::run(&arguments),
        Some(Command::Sensor(arguments)) => sensor::run(&arguments),
        Some(Command::Schema) => print_schema(),
        None => {
            // Nothing was asked for: say what can be.
            let _ = Cli::command().print_help();
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            fault.print();
            fault.exit_code()
        }
    }
}

fn print_schema() -> Result<(), Fault> {
    let schema = etendue_scene::file::scene_schema();
    fault::print_json(&schema)
}
