//! Photon-transfer and signal-to-noise curves of a sensor: simulated, after theory, and with the
//! paper's normal approximation.
//!
//! # Sources
//!
//! EMVA Standard 1288, Release 4.0 Linear: the linear model's variance, signal-to-noise ratio,
//! saturation, absolute sensitivity threshold and dynamic range.
//!
//! Curves as a table and as charts.

use std::fmt::Write as _;

use rayon::prelude::*;
use serde::Serialize;

use crate::approximation::electrons_needed;
use crate::emva::EvenLight;
use crate::film::{Exposure, RawImage};
use crate::{NoiseModel, Sensor, SensorError};
use etendue_chart::{Axis, Chart, GREY, Series, Stroke, Theme, side_by_side};

/// Options of taking curves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Wavelength of the light (nm); `None`: where the quantum efficiency is greatest.
    pub wavelength: Option<f64>,
    /// Points of a curve, 4 or more.
    pub points: usize,
    /// Columns and rows of a frame, of which two are taken at each point.
    pub size: [u32; 2],
    /// The seed of the noise.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { wavelength: None, points: 40, size: [256, 256], seed: 0 }
    }
}

/// The curves of a sensor and what follows from them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhotonTransfer {
    /// Wavelength of the light (nm).
    pub wavelength: f64,
    /// Exposure time of all points (s).
    pub exposure: f64,
    /// η at the wavelength.
    pub quantum_efficiency: f64,
    /// K of the sensor (DN/e⁻).
    pub system_gain: f64,
    /// K as the slope of the simulated variances up to 70 % of saturation (DN/e⁻); `None` where they
    /// have no slope, as with a converter of one bit.
    pub system_gain_measured: Option<f64>,
    /// Temporal dark noise `σ_d`: read-out and dark current (e⁻).
    pub dark_noise: f64,
    /// Saturation (e⁻ and photons).
    pub saturation_electrons: f64,
    /// Saturation (photons).
    pub saturation_photons: f64,
    /// The greatest signal-to-noise ratio, √(saturation).
    pub snr_max: f64,
    /// Photons at which the signal-to-noise ratio is 1.
    pub threshold_photons: f64,
    /// Saturation over threshold.
    pub dynamic_range: f64,
    /// Electrons below which the normal approximation is off by more than 1 % (Kolmogorov's
    /// distance); `None` when it never is.
    pub normal_fails_below: Option<f64>,
    /// Electrons up to which no pixel saturates; beyond, curves show the clipping (e⁻).
    pub unclipped_electrons: f64,
    /// The curves, by rising photons: the last two saturate.
    pub points: Vec<CurvePoint>,
}

/// A point of the curves. Signals are above the dark one; variances are temporal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Mean photons a pixel.
    pub photons: f64,
    /// Mean photo-electrons a pixel (e⁻).
    pub electrons: f64,
    /// Simulated signal (DN).
    pub signal: f64,
    /// Simulated variance (DN²).
    pub variance: f64,
    /// The linear model's variance (DN²): `K²·(σ_d² + μₑ) + 1/12`.
    pub variance_expected: f64,
    /// The simulated variance under the normal approximation (DN²).
    pub variance_normal: f64,
    /// Simulated signal over noise.
    pub snr: f64,
    /// The linear model's.
    pub snr_expected: f64,
    /// The normal approximation's, simulated.
    pub snr_normal: f64,
    /// That of a sensor which counts every photon, √photons.
    pub snr_ideal: f64,
}

impl PhotonTransfer {
    /// Exposes frames from a tenth of an electron to past saturation.
    ///
    /// # Errors
    ///
    /// When the sensor does not see the wavelength.
    pub fn measure(sensor: &Sensor, options: &Options) -> Result<Self, SensorError> {
        let peak = || sensor.quantum_efficiency().peak().unwrap_or(550.0);
        let wavelength = options.wavelength.unwrap_or_else(peak);
        let light = EvenLight::new(sensor, wavelength, options.size)?;
        let exposure = sensor.shots().next().map_or(0.01, |shot| shot.exposure);
        let bench = Bench { sensor, light, exposure, seed: options.seed };
        let most = bench.unclipped();
        let count = options.points.max(4);
        let electrons = |i: usize| match count - i {
            1 => 1.3 * sensor.saturation(),
            2 => sensor.saturation(),
            _ => {
                let part = i as f64 / (count - 3) as f64;
                0.1f64.min(most * 1e-3).powf(1.0 - part) * most.powf(part)
            }
        };
        let points: Vec<_> =
            (0..count).into_par_iter().map(|i| bench.point(i, electrons(i))).collect();
        // The first in order fails, however threads run.
        let points = points.into_iter().collect::<Result<Vec<CurvePoint>, _>>()?;
        Ok(bench.summed_up(wavelength, points))
    }
}

