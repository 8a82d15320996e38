//! Arguments of `etendue lens`, `etendue expose`, `etendue spectrum`, `etendue edge` and `etendue bench`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::parse;
use super::scene::SceneArguments;
use etendue::{LightUnit, Setting};
use etendue_optics::train::Focus;

pub(super) const LENS_HELP: &str = "\
All lengths are millimetres; z = 0 is the first element's vertex, +z runs from the object to the
sensor, and elements count from 0 on the object side.

RAYS.json: {\"from\": \"object\" or \"sensor\", \"clip\": true or false, \"rays\": [
  {\"origin\": [x, y, z], \"direction\": [x, y, z], \"wavelength\": 587.56}]}

Examples:
  etendue lens scenes/lenses/double-gauss.json
  etendue lens scenes/lenses/achromat.json --json --fields 0,5,10
  etendue lens scenes/lenses/double-gauss.json --rays rays.json --json
  etendue lens scenes/lenses/double-gauss.json -o out/double-gauss
  etendue lens bought.zmx --save bought.json
  etendue lens scenes/double-gauss.json --fit-opencv
  etendue lens scenes/lenses/double-gauss.json --report out/double-gauss.html
  etendue lens scenes/lenses/achromat.json --waves --magnification -0.5 --fields 0,5 -o out/achromat";

#[derive(Debug, Args)]
pub(crate) struct LensArguments {
    /// A lens file (.json), a scene whose camera is a lens, or a file of Zemax (.zmx), CODE V (.seq), OSLO (.len),
    /// optiland or ISET (.json), pbrt (.dat) or `PhotonsToPhotos` (.txt)
    #[arg(value_name = "LENS|ZMX|SCENE")]
    pub(crate) lens: PathBuf,
    /// Print JSON for machines, with all digits
    #[arg(long)]
    pub(crate) json: bool,
    /// Trace the rays of a file instead, and print every intersection and how each ray ends
    #[arg(long, value_name = "FILE")]
    pub(crate) rays: Option<PathBuf>,
    /// Draw layout.svg, spots.svg and illumination.svg into this folder, made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Write the lens as a lens file, such as an imported one
    #[arg(long, value_name = "FILE")]
    pub(crate) save: Option<PathBuf>,
    /// Fit OpenCV's camera (K, k1, k2, p1, p2, k3, or its fisheye) to the lens' chief rays, and print it
    /// with its residuals, where it holds, and as the camera of a scene; with -o, into opencv.json there
    #[arg(long, conflicts_with = "rays")]
    pub(crate) fit_opencv: bool,
    /// The tolerance of the fit: "0.5 px", which is the default
    #[arg(long, value_name = "PIXELS", value_parser = parse::pixels, requires = "fit_opencv")]
    pub(crate) tolerance: Option<f64>,
    /// Columns and rows of the picture that is fitted, 1536x1024 when absent
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = parse::resolution, requires = "fit_opencv")]
    pub(crate) resolution: Option<[u32; 2]>,
    /// From one pixel to the next, such as "4 um"; as wide as fills the image circle when absent
    #[arg(long, value_name = "PITCH", value_parser = parse::pitch, requires = "fit_opencv")]
    pub(crate) pixel_pitch: Option<f64>,
    /// Analyse it in waves, too: wavefronts, Zernike terms, MTF, Strehl's ratio, encircled energy, ray fans,
    /// Seidel's sums, field curvature; with -o as figures and tables (.csv) as well
    #[arg(long, conflicts_with_all = ["rays", "fit_opencv"])]
    pub(crate) waves: bool,
    /// Write all of that with its figures on one page; implies --waves
    #[arg(long, value_name = "FILE.html", conflicts_with_all = ["rays", "fit_opencv"])]
    pub(crate) report: Option<PathBuf>,
    /// For waves, what each wavelength counts for, in the order of --wavelengths; alike when absent
    #[arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) weights: Option<Vec<f64>>,
    /// For waves, frequencies of the MTF in cycles/mm; twentieths of the limit when absent
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) frequencies: Option<Vec<f64>>,
    /// For waves, cells over the pupil, a side; as many as the wavefronts need when absent
    #[arg(long, value_name = "N")]
    pub(crate) cells: Option<usize>,
    /// For waves, the image plane where the wavefront on the axis is flattest, and not the sensor's
    #[arg(long)]
    pub(crate) best_focus: bool,
    /// For waves, put the object this far in front of the first vertex, "0.5 m"; fields are its heights in
    /// mm, and the sensor stands at its image unless --focus puts it elsewhere
    #[arg(long, value_name = "DISTANCE", value_parser = parse::focus, conflicts_with = "magnification")]
    pub(crate) object_distance: Option<Focus>,
    /// For waves, put the object where its image is this many times as large: -0.5
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub(crate) magnification: Option<f64>,
    /// For waves, set the stop by the numerical aperture of a near object's light
    #[arg(long, value_name = "NA", conflicts_with = "f_number")]
    pub(crate) numerical_aperture: Option<f64>,
    /// For waves, analyse an afocal lens by the angles of its light: what is mm on an image is mrad then
    #[arg(long, conflicts_with_all = ["object_distance", "magnification", "numerical_aperture", "focus",
          "psf", "best_focus"])]
    pub(crate) afocal: bool,
    /// Write point spread functions by depth, field and wavelength into the folder of -o, as psf.npy,
    /// psf.exr and psf.json: shares of a point's light by cell
    #[arg(long, requires = "output", conflicts_with_all = ["rays", "fit_opencv", "object_distance",
          "magnification", "numerical_aperture", "best_focus"])]
    pub(crate) psf: bool,
    /// Distances of their points from the entrance pupil along the axis, "infinity,2 m"; the one in focus
    /// when absent
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse::focus, requires = "psf")]
    pub(crate) depths: Option<Vec<Focus>>,
    /// A side of their cells, such as a pixel's "3.45 um"; a quarter of the finest detail when absent
    #[arg(long, value_name = "PITCH", value_parser = parse::pitch, requires = "psf")]
    pub(crate) psf_pitch: Option<f64>,
    /// Cells a side, an odd number; as many as hold all of the light when absent
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4095), requires = "psf")]
    pub(crate) psf_size: Option<u32>,
    /// Take them by Huygens' sum, with the true distance from every cell of the pupil to every cell
    #[arg(long, requires = "psf")]
    pub(crate) huygens: bool,
    /// Field angles in degrees; the file's own or shares of the field of view when absent
    #[arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) fields: Option<Vec<f64>>,
    /// Wavelengths in nm, the main one first; the lens' own and the F, d and C lines when absent
    #[arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) wavelengths: Option<Vec<f64>>,
    /// The configuration of a Zemax file, from 1; the one that it stands at when absent
    #[arg(long, value_name = "N")]
    pub(crate) configuration: Option<usize>,
    /// Put the sensor where a plane at this distance is sharp: "1.2 m", or infinity
    #[arg(long, value_name = "DISTANCE", value_parser = parse::focus, allow_hyphen_values = true)]
    pub(crate) focus: Option<Focus>,
    /// Open or close the stop to this f-number
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) f_number: Option<f64>,
    /// A glass catalogue in Zemax' AGF format, searched before the built-in one; the last one given is
    /// searched first
    #[arg(long = "glass-catalog", value_name = "FILE")]
    pub(crate) glass_catalogs: Vec<PathBuf>,
    /// Refuse wavelengths outside of what the glasses are stated for instead of warning
    #[arg(long)]
    pub(crate) strict: bool,
    /// Let the file name files outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Say nothing on standard error but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

