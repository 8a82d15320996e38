//! Normal deviates, two at a time, and the elementary functions they need: short polynomials
//! without branches, so that a compiler makes vectors of them, and the same bits on any machine
//! (the system's own `ln` and `sin` differ between systems).
//!
//! # Sources
//!
//! * G. E. P. Box and M. E. Muller, "A Note on the Generation of Random Normal Deviates", 1958.
//! * Logarithm: the reduction and coefficients of fdlibm's `e_log.c` (Sun Microsystems, 1993).
//! * Sine, cosine and exponential: Taylor series.
//!
//! Mean and variance of a normal variable that cannot leave an interval.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, LN_2, LOG2_E, PI};

use crate::philox::unit52;

/// 2⁵² + 2⁵¹: adding it and taking it away again rounds a number to the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Two independent standard normal deviates from three random words (in the low halves).
///
/// The radius has 52 random bits, so deviates reach 8.5; the angle has 32.
#[inline(always)]
pub(crate) fn pair(words: [u64; 3]) -> [f64; 2] {
    let radius = (-2.0 * ln(unit52(words[0], words[1]))).sqrt();
    // Three bits choose the eighth of the circle, the others a place in it.
    let place = f64::from_bits(0x3FF0_0000_0000_0000 | (words[2] >> 3) << 23 | 1 << 22) - 1.0;
    let (sin, cos) = sin_cos_eighth(place * FRAC_PI_4);
    let swap = words[2] & 1 == 0;
    let (x, y) = (if swap { sin } else { cos }, if swap { cos } else { sin });
    let signed = |value: f64, bit: u64| f64::from_bits(value.to_bits() ^ bit << 63);
    [radius * signed(x, words[2] >> 1 & 1), radius * signed(y, words[2] >> 2 & 1)]
}

/// The natural logarithm of a normal positive number, to 1e-15 of its size.
#[inline(always)]
pub(crate) fn ln(x: f64) -> f64 {
    let (k, m) = split(x);
    k * LN_2 + ln_1p_small(m - 1.0)
}

/// ln(1 + f) for f > −1.
#[inline(always)]
pub(crate) fn ln_1p(f: f64) -> f64 {
    let (k, m) = split(1.0 + f);
    let small = (f > -0.29) & (f < 0.41);
    let rest = if small { f } else { m - 1.0 };
    ln_1p_small(rest) + if small { 0.0 } else { k * LN_2 }
}

/// x = 2ᵏ·m with m in [√½, √2).
#[inline(always)]
fn split(x: f64) -> (f64, f64) {
    const SQRT_HALF: u64 = 0x3FE6_A09E_0000_0000;
    let shifted = x.to_bits().wrapping_add(0x3FF0_0000_0000_0000 - SQRT_HALF);
    let k =
        f64::from_bits(0x4330_0000_0000_0000 | shifted >> 52) - (4_503_599_627_370_496.0 + 1023.0);
    (k, f64::from_bits((shifted & 0x000F_FFFF_FFFF_FFFF) + SQRT_HALF))
}

/// ln(1 + f) for f in √½ − 1 ..= √2 − 1.
#[inline(always)]
fn ln_1p_small(f: f64) -> f64 {
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let odd = w * horner(
        w,
        [0.399_999_999_994_094_2, 0.222_221_984_321_497_84, 0.153_138_376_992_093_73],
    );
    let even = z * horner(
        w,
        [
            0.666_666_666_666_673_5,
            0.285_714_287_436_623_9,
            0.181_835_721_616_180_5,
            0.147_981_986_051_165_86,
        ],
    );
    let half_square = 0.5 * f * f;
    f - (half_square - s * (half_square + odd + even))
}

/// Sine and cosine of an angle in 0..=π/4, to 3e-14.
#[inline(always)]
pub(crate) fn sin_cos_eighth(x: f64) -> (f64, f64) {
    const SIN: [f64; 7] = [
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
    ];
    const COS: [f64; 8] = [
        1.0,
        -0.5,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
    ];
    let z = x * x;
    (x * horner(z, SIN), horner(z, COS))
}

/// 1/k!.
const EXP: [f64; 13] = {
    let mut terms = [1.0; 13];
    let mut k = 1;
    while k < 13 {
        terms[k] = terms[k - 1] / k as f64;
        k += 1;
    }
    terms
};

