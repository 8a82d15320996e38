//! When the samples of a pixel are enough: what the scene asks for, as far as it can be had.

use std::ops::Range;
use std::time::Duration;

use etendue_scene::Scene;
use etendue_scene::file::{SAMPLES_AT_ONCE, SamplesSpec};
use etendue_sensor::NoiseModel;

/// The relative error that stands in for a sensor's noise where there is none.
const WITHOUT_NOISE: f64 = 0.02;

/// When the samples of a pixel are enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stopping {
    /// When they are as many as were asked for.
    Count,
    /// When the variance of their mean is less than this share of the sensor's own at that signal.
    SensorNoise(f64),
    /// When the standard deviation of their mean is less than this share of it.
    RelativeError(f64),
    /// When they took so long.
    Time(Duration),
}

impl Stopping {
    /// What is held to for `scene`, and why it is not what the scene asks for.
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
                let note = format!(
                    "samples: {why}, so there is nothing to stop at; they stop at a relative error of \
                     {} % instead, as `\"samples\": {{\"relative_error\": {WITHOUT_NOISE}}}` says",
                    100.0 * WITHOUT_NOISE
                );
                (Self::RelativeError(WITHOUT_NOISE), Some(note))
            }
        }
    }

    /// Whether pixels get different numbers of samples.
    #[must_use]
    pub fn is_adaptive(self) -> bool {
        matches!(self, Self::SensorNoise(_) | Self::RelativeError(_))
    }

    /// How long samples are taken, where that is what ends them.
    #[must_use]
    pub fn time(self) -> Option<Duration> {
        match self {
            Self::Time(time) => Some(time),
            Self::Count | Self::SensorNoise(_) | Self::RelativeError(_) => None,
        }
    }

    /// The choice and the reason, in words.
    pub(crate) fn words(self, samples: SamplesSpec, note: Option<&String>) -> (String, String) {
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
        let because = match (self, note) {
            (_, Some(note)) => note.trim_start_matches("samples: ").to_owned(),
            (Self::SensorNoise(_), _) => format!(
                "{least} to {most} a pixel, block by block: more would be lost in the variance that \
                 shot, read-out, dark current and quantisation have at the pixel's signal"
            ),
            (Self::RelativeError(_) | Self::Count | Self::Time(_), _) => format!(
                "{least} to {most} a pixel, block by block, by the differences of their sets"
            ),
        };
        (choice, because)
    }
}

/// The passes of samples that are judged on the way: after the fewest that there may be, and then
/// whenever they have become a quarter more. A step of a factor is overshot by half of it on average,
/// and each judgement costs a look at all sums.
pub(crate) fn judged_passes(least: u32, most: u32) -> Vec<Range<u32>> {
    let mut passes: Vec<Range<u32>> = std::iter::once(0..least.min(most)).collect();
    while let Some(end) = passes.last().map(|pass| pass.end).filter(|end| *end < most) {
        let more = (end / 4).next_multiple_of(SAMPLES_AT_ONCE).max(SAMPLES_AT_ONCE);
        passes.push(end..most.min(end.saturating_add(more)));
    }
    passes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judged_passes_cover_all_samples_in_whole_sets() {
        for (least, most) in [(4, 4), (16, 16), (16, 4096), (64, 1 << 20), (8, 12), (4096, 16)] {
            let passes = judged_passes(least, most);
            assert_eq!((passes[0].start, passes[0].end), (0, least.min(most)));
            assert_eq!(passes.last().unwrap().end, most);
            assert!(passes.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert!(passes.iter().all(|pass| pass.len() % 4 == 0), "{passes:?}");
            assert!(passes[1..].iter().all(|pass| pass.end <= pass.start + pass.start / 4 + 4));
            assert!(passes.len() < 60, "{}", passes.len());
        }
    }
}
