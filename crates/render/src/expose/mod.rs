//! Exposures of the camera's sensor: the film is rendered once and exposed as often as the scene
//! says. Raw numbers, previews, moments and a sidecar go out as files.
//!
//! | file | what it is |
//! |---|---|
//! | `raw.png` | digital numbers, 16 bits a channel, unscaled (one channel or three) |
//! | `raw.npy` | the same, `[h, w]` or `[h, w, channels]`, `u2` |
//! | `raw.dng` | the same for raw converters, with pattern and levels (`raw` sensors of r, g, b or none) |
//! | `raw.preview.png` | demosaiced, white balanced, sRGB; not data |
//! | `raw_left.png`, `.npy`, `raw_right…`, `raw_top_left…`, … | the numbers of the photodiodes of dual and quad pixels |
//! | `raw_second.png`, `raw_second.npy` | the second number of each pixel, of sensors that have two |
//! | `raw_mean.npy`, `raw_variance.npy` | the expected value and variance of every pixel, once an exposure time, when asked for |
//! | `raw_snr.preview.png` | beside those, of one number a pixel, the ratio of signal to noise from 0 to 50 dB; not data |
//! | `raw_hdr.npy`, `raw_hdr_sigma.npy` | electrons a second of all exposures merged, when asked for |
//! | `sensor.json` | what the numbers mean, and which file is which exposure |
//!
//! Several exposures or frames are numbered: `raw_000.png`, `raw_001.png`, …

mod angles;
mod bands;
mod elsewhere;
mod files;
mod film;
mod illumination;
mod noise;
mod photometry;
mod remarks;
mod unit;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etendue_files::{Transaction, WriteError};
use etendue_report::{Decision, DecisionKind, DecisionValue};
use etendue_scene::Scene;
use etendue_sensor::matching::{MatchError, Matched, Photograph};
use etendue_sensor::{
    Exposure, Film, InvalidValues, Moments, NoiseModel, Photodiodes, RawImage, Sensor, SensorError,
    SensorKind,
};
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

pub use crate::output::SPECTRUM;
pub(crate) use bands::{bands, explain_bands};
pub use elsewhere::{PictureLight, PixelLight};
pub use film::BandFilm;
pub(crate) use film::{has_spectrum, spectrum, three_planes};
pub(crate) use noise::NoiseOfPixels;
pub use photometry::Photometry;
pub use unit::{KNOWN_UNITS, LightUnit, pupil_solid_angle};

use crate::memory::NoMemory;
use crate::output::{OutputError, Outputs, Picture, PictureError, sidecar};
use files::{ExposureWriter, Sidecar};
use film::colors;

/// Error of an exposure.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExposeError {
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The film is not the sensor's; a fault of this program.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// An image is no picture; a fault of this program.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The system has less memory than the light takes in the sensor's bands.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<WriteError> for ExposeError {
    fn from(error: WriteError) -> Self {
        Self::Output(error.into())
    }
}

/// Decision of what the sensor will do, with the reason.
pub(crate) fn explain_sensor(scene: &Scene) -> Option<Decision> {
    let sensor = scene.sensor.as_ref()?;
    if scene.picture.is_none() {
        let off = DecisionValue::Switch(false);
        return Some(Decision::new(DecisionKind::Sensor, off, NOTHING_TO_EXPOSE));
    }
    let noise = match sensor.noise() {
        NoiseModel::Poisson => "exact Poisson noise",
        NoiseModel::Normal => "normal approximation of noise",
        NoiseModel::None => "no noise",
    };
    let shots = sensor.shots().count();
    let because = format!(
        "camera.sensor says more than its grid of pixels; the light is rendered once and exposed \
         {shots} time{}",
        if shots == 1 { "" } else { "s" }
    );
    let choice = format!("{}, {} bit, {noise}", name(sensor), sensor.bit_depth());
    Some(Decision::new(DecisionKind::Sensor, choice, because))
}

const NOTHING_TO_EXPOSE: &str =
    "the scene has layers and no tracer: there is no picture for the sensor to expose";

fn name(sensor: &Sensor) -> String {
    let kind = match sensor.spec().kind {
        SensorKind::Raw => "raw",
        SensorKind::Rgb => "rgb",
        SensorKind::Multispectral => "multispectral",
    };
    match sensor.spec().model {
        Some(model) => format!("{kind} {}", model.preset().name),
        None => kind.to_owned(),
    }
}