pub(super) const EXPOSE_HELP: &str = "\
Writes what `etendue render` writes of a scene's sensor: raw.png, .npy, .dng, raw.preview.png,
moments and sensor.json; of a folder of pictures, or of a render's frames, a folder
frames/000000, … each.

The unit of the values is the file's own: spectral EXR files, ENVI headers (`data units`) and
renders of etendue say it; else --unit does. Of radiance L, a lens of f-number N, focused at the
magnification m, brings E = pi L / (1 + 4 N^2 (1 + m)^2) onto the sensor: --f-number and
--magnification, or the pupil of the camera of a render.

Examples:
  etendue expose photo.exr --sensor imx183 --unit 1 -o out/photo
  etendue expose cube.hdr --sensor imx183 --unit uW/cm2/sr/nm --f-number 2.8 -o out/cube
  etendue expose cube.npy --sensor scene.json --unit W/m2/nm --wavelengths 450,550,650 -o out/cube
  etendue expose out/orbit --sensor imx250 --set exposures=[0.001,0.01] --unit 1 -o out/orbit-imx250";

#[derive(Debug, Args)]
pub(crate) struct ExposeArguments {
    /// A picture of light (.exr, .npy, ENVI .hdr or .img, Radiance .hdr), or a folder of them
    #[arg(value_name = "IMAGE|FOLDER")]
    pub(crate) image: PathBuf,
    /// A preset's name, a scene, or a file with a scene's `sensor` object; its pixels are the picture's
    #[arg(long, value_name = "NAME|SENSOR.json|SCENE")]
    pub(crate) sensor: String,
    /// The folder to write into; made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// The unit of the picture's values: 1 (1 is full scale), W/m2/sr/nm (spectral radiance) or W/m2/nm
    /// (spectral irradiance on the sensor), with mW, uW, cm2, um and the like; the file's own when absent
    #[arg(long, value_name = "UNIT", value_parser = LightUnit::parse)]
    pub(crate) unit: Option<LightUnit>,
    /// The f-number of the lens before the sensor, of pictures in radiance
    #[arg(long, value_name = "N", value_parser = parse::f_number)]
    pub(crate) f_number: Option<f64>,
    /// The magnification of that lens, as a positive number: 0 of far scenes
    #[arg(long, value_name = "M", default_value_t = 0.0, requires = "f_number")]
    pub(crate) magnification: f64,
    /// The middles of the bands of an array (nm), from the shortest on
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) wavelengths: Option<Vec<f64>>,
    // Not a comment of documentation, whose brackets would be a link.
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the sensor's file, e.g. exposure=0.02, or camera.sensor.exposure=0.02 of a scene"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Seed of the noise; when absent the `noise_seed` of the render that left the picture, or else 0
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Kinds of file to write
    #[arg(long, value_name = "LIST", default_value = "png,npy,dng")]
    pub(crate) outputs: String,
    /// Refuse pictures that may need more memory than this in all, program and mapped files included, e.g. 800M
    /// or 4G (bytes, 1024-based), before work on them starts; without it, more than the system has free
    #[arg(long, value_name = "BYTES", value_parser = parse::bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Let a scene name a camera file outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Show no progress and no summary; the list of files and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

