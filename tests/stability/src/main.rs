//! Runs every case at full scale and writes `docs/measurements/stability.md`. With `--quick` at the scale of the tests;
//! with a word, runs the cases that have it in their names and writes nothing.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use etendue_stability::{Case, METHODS, Outcome, Scale, page};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let scale = if words.iter().any(|word| word == "--quick") { Scale::Quick } else { Scale::Full };
    if let Some(unknown) = words.iter().find(|word| word.starts_with('-') && *word != "--quick") {
        eprintln!("{unknown} is not known; give --quick, a word of the names of cases, or nothing");
        return ExitCode::from(2);
    }
    let word = words.iter().find(|word| !word.starts_with('-'));
    match run(scale, word.map(String::as_str)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(scale: Scale, word: Option<&str>) -> Result<()> {
    let mut ran = Vec::new();
    let mut failed = 0;
    for method in METHODS {
        for case in method.cases.iter().filter(|case| case.name.contains(word.unwrap_or(""))) {
            let outcome = measure(scale, method.name, case)?;
            failed += outcome.violations().len();
            ran.push((method.name, case.name, outcome));
        }
    }
    if failed > 0 {
        bail!("{failed} things that must hold do not; the page is left as it is");
    }
    if word.is_none() {
        let path = Path::new(page::PATH);
        let page = page::write(scale, &ran);
        std::fs::write(path, page).with_context(|| path.display().to_string())?;
        eprintln!("wrote {}", path.display());
    }
    Ok(())
}

/// Runs a case and says what it found.
fn measure(scale: Scale, method: &str, case: &Case) -> Result<Outcome> {
    eprint!("{method} {} ... ", case.name);
    let start = Instant::now();
    let outcome = (case.run)(scale).context("the case could not be tried")?;
    eprintln!("{outcome} ({:.1} s)", start.elapsed().as_secs_f64());
    for violation in outcome.violations() {
        eprintln!("    does not hold: {violation}");
    }
    Ok(outcome)
}
