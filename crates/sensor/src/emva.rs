//! The image series that a characterisation after EMVA 1288 wants, as files.
//!
//! Exposure times rise in equal steps to one past saturation under a constant light (more of them, with
//! noise behind a full well, are taken for signal by evaluations that look for the greatest variance),
//! each with a pair of bright and a pair of dark frames (the standard's method 1); then 16 bright and 16 dark frames at
//! half saturation, for what differs between pixels. Sixteen-bit PNGs hold digital numbers as they
//! are; beside them stand the descriptor of the reference implementation (`emva1288` of Python's package index) and
//! `manifest.json`, which is written last.
//!
//! Times are chosen so that the dark signal can be measured: at the longest it is 1.5 times the
//! variance of the read-out (at least 1 e⁻, at most a tenth of saturation). A sensor without dark
//! current takes its own exposure time as the longest.
//!
//! A sensor with colour filters is characterised without them.
//!
//! A sensor before an even light of known photons: what a characterisation looks at.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use etendue_files::{Transaction, WriteError, prepare_folder};
use etendue_report::Refusal;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::film::{Exposure, Film, RawImage};
use crate::response::{PhotositeKind, Response};
use crate::spec::Radiometry;
use crate::{NoiseModel, Sensor, SensorError};
use etendue_spectrum::Bands;

/// Frames of each kind at half saturation.
const SPATIAL: u32 = 16;

/// File name of the reference implementation's descriptor.
pub const DESCRIPTOR: &str = "emva1288.txt";

/// File name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// Options of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Wavelength of the light (nm).
    pub wavelength: f64,
    /// Exposure times, 20 or more.
    pub steps: usize,
    /// The largest images, in columns and rows: a corner of the sensor. `None`: as many pixels as a
    /// linearity error of 0.02 % wants (four standard errors of a mean at a tenth of saturation), 256
    /// to 1536 a side.
    pub size: Option<[u32; 2]>,
    /// The seed of the noise.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { wavelength: 525.0, steps: 25, size: None, seed: 0 }
    }
}

impl Options {
    fn light(&self, sensor: &Sensor) -> Result<EvenLight, SensorError> {
        EvenLight::new(sensor, self.wavelength, self.size.unwrap_or([side(sensor); 2]))
    }
}

/// The content of `manifest.json`: files by name, in the manifest's own folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Bits of the converter.
    pub bits: u32,
    /// Two bright and two dark files at each exposure time, ascending.
    pub steps: Vec<SeriesStep>,
    /// Sixteen bright and sixteen dark files at half saturation.
    pub spatial: SeriesStep,
}

/// The files of one exposure time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeriesStep {
    /// Exposure time (s).
    pub exposure_s: f64,
    /// Mean photons a pixel in the bright files.
    pub photons: f64,
    /// Files with light.
    pub bright: Vec<String>,
    /// Files without.
    pub dark: Vec<String>,
}

/// Error of a series that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmvaError {
    /// The sensor cannot be characterised so.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The caller's progress function asked to stop.
    #[error("writing the series was stopped")]
    Stopped,
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Exposure times, photons and file names of a series, before any image is made.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Manifest of what will be written.
    pub manifest: Manifest,
    /// Columns and rows of the images.
    pub size: [u32; 2],
    /// Exposure times as the descriptor names them (ns), one a step and the spatial one last.
    nanoseconds: Vec<u64>,
}

/// One image to be made.
struct SeriesImage<'a> {
    name: &'a str,
    photons: f64,
    shot: Exposure,
}

impl Series {
    /// Plans a series.
    ///
    /// # Errors
    ///
    /// When there are fewer than 20 steps, or the sensor does not see the wavelength or has no gain or no noise.
    pub fn plan(sensor: &Sensor, options: &Options) -> Result<Self, SensorError> {
        if !(20..=10_000).contains(&options.steps) {
            let steps = options.steps;
            let why =
                format!("{steps} exposure steps asked for: a characterisation needs 20 to 10000");
            return Err(Refusal::new(why).into());
        }
        if sensor.noise() == NoiseModel::None {
            let why = "what has no noise cannot be characterised by it";
            return Err(SensorError::misplaced("noise", why));
        }
        let light = options.light(sensor)?;
        let longest = longest_exposure(sensor, options.steps);
        // Light and dark current together saturate pixels at the last step but one.
        let saturating = longest * (1.0 - 1.0 / options.steps as f64);
        let electrons = sensor.saturation() - sensor.dark_current() * saturating;
        let photons_a_second = electrons / (light.efficiency * saturating);
        let step = |time: f64, prefix: &str, frames: u32| {
            let nanoseconds = nanoseconds(time);
            let exposure_s = nanoseconds as f64 * 1e-9;
            let files = |kind: &str| {
                (0..frames).map(|frame| format!("{kind}_{prefix}_{frame:02}.png")).collect()
            };
            let photons = light.rounded(photons_a_second * exposure_s);
            let step =
                SeriesStep { exposure_s, photons, bright: files("bright"), dark: files("dark") };
            (step, nanoseconds)
        };
        let count = options.steps;
        let each = |i: usize| step(longest * i as f64 / count as f64, &format!("{i:03}"), 2);
        let (steps, mut times): (Vec<SeriesStep>, Vec<u64>) = (1..=count).map(each).unzip();
        let (spatial, time) = step(0.5 * saturating, "spatial", SPATIAL);
        times.push(time);
        let manifest = Manifest { bits: sensor.bit_depth(), steps, spatial };
        Ok(Self { manifest, size: light.size(), nanoseconds: times })
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pictures().len()
    }

