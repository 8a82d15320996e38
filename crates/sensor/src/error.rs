//! Errors of sensors that are refused.

use std::fmt;

use etendue_spectrum::CurveError;

/// Error of a sensor that is refused, or cannot do what is asked.
///
/// Its message is `sensor.KEY: reason`, or the reason alone; [`Self::at`] and [`Self::why`] give the
/// two apart, for those who know where in a file the sensor stands.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SensorError {
    /// A number that its meaning does not allow.
    Value {
        /// Name of the key.
        key: &'static str,
        /// Value that was given.
        value: f64,
        /// Description of valid values.
        demand: &'static str,
    },
    /// A key that is needed here and absent.
    Missing {
        /// Name of the key.
        key: &'static str,
        /// Reason: what needs the key.
        why: &'static str,
    },
    /// A key that means nothing here.
    Misplaced {
        /// Name of the key.
        key: &'static str,
        /// Reason.
        why: &'static str,
    },
    /// A curve that is none, or leaves its bounds.
    Curve {
        /// Name of the key.
        key: String,
        /// Fault of the curve.
        fault: CurveError,
    },
    /// The full well holds less than the converter can tell from nothing.
    FullWell {
        /// The full well (e⁻).
        full_well: f64,
        /// The gain (DN/e⁻).
        gain: f64,
    },
    /// A setting of the amplifier that the sensor does not have.
    UnknownIso {
        /// Its number.
        iso: f64,
        /// Those that there are.
        known: Vec<f64>,
    },
    /// A colour filter array that is not a rectangle of letters.
    Pattern(String),
    /// A channel of a multispectral sensor that cannot be called so.
    Channel {
        /// Index of the channel, counted from 0.
        index: usize,
        /// Description of the error in its name.
        why: &'static str,
    },
    /// A letter of the colour filter array without a curve.
    UnknownFilter {
        /// The letter.
        letter: char,
    },
    /// A channel that sees nothing of the spectral bands.
    Blind {
        /// Name of the key that holds the curve.
        key: &'static str,
        /// Name of the channel.
        channel: String,
        /// The range of the bands (nm).
        bands: [f64; 2],
    },
    /// Light of which the sensor sees nothing.
    Dark {
        /// Range in which the sensor sees (nm).
        sensor: [f64; 2],
        /// Range in which the lights shine (nm).
        light: [f64; 2],
    },
    /// A quantum efficiency of nothing at the wavelength of a characterisation.
    BlindAt {
        /// The wavelength (nm).
        wavelength: f64,
    },
    /// A film that is not this sensor's.
    Film {
        /// Number of values of the film.
        film: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Bands of the sensor.
        bands: usize,
    },
    /// A series that is too short to be characterised, or too long.
    Steps {
        /// Number of steps that were asked for.
        steps: usize,
    },
}

impl SensorError {
    /// Refuses `value` unless `allowed`.
    pub(crate) fn unless(
        allowed: bool,
        key: &'static str,
        value: f64,
        demand: &'static str,
    ) -> Result<(), Self> {
        if allowed { Ok(()) } else { Err(Self::Value { key, value, demand }) }
    }

    /// The key at fault inside of the sensor (`system_gain`, `filters.r`); empty when it is the
    /// sensor as a whole, or not the sensor.
    #[must_use]
    pub fn at(&self) -> &str {
        match self {
            Self::Value { key, .. }
            | Self::Missing { key, .. }
            | Self::Misplaced { key, .. }
            | Self::Blind { key, .. } => key,
            Self::Curve { key, .. } => key,
            Self::FullWell { .. } => "full_well",
            Self::Dark { .. } => "quantum_efficiency",
            Self::Pattern(_) | Self::UnknownFilter { .. } => "cfa",
            Self::Channel { .. } => "channels",
            Self::UnknownIso { .. } => "iso",
            Self::BlindAt { .. } | Self::Film { .. } | Self::Steps { .. } => "",
        }
    }

    /// Description of the error, and of what is valid, without the key.
    #[must_use]
    pub fn why(&self) -> String {
        match self {
            Self::Value { value, demand, .. } => {
                format!("expected {demand}, found {}", Readable(*value))
            }
            Self::Missing { why, .. } => format!("is missing: {why}"),
            Self::Misplaced { why, .. } => format!("is of no use here: {why}"),
            Self::Curve { fault, .. } => fault.to_string(),
            Self::FullWell { full_well, gain } => format!(
                "{} e⁻ times the system_gain of {} DN/e⁻ is not half a digital number: every pixel \
                 would be black; one of the two is too small",
                Readable(*full_well),
                Readable(*gain)
            ),
            Self::UnknownIso { iso, known } => {
                let known: Vec<String> = known.iter().map(f64::to_string).collect();
                format!(
                    "there is no setting {}: sensor.iso_settings has {}",
                    Readable(*iso),
                    known.join(", ")
                )
            }
            Self::Pattern(why) => why.clone(),
            Self::Channel { index, why } => format!("the name of channel {index} {why}"),
            Self::UnknownFilter { letter } => format!(
                "names the filter `{letter}`, for which there is no curve: add it to `filters`, or \
                 use r, g, b or w"
            ),
            Self::Blind { channel, bands: [from, to], .. } => format!(
                "the channel `{channel}` sees nothing of {from}..={to} nm, the wavelengths that are \
                 rendered: the image would be black\nhint: give it a curve (in `filters`, or as \
                 `quantum_efficiency`) or `bands` that overlap; ideal r, g and b pass visible light alone"
            ),
            Self::Dark { sensor: [a, b], light: [from, to] } => format!(
                "the sensor sees {a}..={b} nm, the lights shine at {from}..={to} nm: the image would be \
                 black\nhint: give a light the illuminant `a`, `equal_energy` or {{\"black_body\": kelvin}}, \
                 which reach further, or the sensor a curve that reaches into the light"
            ),
            Self::BlindAt { wavelength } => format!(
                "the sensor has no quantum efficiency at {wavelength} nm: choose another --wavelength"
            ),
            Self::Film { film, width, height, bands } => format!(
                "the film has {film} values, {width} × {height} pixels of {bands} spectral bands \
                 need {}",
                width * height * bands
            ),
            Self::Steps { steps } => {
                format!("{steps} exposure steps asked for: a characterisation needs 20 to 10000")
            }
        }
    }
}

impl fmt::Display for SensorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at() {
            "" => f.write_str(&self.why()),
            key => write!(f, "sensor.{key}: {}", self.why()),
        }
    }
}

impl std::error::Error for SensorError {}

/// A number as people write it: neither 300 digits nor 300 zeros.
struct Readable(f64);

impl fmt::Display for Readable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = *self;
        if value == 0.0 || (1e-4..1e15).contains(&value.abs()) {
            write!(f, "{value}")
        } else {
            write!(f, "{value:e}")
        }
    }
}