/// Files that were written.
#[derive(Debug, Default)]
pub struct Exposed {
    /// The files, in the order they were written.
    pub files: Vec<PathBuf>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// The light of a rendered scene on its camera's sensor, to be exposed as often as anybody wants.
#[derive(Debug, Clone)]
pub struct SensorLight {
    sensor: Sensor,
    film: BandFilm,
    /// Of the scene's samples, and of temporal noise.
    seeds: [u64; 2],
    /// Response of each channel to a white surface in the scene's light, the most being 1.
    pub(super) white: Vec<f64>,
    header: Vec<(String, String)>,
    notes: Vec<String>,
    /// The exposure that `auto_exposure` found (s).
    metered: Option<f64>,
    /// Of the lens.
    f_number: Option<f64>,
    /// Of the pupil (sr).
    solid_angle: Option<f64>,
}

impl SensorLight {
    /// The picture of `scene`, or its light in the sensor's own bands where there is any, as it falls
    /// on the sensor.
    ///
    /// Where there is nothing to expose, what a user should know of it: no sensor (then it is empty), or no
    /// picture.
    ///
    /// # Errors
    ///
    /// When there is no memory for it.
    pub fn new(
        scene: &Scene,
        (picture, band_film): (&Picture, Option<BandFilm>),
    ) -> Result<Result<Self, Vec<String>>, ExposeError> {
        let Some(sensor) = &scene.sensor else { return Ok(Err(Vec::new())) };
        let mut notes = sensor.notes().to_vec();
        let Some(colors) = colors(picture.layers()) else {
            notes.push(format!("camera.sensor is not used: {NOTHING_TO_EXPOSE}"));
            return Ok(Err(notes));
        };
        let own = band_film.and_then(|film| {
            notes.extend(bands::unknown(scene, &film.bands));
            Some((sensor.clone().in_bands(film.bands.clone()).ok()?, film))
        });
        let (sensor, film) = match own {
            Some(own) => own,
            None => {
                // In the picture's own three bands where the sensor can: the same numbers from less
                // memory.
                let sensor = sensor.clone().in_bands(Bands::Rgb).unwrap_or_else(|_| sensor.clone());
                let film = BandFilm::from_rgb(sensor.bands().clone(), &colors)?;
                (sensor, film)
            }
        };
        let film = match film.parts.is_empty() {
            true => film.with_parts_of(&sensor, picture)?,
            false => film,
        };
        let film = film.on_sensor(scene, &sensor);
        let film = angles::seen(film, scene, &sensor).summed();
        let seeds = [scene.render.seed, noise_seed(scene)];
        let white = sensor.white_under(&illumination::light(scene, sensor.bands()));
        let header = picture.header().to_vec();
        let solid_angle = scene.camera.pupil_solid_angle();
        let lens = scene.camera.lens().map(etendue_camera::LensCamera::focused);
        let f_number = lens.and_then(|lens| lens.paraxial().f_number);
        let light = Self {
            sensor,
            film,
            seeds,
            white,
            header,
            notes,
            metered: None,
            f_number,
            solid_angle,
        };
        Ok(Ok(light.metered_by_itself()))
    }

    /// Sets the exposure that its own light asks for, where that is metered.
    pub(super) fn metered_by_itself(mut self) -> Self {
        if self.sensor.spec().auto_exposure.is_none() {
            return self;
        }
        match self.sensor.metered(self.film()) {
            Some(time) => self.at_exposure(time),
            None => {
                self.notes.push(
                    "sensor.auto_exposure: no light falls on the sensor, so the exposure is 0.01 s"
                        .to_owned(),
                );
                self
            }
        }
    }

    /// Replaces the exposure time by one that was metered elsewhere (s), such as on the first frame of a sequence.
    #[must_use]
    pub fn at_exposure(mut self, time: f64) -> Self {
        self.sensor = self.sensor.at_exposure(time);
        self.metered = Some(time);
        self
    }

    /// Multiplies the light by a factor; 0 of a sensor in the dark.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.film = self.film.times(factor).summed();
        self
    }

    /// The light of one pixel on all of them.
    #[must_use]
    pub fn even(mut self, [column, row]: [usize; 2]) -> Self {
        let [columns, _] = self.sensor.resolution().map(|side| side as usize);
        let bands = self.film.bands.count();
        let place = row * columns + column;
        let everywhere = |values: &mut Vec<f32>| {
            let Some(own) = values.chunks_exact(bands).nth(place).map(<[f32]>::to_vec) else {
                return;
            };
            values.chunks_exact_mut(bands).for_each(|pixel| pixel.copy_from_slice(&own));
        };
        everywhere(&mut self.film.values);
        self.film.parts.iter_mut().for_each(|(_, values)| everywhere(values));
        self
    }

