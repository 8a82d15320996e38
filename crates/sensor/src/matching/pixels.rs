//! The pixels of a photograph: which count, and the sums over them.

use rayon::prelude::*;

use super::error::MatchError;
use crate::Sensor;
use crate::least_squares::NormalEquations;

/// The share of the brightest signal by which a photograph may be bent.
const MOST_BENT: f64 = 0.05;

/// Standard errors beyond which a bend is no chance.
const CERTAIN: f64 = 8.0;

/// Standard deviations beyond which a number is that of a defective pixel: of normal noise one in 10¹⁵ is.
const OUTLIER: f64 = 8.0;

/// The median of the absolute value of a normal variable, over its standard deviation.
const MEDIAN_DEVIATION: f64 = 0.674_489_750_196_081_7;

/// Of saturation: what is expected to be brighter is left out.
pub(super) const NEARLY_SATURATED: f64 = 0.9;

/// Rows of which the median deviation is taken, evenly spread.
const MOST_ROWS: usize = 512;

/// The share of pixels that may be clipped, at either end.
const MOST_CLIPPED: f64 = 0.02;

/// Parameters that are fitted.
pub(super) struct Fit {
    /// Of no light, and DN an electron of the simulation in each channel.
    pub(super) line: Vec<f64>,
    pub(super) line_covariance: Vec<Vec<f64>>,
    pub(super) gain: f64,
    pub(super) floor: f64,
    pub(super) noise_covariance: [[f64; 2]; 2],
    pub(super) sensor_prnu: f64,
}

impl Fit {
    /// The expected number above black.
    fn signal(&self, channel: usize, x: f64) -> f64 {
        self.line[1 + channel] * x
    }

    /// Its variance (DN²).
    fn variance(&self, signal: f64) -> f64 {
        let signal = signal.max(0.0);
        self.gain * signal + self.floor + (self.sensor_prnu * signal).powi(2)
    }
}

/// Pixels that count: those that are expected to be dark enough, and are no defects.
pub(super) struct DarkPixels {
    pub(super) line: Vec<f64>,
    /// DN, of what is expected.
    pub(super) most: f64,
    pub(super) gain: f64,
    pub(super) floor: f64,
    pub(super) prnu: f64,
    /// Of the deviation that is expected: a number farther off is of a defective pixel.
    pub(super) reach: f64,
}

impl DarkPixels {
    pub(super) fn has(&self, channel: usize, x: f64, y: f64) -> bool {
        let signal = self.line[1 + channel] * x;
        let expected = self.line[0] + signal;
        let positive = signal.max(0.0);
        let variance = self.gain * positive + self.floor + (self.prnu * positive).powi(2);
        expected < self.most && (y - expected).abs() <= self.reach * variance.sqrt()
    }
}

/// The pixels of a photograph with what is expected of them.
pub(super) struct Pixels<'a> {
    pub(super) sensor: &'a Sensor,
    pub(super) electrons: &'a [f64],
    pub(super) numbers: &'a [u16],
    pub(super) columns: usize,
}

