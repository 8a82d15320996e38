//! Exposures of different times merged to one picture of high dynamic range.
//!
//! A pixel's number `y` of an exposure of `T` seconds says that light freed `r = ((y − b)/K − μ_I·T)/T` electrons a
//! second, with the variance
//!
//! ```text
//! v = (r·T + μ_I·T + σ² + 1/(12·K²)) / T²
//! ```
//!
//! of shot noise, dark signal, read-out and rounding. What is merged is `Σ r/v / Σ 1/v`, whose own variance is
//! `1 / Σ 1/v`: no other weights leave less noise (Granados et al., "Optimal HDR reconstruction with linear digital
//! cameras", CVPR 2010). The `r` of the weights is that of the longest exposure which counts, the same for all.
//!
//! Whether an exposure may be saturated is judged by the one before, which is shorter: to leave out what came out
//! saturated would keep those of the others that noise made too dark. Where that judgement goes by chance it favours
//! the bright among the shorter ones, by 0.4 of their standard deviation at most.

use rayon::prelude::*;

use crate::film::{Exposure, RawImage};
use crate::{Sensor, SensorError};

/// Standard deviations that a pixel stays below saturation by.
const MARGIN: f64 = 4.0;

/// A picture merged of several exposures.
#[derive(Debug, Clone, PartialEq)]
pub struct HdrImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers a pixel.
    pub depth: usize,
    /// Photo-electrons a second, `[row][column][channel]`; of pixels that are saturated in the shortest exposure what
    /// they have at least.
    pub rate: Vec<f32>,
    /// Their standard deviations (e⁻/s); +inf of those pixels.
    pub sigma: Vec<f32>,
    /// How many numbers are of such pixels.
    pub saturated: u64,
}

/// What is known of a pixel before exposures are weighed.
#[derive(Debug, Clone, Copy)]
struct Pilot {
    /// Exposures that count, the shortest first; 0 of a pixel that is saturated in that.
    count: usize,
    /// Electrons a second by the longest of them.
    rate: f64,
}

impl Sensor {
    /// Merges what `expose` gives of each of `shots`, which may come in any order, each twice.
    ///
    /// # Errors
    ///
    /// Those of `expose`.
    pub fn merged<E: From<SensorError>>(
        &self,
        shots: &[Exposure],
        mut expose: impl FnMut(Exposure) -> Result<RawImage, E>,
    ) -> Result<HdrImage, E> {
        let mut shots = shots.to_vec();
        shots.sort_by(|a, b| a.exposure.total_cmp(&b.exposure).then(a.frame.cmp(&b.frame)));
        let Some(first) = shots.first() else {
            let why = "nothing to merge: name several exposures";
            return Err(SensorError::Missing { key: "exposures", why }.into());
        };
        // Which exposures count.
        let RawImage { width, height, depth, values, .. } = expose(*first)?;
        let mut before = first.exposure;
        // Below a full well reads what the read-out takes from it.
        let of_read_out = self.dark_noise(0.0).hypot(self.non_uniformity()[1]);
        let limit = self.saturation_level() - MARGIN * self.system_gain() * of_read_out;
        let mut pilots: Vec<Pilot> = values
            .par_iter()
            .map(|&y| Pilot {
                count: usize::from(f64::from(y) < limit),
                rate: self.rate(y, first.exposure),
            })
            .collect();
        for (number, shot) in shots.iter().enumerate().skip(1) {
            let image = expose(*shot)?;
            pilots.par_iter_mut().zip(&image.values).for_each(|(pilot, &y)| {
                let may_saturate = !self.stays_below(pilot.rate, before, shot.exposure);
                if pilot.count == number && !may_saturate {
                    *pilot = Pilot { count: number + 1, rate: self.rate(y, shot.exposure) };
                }
            });
            before = shot.exposure;
        }
        // Those together.
        let mut sums = vec![[0.0; 2]; pilots.len()];
        for (number, shot) in shots.iter().enumerate() {
            let image = expose(*shot)?;
            let pixels = sums.par_iter_mut().zip(&pilots).zip(&image.values);
            pixels.for_each(|(([weighed, weight], pilot), &y)| {
                if number < pilot.count {
                    let own = 1.0 / self.variance_of_rate(pilot.rate, shot.exposure);
                    *weighed += own * self.rate(y, shot.exposure);
                    *weight += own;
                }
            });
        }
        let saturated = pilots.par_iter().filter(|pilot| pilot.count == 0).count() as u64;
        #[expect(clippy::cast_possible_truncation, reason = "a picture of floats")]
        let both =
            sums.par_iter().zip(&pilots).map(|(&[weighed, weight], pilot)| match weight > 0.0 {
                true => [(weighed / weight) as f32, (1.0 / weight).sqrt() as f32],
                false => [pilot.rate as f32, f32::INFINITY],
            });
        let (rate, sigma) = both.map(|[rate, sigma]| (rate, sigma)).unzip();
        Ok(HdrImage { width, height, depth, rate, sigma, saturated })
    }

    /// Photo-electrons a second that a number stands for.
    fn rate(&self, y: u16, exposure: f64) -> f64 {
        let electrons = (f64::from(y) - self.black_level()) / self.system_gain();
        electrons / exposure - self.dark_current()
    }

    /// The variance of [`Self::rate`], where so many electrons a second are freed.
    fn variance_of_rate(&self, rate: f64, exposure: f64) -> f64 {
        let rounding = 1.0 / (12.0 * self.system_gain() * self.system_gain());
        let electrons = rate.max(0.0) * exposure + self.dark_noise(exposure).powi(2) + rounding;
        electrons / (exposure * exposure)
    }

    /// Whether a pixel, of which so many electrons a second were found in the time `before`, is not saturated in
    /// the time `exposure`.
    fn stays_below(&self, rate: f64, before: f64, exposure: f64) -> bool {
        let found = self.variance_of_rate(rate, before) + self.variance_of_rate(rate, exposure);
        let most = (rate + self.dark_current() + MARGIN * found.sqrt()) * exposure;
        most < self.saturation()
    }
}
