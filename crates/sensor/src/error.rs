//! Why a sensor is refused.

use etendue_spectrum::CurveError;

/// Why a sensor is refused, or cannot do what is asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A number that its meaning does not allow.
    #[error("sensor.{key} is {value}: {demand}")]
    Value {
        /// Which key.
        key: &'static str,
        /// What it is.
        value: f64,
        /// What it must be.
        demand: &'static str,
    },
    /// A key that is needed here and absent.
    #[error("sensor.{key} is missing: {why}")]
    Missing {
        /// Which key.
        key: &'static str,
        /// What needs it.
        why: &'static str,
    },
    /// A key that means nothing here.
    #[error("sensor.{key} is of no use here: {why}")]
    Misplaced {
        /// Which key.
        key: &'static str,
        /// Why.
        why: &'static str,
    },
    /// A curve that is none, or leaves its bounds.
    #[error("sensor.{key}: {fault}")]
    Curve {
        /// Which key.
        key: String,
        /// What is wrong.
        fault: CurveError,
    },
    /// The full well holds less than the black level stands for.
    #[error(
        "sensor.full_well is {full_well} e⁻, less than the black level's worth of {black} e⁻ \
         (black_level / system_gain): every pixel would be black"
    )]
    FullWell {
        /// The full well (e⁻).
        full_well: f64,
        /// Black level over gain (e⁻).
        black: f64,
    },
    /// A colour filter array that is not a rectangle of letters.
    #[error("sensor.cfa: {0}")]
    Pattern(String),
    /// A letter of the colour filter array without a curve.
    #[error(
        "sensor.cfa names the filter `{letter}`, for which there is no curve: add it to \
         sensor.filters, or use r, g, b or w"
    )]
    UnknownFilter {
        /// The letter.
        letter: char,
    },
    /// A channel that sees nothing of the spectral lanes.
    #[error(
        "the channel `{channel}` sees nothing of {}..={} nm, the wavelengths of the render's \
         spectral lanes: the image would be black", lanes[0], lanes[1]
    )]
    Blind {
        /// Which channel.
        channel: String,
        /// The range of the lanes (nm).
        lanes: [f64; 2],
    },
    /// A quantum efficiency of nothing at the wavelength of a characterisation.
    #[error("the sensor has no quantum efficiency at {wavelength} nm: choose another --wavelength")]
    BlindAt {
        /// The wavelength (nm).
        wavelength: f64,
    },
    /// A film that is not this sensor's.
    #[error(
        "the film has {film} values, {width} × {height} pixels of {lanes} spectral lanes need {}",
        width * height * lanes
    )]
    Film {
        /// How many values it has.
        film: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Lanes of the sensor.
        lanes: usize,
    },
    /// A series that is too short to be characterised, or too long.
    #[error("{steps} exposure steps asked for: a characterisation needs 20 to 10000")]
    Steps {
        /// How many were asked for.
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
}