pub(super) const CALIBRATE_HELP: &str = "\
Takes the pictures of the scene's own camera, at its own settings:
  dark_000 …         frames in the dark, and their mean dark_mean.npy
  flat_000 …         the same light on every pixel, as without a lens
  white_000 …        an even white surrounding through the lens
  board_000_000 …    a chessboard in poses over the picture; calibration.json says where its corners are
The DNGs say shading as a gain map (OpcodeList2), made of the white image.

Examples:
  etendue calibrate scenes/double-gauss.json -o out/calibration --set camera.sensor.model=imx250
  etendue calibrate scene.json -o out/set --frames 64 --level 0.8 --boards 0
  etendue calibrate scene.json -o out/set --region 0,0,640,480 --binning 2 --packed raw12";

#[derive(Debug, Args)]
pub(crate) struct CalibrateArguments {
    /// A scene whose camera has a sensor
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// The folder to write into; made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    // Not a comment of documentation, whose brackets would be a link.
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the scene, e.g. camera.sensor.exposure=0.02"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Frames of each kind, 1 to 1000
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub(crate) frames: u32,
    /// The share of saturation that flats and white images reach
    #[arg(long, value_name = "SHARE", default_value_t = 0.5)]
    pub(crate) level: f64,
    /// Poses of the chessboard; 0 for none
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub(crate) boards: u32,
    /// Squares of the chessboard along columns and rows
    #[arg(long, value_name = "COLUMNS,ROWS", value_parser = parse::resolution, default_value = "9,6")]
    pub(crate) squares: [u32; 2],
    /// A side of a square, such as "25 mm"; what fills half of the picture when absent
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    pub(crate) square: Option<f64>,
    /// Distance of the chessboard, such as "1.2 m"; where the lens is focused when absent
    #[arg(long, value_name = "DISTANCE", value_parser = parse::length)]
    pub(crate) distance: Option<f64>,
    /// Read out a region alone: left column, top row, width and height (pixels)
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse::region)]
    pub(crate) region: Option<[usize; 4]>,
    /// Average the numbers of so many pixels a side, those behind the same filter
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) binning: usize,
    /// Also write the numbers as MIPI packs them
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) packed: Option<PackedArgument>,
    /// The f-number that DNGs say of a camera without a lens of its own
    #[arg(long, value_name = "N", value_parser = parse::f_number)]
    pub(crate) f_number: Option<f64>,
    /// Kinds of file to write
    #[arg(long, value_name = "LIST", default_value = "png,npy,dng")]
    pub(crate) outputs: String,
    /// Let the scene name files outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Show no progress and no summary; the list of files and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// A packed format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PackedArgument {
    /// Four pixels of 10 bits in five bytes
    Raw10,
    /// Two pixels of 12 bits in three bytes
    Raw12,
}

