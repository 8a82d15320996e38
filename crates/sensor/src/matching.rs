//! The numbers of a sensor by which a simulation matches a photograph: the workflow of Nürnberg et al. (2019), section 4.1.1, with
//! its third step solved instead of tried.
//!
//! 1. What is known of the sensor stands in its spec: PRNU, DSNU, dark current.
//! 2. A linear raw photograph `y` of the scene is there, with the exposure time `T`.
//! 3. The scene is simulated without noise: `x` mean photo-electrons a pixel. Where the photograph is of the same scene,
//!
//!    ```text
//!    y = b + K·μ_I·T + K·a·x + noise,        a of each channel,
//!    v = K·m + D + (PRNU·m)²,                m = K·(a·x + μ_I·T),
//!    D = K²·(σ² + DSNU² + rows² + columns²) + 1/12.
//!    ```
//!
//!    The line is fitted by least squares, weighed by 1/v. The squares of its residuals have the mean v and the variance
//!    2v² + K³·m (a normal variable's, and the fourth cumulant of Poisson's), by which they are fitted to K and D: the
//!    photon transfer of one picture (Janesick, "Photon Transfer", 2007). Both are repeated until they agree. What is stated as
//!    σ of each parameter comes of the inverse of the normal equations.
//!
//! Pixels that are nearly saturated are left out by what is expected of them, not by what they are, which would favour
//! the dark ones. Defective pixels are left out: those farther than eight deviations from what is expected, in units of the
//! median deviation.

use rayon::prelude::*;
use serde::Serialize;

use crate::film::Film;
use crate::least_squares::NormalEquations;
use crate::{Sensor, SensorError};

/// Fits are repeated so often; the last change a parameter by less than a thousandth of its σ.
const ROUNDS: usize = 12;

/// Of saturation: what is expected to be brighter is left out.
const NEARLY_SATURATED: f64 = 0.9;

/// Standard deviations beyond which a number is that of a defective pixel: of normal noise one in 10¹⁵ is.
const OUTLIER: f64 = 8.0;

/// The median of the absolute value of a normal variable, over its standard deviation.
const MEDIAN_DEVIATION: f64 = 0.674_489_750_196_081_7;

/// Rows of which the median deviation is taken, evenly spread.
const MOST_ROWS: usize = 512;

/// The share of pixels that may be clipped, at either end.
const MOST_CLIPPED: f64 = 0.02;

/// The share of the brightest signal by which a photograph may be bent.
const MOST_BENT: f64 = 0.05;

/// Standard errors beyond which a bend is no chance.
const CERTAIN: f64 = 8.0;

/// Why a photograph cannot be matched. The message says what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// A sensor of several numbers a pixel.
    #[error(
        "the scene's sensor has {0} numbers a pixel, and a raw photograph one: set camera.sensor.type to `raw`, with the photograph's `cfa`"
    )]
    NotRaw(usize),
    /// A photograph of other columns and rows.
    #[error("has {} x {} pixels, and the scene's sensor {} x {}: set camera.sensor.resolution to the photograph's", .photo[0], .photo[1], .sensor[0], .sensor[1])]
    Size {
        /// Columns and rows of the photograph.
        photo: [usize; 2],
        /// Of the sensor.
        sensor: [usize; 2],
    },
    /// Too many pixels at an end of the scale.
    #[error(
        "is clipped: {share:.1} % of its pixels are at {level}, the {end} of its scale; {remedy}"
    )]
    Clipped {
        /// Percent.
        share: f64,
        /// DN
        level: f64,
        /// Which end.
        end: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// Numbers that do not go with the light.
    #[error(
        "is not linear in the scene's light: its numbers bend by {0:.0} % of the brightest; it is gamma-encoded or developed, or shows another scene\nhint: give the raw numbers, linearised"
    )]
    NotLinear(f64),
    /// One level of light, or none.
    #[error(
        "shows too few levels of light to tell gain from noise and light from black: photograph a step chart, or a scene with dark and bright parts"
    )]
    OneLevel,
    /// A film that is not the sensor's.
    #[error(transparent)]
    Sensor(#[from] SensorError),
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The level of light in a channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelLevel {
    /// The channel.
    pub channel: String,
    /// Photo-electrons over those of the simulation.
    #[serde(flatten)]
    pub level: Estimate,
}

/// What makes a simulation match a photograph.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Matched {
    /// K (DN/e⁻).
    pub system_gain: Estimate,
    /// `σ_read` (e⁻).
    pub read_noise: Estimate,
    /// What no light reads as, without the dark signal (DN).
    pub black_level: Estimate,
    /// The exposure time (s) at which the simulation has the photograph's electrons, in the channel that has the most.
    pub exposure: Estimate,
    /// Light by channels.
    pub levels: Vec<ChannelLevel>,
    /// Pixels that were used, of all.
    pub used: u64,
    /// All pixels.
    pub of: u64,
    /// The root mean square of means of 8 × 8 residuals, over what noise makes of it: 1 where the scene is the photograph's.
    pub structure: f64,
    /// Residuals over their standard deviations, by rows; NaN of pixels that are left out.
    #[serde(skip)]
    pub residuals: Vec<f32>,
}

