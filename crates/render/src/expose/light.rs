//! The light of a scene on its camera's sensor, exposures to it, and what becomes of them.

use std::path::PathBuf;

use etendue_files::WriteError;
use etendue_scene::Scene;
use etendue_sensor::matching::{MatchError, Matched, Photograph};
use etendue_sensor::{Exposure, Film, Moments, RawImage, Sensor, SensorError};
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use super::film::{BandFilm, colors, photodiodes};
use super::{angles, bands, illumination};
use crate::memory::NoMemory;
use crate::output::{HeaderEntry, OutputError, Picture, PictureError};

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

/// Files that were written.
#[derive(Debug, Default)]
pub struct Exposed {
    /// The files, in the order they were written.
    pub files: Vec<PathBuf>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

pub(super) const NOTHING_TO_EXPOSE: &str =
    "the scene has layers and no tracer: there is no picture for the sensor to expose";

/// The light of a rendered scene on its camera's sensor, to be exposed as often as anybody wants.
#[derive(Debug, Clone)]
pub struct SensorLight {
    pub(super) sensor: Sensor,
    pub(super) film: BandFilm,
    /// Of the scene's samples, and of temporal noise.
    pub(super) seeds: [u64; 2],
    /// Response of each channel to a white surface in the scene's light, the most being 1.
    pub(super) white: Vec<f64>,
    pub(super) header: Vec<HeaderEntry>,
    pub(super) notes: Vec<String>,
    /// The exposure that `auto_exposure` found (s).
    pub(super) metered: Option<f64>,
    /// Of the lens.
    pub(super) f_number: Option<f64>,
    /// Of the pupil (sr).
    pub(super) solid_angle: Option<f64>,
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
        picture: &Picture,
        band_film: Option<BandFilm>,
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

    pub(super) fn film(&self) -> Film<'_> {
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

/// The seed of temporal noise: two frames or cameras of a scene, and two places of one camera, draw noise
/// of their own.
#[must_use]
pub fn noise_seed(scene: &Scene) -> u64 {
    // A camera is made of numbers and words only, which always serialise.
    let camera = serde_json::to_string(&scene.camera.opencv()).unwrap_or_default();
    etendue_sensor::mixed_seed(scene.render.frame_seed(), camera.as_bytes())
}
