//! Measures everything in one run, contestants taking turns, and writes the page of results.
//!
//! ```text
//! benchmarks [--quick] [--rounds N] [--output docs/measurements/benchmarks.md]
//! benchmarks models FOLDER [--triangles N]     the models and scenes that other programs are given
//! benchmarks memory SCENE                      memory after each stage of a render, as JSON
//! benchmarks light-rays SCENE                  what the accelerator takes of a picture of light, as JSON
//! ```
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

mod build;
mod findings;
mod first_light;
mod goals;
mod light;
mod load;
mod page;
mod threads;
mod traversal;
mod whole;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Parser, Subcommand};
use etendue_benches::effort::{Effort, in_short};
use etendue_benches::files::{self, Format};
use etendue_benches::meshes;
use etendue_benches::rays::View;

use crate::findings::Findings;

/// Measures everything in one run, contestants taking turns, and writes the page of results.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    effort: Effort,
    /// The page to write
    #[arg(long, default_value = "docs/measurements/benchmarks.md")]
    output: PathBuf,
    /// Measure only these parts: traversal, threads, first-light, build, load, whole
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a blob as GLB, PLY and OBJ, and a scene for each
    Models {
        /// Folder to write them into
        folder: PathBuf,
        /// Number of triangles
        #[arg(long, default_value_t = 1_000_000)]
        triangles: u64,
        /// Write these formats alone: glb, ply, obj
        #[arg(long, value_delimiter = ',')]
        formats: Vec<String>,
    },
    /// Print as JSON what the accelerator takes for the rays of a picture of light
    LightRays {
        /// The scene
        scene: PathBuf,
    },
    /// Print the memory of this process after each stage of a render
    #[command(name = whole::MEMORY)]
    ProcessMemory {
        /// The scene
        scene: PathBuf,
    },
}

/// Instances along a side of the forest.
fn forest(effort: Effort) -> u32 {
    effort.pick(1_000, 100)
}

fn blob_name(triangles: u64) -> String {
    format!("blob {}", in_short(triangles))
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    match &arguments.command {
        Some(Command::Models { folder, triangles, formats }) => {
            return write_models(folder, *triangles, formats);
        }
        Some(Command::LightRays { scene }) => return light::print_bound(scene),
        Some(Command::ProcessMemory { scene }) => return whole::print_memory(scene),
        None => {}
    }
    let effort = arguments.effort;
    let has = |part: &str| arguments.only.is_empty() || arguments.only.iter().any(|p| p == part);
    // The page is written after each part, so that a run that is stopped leaves what it has.
    let write = |findings: &Findings| page::write(effort, findings, &arguments.output).map(drop);
    let mut findings = Findings::default();
    if has("traversal") || has("threads") {
        let parts = [has("traversal"), has("threads")];
        traversal::measure(effort, parts, &mut findings, &write)?;
    }
    if has("first-light") {
        first_light::measure(effort, &mut findings)?;
        write(&findings)?;
    }
    if has("build") {
        build::measure(effort, &mut findings)?;
        write(&findings)?;
    }
    if has("load") {
        load::measure(effort, &mut findings)?;
        write(&findings)?;
    }
    if has("whole") {
        whole::measure(effort, &mut findings)?;
    }
    let text = page::write(effort, &findings, &arguments.output)?;
    println!("{text}");
    Ok(())
}

fn write_models(folder: &Path, triangles: u64, formats: &[String]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}", folder.display()))?;
    let geometry = meshes::blob(triangles)?;
    let view = View::framing(geometry.bounds());
    let is_wanted =
        |format: &Format| formats.is_empty() || formats.iter().any(|f| f == format.extension());
    for format in Format::ALL.into_iter().filter(is_wanted) {
        let name = format!("blob.{}", format.extension());
        let path = folder.join(&name);
        format.write(&path, &geometry).with_context(|| format!("{}", path.display()))?;
        let scene = folder.join(format!("{}.json", format.extension()));
        std::fs::write(&scene, files::scene(&name, &view).to_string())?;
    }
    Ok(())
}
