//! Exposures of different times, and both numbers of pixels that have two, merged to one picture of high dynamic range.
//!
//! A pixel's number `y` of an exposure of `T` seconds by a photodiode of the sensitivity `q` says that light freed
//! `r = ((y − b)/K − μ_I·T)/(q·T)` electrons a second, with the variance
//!
//! ```text
//! v = (q·r·T + μ_I·T + σ² + 1/(12·K²)) / (q·T)²
//! ```
//!
//! of shot noise, dark signal, read-out and rounding. What is merged is `Σ r/v / Σ 1/v`, whose own variance is
//! `1 / Σ 1/v`: no other weights leave less noise (Granados et al., "Optimal HDR reconstruction with linear digital
//! cameras", CVPR 2010). The `r` of the weights is that of the longest exposure which counts, the same for all.
//!
//! Two readings of the same electrons at two gains have their shot noise in common, which no weights take away: they count
//! together as one number whose read-out has the variance `1 / Σ 1/(σ² + 1/(12·K²))`, each in proportion to its own.
//!
//! Where a sensor is not linear near saturation, `(y − b)/K` is taken through the inverse of its curve first, and `σ` is
//! divided by its slope.
//!
//! A number counts when it lies four standard deviations of the read-out below saturation and all less exposed ones count.
//! Near saturation, where that goes by chance, it favours those that noise made darker: by 0.4 of its own standard deviation at
//! most, the peak of the normal density. To judge it by a less exposed number instead would go by chance over a range
//! that is as many times wider as that number has more noise.

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
    /// Photo-electrons a second (of the first photodiode), `[row][column][channel]`; of pixels that are saturated in the
    /// least exposed number what they have at least.
    pub rate: Vec<f32>,
    /// Their standard deviations (e⁻/s); +inf of those pixels.
    pub sigma: Vec<f32>,
    /// Count of numbers of such pixels.
    pub saturated: u64,
}

/// Knowledge of a pixel before numbers are weighed.
#[derive(Debug, Clone, Copy)]
struct RateEstimate {
    /// Numbers that count, the least exposed first; 0 of a pixel that is saturated in that.
    count: usize,
    /// Electrons a second by the most exposed of them.
    rate: f64,
}

/// One number of each pixel: of a read-out in an exposure.
struct Reading<'a> {
    sensor: &'a Sensor,
    shot: Exposure,
    /// Index of another reading of the same electrons.
    twin: Option<usize>,
}

