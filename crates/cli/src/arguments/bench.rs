//! What `etendue bench` can be asked for.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{SceneArguments, parse};

pub(super) const HELP: &str = "\
Prints a table, and writes into the folder:
  bench.json                 all that was measured, with the machine
  accelerators.csv           each accelerator x batch width x threads: build, memory, speed, errors
  accelerators-hits.svg      rays with a wrong answer against time (.png too)
  accelerators-depth.svg     error of the distance against time
  accelerators-batch.svg     time against batch width
  samplers.csv               each sampler x number of samples: time, and error of the picture
  samplers-time.svg, samplers-samples.svg
  cameras.csv, cameras-time.svg
                             each model of the camera's lens, from a pinhole to the full train

Errors of hits are against `exact`, the f64 reference, which is built and traced too; errors of
pictures against one of sixteen times the samples. Run it on a machine that does nothing else.

Examples:
  etendue bench scenes/first-light.json -o out/bench --quick
  etendue bench model.glb -o out/bench --batches 64,256 --threads 1,8 --rays 1000000
  etendue bench scenes/first-light.json -o out/bench --only accelerators --scattered";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PartArgument {
    /// Each accelerator x batch width x threads
    Accelerators,
    /// Each sampler x number of samples
    Samplers,
    /// Each model of the camera's lens x number of samples
    Cameras,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// The folder to write into; made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Fewer rays, rounds and batch widths: under a minute for a million triangles
    #[arg(long)]
    pub(crate) quick: bool,
    /// Measure these alone
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    pub(crate) only: Vec<PartArgument>,
    /// Times that everything is built and timed [default: 5, quick 3]
    #[arg(long, value_name = "N", value_parser = parse::rounds)]
    pub(crate) rounds: Option<usize>,
    /// The most rays to trace, in whole tiles of the picture [default: 524288, quick 65536]
    #[arg(long, value_name = "N", value_parser = parse::rays)]
    pub(crate) rays: Option<usize>,
    /// Trace rays that scatter from what the camera sees, as paths go on, instead of the camera's own
    #[arg(long)]
    pub(crate) scattered: bool,
    /// Batch widths in rays [default: 16,64,256,1024, quick 64,256]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse::batch)]
    pub(crate) batches: Option<Vec<usize>>,
    /// Numbers of threads [default: 1, 2, 4 … all, quick 1 and all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse::some_threads)]
    pub(crate) threads: Option<Vec<usize>>,
    /// Samples a pixel to compare [default: 1,4,16,64,256, quick 1,4,16,64]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse::samples)]
    pub(crate) sample_counts: Option<Vec<u32>>,
    /// About how long samplers and cameras may take, each; pixels are made larger until they do
    /// [default: 60, quick 10]
    #[arg(long, value_name = "S", value_parser = parse::seconds)]
    pub(crate) seconds: Option<f64>,
    /// Stop when a structure would need more than this, e.g. 800M or 4G (bytes, 1024-based)
    #[arg(long, value_name = "BYTES", value_parser = parse::bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Show no progress and no list of files; the table and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}
