//! Angles of many directions side by side, in turns, in either precision: what a map of all directions is looked up by,
//! and back.
//! Polynomials on local arrays, without a table or a branch, so that they vectorise.
//!
//! # Sources
//!
//! * The arc tangent of t up to tan π/8: t times a polynomial in t² through its values at the eleven Chebyshev
//!   nodes, whose relative error is below 1.2 · 10⁻¹⁶ before rounding; from there to 1 by
//!   arctan t = π/4 + arctan((t − 1)/(t + 1)) (Hart et al., *Computer Approximations*, 1968, section 6.5).
//! * Sine and cosine to π/4: [`Float::small_sine_cosine`].

use std::f64::consts::TAU;

use etendue_geometry::Float;

/// tan π/8.
const EIGHTH: f64 = 0.414_213_562_373_095_03;

/// Of arctan t / (2π t), by powers of t².
const ARC: [f64; 11] = [
    0.159_154_943_091_895_32,
    -0.053_051_647_697_290_656,
    0.031_830_988_616_556_706,
    -0.022_736_420_274_990_697,
    0.017_683_874_717_951_027,
    -0.014_468_414_705_160_23,
    0.012_238_940_998_704_654,
    -0.010_568_259_590_106_346,
    0.009_053_284_031_558_473,
    -0.006_920_125_450_799_899,
    0.003_363_780_726_340_955_5,
];

#[inline(always)]
fn polynomial<F: Float, const N: usize>(coefficients: &[f64; N], x: F) -> F {
    let mut sum = F::of(coefficients[N - 1]);
    for k in (0..N - 1).rev() {
        sum = sum * x + F::of(coefficients[k]);
    }
    sum
}

/// The angle of (x, y) against the first axis (turns, −1/2 to 1/2), to 2 · 10⁻¹⁶ in double precision; some number where
/// both are 0.
#[inline(always)]
fn arc_tangent<F: Float>(y: F, x: F) -> F {
    let (tall, wide) = (y.abs(), x.abs());
    let is_flat = tall < wide;
    let (least, most) = if is_flat { (tall, wide) } else { (wide, tall) };
    let is_steep = least > F::of(EIGHTH) * most;
    let numerator = if is_steep { least - most } else { least };
    let denominator = if is_steep { least + most } else { most };
    let t = numerator / if denominator > F::ZERO { denominator } else { F::of(1.0) };
    let angle = t * polynomial(&ARC, t * t) + if is_steep { F::of(0.125) } else { F::ZERO };
    let angle = if is_flat { angle } else { F::of(0.25) - angle };
    let angle = if x < F::ZERO { F::of(0.5) - angle } else { angle };
    angle.copysign(y)
}

/// Sine and cosine of an angle (turns, few of them), to 3 · 10⁻¹⁶ in double precision.
#[inline(always)]
fn sine_and_cosine<F: Float>(turns: F) -> [F; 2] {
    let (whole, quarter) = (F::of(4.0) * turns).nearest();
    let (sine, cosine) = (F::of(TAU) * (turns - F::of(0.25) * whole)).small_sine_cosine();
    let (a, b) = if quarter & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    [if quarter & 2 == 0 { a } else { -a }, if quarter.wrapping_add(1) & 2 == 0 { b } else { -b }]
}

/// Longitudes and latitudes (u, v) in 0..=1 of unit directions by axis: −Z is in the middle, +Y above.
#[inline(always)]
pub(crate) fn places<F: Float, const N: usize>([x, y, z]: &[[F; N]; 3]) -> [[F; N]; 2] {
    let [mut u, mut v] = [[F::ZERO; N]; 2];
    for i in 0..N {
        u[i] = F::of(0.5) + arc_tangent(x[i], -z[i]);
    }
    for i in 0..N {
        v[i] = F::of(2.0) * arc_tangent((x[i] * x[i] + z[i] * z[i]).sqrt(), y[i]);
    }
    [u, v]
}