pub(super) const MATCH_HELP: &str = "\
The paper's three steps: what is known of the sensor stands in the scene, the photograph is raw, and the
scene is rendered and fitted to it: gain, read noise and black of the sensor, and the level of light in
each channel, each with its standard deviation. The photograph is a DNG or TIFF without compression, or
a grey PNG of 16 bits, of the scene's own view and size. With -o: match.json, residuals.png, where grey is
no difference and black and white are 4 standard deviations, residuals.npy, and residuals.svg.

Examples:
  etendue match photo.dng chart.json
  etendue match raw.png chart.json --set camera.sensor.prnu=0.005 -o out/match
  etendue match photo.dng chart.json --json";

#[derive(Debug, Args)]
pub(crate) struct MatchArguments {
    /// A raw photograph (.dng, .tif, .png)
    #[arg(value_name = "PHOTO")]
    pub(crate) photo: PathBuf,
    /// The scene that it shows, with a raw sensor
    #[arg(value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    // Not a comment of documentation, whose brackets would be a link.
    #[arg(
        long = "set",
        value_name = "PATH=VALUE",
        value_parser = parse::setting,
        help = "Set any value of the scene, e.g. camera.sensor.exposure=0.02"
    )]
    pub(crate) settings: Vec<Setting>,
    /// Draw residuals and write what was found into this folder, made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
    /// Let the scene name files outside its own folder
    #[arg(long)]
    pub(crate) allow_outside: bool,
    /// Show no progress and no notes
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

pub(super) const SPECTRUM_HELP: &str = "\
X, Y and Z are integrals of the curve times the CIE 1931 observer, not normalised; the curve is taken for
light and is 0 beyond its ends. With --under it is a reflectance, and what it leaves of a lamp's light is
told.

Examples:
  etendue spectrum scenes/spectra/colorchecker.csv --under d65
  etendue spectrum lamp.spd -o out/lamp
  etendue spectrum led_b3 --json
  etendue spectrum 3200";

