//! A spec with every gap filled, by the model or by an ideal sensor, and every number checked.

use etendue_spectrum::Curve;

use crate::spec::{HotPixels, NoiseModel, Radiometry, SensorKind, SensorSpec};
use crate::{Model, SensorError};

/// Room temperature (K), where dark currents are measured unless somebody says otherwise.
const ROOM: f64 = 293.15;

/// The most pixels along a side: what image formats can hold.
const LONGEST_SIDE: u32 = 65_535;

/// A sensor's numbers, in the units of [`SensorSpec`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Settings {
    pub(crate) resolution: [u32; 2],
    pub(crate) pixel_pitch: f64,
    pub(crate) efficiency: Curve,
    /// Whether anybody said how many electrons there are.
    pub(crate) counts: bool,
    /// 1 DN/e⁻ when nobody counts electrons.
    pub(crate) gain: f64,
    pub(crate) read_noise: f64,
    /// At the sensor's temperature.
    pub(crate) dark_current: f64,
    /// Extra dark current of hot pixels at the sensor's temperature.
    pub(crate) hot_pixels: Option<HotPixels>,
    /// +inf when only the converter saturates.
    pub(crate) full_well: f64,
    pub(crate) black: f64,
    pub(crate) bit_depth: u32,
    pub(crate) prnu: f64,
    pub(crate) dsnu: f64,
    pub(crate) row_noise: f64,
    pub(crate) column_noise: f64,
    /// At least one.
    pub(crate) exposures: Vec<f64>,
    /// At least one.
    pub(crate) frames: u32,
    pub(crate) noise: NoiseModel,
    pub(crate) serial: u64,
    pub(crate) radiometry: Radiometry,
    /// What a user should know.
    pub(crate) notes: Vec<String>,
}

impl Settings {
    /// 2ᵇ − 1 (DN).
    pub(crate) fn white(&self) -> f64 {
        f64::from((1u32 << self.bit_depth) - 1)
    }

    /// Fills and checks a spec.
    pub(crate) fn new(spec: &SensorSpec) -> Result<Self, SensorError> {
        let preset = spec.model.map(Model::preset);
        let counts = spec.system_gain.is_some() || preset.is_some();
        let noise =
            spec.noise.unwrap_or(if counts { NoiseModel::Poisson } else { NoiseModel::None });
        let mut settings = Self {
            resolution: spec.resolution.or(preset.map(|p| p.resolution.value)).unwrap_or([1024; 2]),
            pixel_pitch: spec.pixel_pitch.or(preset.map(|p| p.pixel_pitch.value)).unwrap_or(5.0),
            efficiency: match &spec.quantum_efficiency {
                Some(curve) => curve.clone(),
                None => preset.map_or(Curve::ONE, crate::preset::Preset::efficiency),
            },
            counts,
            gain: spec.system_gain.or(preset.map(|p| p.system_gain.value)).unwrap_or(1.0),
            read_noise: spec.read_noise.or(preset.map(|p| p.read_noise.value)).unwrap_or(0.0),
            dark_current: spec.dark_current.or(preset.map(|p| p.dark_current.value)).unwrap_or(0.0),
            hot_pixels: spec.hot_pixels,
            full_well: spec
                .full_well
                .or(preset.map(|p| p.full_well.value))
                .unwrap_or(f64::INFINITY),
            black: spec.black_level.or(preset.map(|p| p.black_level.value)).unwrap_or(0.0),
            bit_depth: spec.bit_depth.or(preset.map(|p| p.bit_depth.value)).unwrap_or(16),
            prnu: spec.prnu.unwrap_or(0.0),
            dsnu: spec.dsnu.unwrap_or(0.0),
            row_noise: spec.row_noise.unwrap_or(0.0),
            column_noise: spec.column_noise.unwrap_or(0.0),
            exposures: spec.exposures.clone().unwrap_or(vec![spec.exposure.unwrap_or(0.01)]),
            frames: spec.frames.unwrap_or(1),
            noise,
            serial: spec.serial.unwrap_or(0),
            radiometry: spec.radiometry.unwrap_or_default(),
            notes: Vec::new(),
        };
        settings.check_pixels()?;
        settings.check_electrons()?;
        settings.check_converter(spec.full_well)?;
        settings.check_exposures(spec)?;
        settings.check_use(spec)?;
        settings.warm(spec)?;
        Ok(settings)
    }

    fn check_pixels(&self) -> Result<(), SensorError> {
        for side in self.resolution {
            SensorError::unless(
                (1..=LONGEST_SIDE).contains(&side),
                "resolution",
                f64::from(side),
                "1 to 65535 pixels a side",
            )?;
        }
        positive("pixel_pitch", self.pixel_pitch, "micrometres, above 0")?;
        self.efficiency
            .clone()
            .within(0.0, 1.0)
            .map(|_| ())
            .map_err(|fault| SensorError::Curve { key: "quantum_efficiency".into(), fault })
    }

    fn check_electrons(&self) -> Result<(), SensorError> {
        let demand = "electrons, 0 or more";
        for (key, value) in [
            ("read_noise", self.read_noise),
            ("dsnu", self.dsnu),
            ("row_noise", self.row_noise),
            ("column_noise", self.column_noise),
        ] {
            not_negative(key, value, demand)?;
        }
        not_negative("dark_current", self.dark_current, "electrons a second, 0 or more")?;
        let share = |key, value| {
            SensorError::unless((0.0..=1.0).contains(&value), key, value, "a fraction in 0..=1")
        };
        share("prnu", self.prnu)?;
        if let Some(hot) = self.hot_pixels {
            share("hot_pixels.share", hot.share)?;
            let demand = "electrons a second, 0 or more";
            not_negative("hot_pixels.dark_current", hot.dark_current, demand)?;
        }
        Ok(())
    }