impl Pixels<'_> {
    /// Channel, expected electrons of the simulation, and number of each pixel of a row.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        let range = row * self.columns..(row + 1) * self.columns;
        let both = self.electrons[range.clone()].iter().zip(&self.numbers[range]);
        both.enumerate()
            .map(move |(column, (&x, &y))| (self.sensor.channel_at(row, column), x, f64::from(y)))
    }

    pub(super) fn rows(&self) -> usize {
        self.numbers.len() / self.columns.max(1)
    }

    /// The channel of the most electrons in the mean.
    pub(super) fn brightest_channel(&self) -> usize {
        let mut sums = vec![[0.0; 2]; self.sensor.channels().len()];
        for row in 0..self.rows() {
            for (channel, x, _) in self.row(row) {
                sums[channel][0] += x;
                sums[channel][1] += 1.0;
            }
        }
        let mean = |k: &usize| sums[*k][0] / f64::max(sums[*k][1], 1.0);
        (0..sums.len()).max_by(|a, b| mean(a).total_cmp(&mean(b))).unwrap_or(0)
    }

    /// Returns the pixels that count by a fit. Deviations are in units of their median, which defects do not bend, or of
    /// what is expected where that is more.
    pub(super) fn kept(&self, fit: &Fit, white: f64) -> DarkPixels {
        let most = NEARLY_SATURATED * (white - fit.line[0]) + fit.line[0];
        let all = DarkPixels {
            line: fit.line.clone(),
            most,
            gain: fit.gain,
            floor: fit.floor,
            prnu: fit.sensor_prnu,
            reach: f64::INFINITY,
        };
        let step = self.rows().div_ceil(MOST_ROWS).max(1);
        let of_row = |row: usize| {
            let used = self.row(row).filter(|&(c, x, y)| all.has(c, x, y));
            let deviation = |(channel, x, y): (usize, f64, f64)| {
                let signal = fit.signal(channel, x);
                (y - fit.line[0] - signal).abs() / fit.variance(signal).sqrt()
            };
            used.map(deviation).collect::<Vec<_>>()
        };
        let rows: Vec<usize> = (0..self.rows()).step_by(step).collect();
        let mut deviations: Vec<f64> = rows.into_par_iter().flat_map_iter(of_row).collect();
        let middle = deviations.len() / 2;
        let median = match deviations.is_empty() {
            true => 0.0,
            false => *deviations.select_nth_unstable_by(middle, f64::total_cmp).1,
        };
        DarkPixels { reach: OUTLIER * (median / MEDIAN_DEVIATION).max(1.0), ..all }
    }

    /// Fits the line of numbers over electrons, a slope for each channel.
    pub(super) fn fit_line(
        &self,
        fit: &mut Fit,
        is_used: &(impl Fn(usize, f64, f64) -> bool + Sync),
    ) -> Result<(), MatchError> {
        let count = fit.line.len();
        let of_row = |row: usize| {
            let mut sums = NormalEquations::new(count);
            let mut terms = vec![0.0; count];
            for (channel, x, y) in self.row(row).filter(|&(c, x, y)| is_used(c, x, y)) {
                terms.fill(0.0);
                terms[0] = 1.0;
                terms[1 + channel] = x;
                sums.add(&terms, y, 1.0 / fit.variance(fit.signal(channel, x)));
            }
            sums
        };
        let sums = self.sum_of_rows(count, of_row);
        let (line, covariance) = sums.solved().ok_or_else(MatchError::one_level)?;
        if line[1..].iter().any(|slope| *slope <= 0.0) {
            return Err(MatchError::one_level());
        }
        (fit.line, fit.line_covariance) = (line, covariance);
        Ok(())
    }

    /// Fits gain and floor to the squares of residuals.
    pub(super) fn fit_noise(
        &self,
        fit: &mut Fit,
        is_used: &(impl Fn(usize, f64, f64) -> bool + Sync),
    ) -> Result<(), MatchError> {
        let of_row = |row: usize| {
            let mut sums = NormalEquations::new(2);
            for (channel, x, y) in self.row(row).filter(|&(c, x, y)| is_used(c, x, y)) {
                let signal = fit.signal(channel, x).max(0.0);
                let residual = y - fit.line[0] - signal;
                let variance = fit.variance(signal);
                let of_square = 2.0 * variance * variance + fit.gain.powi(3) * signal;
                let by_pattern = (fit.sensor_prnu * signal).powi(2);
                sums.add(&[signal, 1.0], residual * residual - by_pattern, 1.0 / of_square);
            }
            sums
        };
        let sums = self.sum_of_rows(2, of_row);
        let (found, covariance) = sums.solved().ok_or_else(MatchError::one_level)?;
        // Below these the weights of the next round would be none.
        fit.gain = found[0].max(1e-3 * fit.gain);
        fit.floor = found[1].max(1.0 / 24.0);
        fit.noise_covariance =
            [[covariance[0][0], covariance[0][1]], [covariance[1][0], covariance[1][1]]];
        Ok(())
    }

    /// Refuses numbers that bend over the light.
    pub(super) fn not_bent(
        &self,
        fit: &Fit,
        is_used: &(impl Fn(usize, f64, f64) -> bool + Sync),
    ) -> Result<(), MatchError> {
        let most = (0..self.rows())
            .into_par_iter()
            .map(|row| {
                let signals = self.row(row).filter(|&(c, x, y)| is_used(c, x, y));
                signals.map(|(channel, x, _)| fit.signal(channel, x)).fold(0.0, f64::max)
            })
            .reduce(|| 0.0, f64::max);
        let of_row = |row: usize| {
            let mut sums = NormalEquations::new(3);
            for (channel, x, y) in self.row(row).filter(|&(c, x, y)| is_used(c, x, y)) {
                let share = fit.signal(channel, x) / most;
                sums.add(&[1.0, share, share * share], y, 1.0 / fit.variance(share * most));
            }
            sums
        };
        let Some((bent, covariance)) = self.sum_of_rows(3, of_row).solved() else { return Ok(()) };
        // A parabola lies a quarter of its bend off its chord.
        let (bend, error) = (bent[2].abs() / most, covariance[2][2].sqrt() / most);
        match bend > 4.0 * MOST_BENT && bend > CERTAIN * error {
            true => Err(MatchError::not_linear(25.0 * bend)),
            false => Ok(()),
        }
    }

    pub(super) fn residuals(
        &self,
        fit: &Fit,
        is_used: &(impl Fn(usize, f64, f64) -> bool + Sync),
    ) -> Vec<f32> {
        let rows = (0..self.rows()).into_par_iter();
        rows.flat_map_iter(|row| {
            let residual = |(channel, x, y): (usize, f64, f64)| {
                let signal = fit.signal(channel, x);
                let own = (y - fit.line[0] - signal) / fit.variance(signal).sqrt();
                #[expect(clippy::cast_possible_truncation, reason = "a picture of floats")]
                let own = own as f32;
                if is_used(channel, x, y) { own } else { f32::NAN }
            };
            self.row(row).map(residual).collect::<Vec<_>>()
        })
        .collect()
    }

    /// Sums over all rows, in the same order whatever the number of threads.
    pub(super) fn sum_of_rows(
        &self,
        count: usize,
        of_row: impl Fn(usize) -> NormalEquations + Sync + Send,
    ) -> NormalEquations {
        let rows: Vec<NormalEquations> = (0..self.rows()).into_par_iter().map(of_row).collect();
        let mut all = NormalEquations::new(count);
        rows.iter().for_each(|row| all.add_all(row));
        all
    }
}