/// A sensor on the bench.
struct Bench<'a> {
    sensor: &'a Sensor,
    light: EvenLight,
    exposure: f64,
    seed: u64,
}

impl Bench<'_> {
    fn point(&self, index: usize, electrons: f64) -> Result<CurvePoint, SensorError> {
        let photons = self.light.rounded(electrons / self.light.efficiency);
        let electrons = photons * self.light.efficiency;
        let [signal, variance] = self.pair(index, photons, NoiseModel::Poisson)?;
        let [signal_normal, variance_normal] = self.pair(index, photons, NoiseModel::Normal)?;
        let gain = self.sensor.system_gain();
        let variance_expected = gain * gain * (self.dark_variance() + electrons) + 1.0 / 12.0;
        let ratio = |signal: f64, variance: f64| {
            if variance > 0.0 { signal.max(0.0) / variance.sqrt() } else { 0.0 }
        };
        Ok(CurvePoint {
            photons,
            electrons,
            signal,
            variance,
            variance_expected,
            variance_normal,
            snr: ratio(signal, variance),
            snr_expected: ratio(gain * electrons, variance_expected),
            snr_normal: ratio(signal_normal, variance_normal),
            snr_ideal: photons.sqrt(),
        })
    }

    /// `[signal above the dark one, temporal variance]` of two frames: their mean, and half of the
    /// variance of their difference.
    fn pair(&self, index: usize, photons: f64, noise: NoiseModel) -> Result<[f64; 2], SensorError> {
        let light = self.light.with_noise(noise);
        let frame = |photons, number: usize| {
            #[expect(clippy::cast_possible_truncation, reason = "four frames a point")]
            let shot = Exposure { exposure: self.exposure, frame: (4 * index + number) as u32 };
            light.frame(photons, shot, self.seed)
        };
        let [first, second] = [frame(photons, 0)?, frame(photons, 1)?];
        let dark = 0.5 * (mean(&frame(0.0, 2)?) + mean(&frame(0.0, 3)?));
        let count = first.values.len() as f64;
        let pairs = || first.values.iter().zip(&second.values);
        let difference = |(a, b): (&u16, &u16)| f64::from(*a) - f64::from(*b);
        let shift = pairs().map(difference).sum::<f64>() / count;
        let squares: f64 = pairs().map(|pair| (difference(pair) - shift).powi(2)).sum();
        Ok([0.5 * (mean(&first) + mean(&second)) - dark, squares / (2.0 * (count - 1.0).max(1.0))])
    }

    /// Photo-electrons at which hardly a pixel saturates, four standard deviations below (e⁻).
    fn unclipped(&self) -> f64 {
        let saturation = self.sensor.saturation();
        let [prnu, dsnu] = self.sensor.non_uniformity();
        let spread = saturation + self.dark_variance() + (prnu * saturation).powi(2) + dsnu * dsnu;
        let dark = self.sensor.dark_current() * self.exposure;
        (saturation - dark - 4.0 * spread.sqrt()).max(0.25 * saturation)
    }

    /// `σ_d²` (e⁻²).
    fn dark_variance(&self) -> f64 {
        self.sensor.read_noise().powi(2) + self.sensor.dark_current() * self.exposure
    }

    fn summed_up(&self, wavelength: f64, points: Vec<CurvePoint>) -> PhotonTransfer {
        let efficiency = self.light.efficiency;
        let gain = self.sensor.system_gain();
        let saturation = self.sensor.saturation();
        let dark = self.dark_variance();
        // Where η·μ = √(σ_d² + σ_q²/K² + η·μ), the standard's absolute sensitivity threshold.
        let threshold = ((dark + 1.0 / (12.0 * gain * gain) + 0.25).sqrt() + 0.5) / efficiency;
        // Variance = dark + K·signal, weighted by the inverse of the variance's own scatter.
        let fitted = points.iter().filter(|p| p.electrons <= 0.7 * saturation);
        let dark_dn = gain * gain * dark + 1.0 / 12.0;
        let (mut product, mut square) = (0.0, 0.0);
        for p in fitted {
            let weight = 1.0 / p.variance_expected.powi(2);
            product += weight * p.signal * (p.variance - dark_dn);
            square += weight * p.signal * p.signal;
        }
        PhotonTransfer {
            wavelength,
            exposure: self.exposure,
            quantum_efficiency: efficiency,
            system_gain: gain,
            system_gain_measured: (square > 0.0 && product > 0.0).then(|| product / square),
            dark_noise: dark.sqrt(),
            saturation_electrons: saturation,
            saturation_photons: saturation / efficiency,
            snr_max: saturation.sqrt(),
            threshold_photons: threshold,
            dynamic_range: saturation / efficiency / threshold,
            normal_fails_below: electrons_needed(self.sensor.read_noise(), 0.01),
            unclipped_electrons: self.unclipped(),
            points,
        }
    }
}

