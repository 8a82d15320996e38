//! Failures of the normal approximation of the Poisson distribution.
//!
//! A pixel of mean μ electrons and read noise σ gives Poisson(μ) + N(0, σ²); the approximation gives
//! N(μ, μ + σ²). Mean and variance agree, everything else does not: at few electrons the true
//! distribution is skewed, and with little read noise it is a comb.

use serde::Serialize;

use crate::normal::{normal_cdf, normal_density};
use crate::poisson::probability;

/// Deviation of the approximation from the truth, in electrons, before the converter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Deviation {
    /// μ (e⁻).
    pub mean: f64,
    /// σ (e⁻).
    pub read_noise: f64,
    /// The largest difference of the two distribution functions (Kolmogorov's distance).
    pub distance: f64,
    /// Amount that clipping at 0 adds to the mean without a black level (e⁻), in truth.
    pub bias: f64,
    /// The same in the approximation.
    pub bias_of_normal: f64,
    /// The skewness in truth; the approximation has none.
    pub skewness: f64,
}

impl Deviation {
    /// For a mean in 0..=10⁶ e⁻ and a read noise in 0..=1000 e⁻; numbers outside are put on the
    /// nearer end, NaN on 0.
    #[must_use]
    pub fn new(mean: f64, read_noise: f64) -> Self {
        let number = |value: f64| if value.is_nan() { 0.0 } else { value };
        let truth = Mixture::new(number(mean).clamp(0.0, 1e6), number(read_noise).clamp(0.0, 1e3));
        let (mean, sigma) = (truth.mean, truth.sigma);
        let variance = mean + sigma * sigma;
        let positive_part = |centre: f64, sigma: f64| {
            if sigma > 0.0 {
                centre * normal_cdf(centre / sigma) + sigma * normal_density(centre / sigma)
            } else {
                centre.max(0.0)
            }
        };
        let clipped: f64 =
            truth.terms.iter().map(|&(n, p)| p * positive_part(n, sigma)).sum::<f64>();
        Self {
            mean,
            read_noise: sigma,
            distance: truth.distance_to_normal(),
            bias: clipped - mean,
            bias_of_normal: positive_part(mean, variance.sqrt()) - mean,
            skewness: if variance > 0.0 { mean / variance.powf(1.5) } else { 0.0 },
        }
    }
}

/// The mean electrons above which the approximation stays closer than `limit` (of Kolmogorov's
/// distance, 0.001 or more) at this read noise (e⁻), to 1 %; searched downwards. `None` when it always
/// stays closer.
#[must_use]
pub fn electrons_needed(read_noise: f64, limit: f64) -> Option<f64> {
    let limit = limit.max(1e-3);
    let distance = |mean: f64| Deviation::new(mean, read_noise).distance;
    // With little read noise electrons are a comb, and the distance swings with every electron.
    let turns: &[f64] = if read_noise < 0.7 { &[0.0, 0.25, 0.5, 0.75] } else { &[0.0] };
    // Without any read noise the distance is below 0.3/√μ, with some it is less.
    let mut mean = (0.3 / limit).powi(2);
    while mean > 1e-3 {
        let swing = mean.min(1.0);
        let worst = turns.iter().map(|turn| distance(mean + swing * turn)).fold(0.0, f64::max);
        if worst >= limit {
            let fine = (0..=50).map(|i| mean + swing * (1.0 - f64::from(i) / 50.0));
            return fine.into_iter().find(|&mean| distance(mean) >= limit).or(Some(mean));
        }
        // The distance falls about like 1/√μ: far below the limit the steps may be long.
        mean /= if worst < 0.7 * limit { 1.1 } else { 1.01 };
    }
    None
}

/// Poisson(μ) + N(0, σ²).
struct Mixture {
    mean: f64,
    sigma: f64,
    /// `(n, probability)` of all that matter, ascending.
    terms: Vec<(f64, f64)>,
    /// Probability of `n` and all below, for each term.
    cumulative: Vec<f64>,
}

impl Mixture {
    fn new(mean: f64, sigma: f64) -> Self {
        let reach = 9.0 * mean.sqrt() + 30.0;
        let first = (mean - reach).floor().max(0.0);
        let mut terms = Vec::new();
        let mut cumulative = Vec::new();
        let (mut n, mut sum) = (first, 0.0);
        while n <= mean + reach {
            let (exponent, factor) = if mean > 0.0 {
                probability(n, mean)
            } else {
                (0.0, f64::from(u8::from(n == 0.0)))
            };
            let p = factor * exponent.exp();
            sum += p;
            terms.push((n, p));
            cumulative.push(sum);
            n += 1.0;
        }
        Self { mean, sigma, terms, cumulative }
    }

