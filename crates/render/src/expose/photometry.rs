//! The light on a sensor in photometric units.

use etendue_sensor::Radiometry;
use etendue_spectrum::colour::FINE_OBSERVER;
use serde::Serialize;

use super::SensorLight;

/// Luminous efficacy of light of 555 nm (lm/W; CIE 018:2019).
const EFFICACY: f64 = 683.002;

/// Luminance of red, green and blue of sRGB's primaries, white being 1 (IEC 61966-2-1).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The constant of reflected-light meters, K (ISO 2720:1974): L·S/K is N²/T.
const METER: f64 = 12.5;

/// The light on a sensor of `physical` radiometry, in the mean over its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Photometry {
    /// Illuminance on the sensor (lx).
    pub illuminance_lux: f64,
    /// Luminance of the scene through an unvignetted lens (cd/m²), where the camera has a pupil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub luminance_cd_m2: Option<f64>,
    /// Exposure value at ISO 100 that a reflected-light meter shows, log₂(L·100/12.5).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ev100: Option<f64>,
}

impl SensorLight {
    /// The light in photometric units; `None` in `digital` radiometry, whose light has no unit. Bands are weighed as the
    /// colours that they make, which is exact for light that red, green and blue stand for.
    #[must_use]
    pub fn photometry(&self) -> Option<Photometry> {
        if self.sensor.radiometry() == Radiometry::Digital {
            return None;
        }
        let [red, green, blue] = self.film.colors().ok()?;
        let pixels = red.iter().zip(&green).zip(&blue);
        let sum: f64 = pixels
            .map(|((r, g), b)| {
                let all = [r, g, b].map(|part| f64::from(*part));
                all.iter().zip(LUMINANCE).map(|(part, weight)| part * weight).sum::<f64>()
            })
            .sum();
        // Of a flat spectrum of 1 W/m²/nm.
        let [from, to] = FINE_OBSERVER[1].range();
        let white = EFFICACY * FINE_OBSERVER[1].integral(from, to);
        let illuminance = white * sum / red.len().max(1) as f64;
        let luminance = self.solid_angle.map(|angle| illuminance / angle);
        Some(Photometry {
            illuminance_lux: illuminance,
            luminance_cd_m2: luminance,
            ev100: luminance.filter(|l| *l > 0.0).map(|l| (l * 100.0 / METER).log2()),
        })
    }
}