#[derive(Debug, Args)]
pub(crate) struct SpectrumArguments {
    /// A .csv, .spd or refractiveindex.info .yml file, the name of a lamp, or a black body's kelvin
    #[arg(value_name = "FILE|LAMP|KELVIN")]
    pub(crate) spectrum: String,
    /// One column of a file, by the header's word or counted from 1; all when absent
    #[arg(long, value_name = "COLUMN")]
    pub(crate) column: Option<String>,
    /// Take the curves for reflectances under this lamp, a name or a black body's kelvin
    #[arg(long, value_name = "LAMP|KELVIN")]
    pub(crate) under: Option<String>,
    /// Draw spectrum.svg into this folder, made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
}

pub(super) const EDGE_HELP: &str = "\
By the method e-SFR of ISO 12233: the edge may lie at 0.5 to 44 degrees from rows or columns, 5 are
best, and is to cross the region from side to side. Integers of PNG and JPEG files are taken for sRGB
and made linear; those of raw frames are light already: --raw.

Examples:
  etendue edge out/slanted/layers.exr --region 200,150,120,160
  etendue edge out/slanted/raw.png --raw --mosaic 0,0 --pitch \"3.45 um\" --json
  etendue edge photo.png --region 40,60,200,240 -o out/edge";

#[derive(Debug, Args)]
pub(crate) struct EdgeArguments {
    /// A picture (.exr, .png, .hdr, .jpg, or an ENVI cube)
    #[arg(value_name = "IMAGE")]
    pub(crate) image: PathBuf,
    /// Left column, top row, width and height of the region (pixels); all of the picture when absent
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse::region)]
    pub(crate) region: Option<[usize; 4]>,
    /// The layer of an EXR file; the picture when absent
    #[arg(long, value_name = "NAME", default_value = "")]
    pub(crate) layer: String,
    /// Take the integers of the file as light, as those of raw frames are
    #[arg(long)]
    pub(crate) raw: bool,
    /// Take every second pixel of every second row alone, from this column and row on: one colour of a
    /// mosaic
    #[arg(long, value_name = "COLUMN,ROW", value_parser = parse::mosaic)]
    pub(crate) mosaic: Option<[usize; 2]>,
    /// From one pixel to the next, such as "3.45 um", for cycles/mm
    #[arg(long, value_name = "PITCH", value_parser = parse::pitch)]
    pub(crate) pitch: Option<f64>,
    /// Draw edge.svg and write edge.csv into this folder, made when it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print JSON for machines
    #[arg(long)]
    pub(crate) json: bool,
    /// Show no list of files
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

pub(super) const BENCH_HELP: &str = "\
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
    /// About how long samplers and cameras may take, each; pixels are made larger until they do. How long all renders
    /// of --target may take, of pixels as they are [default: 60, quick 10; --target 600, quick 50]
    #[arg(long, value_name = "S", value_parser = parse::seconds)]
    pub(crate) seconds: Option<f64>,
    /// Find which settings reach this error of what the sensor records soonest, e.g. 1%, by the time of the whole
    /// program; the parts of --only are measured where they are named, too
    #[arg(long, value_name = "SHARE", value_parser = parse::share)]
    pub(crate) target: Option<f64>,
    /// Values of a key that contend for --target, too, e.g. render.seed=1,2; of a number of `accuracy` the key alone
    /// takes a quarter, half, twice and four times its default. Several keys with several of these
    #[arg(long, value_name = "KEY=VALUES", value_parser = parse::sweep, requires = "target")]
    pub(crate) sweep: Vec<parse::Sweep>,
    /// Stop when a structure would need more than this, e.g. 800M or 4G (bytes, 1024-based)
    #[arg(long, value_name = "BYTES", value_parser = parse::bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Show no progress and no list of files; the table and errors remain
    #[arg(short, long)]
    pub(crate) quiet: bool,
}
