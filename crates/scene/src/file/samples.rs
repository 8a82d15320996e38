//! Samples per pixel: a number, or what they are to reach.

use etendue_camera::sampler::Sampler;
use etendue_geometry::units::Seconds;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The sets that the samples of a pixel are of where they go on until an error is reached.
pub const SETS: u32 = 2;

/// The fewest samples that an error is told by; `max` is a multiple of it.
pub const LEAST_SAMPLES: u32 = 4;

/// Number of samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum SamplesSpec {
    /// So many.
    Count(#[schemars(range(min = 1, max = 1_048_576))] u32),
    /// As many as it takes for their error to be lost in the sensor's noise.
    SensorNoise(SensorNoiseSpec),
    /// As many as it takes for an error relative to the light.
    RelativeError(RelativeErrorSpec),
    /// As many as a time is enough for, the same number for each pixel.
    Time(TimeSpec),
}

/// Samples until their error is lost in the sensor's noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorNoiseSpec {
    /// Goal of the samples.
    pub until: Until,
    /// The variance of the samples' mean, as a share of the sensor's own at that signal (above 0, at
    /// most 1).
    #[serde(default = "tenth")]
    #[schemars(range(min = 0, max = 1))]
    pub fraction: f64,
    /// Samples that each pixel gets in any case; rounded up to an even number, four at least.
    #[serde(default = "four")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub min: u32,
    /// Samples that no pixel gets more of; rounded up to a multiple of four.
    #[serde(default = "four_thousand")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub max: u32,
}

/// Goal of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Until {
    /// The noise of the camera's sensor.
    #[serde(rename = "sensor-noise")]
    SensorNoise,
}

/// Samples until an error relative to the light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelativeErrorSpec {
    /// The standard deviation of the samples' mean, as a share of it (above 0, at most 1).
    #[schemars(range(min = 0, max = 1))]
    pub relative_error: f64,
    /// Samples that each pixel gets in any case; rounded up to an even number, four at least.
    #[serde(default = "four")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub min: u32,
    /// Samples that no pixel gets more of; rounded up to a multiple of four.
    #[serde(default = "four_thousand")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub max: u32,
}

/// Samples for a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeSpec {
    /// Time for which samples are taken (s, above 0). Loading, building and writing are not counted.
    pub time: Seconds,
    /// Samples that no pixel gets more of.
    #[serde(default = "sixty_thousand")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub max: u32,
}

fn tenth() -> f64 {
    0.1
}

fn four() -> u32 {
    LEAST_SAMPLES
}

/// Errors under this are reached by no number of samples.
const LEAST_ERROR: f64 = 1e-9;

fn four_thousand() -> u32 {
    4096
}

fn sixty_thousand() -> u32 {
    65_536
}

impl SamplesSpec {
    /// Samples that no pixel gets more of.
    #[must_use]
    pub fn most(self) -> u32 {
        match self {
            Self::Count(count) => count,
            Self::SensorNoise(SensorNoiseSpec { max, .. })
            | Self::RelativeError(RelativeErrorSpec { max, .. }) => {
                max.next_multiple_of(LEAST_SAMPLES)
            }
            Self::Time(TimeSpec { max, .. }) => max,
        }
    }

    /// Samples that each pixel gets.
    #[must_use]
    pub fn least(self) -> u32 {
        match self {
            Self::Count(count) => count,
            Self::SensorNoise(SensorNoiseSpec { min, .. })
            | Self::RelativeError(RelativeErrorSpec { min, .. }) => {
                min.next_multiple_of(SETS).max(LEAST_SAMPLES).min(self.most())
            }
            Self::Time(_) => 1,
        }
    }

    /// A number to reckon with before anything is known of the picture: the least and the most in the
    /// geometric mean.
    #[must_use]
    pub fn typical(self) -> u32 {
        let product = u64::from(self.least()) * u64::from(self.most());
        u32::try_from(product.isqrt()).unwrap_or(u32::MAX).max(1)
    }

    /// True if pixels get samples until their error is small enough, and so different numbers of
    /// them.
    #[must_use]
    pub fn is_adaptive(self) -> bool {
        matches!(self, Self::SensorNoise(_) | Self::RelativeError(_))
    }
}

/// Fault of `samples`, which `render.samples` of the scene `value` is, with its path.
pub(super) fn fault(
    samples: SamplesSpec,
    sampler: Sampler,
    layers: &[&str],
    value: &Value,
) -> Option<(String, String)> {
    let at = |key: &str, why: &str| Some((format!("render.samples{key}"), why.to_owned()));
    // Rules that never stop, or at once.
    let [min, max] = match samples {
        SamplesSpec::Count(_) | SamplesSpec::Time(_) if !layers.is_empty() => {
            let why = format!(
                "the layer `{}` is of samples that go on until an error is reached\nhint: give \
                 `render.samples` {{\"until\": \"sensor-noise\"}} or {{\"relative_error\": 0.02}}, or \
                 leave the layer out",
                layers[0]
            );
            return Some(("layers".to_owned(), why));
        }
        SamplesSpec::Count(_) => return None,
        SamplesSpec::Time(TimeSpec { time, .. }) if time.0 <= 0.0 => {
            return at(".time", "no samples are taken in no time\nhint: give it more than 0 s");
        }
        SamplesSpec::Time(_) => [0, 0],
        SamplesSpec::SensorNoise(SensorNoiseSpec { fraction, .. }) if fraction < LEAST_ERROR => {
            let why = "sampling would never stop\nhint: give it more than 1e-9, such as 0.1";
            return at(".fraction", why);
        }
        SamplesSpec::RelativeError(RelativeErrorSpec { relative_error, .. })
            if relative_error < LEAST_ERROR =>
        {
            let why = "sampling would never stop\nhint: give it more than 1e-9, such as 0.02";
            return at(".relative_error", why);
        }
        SamplesSpec::SensorNoise(SensorNoiseSpec { min, max, .. })
        | SamplesSpec::RelativeError(RelativeErrorSpec { min, max, .. }) => [min, max],
    };
    // What goes beside a rule: its bounds, and a sampler that needs no number beforehand.
    if min > max {
        let key = match value.pointer("/render/samples/min") {
            Some(_) => ".min",
            None => ".max",
        };
        let why = format!(
            "at least {min} samples and at most {max} is none at all\nhint: give a `min` up to `max`"
        );
        return at(key, &why);
    }
    if matches!(sampler, Sampler::Stratified | Sampler::Hammersley | Sampler::BlueNoise) {
        let why = "has to be told the number of samples beforehand, and `render.samples` is none\
                   \nhint: take `sobol` or `independent`";
        return Some(("render.sampler".to_owned(), why.to_owned()));
    }
    None
}