    /// P(X ≤ x), and P(X < x): they differ where there is no read noise.
    fn distribution(&self, x: f64) -> [f64; 2] {
        let reach = 8.5 * self.sigma;
        let first = self.terms[0].0;
        let index = |n: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let i = (n - first).clamp(0.0, self.terms.len() as f64) as usize;
            i
        };
        if self.sigma <= 0.0 {
            let below = |count: usize| if count == 0 { 0.0 } else { self.cumulative[count - 1] };
            return [below(index(x.floor() + 1.0)), below(index(x.ceil()))];
        }
        let (low, high) = (index((x - reach).floor()), index((x + reach).ceil() + 1.0));
        let whole = if low == 0 { 0.0 } else { self.cumulative[low - 1] };
        let near = self.terms[low..high.max(low)].iter();
        let part: f64 = near.map(|&(n, p)| p * normal_cdf((x - n) / self.sigma)).sum();
        [whole + part; 2]
    }

    /// Looks at the difference on a grid fine enough for the narrowest feature, then around its
    /// greatest value.
    fn distance_to_normal(&self) -> f64 {
        let spread = (self.mean + self.sigma * self.sigma).sqrt();
        if spread <= 0.0 {
            return 0.0;
        }
        let difference = |x: f64| {
            let normal = normal_cdf((x - self.mean) / spread);
            self.distribution(x).iter().map(|f| (f - normal).abs()).fold(0.0, f64::max)
        };
        if self.sigma <= 0.0 {
            return self.terms.iter().map(|&(n, _)| difference(n)).fold(0.0, f64::max);
        }
        // The greatest difference lies within three spreads of the mean.
        let step = (self.sigma / 8.0).min(spread / 40.0);
        #[expect(clippy::cast_possible_truncation, reason = "a few hundred thousand at most")]
        let count = (3.0 * spread / step).ceil() as i32;
        let at = |i: i32| self.mean + step * f64::from(i);
        let best = (-count..=count)
            .map(|i| (difference(at(i)), i))
            .fold((0.0, 0), |best, this| if this.0 > best.0 { this } else { best });
        let fine = (-20..=20).map(|i| difference(at(best.1) + step * f64::from(i) / 20.0));
        fine.fold(best.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_approximation_fails_where_it_is_known_to() {
        // An independent computation of the same limits, two to three digits.
        for (sigma, limit, expected) in [
            (0.3, 0.05, 2.8),
            (0.3, 0.02, 19.5),
            (0.3, 0.01, 75.0),
            (0.5, 0.05, 0.85),
            (0.5, 0.01, 45.0),
            (1.0, 0.02, 7.7),
            (1.0, 0.01, 42.0),
            (2.0, 0.01, 30.0),
        ] {
            let found = electrons_needed(sigma, limit).unwrap();
            assert!((found / expected - 1.0).abs() < 0.04, "σ {sigma}, {limit}: {found}");
        }
        for (sigma, limit) in [(1.0, 0.05), (2.0, 0.02), (3.0, 0.01), (10.0, 0.005)] {
            assert_eq!(electrons_needed(sigma, limit), None, "σ {sigma}, {limit}");
        }
    }

    #[test]
    fn many_electrons_are_off_by_their_skewness_alone() {
        // Edgeworth's first term: the distance tends to skewness / (6·√(2π)).
        for mean in [300.0, 1000.0, 10_000.0] {
            let deviation = Deviation::new(mean, 2.0);
            let expected = deviation.skewness / (6.0 * (2.0 * std::f64::consts::PI).sqrt());
            assert!((deviation.distance / expected - 1.0).abs() < 0.02, "{mean}: {deviation:?}");
            assert!((deviation.skewness - mean / (mean + 4.0f64).powf(1.5)).abs() < 1e-15);
        }
    }

    #[test]
    fn without_read_noise_electrons_are_a_comb() {
        // At no light everything is 0, and half of the normal distribution is below.
        assert_eq!(Deviation::new(0.0, 0.0).distance, 0.0);
        let few = Deviation::new(0.01, 0.0).distance;
        // All but 1 % of the mass at 0, where Φ(−0.1) = 0.46.
        assert!((few - (0.990_05 - 0.460_17)).abs() < 1e-4, "{few}");
        assert!(Deviation::new(100.0, 0.0).distance > 0.02);
    }

    #[test]
    fn clipping_adds_what_it_should() {
        // σ·φ(0) at no light: 1.197 e⁻ at 3 e⁻, in both.
        let dark = Deviation::new(0.0, 3.0);
        assert!(
            (dark.bias - 1.196_83).abs() < 1e-5 && (dark.bias_of_normal - dark.bias).abs() < 1e-12
        );
        // Without read noise there is nothing to clip but in the approximation.
        let quiet = Deviation::new(1.0, 0.0);
        assert!(quiet.bias.abs() < 1e-12 && quiet.bias_of_normal > 0.08, "{quiet:?}");
        let bright = Deviation::new(1000.0, 3.0);
        assert!(bright.bias.abs() < 1e-9 && bright.bias_of_normal.abs() < 1e-9);
    }
}
