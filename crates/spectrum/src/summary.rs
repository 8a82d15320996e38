//! Summary of a curve to the eye, as a colour and as photons.
//!
//! # Sources
//!
//! * XYZ, xy, uv and the correlated colour temperature: CIE 015:2018, "Colorimetry", sections 7 and 9.5. The
//!   temperature is that of the black body whose chromaticity (u, 2/3 v') is nearest; it is told where that is
//!   nearer than 0.05, as the CIE demands.
//! * Luminous efficacy: 683.002 lm/W times ∫ S ȳ dλ over ∫ S dλ (CIE 018:2019, "The Basis of Physical Photometry").

use crate::colour::{FINE_OBSERVER, chromaticity};
use crate::curve::integral;
use crate::illuminant::planck;
use crate::{Curve, PLANCK, SPEED_OF_LIGHT};

/// The greatest luminous efficacy (lm/W), that of light of 555 nm: 683 lm/W of light of 540 THz, over the observer's ȳ
/// there.
pub const LUMINOUS_EFFICACY: f64 = 683.002;

/// A curve in a few numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// The wavelengths at which it is known (nm).
    pub range: [f64; 2],
    /// X, Y, Z of it as light: ∫ S (x̄, ȳ, z̄) dλ, not normalised.
    pub xyz: [f64; 3],
    /// Chromaticity; `None` of what is not seen.
    pub xy: Option<[f64; 2]>,
    /// Correlated colour temperature (K), where the CIE defines it.
    pub temperature: Option<f64>,
    /// Distance from the black bodies in the uniform chromaticity scale of 1960.
    pub duv: Option<f64>,
    /// Lumens in a watt of it; `None` of nothing.
    pub efficacy: Option<f64>,
    /// ∫ S dλ, in its unit times nm.
    pub total: f64,
    /// Photons in a joule of it (1/J); `None` of nothing.
    pub photons: Option<f64>,
}

impl Summary {
    /// That of a curve as light, which is 0 outside of its range.
    #[must_use]
    pub fn of(curve: &Curve) -> Self {
        // A flat curve is taken for what the observer sees of it.
        let [low, high] = curve.range();
        let range = match curve.as_flat() {
            Some(_) => FINE_OBSERVER[0].range(),
            None => [low, high],
        };
        let [from, to] = range;
        let xyz = std::array::from_fn(|k| integral(&[curve, &FINE_OBSERVER[k]], from, to));
        let total = curve.integral(from, to);
        let ramp = Curve::trusted(vec![[from, from], [to, to]]);
        let xy = chromaticity(xyz);
        let nearest = xy.and_then(correlated);
        // E = hc/λ, and wavelengths are nm.
        let photons = integral(&[curve, &ramp], from, to) * 1e-9 / (PLANCK * SPEED_OF_LIGHT);
        Self {
            range,
            xyz,
            xy,
            temperature: nearest.filter(|[_, duv]| duv.abs() <= 0.05).map(|[kelvin, _]| kelvin),
            duv: nearest.map(|[_, duv]| duv),
            efficacy: (total > 0.0).then(|| LUMINOUS_EFFICACY * xyz[1] / total),
            total,
            photons: (total > 0.0).then(|| photons / total),
        }
    }
}

/// Chromaticity in the uniform chromaticity scale of 1960.
fn uv([x, y]: [f64; 2]) -> [f64; 2] {
    let scale = -2.0 * x + 12.0 * y + 3.0;
    [4.0 * x / scale, 6.0 * y / scale]
}

/// The uv of a black body (K).
fn black_body(kelvin: f64) -> [f64; 2] {
    let mut xyz = [0.0; 3];
    // The sum over the nanometres of the observer.
    for i in 0..FINE_OBSERVER[0].samples().len() {
        let nm = FINE_OBSERVER[0].samples()[i][0];
        let power = planck(nm, kelvin) / planck(560.0, kelvin);
        xyz = std::array::from_fn(|k| xyz[k] + power * FINE_OBSERVER[k].samples()[i][1]);
    }
    chromaticity(xyz).map_or([0.0; 2], uv)
}

/// The temperature (K) of the nearest black body, and how far above it the chromaticity lies in uv; `None` beyond
/// 1000 to 100 000 K.
fn correlated(xy: [f64; 2]) -> Option<[f64; 2]> {
    let [u, v] = uv(xy);
    let offset = |mired: f64| {
        let [a, b] = black_body(1e6 / mired);
        [u - a, v - b]
    };
    let distance = |mired: f64| {
        let [a, b] = offset(mired);
        a.hypot(b)
    };
    // The nearest of a coarse row, then by the golden section.
    let row = (1..=100).map(|k| 10.0 * f64::from(k));
    let start = row.min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
    let (mut low, mut high) = ((start - 10.0).max(5.0), start + 10.0);
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..60 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if distance(a) < distance(b) { high = b } else { low = a }
    }
    let mired = 0.5 * (low + high);
    let [_, above] = offset(mired);
    let inside = mired > 10.0 && mired < 1000.0;
    inside.then(|| [1e6 / mired, distance(mired).copysign(above)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Illuminant;

    /// Chromaticities and temperatures of CIE 015:2018, tables 9.1 and 12.2, and those of D65 and A.
    #[test]
    fn lamps_have_the_published_chromaticities_and_temperatures() {
        for (illuminant, x, y, kelvin) in [
            (Illuminant::A, 0.447_58, 0.407_45, 2856.0),
            (Illuminant::D65, 0.312_72, 0.329_03, 6504.0),
            (Illuminant::C, 0.310_06, 0.316_16, 6774.0),
            (Illuminant::Fl2, 0.3721, 0.3751, 4230.0),
            (Illuminant::Fl11, 0.3805, 0.3769, 4000.0),
            (Illuminant::LedB1, 0.4560, 0.4078, 2733.0),
            (Illuminant::LedB5, 0.3118, 0.3236, 6598.0),
        ] {
            let summary = Summary::of(&illuminant.curve().unwrap());
            let [found_x, found_y] = summary.xy.unwrap();
            // Four figures, and sums of 5 nm in the publication.
            assert!((found_x - x).abs() < 3e-4 && (found_y - y).abs() < 3e-4, "{summary:?}");
            let found = summary.temperature.unwrap();
            assert!((found / kelvin - 1.0).abs() < 5e-3, "{illuminant:?}: {found}");
        }
    }

    #[test]
    fn green_light_has_the_greatest_efficacy_and_photons_by_their_energy() {
        let line = Curve::sampled(vec![[554.9, 0.0], [555.0, 1.0], [555.1, 0.0]]).unwrap();
        let summary = Summary::of(&line);
        // ȳ is 1 at 555 nm, and within 1e-4 of it a tenth away.
        assert!((summary.efficacy.unwrap() / 683.0 - 1.0).abs() < 1e-4);
        let photon = PLANCK * SPEED_OF_LIGHT / 555e-9;
        assert!((summary.photons.unwrap() * photon - 1.0).abs() < 1e-9);
        assert_eq!(summary.temperature, None, "no lamp is that green");
    }
}
