//! Poisson deviates, exact at any mean.
//!
//! From [`PD_FROM`] electrons on, a normal deviate is rounded down and mostly kept as it is: right of
//! the mean because the Poisson distribution has more mass there than the rounded normal one, left of
//! it after one comparison. The few that the comparison refuses go through the full test. Below, the
//! distribution is summed until it passes a random number.
//!
//! A test shows that what the algorithm assumes of the two distributions is true from a mean of ten
//! on. "Exact" means: to the precision of the random numbers (steps of 2⁻³² in probability, finer in the
//! tails) and of the series for ln k! (1e-13); nothing is approximated by a normal distribution.
//!
//! # Sources
//!
//! * J. H. Ahrens and U. Dieter, "Computer Generation of Poisson Deviates from Modified Normal
//!   Distributions", ACM TOMS 8(2), 1982, algorithm PD; step names are theirs. Ours takes ln k! from
//!   Stirling's series to 1e-13 instead of their 1e-9.
//! * Small means: L. Devroye, "Non-Uniform Random Variate Generation", 1986, section X.3.3.

use crate::normal::{exp, floor, ln, ln_1p};
use crate::philox::{DrawUse, PhiloxKey, Site, unit32, unit52};

/// Mean from which algorithm PD holds.
pub(crate) const PD_FROM: f64 = 10.0;

/// Deviates no further below the mean than this, rounded down, are accepted at once (step I).
const IMMEDIATE: f64 = 1.1484;

/// Deviates further below are accepted when `SQUEEZE·μ²·u` is at least the cube of how far (step S).
const SQUEEZE: f64 = 6.0;

/// The double exponential times `HAT/μ` covers all that the normal distribution lacks (step H).
const HAT: f64 = 0.1069;

/// Deviations above which the normal distribution may lack something (step E).
const LACKING_FROM: f64 = -0.6744;

/// Mean from which f64 cannot count single electrons any more: there the rounding of a normal
/// deviate is coarser than its distance from the Poisson distribution.
const UNCOUNTABLE: f64 = 1e15;

/// A uniform number above this is drawn again, finer, within its interval, so that the far tail of a
/// small mean has its own random bits.
const TAIL: f64 = 1.0 - 1.0 / 65_536.0;

/// Marks a deviate that needs [`finish`].
pub(crate) const OPEN: f64 = -1.0;

/// Steps N, I and S: the deviate of most pixels from a standard normal deviate and a number in
/// (0, 1), or [`OPEN`]; `OPEN` for a mean below [`PD_FROM`] too.
#[inline(always)]
pub(crate) fn first_try(mean: f64, normal: f64, unit: f64) -> f64 {
    let k = floor((mean + mean.sqrt() * normal).max(0.0));
    let below = mean - k;
    let immediate = below < IMMEDIATE;
    let squeezed = SQUEEZE * mean * mean * unit >= below * below * below;
    let in_range = (PD_FROM..=UNCOUNTABLE).contains(&mean);
    if in_range & (immediate | squeezed) { k } else { OPEN }
}

/// Deviates of means below [`PD_FROM`] from numbers in (0, 1), a few side by side: sums each
/// distribution until it passes its number. Other means, and numbers in the tail, keep what they
/// have in `electrons`.
#[inline(always)]
pub(crate) fn small_means<const N: usize>(
    mean: &[f64; N],
    unit: &[f64; N],
    electrons: &mut [f64; N],
) {
    let small = |i: usize| (mean[i] < PD_FROM) & (unit[i] <= TAIL);
    let mut own = [0.0; N];
    let mut probability = [0.0; N];
    let mut left = [0.0; N];
    let mut k = [0.0; N];
    for i in 0..N {
        own[i] = if small(i) { mean[i] } else { 0.0 };
        probability[i] = exp(-own[i]);
        left[i] = unit[i] - probability[i];
    }
    // Four terms at a time: asking whether all are done costs as much as a term.
    for inverses in INVERSES.as_chunks::<4>().0 {
        let mut any = false;
        for i in 0..N {
            for inverse in inverses {
                k[i] += if left[i] > 0.0 { 1.0 } else { 0.0 };
                probability[i] *= own[i] * inverse;
                left[i] -= probability[i];
            }
            any |= left[i] > 0.0;
        }
        if !any {
            break;
        }
    }
    for i in 0..N {
        electrons[i] = if small(i) { k[i] } else { electrons[i] };
    }
}

/// 1/1, 1/2, … as far as a mean below 10 reaches with a chance of 2⁻¹⁶ or more.
const INVERSES: [f64; 36] = {
    let mut inverses = [0.0; 36];
    let mut i = 0;
    while i < 36 {
        inverses[i] = 1.0 / (i + 1) as f64;
        i += 1;
    }
    inverses
};

/// A pixel that is still [`OPEN`], with the numbers of its first try, which the full test still uses.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct OpenPixel {
    pub(crate) mean: f64,
    pub(crate) normal: f64,
    pub(crate) unit: f64,
    pub(crate) column: u32,
}

