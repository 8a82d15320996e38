//! `fuzz-smoke [--seconds N] [--seed N] [TARGET…]`: changed inputs for every reader, each target in a
//! process of its own; the seeds alone with `--seconds 0`. `--write-seeds FOLDER` writes the seeds
//! for `cargo fuzz`; `--one TARGET FILE` reads one file.

#![allow(clippy::disallowed_methods, reason = "it reads and writes what it is told to")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use etendue_fuzz::run::{self, Effort};
use etendue_fuzz::targets::{TARGETS, Target, named};

/// Folder in which failing inputs are kept.
const KEPT: &str = "out/fuzz";

fn main() -> Result<ExitCode> {
    let mut arguments = std::env::args().skip(1);
    let mut effort = Effort { time: Duration::from_secs(60), seed: 1 };
    let mut targets: Vec<Target> = Vec::new();
    let number = |text: Option<String>| -> Result<u64> {
        text.context("a number is missing")?.parse().context("not a whole number")
    };
    while let Some(argument) = arguments.next() {
        match &*argument {
            "--child" => {
                let target = target(&arguments.next().unwrap_or_default())?;
                let folder = PathBuf::from(arguments.next().unwrap_or_default());
                effort.time = Duration::from_secs(number(arguments.next())?);
                effort.seed = number(arguments.next())?;
                println!("{}", run::child(target, &folder, effort)?);
                return Ok(ExitCode::SUCCESS);
            }
            "--one" => {
                let target = target(&arguments.next().unwrap_or_default())?;
                let input = std::fs::read(arguments.next().unwrap_or_default())?;
                let folder = tempfile::tempdir()?;
                (target.run)(&input, folder.path());
                return Ok(ExitCode::SUCCESS);
            }
            "--write-seeds" => {
                let folder = PathBuf::from(arguments.next().context("a folder is missing")?);
                for target in TARGETS {
                    let count = run::write_seeds(target, &folder)?;
                    println!("{}: {count} seeds", target.name);
                }
                return Ok(ExitCode::SUCCESS);
            }
            "--seconds" => effort.time = Duration::from_secs(number(arguments.next())?),
            "--seed" => effort.seed = number(arguments.next())?,
            name => targets.push(target(name)?),
        }
    }
    if targets.is_empty() {
        targets = TARGETS.to_vec();
    }
    all(&targets, effort)
}

fn target(name: &str) -> Result<Target> {
    let Some(target) = named(name) else {
        let known: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        bail!("there is no target \"{name}\"; known: {}", known.join(", "));
    };
    Ok(target)
}

fn all(targets: &[Target], effort: Effort) -> Result<ExitCode> {
    let program = std::env::current_exe()?;
    let mut failed = 0;
    for target in targets {
        match run::supervise(*target, effort, &program)? {
            Ok(count) => println!("{}: {count} inputs, fine", target.name),
            Err(failure) => {
                failed += 1;
                let kept = run::keep(&failure, *target, Path::new(KEPT))?;
                println!("{}: FAILED on {}: {}", target.name, kept.display(), failure.how);
            }
        }
    }
    if failed == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    println!("{failed} failed; look again with: fuzz-smoke --one TARGET FILE");
    Ok(ExitCode::FAILURE)
}
