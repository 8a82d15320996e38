//! A sensor before an even light of known photons: what a characterisation looks at.

use etendue_spectrum::Bands;

use crate::film::{Exposure, Film, RawImage};
use crate::response::{Channel, Response};
use crate::spec::Radiometry;
use crate::{Sensor, SensorError};

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
            return Err(SensorError::Missing { key: "system_gain", why });
        }
        let efficiency = sensor.quantum_efficiency().at(wavelength).unwrap_or(0.0);
        if efficiency < LEAST_EFFICIENCY {
            return Err(SensorError::BlindAt { wavelength });
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
        let channel = Channel { name: "Y".into(), electrons: vec![1.0], primaries: [1.0 / 3.0; 3] };
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
            return Err(SensorError::Missing { key: "system_gain", why });
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