/// Number of open pixels that are finished side by side.
pub(crate) const FINISHED_TOGETHER: usize = 8;

/// The deviates of open pixels.
#[inline(always)]
pub(crate) fn finish(
    open: &[OpenPixel; FINISHED_TOGETHER],
    key: &PhiloxKey,
    site: Site,
) -> [f64; FINISHED_TOGETHER] {
    let mut electrons = full_tests(open, key, site);
    for (n, open) in electrons.iter_mut().zip(open) {
        if open.mean < PD_FROM {
            let [high, low, ..] = key.words(site.counter(open.column, DrawUse::Electrons, 0));
            *n = tail_of_small_mean(open.mean, (1.0 - TAIL) * unit52(high, low));
        } else if open.mean > UNCOUNTABLE {
            *n = (open.mean + open.mean.sqrt() * open.normal).round();
        }
    }
    electrons
}

/// The deviate of which all greater ones together have a probability just below `above`.
fn tail_of_small_mean(mean: f64, above: f64) -> f64 {
    // Terms far above the mean, each the one before times μ/k, summed from the smallest.
    let mut terms = [0.0; 200];
    let mut probability = exp(-mean);
    for (k, term) in (1u32..).zip(&mut terms) {
        *term = probability;
        probability *= mean / f64::from(k);
    }
    let mut sum = 0.0;
    let mut k = terms.len();
    while k > 0 && sum < above {
        k -= 1;
        sum += terms[k];
    }
    k as f64
}

/// Steps Q, E and H: the quotient test of the first try, then double exponential deviates until one
/// is accepted (the bound on tries is a guard that is never met). Means out of range give numbers without meaning.
#[inline(always)]
fn full_tests(
    open: &[OpenPixel; FINISHED_TOGETHER],
    key: &PhiloxKey,
    site: Site,
) -> [f64; FINISHED_TOGETHER] {
    let mean = open.map(|open| open.mean.clamp(PD_FROM, UNCOUNTABLE));
    let normal = open.map(|open| open.normal);
    let unit = open.map(|open| open.unit);
    let columns = open.map(|open| open.column);
    let mut electrons = quotient_tests(&mean, &normal, &unit);
    for draw in 1..u16::MAX {
        if electrons.iter().fold(true, |all, &n| all & (n >= 0.0)) {
            break;
        }
        exponential_tries(&mean, key, site, &columns, draw, &mut electrons);
    }
    electrons
}

/// Step Q: what the first try gave, if the quotient of the distributions allows it.
#[inline(always)]
fn quotient_tests<const N: usize>(mean: &[f64; N], normal: &[f64; N], unit: &[f64; N]) -> [f64; N] {
    let mut electrons = [OPEN; N];
    for i in 0..N {
        let shifted = mean[i] + mean[i].sqrt() * normal[i];
        let k = floor(shifted.max(0.0));
        let [px, py, fx, fy] = masses(k, mean[i]);
        let accepted = (shifted >= 0.0) & (fy * (1.0 - unit[i]) <= py * exp(px - fx));
        electrons[i] = if accepted { k } else { OPEN };
    }
    electrons
}

/// Steps E and H, once for each pixel that is still open.
#[inline(always)]
fn exponential_tries<const N: usize>(
    mean: &[f64; N],
    key: &PhiloxKey,
    site: Site,
    columns: &[u32; N],
    draw: u16,
    electrons: &mut [f64; N],
) {
    for i in 0..N {
        let [sign, _, high, low] = key.words(site.counter(columns[i], DrawUse::Electrons, draw));
        let exponential = -ln(unit52(high, low));
        let signed = 2.0 * unit32(sign) - 1.0;
        let t = 1.8 + exponential.copysign(signed);
        let k = floor((mean[i] + mean[i].sqrt() * t).max(0.0));
        let [px, py, fx, fy] = masses(k, mean[i]);
        let gap = py * exp(px + exponential) - fy * exp(fx + exponential);
        let accepted = (t > LACKING_FROM) & (HAT / mean[i] * signed.abs() <= gap);
        electrons[i] = if (electrons[i] < 0.0) & accepted { k } else { electrons[i] };
    }
}

/// The Poisson distribution, p = py·e^px, and the rounded normal one, f = fy·e^fx, at an integer
/// `k` ≥ 0 for a mean ≥ 10 (procedure F).
#[inline(always)]
fn masses(k: f64, mean: f64) -> [f64; 4] {
    let inverse = 1.0 / mean;
    let b1 = inverse * (1.0 / 24.0);
    let b2 = 0.3 * b1 * b1;
    let c3 = b1 * b2 * (1.0 / 7.0);
    let c2 = b2 - 15.0 * c3;
    let c1 = b1 - 6.0 * b2 + 45.0 * c3;
    let c0 = 1.0 - b1 + 3.0 * b2 - 15.0 * c3;
    let from_mean = k - mean + 0.5;
    let xx = from_mean * from_mean * inverse;
    let fy = (((c3 * xx + c2) * xx + c1) * xx + c0) * (INVERSE_SQRT_TAU / mean.sqrt());
    let (px, py) = probability(k, mean);
    [px, py, -0.5 * xx, fy]
}