    /// Fits the sensor's numbers and the level of this light to a photograph of it.
    ///
    /// # Errors
    ///
    /// As [`Sensor::matched`].
    pub fn matched(&self, exposure: f64, photo: Photograph<'_>) -> Result<Matched, MatchError> {
        self.sensor.matched(self.film(), exposure, photo)
    }

    /// Mean photo-electrons that all but the brightest thousandth of the pixels have at most, in an exposure of so long
    /// (s).
    #[must_use]
    pub fn brightest(&self, exposure: f64) -> f64 {
        self.sensor.electrons_of_brightest(self.film(), exposure, 1e-3)
    }

    /// Response of each channel to a white surface in the scene's light, the most being 1.
    #[must_use]
    pub fn white(&self) -> &[f64] {
        &self.white
    }

    /// The f-number of the lens, where there is one.
    #[must_use]
    pub fn f_number(&self) -> Option<f64> {
        self.f_number
    }

    /// The exposure that was metered (s), where `auto_exposure` asks for it and there is light.
    #[must_use]
    pub fn metered(&self) -> Option<f64> {
        self.metered
    }

    /// The sensor, in the bands of the light.
    #[must_use]
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Notes on the light for the user.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// One exposure: the same numbers whenever it is asked for.
    ///
    /// # Errors
    ///
    /// When the film is not the sensor's; a fault of this program.
    pub fn expose(&self, exposure: Exposure) -> Result<RawImage, SensorError> {
        self.expose_on(&self.sensor, exposure)
    }

    /// One exposure of a sensor that has the same film: the sensor's own, or its second read-out.
    ///
    /// # Errors
    ///
    /// As [`Self::expose`].
    pub fn expose_on(&self, sensor: &Sensor, exposure: Exposure) -> Result<RawImage, SensorError> {
        sensor.expose(self.film(), exposure, self.seeds[1])
    }

    /// Mean over frames of what the sensor records, and its variance, in one exposure.
    ///
    /// # Errors
    ///
    /// As [`Self::expose`].
    pub fn moments(&self, exposure: Exposure) -> Result<Moments, SensorError> {
        self.sensor.moments(self.film(), exposure)
    }

    fn film(&self) -> Film<'_> {
        Film { values: &self.film.values }
    }

    /// File name of a photodiode whose light is a layer.
    fn part_name(&self, layer: LayerSpec) -> &'static str {
        let own = photodiodes(&self.sensor).iter().find(|(known, _)| *known == layer);
        own.map_or("", |(_, name)| name)
    }

    /// The parts of the pupil whose light is told apart, each by the name of its files.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = &'static str> + '_ {
        self.film.parts.iter().map(|(layer, _)| self.part_name(*layer))
    }

    /// One exposure of the photodiodes that see a part of the pupil, by the number of the part: their electrons, and noise
    /// of their own.
    ///
    /// # Errors
    ///
    /// As [`Self::expose`].
    pub fn expose_part(&self, part: usize, exposure: Exposure) -> Result<RawImage, SensorError> {
        let none = (LayerSpec::Radiance, Vec::new());
        let (layer, values) = self.film.parts.get(part).unwrap_or(&none);
        let seed = etendue_sensor::mixed_seed(self.seeds[1], self.part_name(*layer).as_bytes());
        self.sensor.expose(Film { values }, exposure, seed)
    }
}

/// Writes what the sensor makes of `light` into `folder`. Told the share done, `progress` answers
/// whether to go on.
///
/// # Errors
///
/// When a file cannot be written, or `progress` says stop.
pub fn write(
    light: &SensorLight,
    (files, folder): (&Transaction, &Path),
    outputs: Outputs,
    progress: &dyn Fn(f64) -> bool,
) -> Result<Exposed, ExposeError> {
    let sensor = light.sensor();
    let shots: Vec<Exposure> = sensor.shots().collect();
    let digits = digits(shots.len());
    let mut writer = ExposureWriter {
        sensor,
        second: sensor.second(),
        light,
        files,
        folder,
        outputs,
        digits,
        moments: Vec::new(),
        invalid: InvalidValues::default(),
        remarked_exposure: None,
        exposed: Exposed { files: Vec::new(), notes: light.notes.clone() },
    };
    let mut sidecar = Sidecar::new(sensor, light.seeds);
    sidecar.metered_exposure_s = light.metered;
    sidecar.photometry = light.photometry();
    // One shot after the other, each with its entry in the sidecar.
    for (done, shot) in shots.iter().enumerate() {
        if !progress(done as f64 / shots.len() as f64) {
            return Err(ExposeError::Stopped);
        }
        sidecar.shots.push(writer.shot(*shot)?);
    }
    if sensor.spec().hdr == Some(true) {
        sidecar.hdr = Some(writer.merged(&shots)?);
    }
    sidecar.invalid = writer.invalid;
    writer.exposed.notes.extend(in_words(sidecar.invalid));
    sidecar.notes.clone_from(&writer.exposed.notes);
    let path = writer.place("sensor.json");
    sidecar::write_json(files, &path, &sidecar)?;
    Ok(writer.exposed)
}

