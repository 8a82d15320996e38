//! Point sets: where in its pixel, and where in the pupil, each sample lies.
//!
//! A point depends on (seed, pixel, sample, dimension) alone, so any thread may work it out, in any
//! order, and a resumed render goes on where it stopped.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sobol::{self, Half, SobolKey};

/// The point sets that samples come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampler {
    /// Scrambled Sobol points (Burley, "Practical hash-based Owen scrambling", 2020) that keep their distance: the
    /// error falls nearly as 1/n for smooth integrands, and any number of samples is a good one.
    #[default]
    Sobol,
    /// Random numbers: the error falls as 1/√n.
    Independent,
    /// One random point in each cell of the most nearly square grid of as many cells as samples.
    Stratified,
    /// The Hammersley set, rotated at random for each pixel (Cranley & Patterson 1976).
    Hammersley,
    /// One scrambled Sobol sequence for the whole picture, of which each pixel has a part, along a Z-order
    /// curve with its quarters in random order (Ahmed & Wonka, "Screen-space blue-noise diffusion of Monte
    /// Carlo sampling error via hierarchical ordering of pixels", 2020): neighbours' errors are unlike, so
    /// that the noise is fine-grained and goes when pixels are averaged. For few samples, as many as a power
    /// of two.
    BlueNoise,
}

/// The samples of one pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelSamples {
    sampler: Sampler,
    seed: u64,
    count: u32,
    /// Position of the pixel along a Z-order curve.
    place: u32,
}

impl Sampler {
    /// The samples of the pixel in `column` and `row`, of which there will be `count`.
    #[must_use]
    pub fn pixel(self, seed: u64, column: u32, row: u32, count: u32) -> PixelSamples {
        // A picture's sides have 16 bits.
        let pixel = u64::from(row) << 32 | u64::from(column);
        // All pixels have parts of one sequence.
        let own = if self == Self::BlueNoise { 0 } else { pixel };
        let place = spread_bits(column) | spread_bits(row) << 1;
        PixelSamples { sampler: self, seed: mix(seed ^ mix(own)), count: count.max(1), place }
    }
}

impl Sampler {
    /// Size of the set that `count` samples are taken from; `None` of a sequence. The first samples
    /// of a larger count are those of a smaller one where both are of one set, or of a sequence.
    #[must_use]
    pub fn set_size(self, count: u32) -> Option<u32> {
        match self {
            Self::Sobol | Self::Independent => None,
            Self::BlueNoise => Some(count.next_power_of_two()),
            Self::Stratified | Self::Hammersley => Some(count),
        }
    }

    /// True if points are those of [`sobol`].
    fn is_sobol(self) -> bool {
        matches!(self, Self::Sobol | Self::BlueNoise)
    }
}

/// One of the samples of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelSample {
    /// The samples of its pixel.
    pub pixel: PixelSamples,
    /// Its number among them.
    pub index: u32,
}

/// Some of the samples of one pixel, by their numbers.
#[derive(Debug, Clone)]
pub struct PixelRun {
    /// The samples of the pixel.
    pub pixel: PixelSamples,
    /// Their numbers among them.
    pub numbers: Range<u32>,
}

impl PixelSamples {
    /// The samples of these numbers.
    pub fn samples(self, numbers: Range<u32>) -> impl Iterator<Item = PixelSample> + Clone {
        numbers.map(move |index| PixelSample { pixel: self, index })
    }