/// A photograph: raw numbers by rows.
#[derive(Debug, Clone, Copy)]
pub struct Photograph<'a> {
    /// Columns and rows.
    pub size: [usize; 2],
    /// DN, `[row][column]`.
    pub numbers: &'a [u16],
    /// The number at which it saturates (DN); the sensor's when absent.
    pub white: Option<f64>,
}

/// What is fitted.
struct Fit {
    /// Of no light, and DN an electron of the simulation in each channel.
    line: Vec<f64>,
    line_covariance: Vec<Vec<f64>>,
    gain: f64,
    floor: f64,
    noise_covariance: [[f64; 2]; 2],
    sensor_prnu: f64,
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

impl Sensor {
    /// Fits gain, noise, black and light by channels to a photograph of what `film` has, exposed for `exposure` seconds in the
    /// simulation.
    ///
    /// # Errors
    ///
    /// [`MatchError`] when the photograph is of another size, clipped, not linear, or shows too little.
    pub fn matched(
        &self,
        film: Film<'_>,
        exposure: f64,
        photo: Photograph<'_>,
    ) -> Result<Matched, MatchError> {
        if self.depth() != 1 {
            return Err(MatchError::NotRaw(self.depth()));
        }
        let size = self.resolution().map(|side| side as usize);
        if photo.size != size || photo.numbers.len() != size[0] * size[1] {
            return Err(MatchError::Size { photo: photo.size, sensor: size });
        }
        let white = photo.white.unwrap_or_else(|| self.saturation_level());
        not_clipped(photo.numbers, white)?;
        let electrons = self.electrons_of_pixels(film, exposure)?;
        let pixels = Pixels {
            sensor: self,
            electrons: &electrons,
            numbers: photo.numbers,
            columns: size[0],
        };
        let mut fit = self.first_fit(exposure);
        // The first line is of what is dark enough by itself.
        let by_number = |_: usize, _: f64, y: f64| y < NEARLY_SATURATED * white;
        pixels.fit_line(&mut fit, &by_number)?;
        for _ in 0..ROUNDS {
            let kept = pixels.kept(&fit, white);
            let is_used = |channel: usize, x: f64, y: f64| kept.has(channel, x, y);
            pixels.fit_noise(&mut fit, &is_used)?;
            pixels.fit_line(&mut fit, &is_used)?;
        }
        let kept = pixels.kept(&fit, white);
        let is_used = |channel: usize, x: f64, y: f64| kept.has(channel, x, y);
        pixels.not_bent(&fit, &is_used)?;
        Ok(self.estimates(&fit, &pixels, &is_used, exposure))
    }

