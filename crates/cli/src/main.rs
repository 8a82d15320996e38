#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod arguments;
mod bench;
mod calibrate;
mod check;
mod edge;
mod expose;
mod fault;
mod job;
mod lens;
mod matching;
mod merge;
mod opencv;
mod plan;
mod progress;
mod psf;
mod render;
mod room;
mod sensor;
mod sequence;
mod spectrum;
mod stop;
mod waves;

use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use clap::CommandFactory;
use clap_complete::Shell;
use clap_mangen::Man;

use arguments::{Cli, Command, SchemaArgument, ViewArguments};
use etendue_files::Transaction;
use fault::{Fault, print_text};
use progress::say;

fn main() -> ExitCode {
    if !room::has_room_for_command() {
        return ExitCode::from(2);
    }
    let cli = arguments::parse();
    if cli.version {
        print_version();
        return ExitCode::SUCCESS;
    }
    let threads = match &cli.command {
        Some(Command::Render(arguments)) => arguments.threads,
        _ => 0,
    };
    if let Err(fault) = room::check_memory_limit(threads) {
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
        Some(Command::Expose(arguments)) => expose::run(&arguments),
        Some(Command::Calibrate(arguments)) => calibrate::run(&arguments),
        Some(Command::Match(arguments)) => matching::run(&arguments),
        Some(Command::Spectrum(arguments)) => spectrum::run(&arguments),
        Some(Command::Edge(arguments)) => edge::run(&arguments),
        Some(Command::View(arguments)) => view(&arguments),
        Some(Command::Lens(arguments)) => lens::run(&arguments),
        Some(Command::Schema { of }) => print_schema(of),
        Some(Command::Completions { shell }) => print_completions(shell),
        Some(Command::Man { folder }) => write_pages(&folder),
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

/// Prints the program's version and what traces its rays.
pub(crate) fn print_version() {
    #[cfg(feature = "embree")]
    let accel = match etendue_accel::embree_version() {
        Ok(version) => version.to_string(),
        Err(error) => format!("Embree: {error}"),
    };
    #[cfg(not(feature = "embree"))]
    let accel = "without Embree (pure Rust)";
    let _ = print_text(&format!("etendue {}\n{accel}", env!("CARGO_PKG_VERSION")));
}

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

#[cfg(feature = "window")]
pub(crate) fn view(arguments: &ViewArguments) -> Result<(), Fault> {
    let options = etendue::Options {
        settings: arguments.settings.clone(),
        reach: match arguments.allow_outside {
            true => etendue::Reach::Anywhere,
            false => etendue::Reach::OwnFolder,
        },
        ..etendue::Options::default()
    };
    if let Some(path) = &arguments.scene {
        // What cannot be opened at all is told where the command was given.
        etendue::ViewedFile::open(path, options.clone())?;
    }
    etendue_window::run(arguments.scene.clone(), options)
        .map_err(|refusal| Fault::Refused(refusal.into()))
}

#[cfg(not(feature = "window"))]
pub(crate) fn view(_: &ViewArguments) -> Result<(), Fault> {
    Err(Fault::refused(
        "this etendue was built without the window\nhint: build it with \
         `cargo build --release -p etendue-cli --features window`, or run `make view`; without a window \
         there is `etendue render`",
    ))
}