    /// Sample `index` in the square 0..1, for the `pair`-th pair of dimensions (0: place in the
    /// pixel, 1: place in the pupil). Numbers are multiples of 2⁻⁵³, with every sampler: what a choice
    /// among 2²⁴ leaves of one is still a number.
    #[must_use]
    pub fn square(&self, index: u32, pair: u32) -> [f64; 2] {
        let key = mix(self.seed.wrapping_add(u64::from(pair)));
        let random = |salt: u64| unit(mix(key ^ mix(u64::from(index) << 8 | salt)));
        match self.sampler {
            Sampler::Sobol | Sampler::BlueNoise => {
                let (key, half) = self.sobol_key(index, pair, &mut Sequence::default());
                sobol::point(key, half)
            }
            Sampler::Independent => [random(0), random(1)],
            Sampler::Stratified => {
                let [columns, rows] = self.grid();
                let cell = index % (columns * rows);
                // Each pair visits the cells in another order, so that pairs are not correlated.
                let cell = permute(cell, columns * rows, key);
                [
                    (f64::from(cell % columns) + random(0)) / f64::from(columns),
                    (f64::from(cell / columns) + random(1)) / f64::from(rows),
                ]
            }
            Sampler::Hammersley => {
                let place = permute(index % self.count, self.count, key);
                let x = (f64::from(place) + 0.5) / f64::from(self.count);
                let y = f64::from(place.reverse_bits()) / 4_294_967_296.0;
                let shift = [unit(mix(key)), unit(mix(key ^ 1))];
                [(x + shift[0]).fract(), (y + shift[1]).fract()]
            }
        }
    }

    /// Key of a pair's point, and its half of the set.
    #[inline]
    fn sobol_key(&self, index: u32, pair: u32, sequence: &mut Sequence) -> (SobolKey, Half) {
        if self.sampler == Sampler::BlueNoise {
            return (self.blue_noise_key(index, pair, sequence), Half::First);
        }
        let (half, shift) = set_of_pair(pair);
        (self.key_of_set(index, shift), half)
    }

    /// Key of a sample's point in a set. Sets have 2¹⁶ points, and start over, scrambled anew.
    #[inline]
    fn key_of_set(&self, index: u32, shift: u32) -> SobolKey {
        let again = (index >> 16).wrapping_mul(0x85eb_ca6b);
        #[expect(clippy::cast_possible_truncation, reason = "the low half is the seed")]
        let seed = (self.seed as u32).wrapping_add(again);
        SobolKey { index: index & 0xffff, seed }.shifted(shift)
    }

    /// Key of a sample's point in the picture's sequence. The scrambling of indices ([`sobol`]) puts the halves of each
    /// square of the Z-order curve, and then each half's, in an order of the pair's own. What is beyond 2³² points, of
    /// large pictures or many samples, is a sequence for itself.
    #[inline]
    fn blue_noise_key(&self, index: u32, pair: u32, sequence: &mut Sequence) -> SobolKey {
        let own = u64::from(self.place) * u64::from(self.count.next_power_of_two());
        let all = own + u64::from(index);
        let of_sequence = (all >> 32) << 32 | u64::from(pair);
        let seed = sequence.scrambling(self.seed, of_sequence);
        #[expect(clippy::cast_possible_truncation, reason = "the low half")]
        let index = all as u32;
        SobolKey { index, seed }
    }

    /// Columns and rows whose product is at most the number of samples and is nearest to a square.
    fn grid(&self) -> [u32; 2] {
        let mut rows = self.count.isqrt();
        while !self.count.is_multiple_of(rows) {
            rows -= 1;
        }
        [self.count / rows, rows]
    }
}

/// [`PixelSamples::square`] of one pair of dimensions for each of `samples` in one go: `out` is refilled.
pub fn squares_of_pair(
    samples: impl Iterator<Item = PixelSample> + Clone,
    pair: u32,
    out: &mut Vec<[f64; 2]>,
) {
    out.clear();
    let SobolKeys { keys, half, is_sobol } = SobolKeys::of(samples.clone(), pair);
    if !is_sobol {
        out.extend(samples.map(|sample| sample.pixel.square(sample.index, pair)));
        return;
    }
    out.resize(keys.len(), [0.0; 2]);
    sobol::points(&keys, half, out);
}

/// Samples of which numbers are drawn again and again: what is the same for all pairs of dimensions is worked out once.
#[derive(Debug, Default)]
pub struct SampleKeys {
    /// Those of the first pair, where all are of [`Sampler::Sobol`].
    keys: Vec<SobolKey>,
    /// The samples, where they are not.
    samples: Vec<PixelSample>,
}

