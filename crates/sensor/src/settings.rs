//! A spec with every gap filled, by the model or by an ideal sensor, and every number checked.

use std::borrow::Cow;
use std::sync::Arc;

use etendue_report::Refusal;
use etendue_spectrum::Curve;

use crate::chip::Effects;
use crate::error::Readable;
use crate::spec::{Filters, HotPixels, NoiseModel, Radiometry, SensorKind, SensorSpec};
use crate::{CfaSpec, Model, SensorError};

/// Room temperature (K), where dark currents are measured unless somebody says otherwise.
const ROOM: f64 = 293.15;

/// The most pixels along a side: what image formats can hold.
const LONGEST_SIDE: u32 = 65_535;

/// The shortest and the longest exposure (s).
pub const EXPOSURES: [f64; 2] = [1e-12, 1e9];

/// Noise beyond this is a slip (e⁻), and would leave f64 no room.
const MOST_ELECTRONS: f64 = 1e9;

/// Dark currents beyond this are, too (e⁻/s).
const MOST_CURRENT: f64 = 1e15;

/// Read-out of a pixel's electrons: the noise of each is its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReadoutPath {
    First,
    Second,
}

/// A sensor's numbers, in the units of [`SensorSpec`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorSettings {
    pub(crate) resolution: [u32; 2],
    pub(crate) pixel_pitch: f64,
    pub(crate) efficiency: Curve,
    /// True if the number of electrons was specified.
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
    pub(crate) row_pattern: f64,
    pub(crate) column_pattern: f64,
    pub(crate) dcnu: f64,
    /// Shares of pixels.
    pub(crate) dead: f64,
    pub(crate) stuck: f64,
    /// Share of electrons that each of four neighbours gets.
    pub(crate) crosstalk: f64,
    /// At least one.
    pub(crate) exposures: Vec<f64>,
    /// At least one.
    pub(crate) frames: u32,
    pub(crate) noise: NoiseModel,
    pub(crate) serial: u64,
    pub(crate) radiometry: Radiometry,
    /// Sensitivity beside that of the first read-out's photodiode, which is 1.
    pub(crate) sensitivity: f64,
    /// Read-out of the electrons.
    pub(crate) readout: ReadoutPath,
    pub(crate) effects: Arc<Effects>,
    /// Notes for the user.
    pub(crate) notes: Vec<String>,
}

impl SensorSettings {
    /// 2ᵇ − 1 (DN).
    pub(crate) fn white(&self) -> f64 {
        f64::from((1u32 << self.bit_depth) - 1)
    }

    /// Saturation level of a pixel (DN): its well, or the converter.
    pub(crate) fn saturation_level(&self) -> f64 {
        (self.gain * self.read_of(self.full_well) + self.black).round_ties_even().min(self.white())
    }

    /// Charge that is read of so many electrons (e⁻), which the well holds.
    pub(crate) fn read_of(&self, electrons: f64) -> f64 {
        match &self.effects.nonlinearity {
            Some(curve) => self.full_well * curve.read(electrons / self.full_well),
            None => electrons,
        }
    }

    /// The electrons of which so many are read, and what one more of them adds to that.
    pub(crate) fn collected_of(&self, read: f64) -> (f64, f64) {
        match &self.effects.nonlinearity {
            Some(curve) => {
                let share = curve.collected(read / self.full_well);
                (self.full_well * share, curve.slope(share))
            }
            None => (read, 1.0),
        }
    }