/// eˣ to 1e-15 of its size for |x| ≤ 700; beyond, what 700 gives.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    let x = x.clamp(-700.0, 700.0);
    let shifted = x * LOG2_E + ROUNDER;
    let k = shifted - ROUNDER;
    // ln 2 in two parts, the first with zeros at its end, so that k times it is exact.
    let r = (x - k * 0.693_147_180_369_123_8) - k * 1.908_214_929_270_587_7e-10;
    let series = horner(r, EXP);
    // The low bits of the shifted number are k; they go into the exponent.
    f64::from_bits(series.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// c₀ + c₁·x + c₂·x² + …
#[inline(always)]
fn horner<const N: usize>(x: f64, coefficients: [f64; N]) -> f64 {
    let mut sum = coefficients[N - 1];
    for k in (0..N - 1).rev() {
        sum = sum * x + coefficients[k];
    }
    sum
}

/// The greatest integer not above `x`, for |x| < 2⁵¹.
#[inline(always)]
pub(crate) fn floor(x: f64) -> f64 {
    let nearest = (x + ROUNDER) - ROUNDER;
    nearest - f64::from(u8::from(nearest > x))
}

/// P(Z ≤ z) of a standard normal variable.
pub(crate) fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// The density of a standard normal variable.
pub(crate) fn normal_density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// `[mean, variance]` of a normal variable of that mean and variance after values outside of
/// `low..=high` were put on the nearer end (Greene 2003, "Econometric Analysis", theorem 22.3, for
/// both ends).
pub(crate) fn clipped([mean, variance]: [f64; 2], low: f64, high: f64) -> [f64; 2] {
    let sigma = variance.sqrt();
    if sigma <= 0.0 || sigma.is_nan() {
        return [mean.clamp(low, high), 0.0];
    }
    // In units of σ from the mean; ten σ away nothing is left to clip.
    let [a, b] = [(low - mean) / sigma, (high - mean) / sigma].map(|z| z.clamp(-40.0, 40.0));
    if a < -10.0 && b > 10.0 {
        return [mean, variance];
    }
    let (below, above) = (normal_cdf(a), normal_cdf(-b));
    let inside = (1.0 - below - above).max(0.0);
    let (at_low, at_high) = (normal_density(a), normal_density(b));
    let first = a * below + b * above + at_low - at_high;
    let second = a * a * below + b * b * above + inside + a * at_low - b * at_high;
    let left = (second - first * first).max(0.0);
    [(mean + sigma * first).clamp(low, high), variance * left]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_the_systems() {
        for i in 1..=200_000u32 {
            let t = f64::from(i) / 200_000.0;
            for x in [t, t * 1e-10, f64::EPSILON * f64::from(i)] {
                let (ours, theirs) = (ln(x), x.ln());
                assert!((ours - theirs).abs() <= 4e-16 * theirs.abs(), "ln {x}: {ours} {theirs}");
            }
            let (sin, cos) = sin_cos_eighth(t * FRAC_PI_4);
            let (s, c) = (t * FRAC_PI_4).sin_cos();
            assert!((sin - s).abs() < 3e-14 && (cos - c).abs() < 3e-14, "{t}");
            let (ours, theirs) = (exp(-40.0 * t), (-40.0 * t).exp());
            assert!((ours / theirs - 1.0).abs() < 1e-15, "exp {t}: {ours} {theirs}");
        }
        assert_eq!(ln(1.0), 0.0);
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn floors_are_floors() {
        for x in [0.0, 0.5, 1.0, 1.5, 2.5, 1e9 + 0.999, -0.1, -1.0, -2.5, 4e14 + 0.5] {
            assert_eq!(floor(x), f64::floor(x), "{x}");
        }
    }

    #[test]
    fn clipped_moments_agree_with_numerical_integration() {
        for (mean, variance, low, high) in [
            (0.0, 1.0, 0.0, 100.0),
            (3.0, 4.0, 0.0, 5.0),
            (99.0, 9.0, 0.0, 100.0),
            (-4.0, 1.0, 0.0, 100.0),
            (50.0, 25.0, 0.0, 100.0),
            (130.0, 25.0, 0.0, 100.0),
        ] {
            let sigma = f64::sqrt(variance);
            let (mut first, mut second) = (0.0, 0.0);
            let step = 1e-4;
            for i in -120_000..=120_000 {
                let z = f64::from(i) * step;
                let x = (mean + sigma * z).clamp(low, high);
                let weight = normal_density(z) * step;
                first += weight * x;
                second += weight * (x - mean) * (x - mean);
            }
            let expected = second - (first - mean) * (first - mean);
            let [m, v] = clipped([mean, variance], low, high);
            // The sum's own error is below 1e-8 of the spread.
            assert!(
                (m - first).abs() < 1e-7 * (1.0 + mean.abs()),
                "{mean} {variance}: {m} {first}"
            );
            assert!((v - expected).abs() < 1e-6 * variance, "{mean} {variance}: {v} {expected}");
        }
        assert_eq!(clipped([7.0, 0.0], 0.0, 5.0), [5.0, 0.0]);
        assert_eq!(clipped([7.0, 2.0], f64::NEG_INFINITY, f64::INFINITY), [7.0, 2.0]);
    }
}
