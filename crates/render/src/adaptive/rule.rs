//! Rule of when the error of a block's samples is small enough.

use super::sampled::PixelSets;
use crate::Plan;
use crate::expose::NoiseOfPixels;
use crate::stopping::Stopping;
use crate::sum::variance_of_mean;
use etendue_scene::Scene;

/// Rule of when samples are enough.
pub(crate) struct Rule {
    /// Not before there are so many of each pixel.
    pub(crate) least: u32,
    /// Standard errors of a block's variance that are added to it.
    pub(super) sigmas: f64,
    /// Share of a block's mean variance that each of its pixels is reckoned to have in any case: what none of those
    /// around it happened to tell.
    pub(super) floor: f64,
    /// The most samples that a pixel gets in a round, as a share of what it has: the variance of Sobol points falls
    /// faster than their number grows, and what a round takes too many is lost.
    pub(super) growth: f64,
    reference: ErrorReference,
}

/// Reference of the error of samples.
enum ErrorReference {
    /// The noise of the sensor, of which the variance of the samples' mean may be this share.
    SensorNoise(Box<NoiseOfPixels>, f64),
    /// The light itself, of which the standard deviation may be this share.
    RelativeError(f64),
}

/// Noise that the samples of a pixel tell.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelNoise {
    /// The variance of their mean: as a share of what the sensor's noise allows, or of light.
    pub(super) variance: f64,
    /// The mean of the light over its bands.
    pub(super) light: f64,
}

impl Rule {
    /// The rule of a plan; `None` where the number of samples is given.
    pub(crate) fn of(scene: &Scene, plan: &Plan) -> Option<Self> {
        let reference = match plan.stopping {
            Stopping::Count | Stopping::Time(_) => return None,
            Stopping::RelativeError(share) => ErrorReference::RelativeError(share),
            Stopping::SensorNoise(share) => {
                let noise = NoiseOfPixels::of(scene, &plan.bands)?;
                ErrorReference::SensorNoise(Box::new(noise), share)
            }
        };
        Some(Self {
            least: scene.render.samples.least(),
            sigmas: scene.accuracy.sample_sigmas,
            floor: scene.accuracy.sample_floor,
            growth: scene.accuracy.sample_growth,
            reference,
        })
    }

    /// A relative error, with so many standard errors.
    #[cfg(test)]
    pub(super) fn of_relative_error(share: f64, sigmas: f64) -> Self {
        let reference = ErrorReference::RelativeError(share);
        Self { least: 4, sigmas, floor: 0.1, growth: 0.5, reference }
    }

    /// Noise that the two sets of a pixel's samples tell, `a_set` being the number in each.
    pub(super) fn noise(
        &self,
        PixelSets { pixel, sets: [a, b] }: &PixelSets<'_>,
        a_set: u32,
    ) -> PixelNoise {
        let a_set = f64::from(a_set.max(1));
        let of_set = |set: usize, band: usize| [a, b][set][band].total() / a_set;
        let (mut variance, mut light) = (0.0, 0.0);
        for band in 0..a.len() {
            let [a, b] = [of_set(0, band), of_set(1, band)];
            variance += variance_of_mean(a - b);
            light += 0.5 * (a + b);
        }
        let bands = a.len().max(1) as f64;
        let variance = match &self.reference {
            ErrorReference::SensorNoise(noise, share) => noise.share(*pixel, of_set) / share,
            ErrorReference::RelativeError(_) => variance / bands,
        };
        PixelNoise { variance, light: light / bands }
    }

    /// The variance that is allowed where the light is `light` in the mean, in the unit of [`PixelNoise::variance`].
    pub(super) fn allowed(&self, light: f64) -> f64 {
        match &self.reference {
            ErrorReference::SensorNoise(..) => 1.0,
            ErrorReference::RelativeError(share) => (share * light).powi(2),
        }
    }
}
