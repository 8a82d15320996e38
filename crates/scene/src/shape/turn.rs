//! Sine and cosine of whole turns, the same to the last bit on every machine: the system's own
//! functions may differ in it, and a scene's hash must not.
//!
//! # Sources
//!
//! Coefficients of `__kernel_sin` and `__kernel_cos` of Sun's fdlibm 5.3 (1993), good to less than
//! one unit in the last place on ±π/4.

use std::f64::consts::TAU;

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_007e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// (sin 2πt, cos 2πt), exact at quarter turns. |t| should stay below 2⁵⁰.
#[inline]
pub(super) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let quarters = (turns * 4.0).round_ties_even();
    let angle = (turns - quarters * 0.25) * TAU;
    let square = angle * angle;
    let polynomial = |c: &[f64; 6]| {
        c[0] + square * (c[1] + square * (c[2] + square * (c[3] + square * (c[4] + square * c[5]))))
    };
    let sin = angle + angle * square * polynomial(&SIN);
    let cos = 1.0 - 0.5 * square + square * square * polynomial(&COS);
    #[expect(clippy::cast_possible_truncation, reason = "whole, and below 2⁵²")]
    let quadrant = quarters as i64 & 3;
    let (sin, cos) = if quadrant & 1 == 1 { (cos, -sin) } else { (sin, cos) };
    if quadrant >= 2 { (-sin, -cos) } else { (sin, cos) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_system_and_is_exact_at_quarters() {
        for i in -4000..4000 {
            let turns = f64::from(i) * 0.000_73;
            let (sin, cos) = sin_cos_turns(turns);
            let (expected_sin, expected_cos) = (turns * TAU).sin_cos();
            // The reference rounds 2πt, |t| < 3, before it looks: 19 · 2⁻⁵³.
            assert!((sin - expected_sin).abs() < 3e-15, "{turns}: {sin} {expected_sin}");
            assert!((cos - expected_cos).abs() < 3e-15, "{turns}: {cos} {expected_cos}");
        }
        let quarters: Vec<_> = (0..5).map(|q| sin_cos_turns(f64::from(q) * 0.25)).collect();
        assert_eq!(quarters, [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)]);
    }
}