    /// Fills and checks a spec.
    pub(crate) fn new(spec: &SensorSpec) -> Result<Self, SensorError> {
        let spec = &*at_its_iso(spec)?;
        let preset = spec.model.map(Model::preset);
        let counts = spec.system_gain.is_some() || preset.is_some();
        let noise =
            spec.noise.unwrap_or(if counts { NoiseModel::Poisson } else { NoiseModel::None });
        // Each value as it is written, else of the preset, else that of an ideal sensor.
        let mut settings = Self {
            resolution: spec.resolution.or(preset.map(|p| p.resolution.value)).unwrap_or([1024; 2]),
            pixel_pitch: spec
                .pixel_pitch
                .map(|pitch| pitch.0)
                .or(preset.map(|p| p.pixel_pitch.value))
                .unwrap_or(5.0),
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
            prnu: spec.prnu.or(preset.map(|p| p.prnu.value)).unwrap_or(0.0),
            dsnu: spec.dsnu.or(preset.map(|p| p.dsnu.value)).unwrap_or(0.0),
            row_noise: spec.row_noise.unwrap_or(0.0),
            column_noise: spec.column_noise.unwrap_or(0.0),
            row_pattern: spec.row_pattern.unwrap_or(0.0),
            column_pattern: spec.column_pattern.unwrap_or(0.0),
            dcnu: spec.dcnu.unwrap_or(0.0),
            dead: spec.dead_pixels.unwrap_or(0.0),
            stuck: spec.stuck_pixels.unwrap_or(0.0),
            crosstalk: spec.crosstalk.unwrap_or(0.0),
            exposures: match &spec.exposures {
                Some(several) => several.iter().map(|time| time.0).collect(),
                None => vec![spec.exposure.map_or(0.01, |time| time.0)],
            },
            frames: spec.frames.unwrap_or(1),
            noise,
            serial: spec.serial.unwrap_or(0),
            radiometry: spec.radiometry.unwrap_or_default(),
            sensitivity: 1.0,
            readout: ReadoutPath::First,
            effects: Arc::default(),
            notes: Vec::new(),
        };
        settings.amplify(spec)?;
        // Values that contradict one another are refused, and the dark current is brought to the
        // temperature.
        settings.check_pixels()?;
        settings.check_electrons()?;
        settings.check_converter(spec.full_well)?;
        settings.check_exposures(spec)?;
        settings.check_use(spec)?;
        settings.effects = Arc::new(Effects::new(spec, settings.resolution, settings.full_well)?);
        settings.warm(spec)?;
        Ok(settings)
    }

    /// Takes the gain and the noise of the read-out behind the amplifier.
    fn amplify(&mut self, spec: &SensorSpec) -> Result<(), SensorError> {
        let factor = spec.analog_gain.unwrap_or(1.0);
        within("analog_gain", factor, [1e-6, 1e6], "a factor above 0 (1e-6 to 1e6)")?;
        self.gain *= factor;
        let of_converter = spec.converter_noise.unwrap_or(0.0);
        within("converter_noise", of_converter, [0.0, 65_535.0], "DN, 0 or more, up to 65535")?;
        if of_converter > 0.0 && self.gain > 0.0 {
            self.read_noise = self.read_noise.hypot(of_converter / self.gain);
        }
        Ok(())
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
        within("pixel_pitch", self.pixel_pitch, [1e-6, 1e6], "micrometres, above 0, up to 1e6")?;
        self.efficiency
            .clone()
            .within(0.0, 1.0)
            .map(|_| ())
            .map_err(|fault| SensorError::curve("quantum_efficiency", &fault))
    }

    fn check_electrons(&self) -> Result<(), SensorError> {
        let demand = "electrons, 0 or more, up to 1e9";
        for (key, value) in [
            ("read_noise", self.read_noise),
            ("dsnu", self.dsnu),
            ("row_noise", self.row_noise),
            ("column_noise", self.column_noise),
            ("row_pattern", self.row_pattern),
            ("column_pattern", self.column_pattern),
        ] {
            within(key, value, [0.0, MOST_ELECTRONS], demand)?;
        }
        let demand = "electrons a second, 0 or more, up to 1e15";
        within("dark_current", self.dark_current, [0.0, MOST_CURRENT], demand)?;
        let share = |key, value| {
            SensorError::unless((0.0..=1.0).contains(&value), key, value, "a fraction in 0..=1")
        };
        share("prnu", self.prnu)?;
        share("dcnu", self.dcnu)?;
        share("dead_pixels", self.dead)?;
        share("stuck_pixels", self.stuck)?;
        let of_each = "a share of electrons in 0..=0.2: four neighbours get it each";
        within("crosstalk", self.crosstalk, [0.0, 0.2], of_each)?;
        if let Some(hot) = self.hot_pixels {
            share("hot_pixels.share", hot.share)?;
            within("hot_pixels.dark_current", hot.dark_current, [0.0, MOST_CURRENT], demand)?;
        }
        let sum = self.dead + self.stuck + self.hot_pixels.map_or(0.0, |hot| hot.share);
        let demand = "hot, dead and stuck pixels that are all of them at most together";
        SensorError::unless(sum <= 1.0, "stuck_pixels", self.stuck, demand)?;
        Ok(())
    }