/// The unit directions of such places, and the sines of their angles with +Y.
#[inline(always)]
pub(crate) fn directions<F: Float, const N: usize>([u, v]: &[[F; N]; 2]) -> ([[F; N]; 3], [F; N]) {
    let [mut x, mut y, mut z, mut sines] = [[F::ZERO; N]; 4];
    for i in 0..N {
        let [sine, cosine] = sine_and_cosine(F::of(0.5) * v[i]);
        (sines[i], y[i]) = (sine, cosine);
    }
    for i in 0..N {
        let [sine, cosine] = sine_and_cosine(u[i] - F::of(0.5));
        (x[i], z[i]) = (sines[i] * sine, -sines[i] * cosine);
    }
    ([x, y, z], sines)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LANES: usize = 16;

    /// By the standard library, whose functions are good to a unit in the last place: a turn is 2π of its angles.
    #[test]
    fn angles_are_those_of_the_library() {
        for k in 0..200_000 {
            let angle = f64::from(k) / 200_000.0 * TAU - TAU / 2.0;
            for radius in [1e-150, 1.0, 1e150] {
                let (y, x) = (radius * angle.sin(), radius * angle.cos());
                let (found, known) = (arc_tangent(y, x), y.atan2(x) / TAU);
                assert!((found - known).abs() < 2e-16, "{y} {x}: {found} {known}");
            }
            let turns: f64 = f64::from(k) / 100_000.0 - 1.0;
            let found = sine_and_cosine(turns);
            // The library is given the angle as rounded: 2π has an error of 2.4e-16, and up to four roundings.
            let known = (turns * TAU).sin_cos();
            assert!((found[0] - known.0).abs() < 1.5e-15, "{turns}: {found:?} {known:?}");
            assert!((found[1] - known.1).abs() < 1.5e-15, "{turns}: {found:?} {known:?}");
        }
        // Where x is tiny beside y, and the other way around, nothing is lost.
        for tiny in [1e-300, 1e-20, 1e-9] {
            assert!((arc_tangent(tiny, 1.0) / (tiny / TAU) - 1.0).abs() < 4e-16);
            assert_eq!(arc_tangent(-1.0, tiny).to_bits() >> 63, 1);
        }
        for (y, x) in [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (-0.0, -1.0)] {
            assert_eq!(arc_tangent(y, x), f64::atan2(y, x) / TAU);
        }
        assert!(arc_tangent::<f64>(0.0, 0.0).is_finite());
        assert_eq!(
            [0.0_f64, 0.25, 0.5, -0.25].map(|turns| sine_and_cosine(turns)[0]),
            [0.0, 1.0, 0.0, -1.0]
        );
    }

    #[test]
    fn places_and_directions_are_inverse() {
        for k in 0..4_096 {
            let columns: [f64; LANES] = [(f64::from(k) + 0.5) / 4_096.0; LANES];
            let row = [columns, std::array::from_fn(|i| (i as f64 + 0.5) / LANES as f64)];
            let (directions, sines) = directions(&row);
            let back = places(&directions);
            for i in 0..LANES {
                let [x, y, z] = [0, 1, 2].map(|axis: usize| directions[axis][i]);
                assert!((x * x + y * y + z * z - 1.0).abs() < 1e-15);
                assert!((sines[i] - (x * x + z * z).sqrt()).abs() < 1e-15);
                // Rounding of the direction moves its longitude by that over the sine, here at least 0.09.
                for axis in 0..2 {
                    assert!((back[axis][i] - row[axis][i]).abs() < 2e-15, "{:?}", [x, y, z]);
                }
            }
        }
    }

    #[test]
    fn single_precision_is_double_rounded() {
        for k in 0..4_096 {
            let u = [(f64::from(k) + 0.5) / 4_096.0; LANES];
            let v = std::array::from_fn(|i| (i as f64 + 0.5) / LANES as f64);
            let (wide, _) = directions(&[u, v]);
            let (narrow, _) = directions(&[u, v].map(|row| row.map(f32::of)));
            let back = places(&narrow);
            for i in 0..LANES {
                for axis in 0..3 {
                    // Some roundings of angles of up to 2π.
                    let error = (f64::from(narrow[axis][i]) - wide[axis][i]).abs();
                    assert!(error < 2e-6, "{k} {i}: {error}");
                }
                for (axis, place) in [u[i], v[i]].into_iter().enumerate() {
                    // The same over the sine, here at least 0.09, and 2π.
                    let error = (f64::from(back[axis][i]) - place).abs();
                    assert!(error < 4e-6, "{k} {i}: {error}");
                }
            }
        }
    }
}
