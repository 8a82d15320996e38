//! Arguments of the command line.

mod parse;
mod scene;
mod tools;

use std::path::PathBuf;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use etendue::{Setting, Shard, ShardBy};

pub(crate) use parse::Sweep;
pub(crate) use scene::SceneArguments;
pub(crate) use tools::{
    BenchArguments, CalibrateArguments, EdgeArguments, ExposeArguments, LensArguments,
    MatchArguments, PackedArgument, PartArgument, SpectrumArguments,
};

/// Simulates computational cameras: what a sensor records of a scene, with exact ground truth beside
/// it.
#[derive(Debug, Parser)]
#[command(
    name = "etendue",
    arg_required_else_help = true,
    after_help = "Exit code: 0 done, 2 the input was refused, 1 something else failed.\n\
                  Results go to standard output, everything else to standard error."
)]
pub(crate) struct Cli {
    /// Print the versions of etendue and of the Embree it runs on
    #[arg(short = 'V', long)]
    pub(crate) version: bool,
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene file or a model into a folder
    #[command(after_help = RENDER_HELP)]
    Render(RenderArguments),
    /// Put together the shares that `render --shard` wrote: the files of a render on one machine, to the bit
    #[command(after_help = MERGE_HELP)]
    Merge(MergeArguments),
    /// Examine a scene or model without rendering it
    #[command(after_help = "Example:\n  etendue check scenes/first-light.json\n  \
                            etendue check model.glb --json")]
    Check(CheckArguments),
    /// Print what a render would do, and why
    #[command(after_help = "Example:\n  etendue plan scenes/first-light.json\n  \
                            etendue plan scenes/double-gauss.json --models --tolerance \"0.5 px,5 %\"")]
    Plan(PlanArguments),
    /// Show what a sensor makes of light, or make the images that EMVA 1288 characterises it by
    #[command(after_help = SENSOR_HELP)]
    Sensor(SensorArguments),
    /// Expose a sensor to a picture from elsewhere: EXR (RGB or spectral), NPY, ENVI, or a folder of them
    #[command(after_help = tools::EXPOSE_HELP)]
    Expose(ExposeArguments),
    /// Take the pictures by which the camera of a scene is calibrated: darks, flats, white images, a chessboard
    #[command(after_help = tools::CALIBRATE_HELP)]
    Calibrate(CalibrateArguments),
    /// Fit the sensor and the light of a scene to a raw photograph of it
    #[command(after_help = tools::MATCH_HELP)]
    Match(MatchArguments),
    /// Print what a curve over wavelengths is: XYZ, colour temperature, luminous efficacy, photons
    #[command(after_help = tools::SPECTRUM_HELP)]
    Spectrum(SpectrumArguments),
    /// Open a window onto a scene, a lens or an image: look, change the camera, inspect pixels, save
    #[command(after_help = VIEW_HELP)]
    View(ViewArguments),
    /// Analyse a lens, or trace given rays through it
    #[command(after_help = tools::LENS_HELP)]
    Lens(LensArguments),
    /// Measure the modulation transfer (MTF) of a camera from a picture of a slanted edge (ISO 12233)
    #[command(after_help = tools::EDGE_HELP)]
    Edge(EdgeArguments),
    /// Measure speed against accuracy on a scene: every accelerator, on this machine
    #[command(after_help = tools::BENCH_HELP)]
    Bench(BenchArguments),
    /// Print the JSON Schema of scene files, lens files, or files of rays
    #[command(after_help = "Example:\n  etendue schema > scene.schema.json\n  \
                            etendue schema lens > lens.schema.json")]
    Schema {
        /// The kind of file
        #[arg(value_enum, default_value_t = SchemaArgument::Scene)]
        of: SchemaArgument,
    },
    /// Print what completes the command line in a shell
    #[command(after_help = "Example:\n  etendue completions bash > \
                            ~/.local/share/bash-completion/completions/etendue")]
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Write man pages of the program and its commands
    #[command(after_help = "Example:\n  etendue man ~/.local/share/man/man1")]
    Man {
        /// The folder to write into; made when it is not there
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
}

/// Parses the command line.
pub(crate) fn parse() -> Cli {
    // A number below zero is a value, which the option's own check refuses in its own words.
    let takes_value = |arg: &clap::Arg| !arg.is_positional() && arg.get_action().takes_values();
    let command = Cli::command().mut_subcommands(|command| {
        command
            .mut_args(|arg| if takes_value(&arg) { arg.allow_negative_numbers(true) } else { arg })
    });
    Cli::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
}

const RENDER_HELP: &str = "\
Files in the folder:
  layers.exr         every layer, Layer.Channel, 32-bit float
  NAME.npy           each layer as an array for numpy, 64-bit float where it is data
  picture.png        the picture, 8 bits, sRGB; render.exposure (stops, or auto), render.tone_map
                     (none, agx, aces) and render.alpha say how it shows the light; with --denoise
                     it shows the layer Denoised
  id_object.png, …   masks of ids, 16 bits: the numbers themselves
  NAME.preview.png   each layer to look at; not data
  camera.json        K, distortion and pose in OpenCV's convention
  layers.json        what each layer means: definition, unit, frame, miss, and what ids name
