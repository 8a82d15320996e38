//! The unit square on the unit disk, and shares of a full turn, without calls, so that loops over many points vectorise.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A point of the unit square on the unit disk, equal areas staying equal (P. Shirley and K. Chiu, "A
/// low distortion map between disk and square", 1997).
#[must_use]
#[inline(always)]
pub fn point([u, v]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let flat = a.abs() > b.abs();
    let (radius, other) = if flat { (a, b) } else { (b, a) };
    let ratio = if radius == 0.0 { 0.0 } else { other / radius };
    let (sine, cosine) = small_sine_cosine(FRAC_PI_4 * ratio);
    if flat { [radius * cosine, radius * sine] } else { [radius * sine, radius * cosine] }
}

/// Sine and cosine of a share of a full turn, 0..=1.
#[must_use]
#[inline(always)]
pub fn turn(share: f64) -> (f64, f64) {
    // The nearest quarter, and the rest to it.
    let quarter = |from: f64| if share >= from { 1.0 } else { 0.0 };
    let quarters = quarter(0.125) + quarter(0.375) + quarter(0.625) + quarter(0.875);
    let (sine, cosine) = small_sine_cosine(FRAC_PI_2 * (4.0 * share - quarters));
    let is_odd = (quarters == 1.0) | (quarters == 3.0);
    let (a, b) = if is_odd { (cosine, sine) } else { (sine, cosine) };
    let a_falls = (quarters == 2.0) | (quarters == 3.0);
    let b_falls = (quarters == 1.0) | (quarters == 2.0);
    (if a_falls { -a } else { a }, if b_falls { -b } else { b })
}

/// Sine and cosine of an angle (rad) of at most π/4 by Taylor's series: what is left out is below 5 · 10⁻¹⁷.
#[must_use]
#[inline(always)]
pub fn small_sine_cosine(angle: f64) -> (f64, f64) {
    let x = angle * angle;
    let series = |terms: [f64; 8]| {
        let mut sum = terms[7];
        for k in (0..7).rev() {
            sum = sum * x + terms[k];
        }
        sum
    };
    let sine = series([
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ]);
    let cosine = series([
        -1.0 / 2.0,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ]);
    (angle * sine, 1.0 + x * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_middles_of_the_square_are_on_the_rim() {
        for (square, angle) in [([1.0, 0.5], 0.0_f64), ([1.0, 1.0], 45.0), ([0.5, 1.0], 90.0)] {
            let [x, y] = point(square);
            let (sine, cosine) = angle.to_radians().sin_cos();
            assert!((x - cosine).abs() + (y - sine).abs() < 1e-15, "{square:?}: {x} {y}");
        }
        assert_eq!(point([0.5, 0.5]), [0.0, 0.0]);
    }

    #[test]
    fn shares_of_a_turn_have_their_sine_and_cosine() {
        for i in 0..=1000 {
            let share = f64::from(i) / 1000.0;
            let (sine, cosine) = turn(share);
            let (own, other) = (std::f64::consts::TAU * share).sin_cos();
            // The library's angle is rounded: up to half a spacing of 2π.
            assert!((sine - own).abs() < 1e-15, "{share}: {sine}");
            assert!((cosine - other).abs() < 1e-15, "{share}: {cosine}");
        }
        assert_eq!(turn(0.5), (0.0, -1.0));
    }

    #[test]
    fn sines_and_cosines_are_those_of_the_library() {
        for i in -100..=100 {
            let angle = FRAC_PI_4 * f64::from(i) / 100.0;
            let (sine, cosine) = small_sine_cosine(angle);
            // A rounding of each of two operations near 1.
            assert!((sine - angle.sin()).abs() < 3e-16, "{angle}: {sine}");
            assert!((cosine - angle.cos()).abs() < 3e-16, "{angle}: {cosine}");
        }
    }
}