    /// Mean photo-electrons of every pixel of a raw sensor, by rows.
    fn electrons_of_pixels(&self, film: Film<'_>, exposure: f64) -> Result<Vec<f64>, SensorError> {
        let [width, height] = self.resolution().map(|side| side as usize);
        let bands = self.bands().count();
        if film.values.len() != width * height * bands {
            return Err(SensorError::Film { film: film.values.len(), width, height, bands });
        }
        Ok(self.rows_of_electrons(film, exposure, |_| 0.0).flatten().collect())
    }

    /// What the sensor's own numbers say.
    fn first_fit(&self, exposure: f64) -> Fit {
        let gain = self.system_gain();
        let dark = gain * self.dark_noise(exposure).hypot(self.non_uniformity()[1]);
        let channels = self.channels().len();
        let mut line = vec![gain; 1 + channels];
        line[0] = self.black_level();
        Fit {
            line,
            line_covariance: Vec::new(),
            gain,
            floor: dark * dark + 1.0 / 12.0,
            noise_covariance: [[0.0; 2]; 2],
            sensor_prnu: self.non_uniformity()[0],
        }
    }

    /// Parameters and their deviations of a fit.
    fn estimates(
        &self,
        fit: &Fit,
        pixels: &Pixels<'_>,
        is_used: &(impl Fn(usize, f64, f64) -> bool + Sync),
        exposure: f64,
    ) -> Matched {
        let gain = Estimate { value: fit.gain, sigma: fit.noise_covariance[0][0].sqrt() };
        let dark = self.dark_current() * exposure;
        let black = Estimate {
            value: fit.line[0] - fit.gain * dark,
            sigma: (fit.line_covariance[0][0] + dark * dark * fit.noise_covariance[0][0]).sqrt(),
        };
        // σ² of all of the read-out (e⁻²), its deviation, and what of it is known to be something else.
        let above = fit.floor - 1.0 / 12.0;
        let all = above / fit.gain.powi(2);
        let [[of_gain, both], [_, of_floor]] = fit.noise_covariance;
        let [by_gain, by_floor] = [-2.0 * all / fit.gain, fit.gain.powi(-2)];
        let variance = by_gain * by_gain * of_gain
            + by_floor * by_floor * of_floor
            + 2.0 * by_gain * by_floor * both;
        let s = &self.settings;
        let known = s.dsnu.powi(2) + s.row_noise.powi(2) + s.column_noise.powi(2) + dark;
        let read = (all - known).max(0.0).sqrt();
        let least = variance.max(0.0).sqrt();
        let sigma = if read * read > least { 0.5 * least / read } else { least.sqrt() };
        let read_noise = Estimate { value: read, sigma };
        let level = |channel: usize| {
            let slope = fit.line[1 + channel];
            let value = slope / fit.gain;
            let relative = (fit.line_covariance[1 + channel][1 + channel] / (slope * slope)
                + of_gain / (fit.gain * fit.gain))
                .sqrt();
            Estimate { value, sigma: value.abs() * relative }
        };
        let names: Vec<String> = self.channels().map(str::to_owned).collect();
        let levels: Vec<ChannelLevel> = names
            .into_iter()
            .enumerate()
            .map(|(k, channel)| ChannelLevel { channel, level: level(k) })
            .collect();
        let brightest = pixels.brightest_channel();
        let reference = levels.get(brightest).map_or(gain, |channel| channel.level);
        let exposure =
            Estimate { value: exposure * reference.value, sigma: exposure * reference.sigma };
        let residuals = pixels.residuals(fit, is_used);
        let used = residuals.par_iter().filter(|r| r.is_finite()).count() as u64;
        let structure = structure(&residuals, pixels.columns);
        Matched {
            system_gain: gain,
            read_noise,
            black_level: black,
            exposure,
            levels,
            used,
            of: residuals.len() as u64,
            structure,
            residuals,
        }
    }
}

/// What counts: pixels that are expected to be dark enough, and are no defects.
struct Kept {
    line: Vec<f64>,
    /// DN, of what is expected.
    most: f64,
    gain: f64,
    floor: f64,
    prnu: f64,
    /// Of the deviation that is expected: a number farther off is of a defective pixel.
    reach: f64,
}

impl Kept {
    fn has(&self, channel: usize, x: f64, y: f64) -> bool {
        let signal = self.line[1 + channel] * x;
        let expected = self.line[0] + signal;
        let positive = signal.max(0.0);
        let variance = self.gain * positive + self.floor + (self.prnu * positive).powi(2);
        expected < self.most && (y - expected).abs() <= self.reach * variance.sqrt()
    }
}

/// The pixels of a photograph with what is expected of them.
struct Pixels<'a> {
    sensor: &'a Sensor,
    electrons: &'a [f64],
    numbers: &'a [u16],
    columns: usize,
}

