//! Curves as a table and as charts.

use std::fmt::Write as _;

use etendue_chart::{Axis, Chart, GREY, Series, Stroke, Theme, side_by_side};

use super::{CurvePoint, PhotonTransfer};

/// Name, colour and stroke of a line.
type LineStyle = (&'static str, usize, Stroke);

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
    pub(super) fn drawn(&self) -> impl Iterator<Item = &CurvePoint> {
        self.points.iter().filter(|point| point.electrons <= 1.000_001 * self.unclipped_electrons)
    }

    /// Both curves as SVG, under the sensor's `name`.
    #[must_use]
    pub fn svg(&self, name: &str) -> String {
        side_by_side(&[self.transfer_chart(name), self.ratio_chart(name)], Theme::Reader)
    }

    fn line(
        &self,
        (name, colour, stroke): LineStyle,
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

const EXACT: LineStyle = ("exact Poisson", 0, Stroke::Solid);
const NORMAL: LineStyle = ("normal approximation", 2, Stroke::Dashed);
const MODEL: LineStyle = ("linear model", GREY, Stroke::Dotted);
const IDEAL: LineStyle = ("ideal sensor", 1, Stroke::Solid);

/// A straight line that marks a figure, with places along it for its name.
fn guide(name: &str, from: [f64; 2], to: [f64; 2]) -> Series {
    let at = |k: usize, share: f64| from[k].powf(1.0 - share) * to[k].powf(share);
    let points = (0..=8).map(|i| f64::from(i) / 8.0).map(|share| [at(0, share), at(1, share)]);
    Series { colour: GREY, stroke: Stroke::Dashed, ..Series::curve(name, points) }
}
