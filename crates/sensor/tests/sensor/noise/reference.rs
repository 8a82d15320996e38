//! Distributions from textbook formulas and `libm`, none of the crate's own code.

/// Poisson probability of `k` at `mean`.
pub(crate) fn poisson(k: u32, mean: f64) -> f64 {
    let k = f64::from(k);
    (k * mean.ln() - mean - libm::lgamma(k + 1.0)).exp()
}

/// P(Z ≤ z).
pub(crate) fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

/// Probabilities of the digital numbers 0..=white of K·(Poisson(mean) + N(0, σ²)) + black, rounded
/// and clipped.
pub(crate) fn poisson_gauss(mean: f64, sigma: f64, gain: f64, black: f64, white: u32) -> Vec<f64> {
    let reach = 12.0 * mean.sqrt() + 40.0;
    let first = (mean - reach).max(0.0) as u32;
    let last = (mean + reach) as u32;
    let mut probabilities = vec![0.0; white as usize + 1];
    for n in first..=last {
        let weight = poisson(n, mean);
        let below = |y: f64| {
            let z = (y - black) / gain - f64::from(n);
            if sigma > 0.0 { normal_cdf(z / sigma) } else { f64::from(u8::from(z > 0.0)) }
        };
        let mut previous = 0.0;
        for (y, probability) in (0..=white).zip(&mut probabilities) {
            let up_to = if y == white { 1.0 } else { below(f64::from(y) + 0.5) };
            *probability += weight * (up_to - previous);
            previous = up_to;
        }
    }
    probabilities
}

/// Mean and variance of min(Poisson(mean), well)·K + N(black, (K·σ)²), rounded and clipped, from the
/// probability of every digital number.
pub(crate) fn exact_moments(
    mean: f64,
    [sigma, gain, black]: [f64; 3],
    well: f64,
    white: u32,
) -> [f64; 2] {
    let mut probabilities = vec![0.0; white as usize + 1];
    let reach = 9.0 * mean.sqrt() + 45.0;
    // Two counts above the well are one.
    for n in (mean - reach).max(0.0) as u32..=(mean + reach) as u32 {
        let weight = if mean > 0.0 { poisson(n, mean) } else { f64::from(u8::from(n == 0)) };
        let level = gain * f64::from(n).min(well) + black;
        let at = |y: f64| y.clamp(0.0, f64::from(white)).round_ties_even() as u32;
        let [first, last] = [-9.0, 9.0].map(|z| at(level + z * gain * sigma));
        let mut previous = 0.0;
        for y in first..=last {
            let next = if y == last {
                1.0
            } else {
                normal_cdf((f64::from(y) + 0.5 - level) / (gain * sigma))
            };
            probabilities[y as usize] += weight * (next - previous);
            previous = next;
        }
    }
    let sum = |value: &dyn Fn(f64) -> f64| -> f64 {
        (0..=white).zip(&probabilities).map(|(y, p)| p * value(f64::from(y))).sum()
    };
    let centre = sum(&|y| y);
    [centre, sum(&|y| (y - centre) * (y - centre))]
}

/// Pearson's χ² of counts against probabilities in standard deviations of its distribution. Bins
/// that expect fewer than ten are joined to their neighbours.
pub(crate) fn chi_square(counts: &[u64], probabilities: &[f64]) -> f64 {
    let total: u64 = counts.iter().sum();
    let (mut seen, mut expected) = (0.0, 0.0);
    let (mut chi, mut bins) = (0.0, 0);
    let mut last = (0.0, 0.0);
    for (&count, &probability) in counts.iter().zip(probabilities) {
        seen += count as f64;
        expected += probability * total as f64;
        if expected >= 10.0 {
            chi += (seen - expected) * (seen - expected) / expected;
            bins += 1;
            last = (seen, expected);
            (seen, expected) = (0.0, 0.0);
        }
    }
    // What is left at the end belongs to the last bin.
    chi -= (last.0 - last.1) * (last.0 - last.1) / last.1;
    let (seen, expected) = (last.0 + seen, last.1 + expected);
    chi += (seen - expected) * (seen - expected) / expected;
    let freedom = f64::from(bins - 1).max(1.0);
    // Wilson and Hilferty: the cube root is nearly normal, also for few degrees of freedom.
    let spread = 2.0 / (9.0 * freedom);
    ((chi / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Number of occurrences of each digital number.
pub(crate) fn histogram(values: &[u16], white: u32) -> Vec<u64> {
    let mut counts = vec![0; white as usize + 1];
    for &value in values {
        counts[usize::from(value)] += 1;
    }
    counts
}