impl SampleKeys {
    /// Makes them the samples of `runs`, one run behind the other.
    pub fn refill(&mut self, runs: impl Iterator<Item = PixelRun> + Clone) {
        self.keys.clear();
        self.samples.clear();
        if runs.clone().all(|run| run.pixel.sampler == Sampler::Sobol) {
            for PixelRun { pixel, numbers } in runs {
                self.keys.extend(numbers.map(|index| pixel.key_of_set(index, 0)));
            }
        } else {
            self.samples.extend(runs.flat_map(|run| run.pixel.samples(run.numbers)));
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn count(&self) -> usize {
        self.keys.len() + self.samples.len()
    }

    /// [`PixelSamples::square`] of one pair of dimensions for each of all samples: `out` is refilled.
    pub fn squares_of_all(&self, pair: u32, out: &mut Vec<[f64; 2]>) {
        let (half, shift) = set_of_pair(pair);
        if !self.samples.is_empty() {
            squares_of_pair(self.samples.iter().copied(), pair, out);
        } else if shift == 0 {
            out.resize(self.keys.len(), [0.0; 2]);
            sobol::points(&self.keys, half, out);
        } else {
            let keys: Vec<SobolKey> = self.keys.iter().map(|key| key.shifted(shift)).collect();
            out.resize(keys.len(), [0.0; 2]);
            sobol::points(&keys, half, out);
        }
    }

    /// [`Self::squares_of_all`] of the first two pairs.
    pub fn squares_of_first_pairs(&self, [first, second]: [&mut Vec<[f64; 2]>; 2]) {
        if !self.samples.is_empty() {
            self.squares_of_all(0, first);
            return self.squares_of_all(1, second);
        }
        first.resize(self.keys.len(), [0.0; 2]);
        second.resize(self.keys.len(), [0.0; 2]);
        sobol::points_of_sets(&self.keys, [first, second]);
    }

    /// [`PixelSamples::square`] of one pair of dimensions for each of some samples, by their numbers: `out` is
    /// refilled.
    pub fn squares_of_pair(&self, picked: &[u32], pair: u32, out: &mut Vec<[f64; 2]>) {
        if !self.samples.is_empty() {
            let samples = picked.iter().map(|&number| self.samples[number as usize]);
            squares_of_pair(samples, pair, out);
            return;
        }
        let (half, shift) = set_of_pair(pair);
        let key = |&number: &u32| self.keys[number as usize].shifted(shift);
        let keys: Vec<SobolKey> = picked.iter().map(key).collect();
        out.resize(keys.len(), [0.0; 2]);
        sobol::points(&keys, half, out);
    }

    /// Numbers of a pair of dimensions in single precision, below 1, in two columns.
    pub fn floats_of_pair(&self, picked: &[u32], pair: u32, out: &mut [Vec<f32>; 2]) {
        out.iter_mut().for_each(|column| column.resize(picked.len(), 0.0));
        let [x, y] = out;
        if !self.samples.is_empty() {
            let mut squares = Vec::new();
            self.squares_of_pair(picked, pair, &mut squares);
            for ((square, x), y) in squares.into_iter().zip(x).zip(y) {
                [*x, *y] = square.map(sobol::float);
            }
            return;
        }
        let (half, shift) = set_of_pair(pair);
        sobol::floats(&self.keys, shift, picked, half, [x, y]);
    }
}

/// The half of a set that a pair of dimensions is, and what is added to the scramblings of the first set. The pairs 2k and
/// 2k + 1 are one: the places in the pixel and in the pupil (the pairs 0 and 1) say together what a sample sees.
fn set_of_pair(pair: u32) -> (Half, u32) {
    let half = if pair & 1 == 0 { Half::First } else { Half::Second };
    (half, (pair >> 1).wrapping_mul(0x9e37_79b9))
}

/// The points of Sobol's sequence that a pair of dimensions is of some samples.
struct SobolKeys {
    keys: Vec<SobolKey>,
    /// Half of their sets.
    half: Half,
    /// True if all of them are of samplers that have such points.
    is_sobol: bool,
}

impl SobolKeys {
    fn of(samples: impl Iterator<Item = PixelSample>, pair: u32) -> Self {
        let keys = Vec::with_capacity(samples.size_hint().0);
        let mut all = Self { keys, half: Half::First, is_sobol: true };
        let mut sequence = Sequence::default();
        for PixelSample { pixel, index } in samples {
            all.is_sobol &= pixel.sampler.is_sobol();
            let (key, half) = pixel.sobol_key(index, pair, &mut sequence);
            all.keys.push(key);
            all.half = half;
        }
        all
    }
}

/// The scrambling of the sequence that was asked for last: that of nearly all samples of a batch.
#[derive(Debug, Default)]
struct Sequence {
    last: Option<(u64, u64, u32)>,
}

impl Sequence {
    #[inline]
    fn scrambling(&mut self, seed: u64, number: u64) -> u32 {
        match self.last {
            Some((of_seed, of_number, scrambling)) if (of_seed, of_number) == (seed, number) => {
                scrambling
            }
            _ => {
                #[expect(clippy::cast_possible_truncation, reason = "the low half is the seed")]
                let scrambling = mix(seed ^ mix(number)) as u32;
                self.last = Some((seed, number, scrambling));
                scrambling
            }
        }
    }
}

/// The lower 16 bits, each with a 0 behind it.
fn spread_bits(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

/// Steele, Lea & Flood, "Fast splittable pseudorandom number generators", 2014: the finaliser of
/// `SplitMix64`.
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The upper 53 bits as a number in 0..1.
fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Image of `i` in a permutation of 0..`n` chosen by `key` (Kensler, "Correlated multi-jittered
/// sampling", 2013: a hash that is a bijection of the next power of two, walked until it lands).
fn permute(i: u32, n: u32, key: u64) -> u32 {
    let mask = n.next_power_of_two() - 1;
    #[expect(clippy::cast_possible_truncation, reason = "the halves of the key")]
    let (low, high) = (key as u32, (key >> 32) as u32);
    let mut x = i;
    loop {
        x = x.wrapping_add(low) & mask;
        x = x.wrapping_mul(0x915f_77f5 | 1) & mask;
        x ^= x >> 3 & mask;
        x = x.wrapping_add(high) & mask;
        x = x.wrapping_mul(0x85eb_ca6b | 1) & mask;
        x ^= x >> 2 & mask;
        if x < n {
            return x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Sampler; 5] = [
        Sampler::Sobol,
        Sampler::Independent,
        Sampler::Stratified,
        Sampler::Hammersley,
        Sampler::BlueNoise,
    ];

    /// Means over blocks of 8 by 8 pixels have less than half the error with blue noise, of a smooth integrand
    /// and of an edge: neighbours' samples are parts of one net.
    #[test]
    fn blue_noise_goes_when_pixels_are_averaged() {
        let disk = |[x, y]: [f64; 2]| f64::from(u8::from(x * x + y * y < 1.0));
        let smooth = |[x, y]: [f64; 2]| (x + y).exp();
        let e = std::f64::consts::E - 1.0;
        let integrands: [&dyn Fn([f64; 2]) -> f64; 2] = [&disk, &smooth];
        for (integrand, mean) in integrands.into_iter().zip([std::f64::consts::FRAC_PI_4, e * e]) {
            for (count, pair) in [(1, 0), (4, 1), (4, 9), (8, 4)] {
                let error = |sampler: Sampler| -> f64 {
                    let pixel = |column, row| -> f64 {
                        let samples = sampler.pixel(3, column, row, count);
                        (0..count).map(|i| integrand(samples.square(i, pair)) - mean).sum()
                    };
                    let block = |k: u32| -> f64 {
                        let pixels = (0..64).map(|i| pixel(k % 16 * 8 + i % 8, k / 16 * 8 + i / 8));
                        pixels.sum::<f64>().powi(2)
                    };
                    (0..256).map(block).sum::<f64>().sqrt()
                };
                let [blue, sobol] = [Sampler::BlueNoise, Sampler::Sobol].map(error);
                assert!(blue < 0.5 * sobol, "{count} samples, pair {pair}: {blue} {sobol}");
            }
        }
    }

    #[test]
    fn permutations_are_one_to_one() {
        for n in [1, 2, 3, 7, 16, 100, 1000] {
            let mut seen = vec![false; n as usize];
            for i in 0..n {
                seen[permute(i, n, 0x1234_5678_9abc_def0) as usize] = true;
            }
            assert!(seen.into_iter().all(|hit| hit), "{n}");
        }
    }

    /// ∫∫ x y = 1/4, standard deviation √(7/144) ≈ 0.22: random numbers are within 4 standard errors,
    /// and the structured sets at least as near.
    #[test]
    fn means_are_those_of_the_square() {
        for sampler in ALL {
            for pair in [0, 1, 5] {
                let samples = sampler.pixel(7, 3, 9, 4096);
                let sum: f64 = (0..4096)
                    .map(|i| samples.square(i, pair))
                    .inspect(|p| assert!(p.iter().all(|x| (0.0..1.0).contains(x)), "{p:?}"))
                    .map(|[x, y]| x * y)
                    .sum();
                let error = (sum / 4096.0 - 0.25).abs();
                assert!(error < 4.0 * 0.2205 / 64.0, "{sampler:?} pair {pair}: {error}");
            }
        }
    }

    #[test]
    fn many_at_once_are_those_one_by_one() {
        for sampler in ALL {
            let pixel = |i: u32| sampler.pixel(5, i % 7, i / 7, 80_000);
            let samples = (0..200).map(|i| PixelSample { pixel: pixel(i), index: i * 381 });
            let runs = samples
                .clone()
                .map(|of| PixelRun { pixel: of.pixel, numbers: of.index..of.index + 1 });
            let [mut out, mut own] = [Vec::new(), Vec::new()];
            let mut floats = [Vec::new(), Vec::new()];
            let mut keys = SampleKeys::default();
            keys.refill(runs);
            assert_eq!(keys.count(), 200);
            let picked: Vec<u32> = (0..200).rev().step_by(3).collect();
            for pair in [0, 1, 3, 200] {
                squares_of_pair(samples.clone(), pair, &mut out);
                let one_by_one = samples.clone().map(|of| of.pixel.square(of.index, pair));
                assert_eq!(out, one_by_one.collect::<Vec<_>>(), "{sampler:?} pair {pair}");
                keys.squares_of_all(pair, &mut own);
                if pair < 2 {
                    let mut both = [Vec::new(), Vec::new()];
                    let [first, second] = &mut both;
                    keys.squares_of_first_pairs([first, second]);
                    assert_eq!(out, both[pair as usize], "{sampler:?} pair {pair}");
                }
                assert_eq!(out, own, "{sampler:?} pair {pair}");
                keys.squares_of_pair(&picked, pair, &mut own);
                out = picked.iter().map(|&number| out[number as usize]).collect();
                assert_eq!(out, own, "{sampler:?} pair {pair}");
                keys.floats_of_pair(&picked, pair, &mut floats);
                assert_eq!(floats[0].len(), picked.len());
                let [x, y] = floats.each_ref().map(|column| column.iter().copied().map(f64::from));
                for ((a, b), own) in x.zip(y).zip(&out) {
                    // 24 bits of each.
                    let error = (own[0] - a).abs().max((own[1] - b).abs());
                    assert!(
                        error < 1.0 / 16_777_216.0 && a < 1.0 && b < 1.0,
                        "{sampler:?} {own:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn neighbours_and_seeds_differ_and_repeats_do_not() {
        for sampler in ALL {
            let at = |seed, column| sampler.pixel(seed, column, 0, 16).square(0, 0);
            assert_eq!(at(1, 1), at(1, 1), "{sampler:?}");
            assert_ne!(at(1, 1), at(1, 2), "{sampler:?}");
            assert_ne!(at(1, 1), at(2, 1), "{sampler:?}");
        }
    }
}
