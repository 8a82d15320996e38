//! Colour as people see it: the CIE 1931 observer, and sRGB.
//!
//! # Sources
//!
//! * Observer: CIE 018:2019 (see the tables).
//! * sRGB: IEC 61966-2-1:1999, primaries, white and transfer function.

use std::sync::LazyLock;

use crate::cie::{OBSERVER_1931, OBSERVER_START, STEP};
use crate::curve::integral;
use crate::{Curve, Illuminant, cie_fine};

/// x̄, ȳ, z̄ of the CIE 1931 standard observer (2°), 360..=830 nm.
pub static OBSERVER: LazyLock<[Curve; 3]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let row = |(i, row): (usize, &[f64; 3])| [OBSERVER_START + STEP * i as f64, row[k]];
        Curve::trusted(OBSERVER_1931.iter().enumerate().map(row).collect())
    })
});

/// Colour matching functions at every nanometre, by which measured and narrow spectra are weighted.
pub static FINE_OBSERVER: LazyLock<[Curve; 3]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let row = |(i, row): (usize, &[f64; 3])| [cie_fine::START + i as f64, row[k]];
        Curve::trusted(cie_fine::ROWS.iter().enumerate().map(row).collect())
    })
});

/// Chromaticities (x, y) of sRGB's red, green and blue.
pub const SRGB_PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Chromaticity (x, y) of sRGB's white, D65.
pub const SRGB_WHITE: [f64; 2] = [0.3127, 0.3290];

/// A 3 × 3 matrix by rows.
pub type Matrix3 = [[f64; 3]; 3];

/// X, Y, Z of a spectrum: ∫ spectrum · (x̄, ȳ, z̄) dλ, not normalised.
#[must_use]
pub fn xyz(spectrum: &Curve) -> [f64; 3] {
    let [from, to] = OBSERVER[0].range();
    std::array::from_fn(|k| integral(&[spectrum, &OBSERVER[k]], from, to))
}

