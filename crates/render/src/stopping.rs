//! Stopping rule of a pixel's samples: what the scene asks for, as far as it can be had.

use std::time::Duration;

use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use etendue_sensor::NoiseModel;

/// Stopping rule of a pixel's samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stopping {
    /// The number of samples that was asked for.
    Count,
    /// The variance of their mean falls below this share of the sensor's own at that signal.
    SensorNoise(f64),
    /// The standard deviation of their mean falls below this share of it.
    RelativeError(f64),
    /// The time that the samples take reaches this limit.
    Time(Duration),
}

impl Stopping {
    /// Rule that is held to for `scene`, and the reason why it is not what the scene asks for.
    pub(crate) fn of(scene: &Scene) -> (Self, Option<String>) {
        match scene.render.samples {
            SamplesSpec::Count(_) => (Self::Count, None),
            SamplesSpec::RelativeError(spec) => (Self::RelativeError(spec.relative_error), None),
            SamplesSpec::Time(spec) => {
                let time = Duration::try_from_secs_f64(spec.time.0).unwrap_or(Duration::MAX);
                (Self::Time(time), None)
            }
            SamplesSpec::SensorNoise(spec) => {
                let why = match &scene.sensor {
                    None => "the camera has no sensor that exposes the picture",
                    Some(sensor) if sensor.noise() == NoiseModel::None => "the sensor has no noise",
                    Some(_) => return (Self::SensorNoise(spec.fraction), None),
                };
                let error = scene.accuracy.sample_error;
                let why = format!(
                    "{why}, so there is nothing to stop at; they stop at a relative error of \
                     {} % instead, as `\"samples\": {{\"relative_error\": {error}}}` says",
                    100.0 * error
                );
                (Self::RelativeError(error), Some(why))
            }
        }
    }

    /// True if pixels get different numbers of samples.
    #[must_use]
    pub fn is_adaptive(self) -> bool {
        matches!(self, Self::SensorNoise(_) | Self::RelativeError(_))
    }

    /// Time limit of the samples, where that is what ends them.
    #[must_use]
    pub fn time(self) -> Option<Duration> {
        match self {
            Self::Time(time) => Some(time),
            Self::Count | Self::SensorNoise(_) | Self::RelativeError(_) => None,
        }
    }

    /// The choice and the reason, in words.
    pub(crate) fn words(self, samples: SamplesSpec, instead: Option<&String>) -> (String, String) {
        let [least, most] = [samples.least(), samples.most()];
        let choice = match self {
            Self::Count => return (format!("{most} a pixel"), "render.samples says so".to_owned()),
            Self::Time(time) => {
                let why = format!("as many as fit into the time, {most} at most");
                return (format!("{} s", time.as_secs_f64()), why);
            }
            Self::SensorNoise(share) => format!("until {share} of the sensor's noise"),
            Self::RelativeError(share) => format!("until an error of {share}"),
        };
        let because = match (self, instead) {
            (_, Some(why)) => why.clone(),
            (Self::SensorNoise(_), _) => format!(
                "{least} to {most} a pixel, block by block: more would be lost in the variance that \
                 shot, read-out, dark current and quantisation have at the pixel's signal"
            ),
            (Self::RelativeError(_) | Self::Count | Self::Time(_), _) => {
                format!("{least} to {most} a pixel, block by block, by how far their halves differ")
            }
        };
        (choice, because)
    }
}
