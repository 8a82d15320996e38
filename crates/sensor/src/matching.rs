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

mod error;
mod pixels;

use rayon::prelude::*;
use serde::Serialize;

use crate::film::Film;
use crate::{Sensor, SensorError};
use pixels::{Fit, NEARLY_SATURATED, Pixels, not_clipped, structure};

pub use error::MatchError;

/// Fits are repeated so often; the last change a parameter by less than a thousandth of its σ.
const ROUNDS: usize = 12;

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

/// Parameters by which a simulation matches a photograph.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Matched {
    /// K (DN/e⁻).
    pub system_gain: Estimate,
    /// `σ_read` (e⁻).
    pub read_noise: Estimate,
    /// Reading of no light, without the dark signal (DN).
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
            return Err(MatchError::not_raw(self.depth()));
        }
        let size = self.resolution().map(|side| side as usize);
        if photo.size != size || photo.numbers.len() != size[0] * size[1] {
            return Err(MatchError::size(photo.size, size));
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
            return Err(SensorError::film(film.values.len(), [width, height, bands]));
        }
        Ok(self.rows_of_electrons(film, exposure, |_| 0.0).flatten().collect())
    }

    /// Fit by the sensor's own numbers.
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