A scene with `frames` becomes a folder frames/000000, … each, and beside them
  index.json         K, pose, time, seed and file names of every frame
  transforms.json    the same for nerfstudio
  colmap/            the same as COLMAP's text model
and with a camera.sensor that is more than a grid of pixels, for each exposure:
  raw.png, .npy, .dng   digital numbers as the sensor's converter gave them
  raw.preview.png       the same to look at; not data
  sensor.json           what the numbers mean, and which file is which exposure

Examples:
  etendue render scenes/first-light.json -o out/first-light
  etendue render model.glb -o out/model --layers depth,normal,ids
  etendue render model.glb -o out/lit --set tracer.type=path --set render.exposure=auto --samples 64
  etendue render scan.ply -o out/scan --up z
  etendue render scenes/cube.json -o out/cube --set camera.fov=30 --samples 16";

const VIEW_HELP: &str = "\
Drag turns the scene, Shift+drag or the middle button moves it, the right button looks around, the wheel
goes nearer, W A S D Q E fly; Ctrl+wheel enlarges the picture, a double click fits it. docs/reference/window.md
tells the rest.

Examples:
  etendue view scenes/first-light.json
  etendue view model.glb
  etendue view scenes/lenses/double-gauss.json
  etendue view out/layers.exr";

const MERGE_HELP: &str = "\
The scene is read again, from where the shares found it, for what is written beside the picture.

Example:
  etendue render scenes/first-light.json -o out/shares --shard 1/2
  etendue render scenes/first-light.json -o out/shares --shard 2/2
  etendue merge out/first-light out/shares/shard-*.film";

const SENSOR_HELP: &str = "\
Without a sensor, lists the presets. With one, exposes frames of even light from a tenth of an
electron to past saturation and prints the photon-transfer and signal-to-noise curves: simulated,
by the linear model of EMVA 1288, under the normal approximation, and of an ideal sensor.

With --emva, writes bright and dark pairs over exposure times to past saturation and 16 + 16 frames
at half saturation as 16-bit PNG, emva1288.txt (the descriptor of the reference implementation,
emva1288 on PyPI) and manifest.json.

Examples:
  etendue sensor
  etendue sensor imx183 -o out/imx183
  etendue sensor imx183 --set temperature=313.15 --set exposure=10 --json
  etendue sensor kaf8300 --emva out/kaf8300 --wavelength 525 --steps 25";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaArgument {
    /// Scene files
    Scene,
    /// Lens files
    Lens,
    /// Rays for `etendue lens --rays`
    Rays,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum ShardByArgument {
    /// Strips of rows, in turn
    #[default]
    Rows,
    /// Samples of every pixel: each share is a whole picture, with more noise
    Samples,
}

impl From<ShardByArgument> for ShardBy {
    fn from(by: ShardByArgument) -> Self {
        match by {
            ShardByArgument::Rows => Self::Rows,
            ShardByArgument::Samples => Self::Samples,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AccelMode {
    /// Watertight on closed meshes: suspicious rays are traced again in f64
    Robust,
    /// Faster: some rays slip through edges and corners
    Fast,
}

#[derive(Debug, Args)]
pub(crate) struct RenderArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// The folder to write into; made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Kinds of file to write; tum and kitti (16-bit PNG of depth, disparity, flow), flo, indexed
    /// (masks with a palette), envi (light in bands as an ENVI cube), coco and bop (objects with masks, boxes
    /// and poses) and cryptomatte are there, too
    #[arg(long, value_name = "LIST", default_value = "exr,png,npy,dng")]
    pub(crate) outputs: String,
    /// Denoise the picture of a tracer of light by Intel's Open Image Denoise, which is to be
    /// installed (`pip install pyoidn`; the environment variable `ETENDUE_OIDN` names its library): the layer
    /// Denoised, which picture.png shows. The picture in EXR and NPY, and what a sensor makes of it (raw
    /// files, exposures), keep their noise: those are data
    #[arg(long)]
    pub(crate) denoise: bool,
    /// Threads of build and render; 0 takes all that this process may use
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse::threads)]
    pub(crate) threads: usize,
    /// Embree's traversal mode; the other accelerators are always robust
    #[arg(long, value_enum, default_value_t = AccelMode::Robust)]
    pub(crate) accel_mode: AccelMode,
    /// Make Embree use this instruction set: sse2, sse4.2, avx, avx2 or avx512
    #[arg(long, value_name = "NAME")]
    pub(crate) isa: Option<String>,
    /// Refuse pictures that may need more memory than this in all, program and mapped files included, e.g. 800M
    /// or 4G (bytes, 1024-based), before work on them starts; without it, more than the system has free
    #[arg(long, value_name = "BYTES", value_parser = parse::bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Read models into memory instead of using them where their files are mapped: other programs may
    /// then change them while they are rendered
    #[arg(long)]
    pub(crate) copy: bool,
    /// Write times, rays, memory and fingerprints as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// After the render, render a small part with everything, and say how far what was taken of the scene's
    /// `tolerance` is from it
    #[arg(long, conflicts_with_all = ["shard", "frames"])]
    pub(crate) verify: bool,
    /// Of a scene with `frames`, render these alone, e.g. 10..20 (without the last)
    #[arg(long, value_name = "FROM..TO", value_parser = parse::frames)]
    pub(crate) frames: Option<std::ops::Range<usize>>,
    /// Of a scene with `frames`, the names of their files below the folder: {frame} is the number,
    /// {layer} the layer, as {layer}/{frame}
    #[arg(long, value_name = "NAMES", value_parser = etendue::FramePattern::parse)]
    pub(crate) pattern: Option<etendue::FramePattern>,
    /// Of a scene with `frames`, leave those that are complete in the folder
    #[arg(long)]
    pub(crate) resume: bool,
    /// Render only this share of the picture, e.g. 3/8, into shard-3-of-8.film, for `etendue merge`
    #[arg(long, value_name = "NUMBER/COUNT", value_parser = str::parse::<Shard>)]
    pub(crate) shard: Option<Shard>,
    /// The unit by which the picture is divided into shares
    #[arg(long, value_name = "WHAT", value_enum, default_value_t, requires = "shard")]
    pub(crate) shard_by: ShardByArgument,
    /// Write a checkpoint, checkpoint.film, at most this often; after an interruption the same command goes
    /// on from there, and its picture is the same to the bit
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, default_missing_value = "60",
          value_parser = parse::seconds)]
    pub(crate) checkpoint: Option<f64>,
    /// Write nothing of a picture that is stopped by Ctrl-C. Else what all pixels have by then is
    /// written, marked as partial, in the folder `partial` where a complete picture stands
    #[arg(long)]
    pub(crate) discard_partial: bool,
    /// Show no progress and no summary; the list of files and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[cfg_attr(not(feature = "window"), allow(dead_code, reason = "read by the window alone"))]