    fn check_converter(&self, full_well: Option<f64>) -> Result<(), SensorError> {
        let bits = f64::from(self.bit_depth);
        let demand = "a converter of 1 to 16 bits";
        SensorError::unless((1..=16).contains(&self.bit_depth), "bit_depth", bits, demand)?;
        let demand = "DN per electron, above 0 (1e-9 to 1e9)";
        within("system_gain", self.gain, [1e-9, 1e9], demand)?;
        let demand = "DN, 0 or more and below full scale, 2^bit_depth - 1";
        let inside = (0.0..self.white()).contains(&self.black);
        SensorError::unless(inside, "black_level", self.black, demand)?;
        if let Some(capacity) = full_well {
            let demand = "electrons, above 0 (1e-9 to 1e15)";
            within("full_well", capacity, [1e-9, 1e15], demand)?;
        }
        if self.full_well * self.gain <= 0.5 {
            let Self { full_well, gain, .. } = *self;
            let why = format!(
                "{} e⁻ times the system_gain of {} DN/e⁻ is not half a digital number: every pixel \
                 would be black; one of the two is too small",
                Readable(full_well),
                Readable(gain)
            );
            return Err(Refusal::new(why).at("full_well").into());
        }
        Ok(())
    }

    fn check_exposures(&self, spec: &SensorSpec) -> Result<(), SensorError> {
        let demand = "seconds, above 0 (1e-12 to 1e9)";
        if let Some(exposure) = spec.exposure {
            within("exposure", exposure.0, EXPOSURES, demand)?;
        }
        for &exposure in &self.exposures {
            within("exposures", exposure, EXPOSURES, demand)?;
        }
        SensorError::unless(
            !self.exposures.is_empty(),
            "exposures",
            0.0,
            "one exposure time at least",
        )?;
        let frames = f64::from(self.frames);
        SensorError::unless((1..=100_000).contains(&self.frames), "frames", frames, "1 to 100000")?;
        if spec.hdr == Some(true) {
            let readouts = if spec.second_readout.is_some() { 2.0 } else { 1.0 };
            if self.exposures.len() as f64 * frames * readouts < 2.0 {
                let why = "sensor.hdr merges several: name their times, or a second_readout";
                return Err(SensorError::missing("exposures", why));
            }
            if self.radiometry == Radiometry::Digital {
                let why = "with radiometry `digital` longer exposures have no more light\nhint: set `physical`";
                return Err(SensorError::misplaced("hdr", why));
            }
        }
        if spec.exposure.is_some() && spec.exposures.is_some() {
            let why = "sensor.exposures says it all";
            return Err(SensorError::misplaced("exposure", why));
        }
        if spec.auto_exposure.is_some() {
            if spec.exposure.is_some() || spec.exposures.is_some() {
                let why = "sensor.exposure or sensor.exposures gives the time that it would meter";
                return Err(SensorError::misplaced("auto_exposure", why));
            }
            if self.radiometry == Radiometry::Digital {
                let why = "with radiometry `digital` longer exposures have no more light\nhint: set `physical`";
                return Err(SensorError::misplaced("auto_exposure", why));
            }
        }
        Ok(())
    }

    /// Refuses keys that would silently do nothing.
    fn check_use(&self, spec: &SensorSpec) -> Result<(), SensorError> {
        let raw = spec.kind == SensorKind::Raw;
        if spec.cfa.is_some() && !raw {
            let why = "only a `raw` sensor has a colour filter array";
            return Err(SensorError::misplaced("cfa", why));
        }
        if spec.filters.is_some() && spec.kind == SensorKind::Multispectral {
            let why = "a multispectral sensor has `channels`";
            return Err(SensorError::misplaced("filters", why));
        }
        if spec.filters.is_some() && raw && spec.cfa.is_none() {
            let why = "name the pattern of filters in sensor.cfa";
            return Err(SensorError::missing("cfa", why));
        }
        if spec.channels.is_some() && spec.kind != SensorKind::Multispectral {
            let why = "only a `multispectral` sensor has channels";
            return Err(SensorError::misplaced("channels", why));
        }
        if let Some(Filters::Curves(curves)) = &spec.filters {
            let named = spec.cfa.as_ref().map_or(vec!['r', 'g', 'b'], CfaSpec::letters);
            if curves.keys().any(|letter| !named.contains(letter)) {
                let why = "it has a curve for a letter that no pixel has";
                return Err(SensorError::misplaced("filters", why));
            }
        }
        let electrons = [
            spec.read_noise,
            spec.dark_current,
            spec.full_well,
            spec.dsnu,
            spec.row_noise,
            spec.column_noise,
            spec.row_pattern,
            spec.column_pattern,
            spec.converter_noise,
            spec.hot_pixels.map(|hot| hot.share),
            spec.blooming,
            spec.second_readout.map(|second| second.ratio()),
        ];
        let wants_electrons = self.noise != NoiseModel::None
            || self.radiometry == Radiometry::Physical
            || electrons.iter().flatten().any(|&value| value > 0.0);
        if wants_electrons && !self.counts {
            let why = "noise, dark signal, full well and physical radiometry count electrons, and \
                without the gain K (DN/e⁻) nobody knows how many there are";
            return Err(SensorError::missing("system_gain", why));
        }
        Ok(())
    }

