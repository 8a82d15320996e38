//! How fast the variance of a mean of Sobol points falls, and what their halves tell of it.
//!
//! Of `2N` points of a scrambled sequence the first half and the second are nets of `N` points each, which
//! fill each other's gaps: their means are anticorrelated, and the difference `A − B` of the two says more
//! than the variance `V` of the mean of both. With `V(N)` the variance of a mean of `N` points and `C` the
//! covariance of the halves,
//!
//! ```text
//! E (A − B)²/4 = (V(N) − C)/2,   V(2N) = (V(N) + C)/2,   so   E (A − B)²/4 = V(N) − V(2N)
//! ```
//!
//! Where the variance falls as `n⁻ᵃ`, that is `(2ᵃ − 1) V(2N)`, and falls as fast as the variance itself:
//! two of them tell `a`. It is 1 for independent samples, and up to 3 for Sobol points and what is smooth
//! (Owen, "Scrambled net variance for integrals of smooth functions", 1997).
//!
//! Half-way from `N` to `2N`, the points are three nets of `N/2`, of which two are halves of one. Of all
//! four the covariances are known from `V(N/2)`, `V(N)` and `V(2N)`, which gives
//!
//! ```text
//! V(3N/2) = (V(N/2) + 8 V(2N))/9 = V(N) (2ᵃ + 8·2⁻ᵃ)/9,   between 0.63 and 2/3 of V(N) for a from 1 to 1.5
//! E (A − B)² = V(N/2) + 3 V(N) − 4 V(2N) = V(N) (2ᵃ + 3 − 4·2⁻ᵃ)
//! ```

/// The steepest slope that is believed: that of an edge across a pixel. What is smoother has enough with the
/// fewest samples, and a variance that happened to fall by more may not fall so again.
const STEEPEST: f64 = 1.5;

/// `a`, by the squared differences of halves before the last doubling and after it.
pub(super) fn slope(before: f64, after: f64) -> f64 {
    match before > 0.0 && after > 0.0 {
        true => (before / after).log2().clamp(1.0, STEEPEST),
        false => 1.0,
    }
}

/// By how much the variance of the mean is less than a quarter of the square of the difference between the
/// means of the first set and the second, the variance of independent ones of one size.
pub(super) fn share_of_independent(samples: u32, slope: f64) -> f64 {
    let fall = slope.exp2();
    match samples.is_power_of_two() {
        true => 1.0 / (fall - 1.0),
        // Where the second set is neither a half nor a third of all, the third is near enough.
        false => 4.0 / 9.0 * (fall + 8.0 / fall) / (fall + 3.0 - 4.0 / fall),
    }
}

#[cfg(test)]
mod tests {
    use etendue_camera::Sampler;

    use super::*;

    /// Of independent samples the variance is that of two sets of their sizes.
    #[test]
    fn without_a_net_sets_are_independent() {
        assert_eq!(slope(1.0, 0.5), 1.0);
        assert_eq!(slope(1.0, 2.0), 1.0);
        assert_eq!(slope(0.0, 0.0), 1.0);
        assert_eq!(slope(1.0, 1e-9), STEEPEST);
        assert_eq!(share_of_independent(64, 1.0), 1.0);
        // 1/(n + m) over (1/n + 1/m)/4, with n twice m.
        assert!((share_of_independent(96, 1.0) - 4.0 * 2.0 / 9.0).abs() < 1e-12);
    }

    /// Means of Sobol points over a disk: what the differences of their sets are by the formulae, and what is
    /// told from them without knowing any variance.
    #[test]
    fn halves_tell_the_variance_of_nets() {
        let seeds = 4000;
        let inside = |[x, y]: [f64; 2]| f64::from(u8::from(x.hypot(y) < 0.8));
        let known = 0.25 * std::f64::consts::PI * 0.64;
        // A quarter of the square of the difference of the sets, and the variance of the mean of both.
        let of = |samples: u32| {
            let first = crate::samples::of_first_set(samples);
            let (mut apart, mut variance) = (0.0, 0.0);
            for seed in 0..seeds {
                let pixel = Sampler::Sobol.pixel(seed, 3, 5, samples);
                let sum = |range: std::ops::Range<u32>| -> f64 {
                    range.map(|i| inside(pixel.square(i, 1))).sum()
                };
                let [a, b] = [sum(0..first), sum(first..samples)];
                let between = a / f64::from(first) - b / f64::from(samples - first);
                apart += 0.25 * between * between / seeds as f64;
                variance += ((a + b) / f64::from(samples) - known).powi(2) / seeds as f64;
            }
            [apart, variance]
        };
        let is = |found: f64, expected: f64, tolerance: f64| {
            println!("{found:e} of {expected:e}");
            assert!((found / expected - 1.0).abs() < tolerance, "{found} {expected}");
        };
        let [[before, half], [apart, all], [_, double]] = [of(32), of(64), of(128)];
        let [apart_midway, midway] = of(96);
        // Each is the mean of the squares of 4000 numbers, known to 2.2 %: four times that, of two.
        is(apart, half - all, 0.15);
        is(midway, (half + 8.0 * double) / 9.0, 0.15);
        is(4.0 * apart_midway, half + 3.0 * all - 4.0 * double, 0.15);
        // The slope is that of the last doubling, and this variance falls faster from even powers of two (by
        // 3.4 from 64 to 128) than from odd ones (by 2.4 from 32 to 64).
        let slope = slope(before, apart);
        is(share_of_independent(64, slope) * apart, all, 0.5);
        is(share_of_independent(96, slope) * apart_midway, midway, 0.75);
    }
}
