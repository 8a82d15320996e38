//! When the error of a block's samples is small enough.

use super::halves::Sampled;
use crate::Plan;
use crate::expose::NoiseOfPixels;
use crate::samples::of_first_set;
use crate::stopping::Stopping;
use etendue_scene::Scene;
use etendue_scene::file::AccuracySpec;

/// The normal deviate that one of a thousand exceeds.
const ONE_IN_A_THOUSAND: f64 = 3.0902;

/// When samples are enough.
pub(crate) struct Rule {
    /// Not before there are so many of each pixel.
    pub(crate) least: u32,
    /// The error of blocks around that a block does not wait for, as a share of what is allowed: they will
    /// get about so many times its samples.
    pub(super) wait: f64,
    /// What the error may be for half as many samples again to do: they leave two thirds of a variance at most
    /// ([`super::convergence`]).
    pub(super) half_step: f64,
    allowed: Allowed,
}

/// What the error of samples is held against.
enum Allowed {
    /// The noise of the sensor, of which the variance of the samples' mean may be this share.
    SensorNoise(Box<NoiseOfPixels>, f64),
    /// The light itself, of which the standard deviation may be this share.
    RelativeError(f64),
}

impl Rule {
    /// The rule of a plan; `None` where the number of samples is given.
    pub(crate) fn of(scene: &Scene, plan: &Plan) -> Option<Self> {
        let allowed = match plan.stopping {
            Stopping::Count | Stopping::Time(_) => return None,
            Stopping::RelativeError(share) => Allowed::RelativeError(share),
            Stopping::SensorNoise(share) => {
                let noise = NoiseOfPixels::of(scene, &plan.bands)?;
                Allowed::SensorNoise(Box::new(noise), share)
            }
        };
        let AccuracySpec { sample_wait: wait, sample_half_step: half_step, .. } = scene.accuracy;
        Some(Self { least: scene.render.samples.least(), wait, half_step, allowed })
    }

    /// The variance of the mean of two sets of some pixels' samples as a share of what is allowed, as if
    /// each were for itself: in the mean over the pixels. `samples` is what each pixel has. `None` of no
    /// pixels.
    pub(super) fn error<'a>(
        &self,
        pixels: impl Iterator<Item = Sampled<'a>>,
        samples: u32,
    ) -> Option<f64> {
        let of_set = sizes(samples);
        let mut count = 0.0;
        match &self.allowed {
            Allowed::SensorNoise(noise, share) => {
                let mut sum = 0.0;
                for Sampled { pixel, sets: [a, b] } in pixels {
                    let light = |set: usize, band: usize| [a, b][set][band].total() / of_set[set];
                    sum += noise.share(pixel, light);
                    count += 1.0;
                }
                (count > 0.0).then(|| sum / count / share)
            }
            Allowed::RelativeError(share) => {
                // Two sets differ by twice the variance of their mean.
                let (mut variance, mut mean) = (0.0, 0.0);
                for Sampled { sets: [a, b], .. } in pixels {
                    for (a, b) in a.iter().zip(b) {
                        let [a, b] = [a.total() / of_set[0], b.total() / of_set[1]];
                        variance += variance_of_mean(a - b);
                        mean += 0.5 * (a + b);
                        count += 1.0;
                    }
                }
                let error = || match variance > 0.0 {
                    true => variance * count / (mean * mean) / (share * share),
                    false => 0.0,
                };
                (count > 0.0).then(error)
            }
        }
    }
}

/// Samples in each of the two sets that `samples` are of.
pub(super) fn sizes(samples: u32) -> [f64; 2] {
    let first = of_first_set(samples).min(samples);
    [first, samples - first].map(|count| f64::from(count.max(1)))
}

/// The variance of the mean of two independent sets of one size, by the difference of their means: a quarter
/// of its square.
pub(crate) fn variance_of_mean(difference: f64) -> f64 {
    0.25 * difference * difference
}

/// The mean of so many squares of independent normal differences, over its expected value, that chance exceeds once
/// in a thousand: of χ² of as many degrees of freedom, by E. B. Wilson and M. M. Hilferty, "The distribution of
/// chi-square", 1931. It is 1.96 of half a block's 32 pixels, and more of the few in a block that the edge of the
/// picture cuts.
pub(super) fn by_chance(pixels: usize) -> f64 {
    let spread = 2.0 / (9.0 * pixels.max(1) as f64);
    (1.0 - spread + ONE_IN_A_THOUSAND * spread.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of χ² at 0.999 (M. Abramowitz and I. A. Stegun, *Handbook of Mathematical Functions*, table 26.8).
    #[test]
    fn chance_is_that_of_chi_square() {
        for (degrees, quantile) in
            [(1, 10.828), (4, 18.467), (8, 26.125), (16, 39.252), (32, 62.487)]
        {
            let found = by_chance(degrees) * degrees as f64;
            // The cube root is nearly normal: to 3 % of one square, and far less of many.
            assert!(
                (found / quantile - 1.0).abs() < 0.04 / (degrees as f64).sqrt(),
                "{degrees}: {found}"
            );
        }
    }
}