/// Chromaticity (x, y); `None` for black.
#[must_use]
pub fn chromaticity([x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
    let sum = x + y + z;
    (sum > 0.0).then(|| [x / sum, y / sum])
}

/// Linear RGB → XYZ for `primaries` such that (1, 1, 1) has the chromaticity of `white` and Y = 1.
///
/// Source: SMPTE RP 177:1993. `None` when the primaries lie on one line.
#[must_use]
pub fn xyz_from_rgb(primaries: [[f64; 2]; 3], white: [f64; 2]) -> Option<Matrix3> {
    let at_unit_y = |[x, y]: [f64; 2]| [x / y, 1.0, (1.0 - x - y) / y];
    let columns = transpose(primaries.map(at_unit_y));
    let scale = apply(&inverse(&columns)?, at_unit_y(white));
    Some(columns.map(|row| std::array::from_fn(|k| row[k] * scale[k])))
}

/// Linear sRGB → XYZ with Y = 1 for white.
pub static XYZ_FROM_SRGB: LazyLock<Matrix3> =
    LazyLock::new(|| xyz_from_rgb(SRGB_PRIMARIES, SRGB_WHITE).unwrap_or_default());

/// XYZ → linear sRGB, the inverse of [`XYZ_FROM_SRGB`].
pub static SRGB_FROM_XYZ: LazyLock<Matrix3> =
    LazyLock::new(|| inverse(&XYZ_FROM_SRGB).unwrap_or_default());

/// Linear sRGB of what an observer sees when the light of `source` falls on a surface of this
/// `reflectance`, a perfect white being (1, 1, 1) under D65 and Y = 1 under any source.
#[must_use]
pub fn srgb_of_reflectance(reflectance: &Curve, source: Illuminant) -> Option<[f64; 3]> {
    let light = source.curve().ok()?;
    let [from, to] = OBSERVER[0].range();
    let white = integral(&[&light, &OBSERVER[1]], from, to);
    let seen = |k: usize| integral(&[reflectance, &light, &OBSERVER[k]], from, to) / white;
    Some(apply(&SRGB_FROM_XYZ, std::array::from_fn(seen)))
}

/// sRGB's transfer function: linear light in 0..=1 to a display value in 0..=1. Values outside are
/// clipped and NaN is 0.
#[must_use]
pub fn srgb_encode(linear: f64) -> f64 {
    let linear = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_encode`].
#[must_use]
pub fn srgb_decode(display: f64) -> f64 {
    let display = if display.is_nan() { 0.0 } else { display.clamp(0.0, 1.0) };
    if display <= 0.040_45 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

/// The product of a matrix and a column.
#[must_use]
pub fn apply(matrix: &Matrix3, column: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * column[0] + row[1] * column[1] + row[2] * column[2])
}

/// The matrix with rows and columns exchanged.
#[must_use]
pub fn transpose(m: Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|k| m[k][i]))
}

/// The inverse; `None` for a singular matrix.
#[must_use]
pub fn inverse(m: &Matrix3) -> Option<Matrix3> {
    let cofactor = |i: usize, k: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|k| m[0][k] * cofactor(0, k)).sum();
    let inverted: Matrix3 =
        std::array::from_fn(|i| std::array::from_fn(|k| cofactor(k, i) / determinant));
    inverted.iter().flatten().all(|value| value.is_finite()).then_some(inverted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_observer_sees_equal_energy_as_white_and_d65_as_the_white_of_srgb() {
        // CIE 15:2018, table 3: illuminant E is (1/3, 1/3); the three functions were given equal
        // areas, kept to 2e-4 by their rounded values.
        let [x, y] = chromaticity(xyz(&Curve::ONE)).unwrap();
        assert!((x - 1.0 / 3.0).abs() < 1e-4 && (y - 1.0 / 3.0).abs() < 1e-4, "{x} {y}");
        // The CIE's (0.31272, 0.32903) for D65 and (0.34567, 0.35851) for D50 are sums over 5 nm of
        // the same tables; the integral of straight lines differs by less than 3e-5.
        for (source, white) in [
            (Illuminant::D65, [0.312_72, 0.329_03]),
            (Illuminant::D50, [0.345_67, 0.358_51]),
            (Illuminant::A, [0.447_58, 0.407_45]),
        ] {
            let [x, y] = chromaticity(xyz(&source.curve().unwrap())).unwrap();
            let far = (x - white[0]).abs().max((y - white[1]).abs());
            assert!(far < 5e-5, "{source:?}: {x} {y}");
        }
    }

    #[test]
    fn the_matrix_is_that_of_the_standard() {
        // IEC 61966-2-1, equation 7, four decimals.
        let standard =
            [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        for (row, expected) in XYZ_FROM_SRGB.iter().zip(standard) {
            for (value, expected) in row.iter().zip(expected) {
                assert!((value - expected).abs() < 5e-5, "{value} {expected}");
            }
        }
        let back = apply(&SRGB_FROM_XYZ, apply(&XYZ_FROM_SRGB, [0.2, 0.5, 0.9]));
        assert!(back.iter().zip([0.2, 0.5, 0.9]).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn a_white_surface_under_d65_is_white() {
        let [r, g, b] = srgb_of_reflectance(&Curve::ONE, Illuminant::D65).unwrap();
        // The standard rounds the white to four decimals.
        for value in [r, g, b] {
            assert!((value - 1.0).abs() < 5e-4, "{r} {g} {b}");
        }
    }

    #[test]
    fn the_transfer_function_inverts_and_joins() {
        for i in 0..=1000 {
            let display = f64::from(i) / 1000.0;
            // The standard's two pieces miss each other by 1e-8 of linear light where they meet.
            assert!((srgb_encode(srgb_decode(display)) - display).abs() < 2e-7, "{display}");
        }
        assert!((srgb_encode(0.18) - 0.461_356).abs() < 1e-6);
        assert_eq!(srgb_encode(f64::NAN), 0.0);
        assert!((srgb_encode(7.0) - 1.0).abs() < 1e-15);
    }
}