    fn check_converter(&self, full_well: Option<f64>) -> Result<(), SensorError> {
        let bits = f64::from(self.bit_depth);
        let demand = "a converter of 1 to 16 bits";
        SensorError::unless((1..=16).contains(&self.bit_depth), "bit_depth", bits, demand)?;
        positive("system_gain", self.gain, "DN per electron, above 0")?;
        let demand = "a gain at which the electrons of a full pixel can be counted";
        SensorError::unless(self.white() / self.gain < 1e300, "system_gain", self.gain, demand)?;
        let demand = "DN, 0 or more and below full scale, 2^bit_depth - 1";
        let inside = (0.0..self.white()).contains(&self.black);
        SensorError::unless(inside, "black_level", self.black, demand)?;
        if let Some(capacity) = full_well {
            positive("full_well", capacity, "electrons, above 0")?;
        }
        let black = self.black / self.gain;
        if self.full_well < black {
            return Err(SensorError::FullWell { full_well: self.full_well, black });
        }
        Ok(())
    }

    fn check_exposures(&self, spec: &SensorSpec) -> Result<(), SensorError> {
        let demand = "seconds, above 0";
        if let Some(exposure) = spec.exposure {
            positive("exposure", exposure, demand)?;
        }
        for &exposure in &self.exposures {
            positive("exposures", exposure, demand)?;
        }
        SensorError::unless(
            !self.exposures.is_empty(),
            "exposures",
            0.0,
            "one exposure time at least",
        )?;
        let frames = f64::from(self.frames);
        SensorError::unless((1..=100_000).contains(&self.frames), "frames", frames, "1 to 100000")?;
        if spec.exposure.is_some() && spec.exposures.is_some() {
            let why = "sensor.exposures says it all";
            return Err(SensorError::Misplaced { key: "exposure", why });
        }
        Ok(())
    }

    /// Refuses keys that would silently do nothing.
    fn check_use(&self, spec: &SensorSpec) -> Result<(), SensorError> {
        let raw = spec.kind == SensorKind::Raw;
        if spec.cfa.is_some() && !raw {
            let why = "only a `raw` sensor has a colour filter array";
            return Err(SensorError::Misplaced { key: "cfa", why });
        }
        if spec.filters.is_some() && spec.kind == SensorKind::Multispectral {
            let why = "a multispectral sensor has `channels`";
            return Err(SensorError::Misplaced { key: "filters", why });
        }
        if spec.filters.is_some() && raw && spec.cfa.is_none() {
            let why = "name the pattern of filters in sensor.cfa";
            return Err(SensorError::Missing { key: "cfa", why });
        }
        if spec.channels.is_some() && spec.kind != SensorKind::Multispectral {
            let why = "only a `multispectral` sensor has channels";
            return Err(SensorError::Misplaced { key: "channels", why });
        }
        let electrons = [
            spec.read_noise,
            spec.dark_current,
            spec.full_well,
            spec.dsnu,
            spec.row_noise,
            spec.column_noise,
            spec.hot_pixels.map(|hot| hot.share),
        ];
        let wants_electrons = self.noise != NoiseModel::None
            || self.radiometry == Radiometry::Physical
            || electrons.iter().flatten().any(|&value| value > 0.0);
        if wants_electrons && !self.counts {
            let why = "noise, dark signal, full well and physical radiometry count electrons, and \
                without the gain K (DN/e⁻) nobody knows how many there are";
            return Err(SensorError::Missing { key: "system_gain", why });
        }
        Ok(())
    }

    /// Takes the dark current to the sensor's temperature: `μ_I·2^((ϑ − ϑ_ref)/ϑ_d)`.
    fn warm(&mut self, spec: &SensorSpec) -> Result<(), SensorError> {
        let preset = spec.model.map(Model::preset);
        let reference = spec
            .dark_current_temperature
            .or(preset.map(|p| p.dark_current_temperature.value))
            .unwrap_or(ROOM);
        let temperature = spec.temperature.unwrap_or(reference);
        let doubling = spec.dark_current_doubling.or(preset.map(|p| p.dark_current_doubling.value));
        not_negative("temperature", temperature, "kelvin, 0 or more")?;
        not_negative("dark_current_temperature", reference, "kelvin, 0 or more")?;
        if temperature < 150.0 && spec.temperature.is_some() {
            self.notes.push(format!(
                "sensor.temperature is {temperature} K, which is {:.0} °C: was °C meant?",
                temperature - 273.15
            ));
        }
        let Some(doubling) = doubling else {
            if spec.temperature.is_some_and(|given| given != reference) {
                self.notes.push(
                    "sensor.temperature has no effect: sensor.dark_current_doubling is not given"
                        .into(),
                );
            }
            return Ok(());
        };
        positive("dark_current_doubling", doubling, "kelvin, above 0")?;
        let factor = ((temperature - reference) / doubling).exp2();
        let demand = "a temperature at which the dark current can be counted";
        SensorError::unless(factor < 1e100, "temperature", temperature, demand)?;
        self.dark_current *= factor;
        if let Some(hot) = &mut self.hot_pixels {
            hot.dark_current *= factor;
        }
        Ok(())
    }
}

fn positive(key: &'static str, value: f64, demand: &'static str) -> Result<(), SensorError> {
    SensorError::unless(value > 0.0 && value.is_finite(), key, value, demand)
}

fn not_negative(key: &'static str, value: f64, demand: &'static str) -> Result<(), SensorError> {
    SensorError::unless(value >= 0.0 && value.is_finite(), key, value, demand)
}