impl Sensor {
    /// Merges what `expose` gives of each of `shots`, which may come in any order, each twice; of a sensor with a second
    /// read-out both, of which `expose` is given the sensor of each.
    ///
    /// # Errors
    ///
    /// Those of `expose`.
    pub fn merged<E: From<SensorError>>(
        &self,
        shots: &[Exposure],
        mut expose: impl FnMut(&Self, Exposure) -> Result<RawImage, E>,
    ) -> Result<HdrImage, E> {
        let second = self.second();
        let readings = readings([Some(self), second.as_ref()], shots);
        let Some(first) = readings.first() else {
            let why = "nothing to merge: name several exposures";
            return Err(SensorError::missing("exposures", why).into());
        };
        // Which numbers count.
        let RawImage { width, height, depth, values, .. } = expose(first.sensor, first.shot)?;
        let limit = first.limit();
        let mut pilots: Vec<RateEstimate> = values
            .par_iter()
            .map(|&y| RateEstimate {
                count: usize::from(f64::from(y) < limit),
                rate: first.rate(y),
            })
            .collect();
        for (number, reading) in readings.iter().enumerate().skip(1) {
            let image = expose(reading.sensor, reading.shot)?;
            let limit = reading.limit();
            pilots.par_iter_mut().zip(&image.values).for_each(|(pilot, &y)| {
                if pilot.count == number && f64::from(y) < limit {
                    *pilot = RateEstimate { count: number + 1, rate: reading.rate(y) };
                }
            });
        }
        // Those together.
        let mut sums = vec![[0.0; 2]; pilots.len()];
        for (number, reading) in readings.iter().enumerate() {
            let image = expose(reading.sensor, reading.shot)?;
            let pixels = sums.par_iter_mut().zip(&pilots).zip(&image.values);
            pixels.for_each(|(([weighed, weight], pilot), &y)| {
                if number < pilot.count {
                    let twin = reading.twin.filter(|&twin| twin < pilot.count);
                    let own = reading.weight(pilot.rate, twin.map(|twin| &readings[twin]));
                    *weighed += own * reading.rate(y);
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
}

/// Every shot by every read-out, the least exposed first.
fn readings<'a>(readouts: [Option<&'a Sensor>; 2], shots: &[Exposure]) -> Vec<Reading<'a>> {
    let all = readouts.into_iter().flatten();
    let mut readings: Vec<Reading<'a>> = all
        .flat_map(|sensor| shots.iter().map(move |&shot| Reading { sensor, shot, twin: None }))
        .collect();
    // By the light that each can tell, the most first.
    readings.sort_by(|a, b| b.most().total_cmp(&a.most()).then(a.shot.frame.cmp(&b.shot.frame)));
    for number in 0..readings.len() {
        let own = &readings[number];
        let has_twin = |(other, reading): (usize, &Reading<'_>)| {
            let is_shared = reading.sensor.settings.readout != own.sensor.settings.readout;
            other != number && is_shared && reading.shot == own.shot
        };
        readings[number].twin = readings.iter().enumerate().position(has_twin);
    }
    readings
}

impl Reading<'_> {
    /// Electrons a second of light that it can tell.
    fn most(&self) -> f64 {
        self.sensor.saturation() / self.exposed()
    }

    /// Seconds of exposure of a photodiode of sensitivity 1.
    fn exposed(&self) -> f64 {
        self.sensor.settings.sensitivity * self.shot.exposure
    }

    /// Numbers below this are of pixels that are not saturated (DN).
    fn limit(&self) -> f64 {
        // Below a full well reads what the read-out takes from it.
        let sensor = self.sensor;
        let of_read_out = sensor.dark_noise(0.0).hypot(sensor.non_uniformity()[1]);
        sensor.saturation_level() - MARGIN * sensor.system_gain() * of_read_out
    }

    /// Photo-electrons a second that a number stands for.
    fn rate(&self, y: u16) -> f64 {
        let read = (f64::from(y) - self.sensor.black_level()) / self.sensor.system_gain();
        let (electrons, _) = self.sensor.settings.collected_of(read);
        (electrons - self.sensor.dark_current() * self.shot.exposure) / self.exposed()
    }

    /// Mean electrons where so many a second are freed, those of heat included.
    fn electrons(&self, rate: f64) -> f64 {
        rate.max(0.0) * self.exposed() + self.sensor.dark_current() * self.shot.exposure
    }

    /// The variance of read-out and rounding (e⁻²), of so many electrons.
    fn of_read_out(&self, electrons: f64) -> f64 {
        let sensor = self.sensor;
        let read = sensor.settings.read_of(electrons.min(sensor.full_well()));
        let (_, slope) = sensor.settings.collected_of(read);
        let rounding = 1.0 / (12.0 * sensor.system_gain() * sensor.system_gain());
        (sensor.dark_noise(0.0).powi(2) + rounding) / (slope * slope)
    }

    /// The variance of [`Self::rate`], where so many electrons a second are freed.
    fn variance_of_rate(&self, rate: f64) -> f64 {
        let electrons = self.electrons(rate);
        (electrons + self.of_read_out(electrons)) / self.exposed().powi(2)
    }

    /// Weight of the reading, where so many electrons a second are freed, with a twin that counts, or alone.
    fn weight(&self, rate: f64, twin: Option<&Reading<'_>>) -> f64 {
        let Some(twin) = twin else { return 1.0 / self.variance_of_rate(rate) };
        let electrons = self.electrons(rate);
        let [own, other] = [self, twin].map(|reading| 1.0 / reading.of_read_out(electrons));
        let together = (electrons + 1.0 / (own + other)) / self.exposed().powi(2);
        own / (own + other) / together
    }
}
