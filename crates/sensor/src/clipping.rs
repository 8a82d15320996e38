//! Mean and variance of a normal variable that cannot leave an interval.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

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
