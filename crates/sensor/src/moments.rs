//! Mean and variance of a pixel's digital number: of the law that the chain draws from, with the
//! well, the rounding and both ends of the converter in it.
//!
//! The digital number is `Q = clip(round(X), 0, W)` with `X = K·(min(N, C) + σ·z + o) + b`: N the
//! electrons, C the well, σ what the read-out adds, o the pixel's own offset, b the black level.
//!
//! * Where no end is in reach, `Q = X − saw(X)`, and the Fourier series of the sawtooth gives both
//!   moments from the characteristic function of X, which is known in closed form (Widrow and Kollár
//!   2008, "Quantization Noise", chapter 4). σ·K of a fifth of a step leaves a handful of terms.
//! * Else the law is summed over the electrons: [`given`] has the moments of one normal variable,
//!   rounded and clipped, and each count of electrons its probability.

use std::f64::consts::{PI, TAU};

use crate::chip::Nonlinearity;
use crate::normal::{clipped, normal_cdf, normal_density};
use crate::poisson::probability;
use crate::spec::NoiseModel;

/// Standard deviations beyond which a normal variable has no mass that f64 could add.
const REACH: f64 = 8.3;

/// Standard deviations beyond which no count of electrons weighs: 1e-16 of the most probable.
const CHARGE_REACH: f64 = 8.6;

/// Cells that a standard deviation of electrons is summed in, where single ones are too many.
const CELLS: f64 = 250.0;

/// Terms of the series with a factor below this are left out.
const NEGLIGIBLE: f64 = 1e-12;

/// Standard deviations (DN) from which sums over the converter's steps are taken by Euler and
/// Maclaurin's formula; the first term left out is then below 2e-6 of the density at the end.
const WIDE: f64 = 2.0;

/// All that the law of one pixel depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelLaw<'a> {
    pub(crate) noise: NoiseModel,
    /// Mean electrons of light and heat (e⁻).
    pub(crate) mean: f64,
    /// C (e⁻), +inf for none.
    pub(crate) full_well: f64,
    /// Non-linearity of what is read near saturation, as shares of the well.
    pub(crate) curve: Option<&'a Nonlinearity>,
    /// The pixel's own offset (e⁻).
    pub(crate) offset: f64,
    /// Standard deviation of what the read-out adds (e⁻).
    pub(crate) read_noise: f64,
    /// K (DN/e⁻).
    pub(crate) gain: f64,
    /// b (DN).
    pub(crate) black: f64,
    /// W (DN).
    pub(crate) white: f64,
}

