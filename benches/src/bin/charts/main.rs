//! Measures speed against accuracy on scenes of all kinds, and writes the page with its charts.
//!
//! ```text
//! charts [--quick] [--rounds N] [--output docs]
//! ```
//!
//! To be run in the repository's root, where `scenes/` is.
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

mod distance;
mod page;
mod pictures;
mod primary;
mod sensor;

use std::path::PathBuf;

use clap::Parser;
use etendue_benches::effort::Effort;

use crate::page::Page;

/// Measures speed against accuracy on scenes of all kinds, and writes the page with its charts.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    effort: Effort,
    /// The folder of the documents: `measurements/speed-and-accuracy.md` and its images
    #[arg(long, default_value = "docs")]
    output: PathBuf,
}

/// The most rays.
fn rays(effort: Effort) -> usize {
    effort.pick(1 << 17, 1 << 15)
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let effort = arguments.effort;
    let mut page = Page::new(&arguments.output, effort.rounds())?;
    primary::measure(effort, &mut page)?;
    distance::measure(effort, &mut page)?;
    pictures::measure(effort, &mut page)?;
    sensor::measure(effort, &mut page)?;
    println!("{}", page.write()?.display());
    Ok(())
}