const INVERSE_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// The Poisson probability of an integer `k` ≥ 0 at `mean` > 0 as `(exponent, factor)`.
#[inline(always)]
pub(crate) fn probability(k: f64, mean: f64) -> (f64, f64) {
    // k ln(μ/k) + k − μ, without the cancellation of large terms near the mean.
    let some = k.max(1.0);
    let v = (mean - some) / some;
    let exponent = some * (ln_1p(v) - v) - stirling(some);
    let factor = INVERSE_SQRT_TAU / some.sqrt();
    if k > 0.0 { (exponent, factor) } else { (-mean, 1.0) }
}

/// ln k! − (k + ½) ln k + k − ½ ln 2π for an integer k ≥ 1, to 1e-13: a table, from 10 on a series
/// (Abramowitz & Stegun 1964, 6.1.41).
#[inline(always)]
fn stirling(k: f64) -> f64 {
    let inverse = 1.0 / k;
    let square = inverse * inverse;
    let series = inverse
        * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square * (1.0 / 1680.0))));
    // The low bits of a small integer above 2⁵² are that integer: an index without a conversion.
    #[expect(clippy::cast_possible_truncation, reason = "four bits")]
    let entry = SMALL_STIRLING[(k + 4_503_599_627_370_496.0).to_bits() as usize & 15];
    if k < 10.0 { entry } else { series }
}

/// [`stirling`] of 1 to 9; the other entries are not used.
#[rustfmt::skip]
const SMALL_STIRLING: [f64; 16] = [
    0.0,
    0.08106146679532726,
    0.0413406959554093,
    0.02767792568499834,
    0.020790672103765093,
    0.016644691189821193,
    0.013876128823070748,
    0.01189670994589177,
    0.010411265261972096,
    0.009255462182712733,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    /// The Poisson probability of `k`, from `libm`.
    fn poisson(k: f64, mean: f64) -> f64 {
        (k * mean.ln() - mean - libm::lgamma(k + 1.0)).exp()
    }

    /// The probability that a normal variable of that mean and variance lies in k..k + 1, from `libm`.
    fn normal_mass(k: f64, mean: f64) -> f64 {
        let upper_tail = |x: f64| 0.5 * libm::erfc((x - mean) / mean.sqrt() / SQRT_2);
        // The smaller tails cancel less.
        if k < mean {
            upper_tail(2.0 * mean - k - 1.0) - upper_tail(2.0 * mean - k)
        } else {
            upper_tail(k) - upper_tail(k + 1.0)
        }
    }

    /// Means from ten on, and all `k` within six deviations.
    fn cases() -> impl Iterator<Item = (f64, f64)> {
        let means = (0..400).map(|i| 10.0 * 1.012f64.powi(i)).chain([10.5, 11.999, 1e4, 1e5]);
        means.flat_map(|mean| {
            let reach = 6.0 * mean.sqrt();
            let first = (mean - reach).max(0.0).floor();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "some thousands"
            )]
            let count = (2.0 * reach).ceil() as u32;
            (0..count).map(move |i| (mean, first + f64::from(i)))
        })
    }

    /// Algorithm PD is exact if what it assumes of the two distributions is true.
    #[test]
    fn the_assumptions_of_the_algorithm_hold() {
        let (mut worst_p, mut worst_f, mut most_hat) = (0.0f64, 0.0f64, 0.0f64);
        for (mean, k) in cases() {
            let (p, f) = (poisson(k, mean), normal_mass(k, mean));
            let [px, py, fx, fy] = masses(k, mean);
            let at = format!("mean {mean}, k {k}: p {p:e}, f {f:e}");
            worst_p = worst_p.max((py * px.exp() / p - 1.0).abs());
            worst_f = worst_f.max((fy * fx.exp() - f).abs());
            // Rounding of the references, relative to the largest mass.
            let slack = 1e-10 / mean.sqrt();
            if mean - k < IMMEDIATE {
                assert!(p >= f - slack, "immediate acceptance is wrong: {at}");
            } else {
                let squeeze = (mean - k).powi(3) / (SQUEEZE * mean * mean);
                assert!(f * (1.0 - squeeze) <= p + slack, "the squeeze is wrong: {at}");
            }
            // The double exponential must cover what the normal distribution lacks, for any
            // deviate that is rounded down to k, and nothing must be lacking where it is not tried.
            for t in [k - mean, k + 1.0 - mean].map(|x| x / mean.sqrt()) {
                let needed = (p - f) * (t - 1.8).abs().exp() * mean;
                if t > LACKING_FROM {
                    most_hat = most_hat.max(needed);
                }
            }
            if (k + 1.0 - mean) / mean.sqrt() <= LACKING_FROM {
                assert!(p <= f + slack, "mass is lacking where no try is made: {at}");
            }
        }
        assert!(worst_p < 1e-9, "Poisson masses are {worst_p:e} off");
        assert!(worst_f < 1e-9, "normal masses are {worst_f:e} off");
        assert!(most_hat < HAT, "the hat must be {most_hat}");
    }
}
