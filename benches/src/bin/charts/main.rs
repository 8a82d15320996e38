//! Measures speed against accuracy on scenes of all kinds, and writes the page with its charts.
//!
//! ```text
//! charts [--quick] [--rounds N] [--output docs]
//! ```
//!
//! To be run in the repository's root, where `scenes/` is.

mod distance;
mod page;
mod pictures;
mod primary;
mod sensor;

use std::path::PathBuf;

use clap::Parser;

use crate::page::Page;

#[derive(Debug, Parser)]
struct Arguments {
    /// Meshes a tenth as heavy, and shorter turns
    #[arg(long)]
    quick: bool,
    /// Times that everything is timed
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    /// The folder of `speed-and-accuracy.md` and its images
    #[arg(long, default_value = "docs")]
    output: PathBuf,
}

/// How heavy the scenes are, and how long things may take.
#[derive(Debug, Clone, Copy)]
struct Effort {
    rounds: usize,
    /// Triangles of the two smooth meshes.
    meshes: [u64; 2],
    soup: u32,
    /// Instances along a side of the forest.
    forest: u32,
    /// The most rays.
    rays: usize,
    /// What pictures of one scene may take (s).
    seconds: f64,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let rounds = arguments.rounds.max(1);
    let effort = if arguments.quick {
        let (meshes, soup, forest) = ([100_000, 1_000_000], 100_000, 30);
        Effort { rounds, meshes, soup, forest, rays: 1 << 15, seconds: 4.0 }
    } else {
        let (meshes, soup, forest) = ([1_000_000, 10_000_000], 1_000_000, 100);
        Effort { rounds, meshes, soup, forest, rays: 1 << 17, seconds: 25.0 }
    };
    let mut page = Page::new(&arguments.output, rounds)?;
    primary::measure(effort, &mut page)?;
    distance::measure(effort, &mut page)?;
    pictures::measure(effort, &mut page)?;
    sensor::measure(effort, &mut page)?;
    println!("{}", page.write()?.display());
    Ok(())
}
