//! When the error of a block's samples is small enough.

use etendue_scene::Scene;
use etendue_scene::file::SETS;

use super::halves::Half;
use crate::Plan;
use crate::expose::NoiseOfPixels;
use crate::stopping::Stopping;

/// What the error of samples is held against.
pub(crate) enum Rule {
    /// The noise of the sensor, of which the variance of the samples' mean may be this share.
    SensorNoise(Box<NoiseOfPixels>, f64),
    /// The light itself, of which the standard deviation may be this share.
    RelativeError(f64),
}

impl Rule {
    /// The rule of a plan; `None` where the number of samples is given.
    pub(crate) fn of(scene: &Scene, plan: &Plan) -> Option<Self> {
        match plan.stopping {
            Stopping::Count | Stopping::Time(_) => None,
            Stopping::RelativeError(share) => Some(Self::RelativeError(share)),
            Stopping::SensorNoise(share) => {
                let noise = NoiseOfPixels::of(scene, &plan.bands)?;
                Some(Self::SensorNoise(Box::new(noise), share))
            }
        }
    }

    /// The variance of the mean of some pixels' samples, by those of one half of them, as a share of what
    /// is allowed: in the mean over the pixels. `samples` is what each pixel has.
    pub(super) fn error<'a>(&self, halves: impl Iterator<Item = Half<'a>>, samples: u32) -> f64 {
        let of_set = f64::from(samples / SETS);
        match self {
            Self::SensorNoise(noise, share) => {
                let (mut sum, mut count) = (0.0, 0.0);
                for Half { pixel, sets: [a, b] } in halves {
                    let light = |set: usize, band: usize| [a, b][set][band].total() / of_set;
                    sum += noise.share(pixel, light);
                    count += 1.0;
                }
                sum / f64::max(count, 1.0) / share
            }
            Self::RelativeError(share) => {
                let (mut variance, mut mean, mut count) = (0.0, 0.0, 0.0);
                for Half { sets: [a, b], .. } in halves {
                    for (a, b) in a.iter().zip(b) {
                        let [a, b] = [a.total() / of_set, b.total() / of_set];
                        variance += variance_of_mean(a - b);
                        mean += 0.5 * (a + b);
                        count += 1.0;
                    }
                }
                if variance <= 0.0 {
                    return 0.0;
                }
                variance * count / (mean * mean) / (share * share)
            }
        }
    }
}

/// The variance of the mean of four sets, by the difference of the means of two: that of one set is
/// half of its square.
pub(crate) fn variance_of_mean(difference: f64) -> f64 {
    difference * difference / f64::from(2 * SETS)
}
