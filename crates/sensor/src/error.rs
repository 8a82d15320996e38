//! Errors of sensors that are refused.

use std::fmt;

use etendue_report::Refusal;
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
    /// Anything else; its place is the key.
    Refused(Refusal),
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

    /// Error of a key that is needed here and absent; `why` says what needs it.
    pub(crate) fn missing(key: &str, why: &str) -> Self {
        Refusal::new(format!("is missing: {why}")).at(key).into()
    }

    /// Error of a key that means nothing here.
    #[must_use]
    pub fn misplaced(key: &str, why: &str) -> Self {
        Refusal::new(format!("is of no use here: {why}")).at(key).into()
    }

    /// Error of a curve that is none, or leaves its bounds.
    pub(crate) fn curve(key: &str, fault: &CurveError) -> Self {
        Refusal::new(fault.to_string()).at(key).into()
    }

    /// Error of a channel that sees nothing of the spectral bands, whose range is `from` to `to` (nm); `key` holds its
    /// curve.
    #[must_use]
    pub fn blind(key: &str, channel: &str, [from, to]: [f64; 2]) -> Self {
        let why = format!(
            "the channel `{channel}` sees nothing of {from}..={to} nm, the wavelengths that are \
             rendered: the image would be black"
        );
        let remedy = "give it a curve (in `filters`, or as `quantum_efficiency`) or `bands` that overlap; ideal r, g \
                      and b pass visible light alone";
        Refusal::new(why).hint(remedy).at(key).into()
    }

    /// Error of a film of `values` numbers, which is not of the sensor's width, height and number of bands.
    pub(crate) fn film(values: usize, [width, height, bands]: [usize; 3]) -> Self {
        let why = format!(
            "the film has {values} values, {width} × {height} pixels of {bands} spectral bands need {}",
            width * height * bands
        );
        Refusal::new(why).into()
    }

    /// The key at fault inside of the sensor (`system_gain`, `filters.r`); empty when it is the
    /// sensor as a whole, or not the sensor.
    #[must_use]
    pub fn at(&self) -> &str {
        match self {
            Self::Value { key, .. } => key,
            Self::Refused(refusal) => refusal.place(),
        }
    }

    /// Description of the error, and of what is valid, without the key.
    #[must_use]
    pub fn why(&self) -> String {
        match self {
            Self::Value { value, demand, .. } => {
                format!("expected {demand}, found {}", Readable(*value))
            }
            Self::Refused(refusal) => refusal.clone().without_place().to_string(),
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

impl From<Refusal> for SensorError {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

/// A number as people write it: neither 300 digits nor 300 zeros.
pub(crate) struct Readable(pub(crate) f64);

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