    /// Never: a series has images.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Makes the images and writes everything into `folder`, which is made if need be. `done` is
    /// called with the number of images finished so far, and answers whether to go on.
    ///
    /// Every file appears under its name when it is complete; the manifest comes last.
    ///
    /// # Errors
    ///
    /// [`EmvaError`] when the sensor does not see the wavelength, a file cannot be written, or `done`
    /// says stop.
    pub fn write(
        &self,
        sensor: &Sensor,
        options: &Options,
        folder: &Path,
        done: impl Fn(usize) -> bool + Sync,
    ) -> Result<(), EmvaError> {
        let light = options.light(sensor)?;
        prepare_folder(folder)?;
        let files = Transaction::at_once();
        let write = |name: &str, bytes: &[u8]| {
            files.write(&folder.join(name), |part| part.write_all(bytes))
        };
        let finished = AtomicUsize::new(0);
        self.pictures().into_par_iter().try_for_each(|picture| {
            let image = light.frame(picture.photons, picture.shot, options.seed)?;
            let path = folder.join(picture.name);
            let bytes = png(&image).map_err(|source| WriteError::io(&path, source))?;
            write(picture.name, &bytes)?;
            let go_on = done(finished.fetch_add(1, Ordering::Relaxed) + 1);
            if go_on { Ok(()) } else { Err(EmvaError::Stopped) }
        })?;
        write(DESCRIPTOR, self.descriptor().as_bytes())?;
        let json = serde_json::to_vec_pretty(&self.manifest).map_err(io::Error::from);
        write(MANIFEST, &json.map_err(|source| WriteError::io(folder, source))?)?;
        Ok(())
    }

    /// The descriptor of the reference implementation.
    #[must_use]
    pub fn descriptor(&self) -> String {
        let [width, height] = self.size;
        let mut text = format!("v 4.0\nn {} {width} {height}\n", self.manifest.bits);
        let mut add = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        for (step, nanoseconds) in self.steps().zip(&self.nanoseconds) {
            let mut bright = String::new();
            let _ = write!(bright, "b {nanoseconds} {}", step.photons);
            add(&bright);
            step.bright.iter().for_each(|file| add(&format!("i {file}")));
            add(&format!("d {nanoseconds}"));
            step.dark.iter().for_each(|file| add(&format!("i {file}")));
        }
        text
    }

    fn steps(&self) -> impl Iterator<Item = &SeriesStep> {
        self.manifest.steps.iter().chain([&self.manifest.spatial])
    }

    /// All images; every one is a frame of its own.
    fn pictures(&self) -> Vec<SeriesImage<'_>> {
        let named = self.steps().flat_map(|step| {
            let bright = step.bright.iter().map(|name| (step.photons, name));
            let dark = step.dark.iter().map(|name| (0.0, name));
            bright.chain(dark).map(|(photons, name)| (step.exposure_s, photons, name))
        });
        let numbered = named.zip(0..).map(|((exposure, photons, name), frame)| SeriesImage {
            name,
            photons,
            shot: Exposure { exposure, frame },
        });
        numbered.collect()
    }
}

/// Pixels a side of the images; see [`Options::size`].
fn side(sensor: &Sensor) -> u32 {
    let electrons = 0.1 * sensor.saturation();
    let relative = (electrons + sensor.read_noise().powi(2)) / electrons.powi(2);
    // Each mean is that of two frames.
    let pixels = 0.5 * relative * (4.0f64 / 2e-4).powi(2);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast saturates")]
    let side = pixels.sqrt().ceil() as u32;
    side.clamp(256, 1536)
}

/// The longest exposure time (s); see the head of this file.
fn longest_exposure(sensor: &Sensor, steps: usize) -> f64 {
    let read_out = sensor.read_noise().powi(2) + 1.0 / (12.0 * sensor.system_gain().powi(2));
    let dark = (1.5 * read_out).max(1.0).min(0.1 * sensor.saturation());
    let own = sensor.shots().map(|shot| shot.exposure).fold(0.0, f64::max);
    let longest = if sensor.dark_current() > 0.0 { dark / sensor.dark_current() } else { own };
    // Steps must differ by many nanoseconds, and nanoseconds must be countable.
    longest.clamp(1e-7 * steps as f64, 1e9)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 1e18")]
fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round().max(1.0) as u64
}