impl Pixels<'_> {
    /// Channel, expected electrons of the simulation, and number of each pixel of a row.
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        let range = row * self.columns..(row + 1) * self.columns;
        let both = self.electrons[range.clone()].iter().zip(&self.numbers[range]);
        both.enumerate()
            .map(move |(column, (&x, &y))| (self.sensor.channel_at(row, column), x, f64::from(y)))
    }

    fn rows(&self) -> usize {
        self.numbers.len() / self.columns.max(1)
    }

    /// The channel of the most electrons in the mean.
    fn brightest_channel(&self) -> usize {
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

    /// What counts by a fit. Deviations are in units of their median, which defects do not bend, or of what is expected
    /// where that is more.
    fn kept(&self, fit: &Fit, white: f64) -> Kept {
        let most = NEARLY_SATURATED * (white - fit.line[0]) + fit.line[0];
        let all = Kept {
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
        Kept { reach: OUTLIER * (median / MEDIAN_DEVIATION).max(1.0), ..all }
    }

    /// Fits the line of numbers over electrons, a slope for each channel.
    fn fit_line(
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
        let (line, covariance) = sums.solved().ok_or(MatchError::OneLevel)?;
        if line[1..].iter().any(|slope| *slope <= 0.0) {
            return Err(MatchError::OneLevel);
        }
        (fit.line, fit.line_covariance) = (line, covariance);
        Ok(())
    }

    /// Fits gain and floor to the squares of residuals.
    fn fit_noise(
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
        let (found, covariance) = sums.solved().ok_or(MatchError::OneLevel)?;
        // Below these the weights of the next round would be none.
        fit.gain = found[0].max(1e-3 * fit.gain);
        fit.floor = found[1].max(1.0 / 24.0);
        fit.noise_covariance =
            [[covariance[0][0], covariance[0][1]], [covariance[1][0], covariance[1][1]]];
        Ok(())
    }

    /// Refuses numbers that bend over the light.
    fn not_bent(
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
            true => Err(MatchError::NotLinear(25.0 * bend)),
            false => Ok(()),
        }
    }

    fn residuals(
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
    fn sum_of_rows(
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
fn not_clipped(numbers: &[u16], white: f64) -> Result<(), MatchError> {
    let share = |is: &(dyn Fn(&&u16) -> bool + Sync)| {
        numbers.par_iter().filter(is).count() as f64 / numbers.len().max(1) as f64
    };
    let bright = share(&|y| f64::from(**y) >= white);
    if bright > MOST_CLIPPED {
        let remedy = "photograph it with a shorter exposure or less light";
        return Err(MatchError::Clipped {
            share: 100.0 * bright,
            level: white,
            end: "upper end",
            remedy,
        });
    }
    let dark = share(&|y| **y == 0);
    if dark > MOST_CLIPPED {
        let remedy = "leave the black level in the raw numbers";
        return Err(MatchError::Clipped {
            share: 100.0 * dark,
            level: 0.0,
            end: "lower end",
            remedy,
        });
    }
    Ok(())
}

/// The root mean square of means of 8 × 8 residuals, over that of as many independent ones.
fn structure(residuals: &[f32], columns: usize) -> f64 {
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