impl PixelLaw<'_> {
    /// `[mean, variance]` (DN, DN²) over exposures.
    pub(crate) fn moments(&self) -> [f64; 2] {
        if self.noise == NoiseModel::None {
            let level = self.gain * self.read_of(self.mean.min(self.full_well)) + self.black;
            return [quantised(level, self.white), 0.0];
        }
        let mean = self.mean.max(0.0);
        let spread = mean.sqrt();
        // The narrow tail of few electrons is longer than a normal one's.
        let reach = CHARGE_REACH * spread + if spread > 0.0 { 40.0 } else { 0.0 };
        let sigma = self.gain * self.read_noise;
        let low = match self.noise {
            NoiseModel::Poisson => self.level((mean - reach).max(0.0)) - REACH * sigma,
            NoiseModel::Normal | NoiseModel::None => self.level(mean - reach) - REACH * sigma,
        };
        let high = self.level(mean + reach) + REACH * sigma;
        let unclipped = low > 0.5 && high < self.white - 0.5 && mean + reach < self.full_well;
        if unclipped
            && self.curve.is_none()
            && let Some(moments) = self.unclipped()
        {
            return moments;
        }
        let pivot = quantised(self.level(mean.min(self.full_well)), self.white);
        let mut sum = ShiftedMoments::default();
        match self.noise {
            NoiseModel::Poisson => self.over_poisson(mean, pivot, &mut sum),
            NoiseModel::Normal | NoiseModel::None => self.over_normal(mean, pivot, &mut sum),
        }
        sum.moments(pivot)
    }

    /// X of so many electrons without read noise (DN).
    fn level(&self, electrons: f64) -> f64 {
        self.gain * (self.read_of(electrons) + self.offset) + self.black
    }

    fn read_of(&self, electrons: f64) -> f64 {
        let bent = |curve: &Nonlinearity| self.full_well * curve.read(electrons / self.full_well);
        self.curve.map_or(electrons, bent)
    }

    /// Both moments where nothing is clipped; `None` where the series is longer than the sum.
    fn unclipped(&self) -> Option<[f64; 2]> {
        let (gain, centre) = (self.gain, self.level(self.mean));
        let (electrons, sigma) = match self.noise {
            NoiseModel::Poisson => (self.mean, gain * self.read_noise),
            NoiseModel::Normal | NoiseModel::None => {
                (0.0, gain * (self.mean + self.read_noise * self.read_noise).sqrt())
            }
        };
        let terms = series_length(sigma)?;
        if f64::from(terms) > 2.0 * CHARGE_REACH * electrons.sqrt() + 20.0 {
            return None;
        }
        let saw = sawtooth(centre, sigma, terms, electrons, gain);
        let variance = gain * gain * electrons + sigma * sigma;
        let rounded = variance - 2.0 * saw.with_level + saw.square - saw.mean * saw.mean;
        Some([centre - saw.mean, rounded.max(0.0)])
    }

    /// The sum over Poisson electrons, outwards from the most probable count.
    fn over_poisson(&self, mean: f64, pivot: f64, sum: &mut ShiftedMoments) {
        if mean <= 0.0 {
            return self.add(1.0, 0.0, 0.0, pivot, sum);
        }
        // Far more electrons than this are counted in cells of several.
        let cell = (mean.sqrt() / CELLS).floor().max(1.0);
        let own = (cell * cell - 1.0) / 12.0;
        let weight = |n: f64| {
            let (exponent, factor) = probability(n, mean);
            cell * factor * exponent.exp()
        };
        let mode = mean.floor();
        let least = 1e-17 * weight(mode);
        let mut total = 0.0;
        // Downwards; what the well would cut is one number, the well's.
        let mut below = Vec::new();
        let mut n = mode;
        while n >= 0.0 {
            let p = weight(n);
            if p < least {
                break;
            }
            below.push((n, p));
            n -= cell;
        }
        for &(n, p) in below.iter().rev() {
            if n >= self.full_well {
                break;
            }
            total += p;
            self.add(p, n, own, pivot, sum);
        }
        n = mode + cell;
        while n < self.full_well {
            let p = weight(n);
            if p < least {
                break;
            }
            total += p;
            self.add(p, n, own, pivot, sum);
            n += cell;
        }
        // Summed from above where that is little, so that a rare overflow keeps its digits.
        let mut over = 0.0;
        let mut n = n.max(mode + cell);
        loop {
            let p = weight(n);
            if p < least || n < self.full_well {
                break;
            }
            over += p;
            n += cell;
        }
        let full = if total > 0.5 { over } else { (1.0 - total).max(0.0) };
        if full > 0.0 {
            self.add(full, self.full_well, 0.0, pivot, sum);
        }
    }

    /// The sum over normal electrons, in cells of known mass, centroid and variance.
    fn over_normal(&self, mean: f64, pivot: f64, sum: &mut ShiftedMoments) {
        let spread = mean.sqrt();
        let well = (self.full_well - mean) / spread;
        let is_straight = self.curve.is_none();
        if spread <= 0.0 || (well > CHARGE_REACH && is_straight) {
            return self.add(1.0, mean, mean, pivot, sum);
        }
        if self.read_noise <= 0.0 && is_straight {
            // The well is an end of the converter's.
            let white = quantised(self.level(self.full_well), self.white);
            return sum.add(1.0, given(self.level(mean), self.gain * spread, white, pivot));
        }
        let top = well.clamp(-CHARGE_REACH, CHARGE_REACH);
        let cells =
            (2.0 * CHARGE_REACH / (0.5 * self.read_noise / spread).clamp(2e-3, 0.025)).ceil();
        let width = (top + CHARGE_REACH) / cells;
        let mut a = -CHARGE_REACH;
        while width > 0.0 && a < top - 0.5 * width {
            let b = a + width;
            // The smaller tails cancel less.
            let mass = if a > 0.0 {
                normal_cdf(-a) - normal_cdf(-b)
            } else {
                normal_cdf(b) - normal_cdf(a)
            };
            if mass > 0.0 {
                let centre = ((normal_density(a) - normal_density(b)) / mass).clamp(a, b);
                let own = mean * width * width / 12.0;
                self.add(mass, mean + spread * centre, own, pivot, sum);
            }
            a = b;
        }
        self.add(normal_cdf(-top), self.full_well, 0.0, pivot, sum);
    }

    /// Adds a count of electrons with a variance of its own (e⁻²) and the read noise.
    fn add(&self, weight: f64, electrons: f64, own: f64, pivot: f64, sum: &mut ShiftedMoments) {
        let slope = self.curve.map_or(1.0, |curve| curve.slope(electrons / self.full_well));
        let sigma = self.gain * (self.read_noise * self.read_noise + slope * slope * own).sqrt();
        sum.add(weight, given(self.level(electrons), sigma, self.white, pivot));
    }
}