/// A grey 16-bit PNG of an image's first channel.
fn png(image: &RawImage) -> Result<Vec<u8>, io::Error> {
    let too_large = |_| io::Error::other("the image is too large for PNG");
    let width = u32::try_from(image.width).map_err(too_large)?;
    let height = u32::try_from(image.height).map_err(too_large)?;
    let bytes: Vec<u8> = image.values.iter().flat_map(|y| y.to_ne_bytes()).collect();
    let mut out = Vec::new();
    // Noise hardly compresses: what more effort saves is not worth the time.
    PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Up)
        .write_image(&bytes, width, height, ExtendedColorType::L16)
        .map_err(io::Error::other)?;
    Ok(out)
}

/// Less than this is no quantum efficiency that could be measured.
const LEAST_EFFICIENCY: f64 = 1e-9;

/// The silicon of a sensor without its colour filters, lit by photons of one wavelength.
#[derive(Debug, Clone)]
pub(crate) struct EvenLight {
    sensor: Sensor,
    /// η at the wavelength.
    pub(crate) efficiency: f64,
}

impl EvenLight {
    /// A corner of `size` (columns, rows) of the sensor, at most all of it, under `wavelength` (nm).
    pub(crate) fn new(
        sensor: &Sensor,
        wavelength: f64,
        size: [u32; 2],
    ) -> Result<Self, SensorError> {
        if !sensor.settings.counts {
            let why = "a characterisation counts electrons";
            return Err(SensorError::missing("system_gain", why));
        }
        let efficiency = sensor.quantum_efficiency().at(wavelength).unwrap_or(0.0);
        if efficiency < LEAST_EFFICIENCY {
            let why = format!(
                "the sensor has no quantum efficiency at {wavelength} nm: choose another --wavelength"
            );
            return Err(Refusal::new(why).into());
        }
        let [width, height] = sensor.resolution();
        let mut corner = sensor.clone().with_resolution([width.min(size[0]), height.min(size[1])]);
        corner.replace_response(Response::of_electrons());
        Ok(Self { sensor: corner, efficiency })
    }

    /// Columns and rows.
    pub(crate) fn size(&self) -> [u32; 2] {
        self.sensor.resolution()
    }

    /// The sensor that draws its electrons another way.
    pub(crate) fn with_noise(&self, noise: crate::NoiseModel) -> Self {
        Self { sensor: self.sensor.clone().with_noise(noise), efficiency: self.efficiency }
    }

    /// A frame in which every pixel gets `photons` on average.
    pub(crate) fn frame(
        &self,
        photons: f64,
        shot: Exposure,
        seed: u64,
    ) -> Result<RawImage, SensorError> {
        let [width, height] = self.size().map(|side| side as usize);
        let film = vec![self.film_value(photons); width * height];
        self.sensor.expose(Film { values: &film }, shot, seed)
    }

    /// The photons that a frame really gets: films hold f32.
    pub(crate) fn rounded(&self, photons: f64) -> f64 {
        f64::from(self.film_value(photons)) / self.efficiency
    }

    /// Electrons: one band of light is worth one.
    #[expect(clippy::cast_possible_truncation, reason = "films hold f32; `rounded` tells")]
    fn film_value(&self, photons: f64) -> f32 {
        (photons * self.efficiency).min(f64::from(f32::MAX)) as f32
    }
}

impl Response {
    /// One channel, of which one band of light is worth one electron.
    fn of_electrons() -> Self {
        let channel =
            PhotositeKind { name: "Y".into(), electrons: vec![1.0], primaries: [1.0 / 3.0; 3] };
        Self { bands: Bands::Grey, channels: vec![channel], pattern: Some(vec![vec![0]]) }
    }
}

impl Sensor {
    /// One exposure of a sensor of `size` (columns, rows), whose pixels get so many photo-electrons on average,
    /// row by row: everything behind the light. The exposure time counts for the dark current alone.
    ///
    /// # Errors
    ///
    /// When the sensor counts no electrons, or they are not as many as pixels.
    pub fn expose_electrons(
        &self,
        electrons: &[f64],
        [width, height]: [usize; 2],
        exposure: Exposure,
        seed: u64,
    ) -> Result<RawImage, SensorError> {
        if !self.settings.counts {
            let why = "electrons are counted";
            return Err(SensorError::missing("system_gain", why));
        }
        let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        let mut sensor = self.clone().with_resolution([side(width), side(height)]);
        sensor.replace_response(Response::of_electrons());
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let film: Vec<f32> = electrons.iter().map(|&e| e.min(f64::from(f32::MAX)) as f32).collect();
        sensor.expose(Film { values: &film }, exposure, seed)
    }

    /// Electrons straight from the film: bands are worth what `response` says, whatever the exposure.
    fn replace_response(&mut self, response: Response) {
        self.response = response;
        self.cfa = None;
        self.settings.radiometry = Radiometry::Digital;
    }
}