/// The photodiodes that a sensor divides its pixels into: the layer of the light of each, and the name of its files.
pub(crate) fn photodiodes(sensor: &Sensor) -> &'static [(LayerSpec, &'static str)] {
    match sensor.spec().photodiodes {
        None => &[],
        Some(Photodiodes::Dual) => {
            &[(LayerSpec::LeftPupil, "raw_left"), (LayerSpec::RightPupil, "raw_right")]
        }
        Some(Photodiodes::Quad) => &[
            (LayerSpec::TopLeftPupil, "raw_top_left"),
            (LayerSpec::TopRightPupil, "raw_top_right"),
            (LayerSpec::BottomLeftPupil, "raw_bottom_left"),
            (LayerSpec::BottomRightPupil, "raw_bottom_right"),
        ],
    }
}

/// The seed of temporal noise: two frames or cameras of a scene, and two places of one camera, draw noise
/// of their own.
#[must_use]
pub fn noise_seed(scene: &Scene) -> u64 {
    // A camera is made of numbers and words only, which always serialise.
    let camera = serde_json::to_string(&scene.camera.opencv()).unwrap_or_default();
    etendue_sensor::mixed_seed(scene.render.frame_seed(), camera.as_bytes())
}

/// The names of all files that exposing `scene` may write.
#[must_use]
pub fn file_names(scene: &Scene) -> Vec<String> {
    scene.sensor.as_ref().map(files_of).unwrap_or_default()
}

/// The names of all files that exposures of `sensor` may leave.
#[must_use]
pub fn files_of(sensor: &Sensor) -> Vec<String> {
    let shots: Vec<Exposure> = sensor.shots().collect();
    let digits = digits(shots.len());
    let endings = ["png", "preview.png", "npy", "dng"];
    let shot =
        |shot: &Exposure| endings.map(|ending| files::name(digits, "raw", shot.frame, ending));
    let has_moments = sensor.spec().moments == Some(true);
    // Fewer exposure times than shots, numbered alike.
    let moments: BTreeSet<String> = (0..)
        .zip(shots.iter().filter(|_| has_moments))
        .flat_map(|(number, _)| {
            let [mean, variance] = files::moment_names(sensor, digits, number);
            [mean, variance, files::snr_name(sensor, digits, number)]
        })
        .collect();
    let merged = files::HDR_NAMES.iter().filter(|_| sensor.spec().hdr == Some(true));
    let merged = merged.map(|(name, _)| (*name).to_owned());
    let sidecar = ["sensor.json".to_owned()];
    let second = shots.iter().filter(|_| sensor.spec().second_readout.is_some());
    let of_second = |shot: &Exposure| {
        ["png", "npy"].map(|ending| files::name(digits, files::SECOND, shot.frame, ending))
    };
    let second = second.flat_map(of_second);
    let parts = photodiodes(sensor).iter().flat_map(|(_, name)| {
        let of_part = |shot: &Exposure| {
            ["png", "npy"].map(|ending| files::name(digits, name, shot.frame, ending))
        };
        shots.iter().flat_map(of_part).collect::<Vec<_>>()
    });
    shots
        .iter()
        .flat_map(shot)
        .chain(second)
        .chain(parts)
        .chain(moments)
        .chain(merged)
        .chain(sidecar)
        .collect()
}

/// Digits of a shot's number in names; 0 for none.
fn digits(shots: usize) -> usize {
    match shots {
        1 => 0,
        count => (count - 1).to_string().len().max(3),
    }
}

/// Note on what a film has that is no light, if anything.
fn in_words(invalid: InvalidValues) -> Option<String> {
    let InvalidValues { negative, not_finite } = invalid;
    invalid.any().then(|| {
        format!(
            "{negative} negative and {not_finite} infinite or NaN values of the film are no light \
             and were taken for none"
        )
    })
}