fn mean(image: &RawImage) -> f64 {
    image.values.iter().map(|&y| f64::from(y)).sum::<f64>() / image.values.len() as f64
}

/// Name and look of a line.
struct LineStyle {
    name: &'static str,
    colour: usize,
    stroke: Stroke,
}

impl PhotonTransfer {
    /// The figures and curves as text.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = self.figures();
        self.curves(&mut text);
        text
    }

    fn figures(&self) -> String {
        let decibel = |ratio: f64| 20.0 * ratio.log10();
        let measured = match self.system_gain_measured {
            Some(gain) => format!("measured {gain:.5}"),
            None => "not measurable".into(),
        };
        let fails = match self.normal_fails_below {
            Some(electrons) => {
                format!("below {electrons:.3} e⁻ the normal approximation is over 1 % off")
            }
            None => "the normal approximation is never 1 % off".into(),
        };
        format!(
            "wavelength {:.1} nm, quantum efficiency {:.4}, exposure {} s\n\
             system gain {:.5} DN/e⁻ ({measured}), dark noise {:.3} e⁻\n\
             saturation {:.0} e⁻ ({:.0} photons), SNR at most {:.1} ({:.1} dB)\n\
             threshold {:.2} photons, dynamic range {:.0} ({:.1} dB)\n{fails}\n\n",
            self.wavelength,
            self.quantum_efficiency,
            self.exposure,
            self.system_gain,
            self.dark_noise,
            self.saturation_electrons,
            self.saturation_photons,
            self.snr_max,
            decibel(self.snr_max),
            self.threshold_photons,
            self.dynamic_range,
            decibel(self.dynamic_range),
        )
    }

    fn curves(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "{:>12} {:>12} {:>12} {:>12} {:>12} {:>12} {:>10} {:>10} {:>10} {:>10}",
            "photons",
            "electrons",
            "signal DN",
            "var DN²",
            "theory",
            "normal",
            "SNR",
            "theory",
            "normal",
            "ideal"
        );
        for p in &self.points {
            let _ = writeln!(
                text,
                "{:>12.4} {:>12.4} {:>12.4} {:>12.4} {:>12.4} {:>12.4} {:>10.4} {:>10.4} {:>10.4} {:>10.4}",
                p.photons,
                p.electrons,
                p.signal,
                p.variance,
                p.variance_expected,
                p.variance_normal,
                p.snr,
                p.snr_expected,
                p.snr_normal,
                p.snr_ideal
            );
        }
    }

    /// Points at which nothing is clipped: beyond, less and less noise is no better signal.
    fn drawn(&self) -> impl Iterator<Item = &CurvePoint> {
        self.points.iter().filter(|point| point.electrons <= 1.000_001 * self.unclipped_electrons)
    }

    /// Both curves as SVG, under the sensor's `name`.
    #[must_use]
    pub fn svg(&self, name: &str) -> String {
        side_by_side(&[self.transfer_chart(name), self.ratio_chart(name)], Theme::Reader)
    }

    fn line(
        &self,
        LineStyle { name, colour, stroke }: LineStyle,
        point: &dyn Fn(&CurvePoint) -> [f64; 2],
    ) -> Series {
        Series { colour, stroke, ..Series::curve(name, self.drawn().map(point)) }
    }

    /// Variance against signal; where nothing shines, and where pixels are full.
    fn transfer_chart(&self, name: &str) -> Chart {
        let gain = self.system_gain;
        let measured = match self.system_gain_measured {
            Some(measured) => format!(" ({measured:.4} by the slope)"),
            None => String::new(),
        };
        let dark = (gain * self.dark_noise).powi(2) + 1.0 / 12.0;
        let full = gain * self.saturation_electrons;
        let values = |value: fn(&CurvePoint) -> f64| self.drawn().map(value).filter(|v| *v > 0.0);
        let left = values(|p| p.signal).fold(f64::INFINITY, f64::min);
        let bottom = values(|p| p.variance).fold(dark, f64::min);
        let top = values(|p| p.variance_expected).fold(dark, f64::max);
        Chart {
            title: format!("{name}: photon transfer"),
            notes: vec![format!("K {gain:.4} DN/e⁻{measured}, σ_d {:.2} e⁻", self.dark_noise)],
            axes: [
                Axis::new("signal (DN)").fitted(),
                Axis::new("temporal variance (DN²)").fitted(),
            ],
            series: vec![
                self.line(EXACT, &|p| [p.signal, p.variance]),
                self.line(NORMAL, &|p| [p.signal, p.variance_normal]),
                self.line(MODEL, &|p| [p.electrons * gain, p.variance_expected]),
                guide("dark: K²σ_d² + 1/12", [left, dark], [full, dark]),
                guide("saturation", [full, bottom], [full, top]),
            ],
            ..Chart::default()
        }
    }

    /// Signal to noise against photons, from the threshold to saturation.
    fn ratio_chart(&self, name: &str) -> Chart {
        let decibel = |ratio: f64| 20.0 * ratio.log10();
        let (low, high) = (self.threshold_photons, self.saturation_photons);
        let values = |value: fn(&CurvePoint) -> f64| self.drawn().map(value).filter(|v| *v > 0.0);
        let bottom = values(|p| p.snr_expected).fold(1.0, f64::min);
        let mark = |name: String, at: [f64; 2]| Series {
            joined: false,
            colour: GREY,
            ..Series::line(name, [at])
        };
        Chart {
            title: format!("{name}: signal to noise"),
            notes: vec![format!(
                "at {:.0} nm; saturation {:.0} e⁻, {high:.0} photons",
                self.wavelength, self.saturation_electrons,
            )],
            axes: [Axis::new("photons a pixel").fitted(), Axis::new("SNR").fitted()],
            // Curves first, then what is read off them.
            series: vec![
                self.line(EXACT, &|p| [p.photons, p.snr]),
                self.line(NORMAL, &|p| [p.photons, p.snr_normal]),
                self.line(MODEL, &|p| [p.photons, p.snr_expected]),
                self.line(IDEAL, &|p| [p.photons, p.snr_ideal]),
                mark(
                    format!("SNR at most {:.1} ({:.1} dB)", self.snr_max, decibel(self.snr_max)),
                    [high, self.snr_max],
                ),
                mark(format!("threshold: {low:.2} photons"), [low, 1.0]),
                guide("saturation", [high, bottom], [high, self.snr_max]),
                guide(
                    &format!("dynamic range {:.1} dB", decibel(self.dynamic_range)),
                    [low, bottom],
                    [high, bottom],
                ),
            ],
            ..Chart::default()
        }
    }
}

