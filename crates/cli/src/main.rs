//! The `etendue` command.
#![forbid(unsafe_code)]

mod arguments;
mod bench;
mod check;
mod fault;
mod lens;
mod manual;
mod merge;
mod opencv;
mod plan;
mod progress;
mod render;
mod room;
mod sensor;
mod sequence;
mod stop;
mod version;
mod view;

use std::process::ExitCode;

use clap::CommandFactory;

use arguments::{Cli, Command, SchemaArgument};
use fault::Fault;

fn main() -> ExitCode {
    let cli = arguments::parse();
    if cli.version {
        version::print();
        return ExitCode::SUCCESS;
    }
    let threads = match &cli.command {
        Some(Command::Render(arguments)) => arguments.threads,
        _ => 0,
    };
    if let Err(fault) = room::secure(threads) {
        fault.print();
        return fault.exit_code();
    }
    let done = match cli.command {
        Some(Command::Render(arguments)) => render::run(&arguments),
        Some(Command::Merge(arguments)) => merge::run(&arguments),
        Some(Command::Check(arguments)) => check::run(&arguments),
        Some(Command::Plan(arguments)) => plan::run(&arguments),
        Some(Command::Bench(arguments)) => bench::run(&arguments),
        Some(Command::Sensor(arguments)) => sensor::run(&arguments),
        Some(Command::View(arguments)) => view::run(&arguments),
        Some(Command::Lens(arguments)) => lens::run(&arguments),
        Some(Command::Schema { of }) => print_schema(of),
        Some(Command::Completions { shell }) => manual::print_completions(shell),
        Some(Command::Man { folder }) => manual::write_pages(&folder),
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

fn print_schema(of: SchemaArgument) -> Result<(), Fault> {
    fault::print_json(&match of {
        SchemaArgument::Scene => etendue_scene::file::scene_schema(),
        SchemaArgument::Lens => etendue_scene::file::lens_schema(),
        SchemaArgument::Rays => etendue_scene::file::rays_schema(),
    })
}
