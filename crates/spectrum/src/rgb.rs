//! RGB to spectrum: linear, energy-conserving, exact on the way back.
//!
//! A colour in linear sRGB becomes the sum of three fixed spectra, weighted by its red, green and
//! blue. The three are nowhere negative and sum to 1 at every wavelength. So black is 0, white is 1 everywhere, a
//! colour in 0..=1 is a reflectance in 0..=1, and mixing colours mixes spectra.
//!
//! # Sources
//!
//! I. Mallett and C. Yuksel, "Spectral Primary Decomposition for Rendering with sRGB Reflectance",
//! EGSR 2019. Ours divides each row of their table by its sum (within 1e-5 of 1), holds the ends
//! beyond 380..=780 nm, and uses the same spectra for light, so the RGB white of a light is equal
//! energy, the white that a colour of 1 leaves as it is.

use std::iter;
use std::sync::LazyLock;

use crate::colour::{
    Matrix3, OBSERVER, SRGB_FROM_XYZ, apply, inverse, srgb_of_reflectance, transpose,
};
use crate::curve::integral;
use crate::mallett_yuksel::{BASIS, START, STEP};
use crate::{Curve, Illuminant};

/// The spectra of pure red, green and blue, 380..=780 nm; held beyond, they stay a partition of 1.
pub static PRIMARIES: LazyLock<[Curve; 3]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let row = |(i, row): (usize, &[f64; 3])| {
            [START + STEP * i as f64, row[k] / row.iter().sum::<f64>()]
        };
        Curve::trusted(BASIS.iter().enumerate().map(row).collect())
    })
});

/// The wavelengths that stand for red, green and blue where one is asked for (nm): the centroids of
/// their spectra as the CIE 1931 observer sees them (weights x̄ + ȳ + z̄).
pub const PRIMARY_WAVELENGTHS: [f64; 3] = [609.5, 547.6, 455.5];

/// The spectrum of a linear sRGB colour over all that the observer sees, 360..=830 nm. Parts that
/// are not finite count as 0.
#[must_use]
pub fn spectrum(rgb: [f64; 3]) -> Curve {
    let rgb = rgb.map(|part| if part.is_finite() { part } else { 0.0 });
    let [low, high] = OBSERVER[0].range();
    let wavelengths = PRIMARIES[0].samples().iter().map(|s| s[0]);
    let mix = |nm: f64| [nm, (0..3).map(|k| rgb[k] * PRIMARIES[k].held(nm)).sum()];
    Curve::trusted(iter::once(low).chain(wavelengths).chain(iter::once(high)).map(mix).collect())
}

/// The linear sRGB colour of a spectrum, the inverse of [`spectrum`]: the colour of a surface of
/// that reflectance under D65, its white being (1, 1, 1) exactly. Saturated spectra lie outside of
/// 0..=1.
#[must_use]
pub fn colour(spectrum: &Curve) -> [f64; 3] {
    apply(&ROUND_TRIP, srgb_of_reflectance(spectrum, Illuminant::D65).unwrap_or_default())
}

/// Weights of a spectrum's mean over `from..to` (nm) in its linear sRGB colour, as [`colour`].
#[must_use]
pub fn colour_of_band(from: f64, to: f64) -> [f64; 3] {
    let xyz = std::array::from_fn(|k| integral(&[&*DAYLIGHT, &OBSERVER[k]], from, to) / *WHITE_Y);
    apply(&ROUND_TRIP, apply(&SRGB_FROM_XYZ, xyz))
}

static DAYLIGHT: LazyLock<Curve> = LazyLock::new(|| Illuminant::D65.curve().unwrap_or(Curve::ONE));

static WHITE_Y: LazyLock<f64> =
    LazyLock::new(|| integral(&[&*DAYLIGHT, &OBSERVER[1]], 300.0, 900.0));

/// Turns colours of the three primaries, as integration of the tables finds them, into (1, 0, 0),
/// (0, 1, 0) and (0, 0, 1): within 3e-3 of the identity, for the authors integrated another way.
static ROUND_TRIP: LazyLock<Matrix3> = LazyLock::new(|| {
    let pure = |k: usize| spectrum(std::array::from_fn(|i| f64::from(u8::from(i == k))));
    let seen = |k: usize| srgb_of_reflectance(&pure(k), Illuminant::D65).unwrap_or_default();
    inverse(&transpose(std::array::from_fn(seen))).unwrap_or_default()
});

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_primaries_are_a_partition_of_one() {
        let [r, g, b] = &*PRIMARIES;
        for i in 300..=900 {
            let nm = f64::from(i);
            let parts = [r.held(nm), g.held(nm), b.held(nm)];
            assert!(parts.iter().all(|&part| (0.0..=1.0).contains(&part)));
            assert!((parts.iter().sum::<f64>() - 1.0).abs() < 4.0 * f64::EPSILON, "{nm}");
        }
    }

    #[test]
    fn the_correction_is_small() {
        for (i, row) in ROUND_TRIP.iter().enumerate() {
            for (k, value) in row.iter().enumerate() {
                let identity = f64::from(u8::from(i == k));
                assert!((value - identity).abs() < 3e-3, "{ROUND_TRIP:?}");
            }
        }
    }

    #[test]
    fn the_stated_wavelengths_are_the_centroids() {
        let weights: Vec<[f64; 2]> = OBSERVER[0]
            .samples()
            .iter()
            .map(|&[nm, _]| [nm, OBSERVER.iter().filter_map(|c| c.at(nm)).sum()])
            .collect();
        let weights = Curve::sampled(weights).unwrap();
        let ramp = Curve::sampled(vec![[380.0, 380.0], [780.0, 780.0]]).unwrap();
        for (curve, stated) in PRIMARIES.iter().zip(PRIMARY_WAVELENGTHS) {
            let first = integral(&[curve, &weights, &ramp], 380.0, 780.0);
            let centroid = first / integral(&[curve, &weights], 380.0, 780.0);
            assert!((centroid - stated).abs() < 0.1, "{centroid} {stated}");
        }
    }

    proptest! {
        #[test]
        fn colours_come_back_and_reflect_no_more_than_falls_in(
            r in 0.0..=1.0f64, g in 0.0..=1.0f64, b in 0.0..=1.0f64,
        ) {
            let reflectance = spectrum([r, g, b]);
            let [low, high] = reflectance.extent();
            prop_assert!(low >= 0.0 && high <= 1.0 + 4.0 * f64::EPSILON);
            let back = colour(&reflectance);
            for (value, given) in back.iter().zip([r, g, b]) {
                // Sums of a few hundred terms.
                prop_assert!((value - given).abs() < 1e-12, "{back:?}");
            }
        }

        #[test]
        fn mixing_colours_mixes_spectra(a in 0.0..4.0f64, b in 0.0..4.0f64, nm in 380.0..780.0f64) {
            let (one, other) = ([0.2, 0.7, 0.1], [0.9, 0.3, 0.4]);
            let mixed = spectrum(std::array::from_fn(|k| a * one[k] + b * other[k]));
            let expected = a * spectrum(one).held(nm) + b * spectrum(other).held(nm);
            prop_assert!((mixed.held(nm) - expected).abs() < 1e-14 * (1.0 + expected));
        }
    }
}