/// Refuses a photograph with too many pixels at an end of its scale.
pub(super) fn not_clipped(numbers: &[u16], white: f64) -> Result<(), MatchError> {
    let share = |is: &(dyn Fn(&&u16) -> bool + Sync)| {
        numbers.par_iter().filter(is).count() as f64 / numbers.len().max(1) as f64
    };
    let bright = share(&|y| f64::from(**y) >= white);
    if bright > MOST_CLIPPED {
        let remedy = "photograph it with a shorter exposure or less light";
        return Err(MatchError::clipped(bright, white, "upper end", remedy));
    }
    let dark = share(&|y| **y == 0);
    if dark > MOST_CLIPPED {
        let remedy = "leave the black level in the raw numbers";
        return Err(MatchError::clipped(dark, 0.0, "lower end", remedy));
    }
    Ok(())
}

/// The root mean square of means of 8 × 8 residuals, over that of as many independent ones.
pub(super) fn structure(residuals: &[f32], columns: usize) -> f64 {
    const SIDE: usize = 8;
    let rows = residuals.len() / columns.max(1);
    let (mut sum, mut blocks) = (0.0, 0.0);
    for top in (0..rows.saturating_sub(SIDE - 1)).step_by(SIDE) {
        for left in (0..columns.saturating_sub(SIDE - 1)).step_by(SIDE) {
            let own = (0..SIDE).flat_map(|row| {
                residuals[(top + row) * columns + left..][..SIDE].iter().filter(|r| r.is_finite())
            });
            let (total, count) = own.fold((0.0, 0.0), |(t, n), r| (t + f64::from(*r), n + 1.0));
            if count > 0.0 {
                sum += total * total / count;
                blocks += 1.0;
            }
        }
    }
    (sum / f64::max(blocks, 1.0)).sqrt()
}