const EXACT: LineStyle = LineStyle { name: "exact Poisson", colour: 0, stroke: Stroke::Solid };
const NORMAL: LineStyle =
    LineStyle { name: "normal approximation", colour: 2, stroke: Stroke::Dashed };
const MODEL: LineStyle = LineStyle { name: "linear model", colour: GREY, stroke: Stroke::Dotted };
const IDEAL: LineStyle = LineStyle { name: "ideal sensor", colour: 1, stroke: Stroke::Solid };

/// A straight line that marks a figure, with places along it for its name.
fn guide(name: &str, from: [f64; 2], to: [f64; 2]) -> Series {
    let at = |k: usize, share: f64| from[k].powf(1.0 - share) * to[k].powf(share);
    let points = (0..=8).map(|i| f64::from(i) / 8.0).map(|share| [at(0, share), at(1, share)]);
    Series { colour: GREY, stroke: Stroke::Dashed, ..Series::curve(name, points) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(model: &str) -> (Sensor, PhotonTransfer) {
        let spec = serde_json::json!({ "type": "raw", "model": model });
        let sensor = Sensor::new(&serde_json::from_value(spec).unwrap()).unwrap();
        let curves = PhotonTransfer::measure(&sensor, &Options::default()).unwrap();
        (sensor, curves)
    }

    #[test]
    fn curves_give_back_gain_and_noise() {
        for model in ["imx183", "kaf50100", "mt9m031"] {
            let (sensor, curves) = measured(model);
            // Forty variances of 65 536 pixels each: 0.1 % of the slope.
            let error = curves.system_gain_measured.unwrap() / sensor.system_gain() - 1.0;
            assert!(error.abs() < 4e-3, "{model}: K off by {error}");
            for p in curves.points.iter().filter(|p| p.electrons < 0.8 * sensor.saturation()) {
                let scatter = 5.0 * p.variance_expected * (2.0f64 / 65_536.0).sqrt();
                assert!((p.variance - p.variance_expected).abs() < scatter, "{model}: {p:?}");
                assert!(p.snr < p.snr_ideal, "{model}: {p:?}");
            }
            let last = curves.points.last().unwrap();
            // Where the well saturates before the converter, some read noise is left.
            assert!(last.variance < 0.02 * last.variance_expected, "{model}: {last:?}");
            assert!(curves.points.windows(2).all(|p| p[0].photons < p[1].photons));
        }
    }

    #[test]
    fn figures_are_those_of_the_standard() {
        let (sensor, curves) = measured("imx183");
        assert!((curves.snr_max.powi(2) - sensor.saturation()).abs() < 1e-9);
        // At the threshold, signal and noise are equal: η·μ = √(σ_d² + σ_q²/K² + η·μ).
        let electrons = curves.threshold_photons * curves.quantum_efficiency;
        let gain = sensor.system_gain();
        let noise = curves.dark_noise.powi(2) + 1.0 / (12.0 * gain * gain) + electrons;
        assert!((electrons - noise.sqrt()).abs() < 1e-9);
        assert_eq!(curves.wavelength, sensor.quantum_efficiency().peak().unwrap());
        let table = curves.table();
        assert_eq!(table.lines().count(), 7 + curves.points.len(), "{table}");
        let drawn = curves.svg("IMX183");
        // Curves of both charts; dark noise, saturation and dynamic range.
        assert_eq!(drawn.matches("<path").count(), 7 + 4, "{drawn}");
        for word in ["IMX183", "K 1.4693 DN/e⁻", "σ_d 2", "saturation", "SNR at most", "dB"] {
            assert!(drawn.contains(word), "{word} in {drawn}");
        }
    }

    #[test]
    fn what_is_drawn_never_beats_the_ideal_sensor() {
        for model in crate::Model::ALL {
            let (_, curves) =
                measured(model.preset().name.to_lowercase().replace('-', "").as_str());
            let drawn: Vec<&CurvePoint> = curves.drawn().collect();
            assert_eq!(drawn.len(), curves.points.len() - 2, "{model:?}");
            for p in drawn {
                // A part in 256 of scatter: of variances of 65 536 pixels, and of the normal one's.
                assert!(p.snr < 1.004 * p.snr_expected.max(0.3) * 1.03, "{model:?}: {p:?}");
                assert!(p.snr < p.snr_ideal, "{model:?}: {p:?}");
            }
        }
    }

    #[test]
    fn a_wavelength_that_is_not_seen_is_refused() {
        let (sensor, _) = measured("imx183");
        let options = Options { wavelength: Some(200.0), ..Options::default() };
        let error = PhotonTransfer::measure(&sensor, &options).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the sensor has no quantum efficiency at 200 nm: choose another --wavelength"
        );
    }
}