/// E[Q − pivot] and E[(Q − pivot)²].
#[derive(Debug, Clone, Copy, Default)]
struct ShiftedMoments([f64; 2]);

impl ShiftedMoments {
    fn add(&mut self, weight: f64, given: [f64; 2]) {
        for (sum, value) in self.0.iter_mut().zip(given) {
            *sum += weight * value;
        }
    }

    fn moments(self, pivot: f64) -> [f64; 2] {
        let [first, second] = self.0;
        [pivot + first, (second - first * first).max(0.0)]
    }
}

/// clip(round(x), 0, W), half to even, as the chain converts.
fn quantised(level: f64, white: f64) -> f64 {
    level.clamp(0.0, white).round_ties_even()
}

/// E[Q − pivot] and E[(Q − pivot)²] of a normal X of mean `level` and deviation `sigma` (DN);
/// `pivot` is an integer in 0..=white.
fn given(level: f64, sigma: f64, white: f64, pivot: f64) -> [f64; 2] {
    let [low, high] = [level - REACH * sigma, level + REACH * sigma];
    if sigma <= 0.0 || high <= 0.5 || low >= white - 0.5 {
        let from = quantised(level, white) - pivot;
        return [from, from * from];
    }
    if low > 0.0
        && high < white
        && let Some(terms) = series_length(sigma).filter(|&terms| terms <= 4)
    {
        let saw = sawtooth(level, sigma, terms, 0.0, 1.0);
        // (X − pivot − saw)², X about its mean.
        let from = level - pivot;
        let variance = sigma * sigma - 2.0 * saw.with_level + saw.square;
        return [from - saw.mean, from * from - 2.0 * from * saw.mean + variance];
    }
    if sigma >= WIDE { wide(level, sigma, white, pivot) } else { steps(level, sigma, white, pivot) }
}

/// Moments as a sum over the steps of the converter: `Q − pivot` counts the steps passed above the
/// pivot less those missed below, `(Q − pivot)²` the odd numbers of them.
fn steps(level: f64, sigma: f64, white: f64, pivot: f64) -> [f64; 2] {
    let first = (level - REACH * sigma - 0.5).floor().clamp(0.0, white);
    let last = (level + REACH * sigma + 0.5).ceil().clamp(0.0, white);
    // Steps out of reach are passed, or missed, for certain.
    let from = first - pivot;
    let [mut mean, mut square] = [from, from * from];
    let mut j = first;
    while j < last {
        let passed = normal_cdf((level - j - 0.5) / sigma);
        mean += passed;
        square += (2.0 * (j - pivot) + 1.0) * passed;
        j += 1.0;
    }
    [mean, square]
}

