//! Curves as a table and as charts.

use std::fmt::Write as _;

use etendue_chart::{Axis, Chart, GREY, Series, Stroke, Theme, side_by_side};

use super::{PhotonTransfer, Point};

/// Name, colour and stroke of a line.
type Look = (&'static str, usize, Stroke);

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

    /// Both curves as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        const EXACT: Look = ("exact Poisson", 0, Stroke::Solid);
        const NORMAL: Look = ("normal approximation", 2, Stroke::Dashed);
        const MODEL: Look = ("linear model", GREY, Stroke::Dotted);
        const IDEAL: Look = ("ideal sensor", 1, Stroke::Solid);
        let line = |(name, colour, stroke): Look, point: &dyn Fn(&Point) -> [f64; 2]| Series {
            colour,
            stroke,
            ..Series::curve(name, self.points.iter().map(point))
        };
        let transfer = Chart {
            title: "Photon transfer".to_owned(),
            axes: [Axis::new("signal (DN)"), Axis::new("temporal variance (DN²)")],
            series: vec![
                line(EXACT, &|p| [p.signal, p.variance]),
                line(NORMAL, &|p| [p.signal, p.variance_normal]),
                line(MODEL, &|p| [p.electrons * self.system_gain, p.variance_expected]),
            ],
            ..Chart::default()
        };
        let ratio = Chart {
            title: "Signal to noise".to_owned(),
            axes: [Axis::new("photons a pixel"), Axis::new("SNR")],
            series: vec![
                line(EXACT, &|p| [p.photons, p.snr]),
                line(NORMAL, &|p| [p.photons, p.snr_normal]),
                line(MODEL, &|p| [p.photons, p.snr_expected]),
                line(IDEAL, &|p| [p.photons, p.snr_ideal]),
            ],
            ..Chart::default()
        };
        side_by_side(&[transfer, ratio], Theme::Reader)
    }
}