pub(crate) struct ViewArguments {
    /// A scene (.json), a model (.gltf, .glb, .obj, .ply), a lens to look through (.json, .zmx) or an image
    /// (.exr, .hdr, .png, .jpg; ENVI cubes by either of their files); a file can be dropped on the window, too
    #[arg(value_name = "SCENE|MODEL|LENS|IMAGE")]
    pub(crate) scene: Option<PathBuf>,
    // Not a comment of documentation, whose brackets would be a link.
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the scene, e.g. camera.fov=30 or objects[0].transform.scale=2"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Let the scene name files outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
}

#[derive(Debug, Args)]
pub(crate) struct MergeArguments {
    /// The folder to write into; made when it is not there
    #[arg(value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// All shares of one render
    #[arg(value_name = "SHARE", required = true)]
    pub(crate) shares: Vec<PathBuf>,
    /// Place of the scene now, if not where the shares found it
    #[arg(long, value_name = "SCENE|MODEL")]
    pub(crate) scene: Option<PathBuf>,
    /// Write times, rays, memory and fingerprints as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Show no progress and no summary; the list of files and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct PlanArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Compare simpler models of the camera's lens with all of it, by what pixels see of the scene, and
    /// name the cheapest within the tolerance; times the picture through each
    #[arg(long)]
    pub(crate) models: bool,
    /// Render a small part with everything, and print how far what is taken of the tolerance is from it
    #[arg(long, conflicts_with = "models")]
    pub(crate) verify: bool,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
    /// Print a table of GitHub's Markdown
    #[arg(long, conflicts_with_all = ["json", "models"])]
    pub(crate) markdown: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SensorArguments {
    /// A preset's name, a scene, or a file with a scene's `sensor` object; lists presets when absent
    #[arg(value_name = "NAME|SENSOR.json|SCENE")]
    pub(crate) sensor: Option<String>,
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the file, e.g. read_noise=3, or camera.sensor.read_noise=3 of a scene"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Let a scene name a camera file outside its own folder
    #[arg(long, requires = "sensor")]
    pub(crate) allow_outside: bool,
    /// Also write the curves into this folder, as curves.svg and curves.json
    #[arg(short, long, value_name = "DIR", requires = "sensor")]
    pub(crate) output: Option<PathBuf>,
    /// Write the image series of a characterisation into this folder instead
    #[arg(long, value_name = "OUT", requires = "sensor", conflicts_with = "output")]
    pub(crate) emva: Option<PathBuf>,
    /// Wavelength of the light (nm) [default: where the sensor sees best; 525 with --emva]
    #[arg(long, value_name = "NM", requires = "sensor", allow_negative_numbers = true, value_parser = parse::wavelength)]
    pub(crate) wavelength: Option<f64>,
    /// Exposure times of the series, 20 or more
    #[arg(long, value_name = "N", default_value_t = 25, requires = "emva")]
    pub(crate) steps: usize,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
    /// Show no progress and no summary
    #[arg(short, long)]
    pub(crate) quiet: bool,
}