/// Moments for steps that are narrow to the normal distribution: the clipped variable's own moments
/// and the ends' terms of Euler and Maclaurin's formula for midpoints, to the third derivative.
fn wide(level: f64, sigma: f64, white: f64, pivot: f64) -> [f64; 2] {
    let [mean, variance] = clipped([level, sigma * sigma], 0.0, white);
    let from = mean - pivot;
    // f(t) = P(X > t) and its derivatives at an end.
    let at = |t: f64| {
        let u = (level - t) / sigma;
        let density = normal_density(u);
        let first = -density / sigma;
        let second = -u * density / (sigma * sigma);
        let third = (1.0 - u * u) * density / sigma.powi(3);
        let square = 2.0 * (normal_cdf(u) + (t - pivot) * first);
        let square_third = 6.0 * second + 2.0 * (t - pivot) * third;
        [[first, third], [square, square_third]]
    };
    let (low, high) = (at(0.0), at(white));
    let ends = |k: usize| {
        let [first, third] = [0, 1].map(|order: usize| high[k][order] - low[k][order]);
        -first / 24.0 + 7.0 * third / 5760.0
    };
    [from + ends(0), variance + from * from + ends(1)]
}

/// Terms of the sawtooth's series that a normal part of this deviation (DN) leaves; `None` when more
/// than sixty.
fn series_length(sigma: f64) -> Option<u32> {
    // exp(−2π²k²σ²) falls below the negligible.
    let most = (-NEGLIGIBLE.ln() / 2.0).sqrt() / (PI * sigma);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60")]
    (most <= 60.0).then_some(most as u32)
}

/// Moments of what rounding takes away: saw(X) = X − round(X).
struct Sawtooth {
    /// E[saw].
    mean: f64,
    /// E[(X − E X)·saw].
    with_level: f64,
    /// E[saw²].
    square: f64,
}

/// The sawtooth's moments for `X = centre + gain·(N − electrons) + sigma·z`, N of Poisson's
/// distribution with mean `electrons`: saw(x) = Σ (−1)ᵏ⁺¹ sin(2πkx)/(πk), and its square
/// 1/12 + Σ (−1)ᵏ cos(2πkx)/(πk)².
fn sawtooth(centre: f64, sigma: f64, terms: u32, electrons: f64, gain: f64) -> Sawtooth {
    let mut saw = Sawtooth { mean: 0.0, with_level: 0.0, square: 1.0 / 12.0 };
    // Whole turns do not count, and large angles have lost their digits.
    let place = centre - centre.floor();
    for k in 1..=terms {
        let order = f64::from(k);
        // μ·(exp(2πikK) − 1): its real part shrinks the term, its imaginary part turns it.
        let turns = order * gain - (order * gain).floor();
        let (sin, cos) = (TAU * turns).sin_cos();
        let shrunk = electrons * (cos - 1.0) - 0.5 * (TAU * order * sigma).powi(2);
        let factor = shrunk.exp();
        if factor < NEGLIGIBLE {
            continue;
        }
        let turned = TAU * (order * place) + electrons * (sin - TAU * order * gain);
        let (im, re) = turned.sin_cos();
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        saw.mean += sign * factor * im / (PI * order);
        saw.square -= sign * factor * re / (PI * order).powi(2);
        // E[(X − E X)·exp(2πikX)] is the characteristic function's derivative.
        let [slope_re, slope_im] =
            [electrons * gain * (cos - 1.0), electrons * gain * sin + TAU * order * sigma * sigma];
        saw.with_level += sign * factor * (slope_re * im + slope_im * re) / (PI * order);
    }
    saw
}