    /// Takes the dark current to the sensor's temperature: `μ_I·2^((ϑ − ϑ_ref)/ϑ_d)`.
    fn warm(&mut self, spec: &SensorSpec) -> Result<(), SensorError> {
        // The temperature, that at which the dark current was measured, and what doubles it.
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
        // Dark current doubles every `doubling` kelvins.
        let factor = ((temperature - reference) / doubling).exp2();
        let demand = "a temperature at which the dark current can be counted";
        let warm = self.dark_current * factor;
        SensorError::unless(warm <= MOST_CURRENT, "temperature", temperature, demand)?;
        self.dark_current = warm;
        if let Some(hot) = &mut self.hot_pixels {
            hot.dark_current = (hot.dark_current * factor).min(MOST_CURRENT);
        }
        Ok(())
    }
}

/// The spec with the numbers of the ISO setting that holds.
pub(crate) fn at_its_iso(spec: &SensorSpec) -> Result<Cow<'_, SensorSpec>, SensorError> {
    let Some(all) = &spec.iso_settings else {
        if spec.iso.is_some() {
            let why = "sensor.iso names one of them";
            return Err(SensorError::missing("iso_settings", why));
        }
        return Ok(Cow::Borrowed(spec));
    };
    if spec.system_gain.is_some() {
        let why = "sensor.iso_settings has the gain of each setting";
        return Err(SensorError::misplaced("system_gain", why));
    }
    let Some(first) = all.first() else {
        let why = "name one setting at least";
        return Err(SensorError::missing("iso_settings", why));
    };
    for (index, setting) in all.iter().enumerate() {
        within("iso_settings.iso", setting.iso, [1e-3, 1e9], "a number above 0 (1e-3 to 1e9)")?;
        if all[..index].iter().any(|other| other.iso == setting.iso) {
            let demand = "settings of different numbers";
            return Err(SensorError::Value { key: "iso_settings.iso", value: setting.iso, demand });
        }
    }
    let iso = spec.iso.unwrap_or(first.iso);
    let Some(setting) = all.iter().find(|setting| setting.iso == iso) else {
        let known: Vec<String> = all.iter().map(|setting| setting.iso.to_string()).collect();
        let why = format!(
            "there is no setting {}: sensor.iso_settings has {}",
            Readable(iso),
            known.join(", ")
        );
        return Err(Refusal::new(why).at("iso").into());
    };
    Ok(Cow::Owned(SensorSpec {
        system_gain: Some(setting.system_gain),
        read_noise: setting.read_noise.or(spec.read_noise),
        full_well: setting.full_well.or(spec.full_well),
        black_level: setting.black_level.or(spec.black_level),
        ..spec.clone()
    }))
}

fn positive(key: &'static str, value: f64, demand: &'static str) -> Result<(), SensorError> {
    SensorError::unless(value > 0.0 && value.is_finite(), key, value, demand)
}

fn within(
    key: &'static str,
    value: f64,
    [low, high]: [f64; 2],
    demand: &'static str,
) -> Result<(), SensorError> {
    SensorError::unless((low..=high).contains(&value), key, value, demand)
}

fn not_negative(key: &'static str, value: f64, demand: &'static str) -> Result<(), SensorError> {
    SensorError::unless(value >= 0.0 && value.is_finite(), key, value, demand)
}
