//! Owen-scrambled Sobol points of many samples side by side, to the last bit of an f64 below 1.
//!
//! Most pairs of numbers are points of the first two dimensions of Sobol's sequence, which are the best
//! stratified that there are (of any 2ᵐ points from a multiple of 2ᵐ on, one lies in each elementary
//! interval of area 2⁻ᵐ), scrambled and shuffled for itself (Burley, "Practical hash-based Owen
//! scrambling", 2020, section 3: shuffling pads such pairs to any number of dimensions). The places
//! in the pixel and in the pupil are the first four dimensions with one shuffling, by a table.
//!
//! The first dimension is the reversed index. The second multiplies it by Pascal's triangle modulo 2,
//! which is 1 where the bits of a row's number are among those of the column's (Lucas 1878): a sum over
//! supersets, five shifts (Ahmed, "An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and
//! Compact", 2024).
//!
//! 32 bits are scrambled, and 21 random ones go behind them: a table of 2²⁴ entries leaves as many even
//! ones for what comes after the choice.

use std::array;
use std::sync::LazyLock;

use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev};

/// Samples worked on side by side.
const LANES: usize = 16;

/// Bits of an index.
const BITS: usize = 16;

/// Dimensions that share a shuffling.
const DIMENSIONS: usize = 4;

/// For each dimension, what each bit of the index adds (exclusive or) to the reversed number.
static DIRECTIONS: LazyLock<[[u32; BITS]; DIMENSIONS]> = LazyLock::new(|| {
    // In range: there are four.
    #[expect(clippy::cast_possible_truncation, reason = "below four")]
    array::from_fn(|d| array::from_fn(|bit| sobol_rev(1_u32 << (31 - bit), d as u32)))
});

/// A sample of a scrambled set.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SobolKey {
    /// Index of the sample, below 2¹⁶.
    pub(crate) index: u32,
    /// Seed of the scrambling.
    pub(crate) seed: u32,
}

impl SobolKey {
    /// Returns the key of the sample in another scrambling.
    #[inline(always)]
    pub(crate) fn shifted(self, shift: u32) -> Self {
        Self { seed: self.seed.wrapping_add(shift), ..self }
    }
}

/// The point of each of `keys` in dimensions `first` and `first + 1`; `first` is 0 or 2.
/// `out` is as long as `keys`.
pub(crate) fn points(keys: &[SobolKey], first: usize, out: &mut [[f64; 2]]) {
    scrambled(keys, first, &DIRECTIONS, out);
}

/// The points of those of `keys` that are picked, of scramblings shifted by `shift`, to 24 bits in two columns as long
/// as `picked`.
pub(crate) fn floats(
    keys: &[SobolKey],
    shift: u32,
    picked: &[u32],
    first: usize,
    out: [&mut [f32]; 2],
) {
    scrambled_floats(keys, shift, picked, first, &DIRECTIONS, out);
}

/// The first 24 bits of a number below 1.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a whole number below 2²⁴ is one of single precision"
)]
pub(crate) fn float(x: f64) -> f32 {
    ((x * TWO_TO_24).floor() / TWO_TO_24) as f32
}

/// The point of one key in dimensions `first` and `first + 1`.
pub(crate) fn point(key: SobolKey, first: usize) -> [f64; 2] {
    let [point] = side_by_side([key.index], |_| key.seed, first, &DIRECTIONS);
    point
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled(
    keys: &[SobolKey],
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
    out: &mut [[f64; 2]],
) {
    let (whole, rest) = keys.as_chunks::<LANES>();
    let (to, to_rest) = out.as_chunks_mut::<LANES>();
    for (keys, out) in whole.iter().zip(to) {
        *out = chunk(keys, first, directions);
    }
    if let Some(last) = rest.last() {
        let mut lanes = [*last; LANES];
        lanes[..rest.len()].copy_from_slice(rest);
        to_rest.copy_from_slice(&chunk(&lanes, first, directions)[..rest.len()]);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scrambled_floats(
    keys: &[SobolKey],
    shift: u32,
    picked: &[u32],
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
    [x, y]: [&mut [f32]; 2],
) {
    for ((picked, x), y) in picked.chunks(LANES).zip(x.chunks_mut(LANES)).zip(y.chunks_mut(LANES)) {
        let mut lanes = [SobolKey::default(); LANES];
        for (lane, &number) in lanes.iter_mut().zip(picked) {
            *lane = keys[number as usize].shifted(shift);
        }
        let [across, up] = numbers_of(&lanes, first, directions);
        let (mut a, mut b) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            // Their upper 24 bits, which single precision holds.
            a[i] = (across[i] >> 8) as f32 / 16_777_216.0;
            b[i] = (up[i] >> 8) as f32 / 16_777_216.0;
        }
        x.copy_from_slice(&a[..x.len()]);
        y.copy_from_slice(&b[..y.len()]);
    }
}

/// The upper 32 bits of the points of some keys.
#[inline(always)]
fn numbers_of(
    keys: &[SobolKey; LANES],
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
) -> [[u32; LANES]; 2] {
    let (index, seeds) = apart(keys);
    let seed = seeds[0];
    let numbers = match seeds.iter().fold(0, |others, other| others | (other ^ seed)) {
        0 => upper_bits(index, |_| seed, first, directions),
        _ => upper_bits(index, |i| seeds[i], first, directions),
    };
    let [(across, _), (up, _)] = numbers;
    [across, up]
}

/// The samples and the scramblings of some keys. (What maps arrays is a function of its own, compiled without wide
/// registers.)
#[inline(always)]
fn apart(keys: &[SobolKey; LANES]) -> ([u32; LANES], [u32; LANES]) {
    let (mut index, mut seeds) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        (index[i], seeds[i]) = (keys[i].index, keys[i].seed);
    }
    (index, seeds)
}

/// Evaluates a chunk of keys: where all are of one scrambling, as nearly always, what goes into it is hashed once.
#[inline(always)]
fn chunk(
    keys: &[SobolKey; LANES],
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
) -> [[f64; 2]; LANES] {
    let (index, seeds) = apart(keys);
    let seed = seeds[0];
    match seeds.iter().fold(0, |others, other| others | (other ^ seed)) {
        0 => side_by_side(index, |_| seed, first, directions),
        _ => side_by_side(index, |i| seeds[i], first, directions),
    }
}

/// The second dimension of point `index`, its bits reversed.
#[inline(always)]
fn second_reversed(index: u32) -> u32 {
    let mut bits = index;
    bits ^= (bits >> 1) & 0x5555_5555;
    bits ^= (bits >> 2) & 0x3333_3333;
    bits ^= (bits >> 4) & 0x0f0f_0f0f;
    bits ^= (bits >> 8) & 0x00ff_00ff;
    bits ^ ((bits >> 16) & 0x0000_ffff)
}

/// The scrambled upper 32 bits of each dimension, with what they were scrambled by.
#[inline(always)]
fn upper_bits<const N: usize>(
    keys: [u32; N],
    seed: impl Fn(usize) -> u32,
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
) -> [([u32; N], [u32; N]); 2] {
    const DIMENSION: [u32; 2] = [0x912f_69ba, 0x174f_18ab];
    // The scrambled index of each sequence.
    let mut index = [0; N];
    for i in 0..N {
        index[i] = owen_scramble_rev(keys[i].reverse_bits(), hash(seed(i))).reverse_bits();
    }
    let mut out = [([0; N], [0; N]); 2];
    for (k, (high, scrambles)) in out.iter_mut().enumerate() {
        // A dimension of Sobol's sequence: XOR of the direction numbers of the index' bits.
        let mut number = [0; N];
        match first + k {
            0 => number = index,
            1 => {
                for i in 0..N {
                    number[i] = second_reversed(index[i]);
                }
            }
            dimension => {
                for (bit, &direction) in directions[dimension].iter().enumerate() {
                    for (number, &index) in number.iter_mut().zip(&index) {
                        *number ^= direction & (index >> bit & 1).wrapping_neg();
                    }
                }
            }
        }
        // Scrambled by Owen's method.
        let salt = hash(DIMENSION[k].wrapping_add(u32::try_from(first).unwrap_or(0)));
        for i in 0..N {
            scrambles[i] = hash(hash(seed(i)) ^ salt);
            high[i] = owen_scramble_rev(number[i], scrambles[i]).reverse_bits();
        }
    }
    out
}

/// 32 bits that are scrambled, and 21 more by hashing.
#[inline(always)]
fn side_by_side<const N: usize>(
    keys: [u32; N],
    seed: impl Fn(usize) -> u32,
    first: usize,
    directions: &[[u32; BITS]; DIMENSIONS],
) -> [[f64; 2]; N] {
    let mut rows = [[0.0; N]; 2];
    for (row, (high, scrambles)) in rows.iter_mut().zip(upper_bits(keys, seed, first, directions)) {
        for i in 0..N {
            let low = hash(high[i] ^ scrambles[i]) >> 11;
            row[i] = (f64::from(high[i]) + f64::from(low) / TWO_TO_21) / TWO_TO_32;
        }
    }
    let mut out = [[0.0; 2]; N];
    for i in 0..N {
        out[i] = [rows[0][i], rows[1][i]];
    }
    out
}

const TWO_TO_24: f64 = 16_777_216.0;
const TWO_TO_21: f64 = 2_097_152.0;
const TWO_TO_32: f64 = 4_294_967_296.0;

#[cfg(test)]
mod tests {
    use sobol_burley::parts::sobol_rev;

    use super::*;

    #[test]
    fn the_second_dimension_is_that_of_the_crate() {
        // Its table has 16 bits of indices.
        for index in (0..1 << 16).step_by(37) {
            let reversed: u32 = index;
            assert_eq!(second_reversed(index), sobol_rev(reversed.reverse_bits(), 1), "{index}");
            assert_eq!(index, sobol_rev(reversed.reverse_bits(), 0), "{index}");
        }
    }

    /// Of 2ᵐ points from a multiple of 2ᵐ on, one lies in each box of 2⁻ᵃ by 2ᵃ⁻ᵐ, for all a.
    #[test]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2⁸")]
    fn points_are_a_net_in_every_elementary_interval() {
        for (m, first, seed) in [(4, 0, 1), (6, 64, 2), (8, 1 << 15, 3)] {
            let count = 1_u32 << m;
            let keys: Vec<SobolKey> =
                (first..first + count).map(|index| SobolKey { index, seed }).collect();
            let mut out = vec![[0.0; 2]; keys.len()];
            points(&keys, 0, &mut out);
            for a in 0..=m {
                let mut boxes = vec![0; count as usize];
                for [x, y] in &out {
                    let column = (x * f64::from(1 << a)) as usize;
                    let row = (y * f64::from(1 << (m - a))) as usize;
                    boxes[row << a | column] += 1;
                }
                assert!(boxes.iter().all(|&points| points == 1), "2^{m} points, 2^-{a}: {boxes:?}");
            }
        }
    }

    #[test]
    fn many_points_are_those_one_by_one() {
        let keys: Vec<SobolKey> =
            (0..77).map(|i: u32| SobolKey { index: i * 7919, seed: i / 5 }).collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        for first in [0, 2] {
            points(&keys, first, &mut out);
            assert_eq!(out, keys.iter().map(|&key| point(key, first)).collect::<Vec<_>>());
        }
    }

    /// Dimensions of one shuffling belong to each other: of 2ᵐ points from a multiple of 2ᵐ on, one lies in
    /// each interval of 2⁻ᵐ of every dimension, and the unscrambled numbers are those of the crate.
    #[test]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2⁶")]
    fn further_dimensions_are_those_of_the_crate() {
        for (d, directions) in DIRECTIONS.iter().enumerate() {
            let own = (0..BITS).filter(|bit| 0x5a3c >> bit & 1 == 1);
            let sum = own.fold(0, |sum, bit| sum ^ directions[bit]);
            assert_eq!(sum, sobol_rev(0x5a3c_u32.reverse_bits(), d as u32), "{d}");
        }
        let keys: Vec<SobolKey> = (192..256).map(|index| SobolKey { index, seed: 11 }).collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        for first in [0, 2] {
            points(&keys, first, &mut out);
            for k in 0..2 {
                let mut cells =
                    out.iter().map(|point| (point[k] * 64.0) as usize).collect::<Vec<_>>();
                cells.sort_unstable();
                assert_eq!(cells, (0..64).collect::<Vec<_>>(), "{first} {k}");
            }
        }
    }

    /// Pairs of one sample do not know of each other: the mean of the product of two uniform numbers is
    /// 1/4, with a standard deviation of √(7/144).
    #[test]
    fn pairs_are_independent() {
        let count = 1 << 14;
        let keys = |pair: u32| {
            (0..count).map(move |i| SobolKey { index: i % 64, seed: i / 64 * 8 + pair })
        };
        let product = |(a, b): (SobolKey, SobolKey)| point(a, 0)[0] * point(b, 0)[0];
        let mean = keys(0).zip(keys(1)).map(product).sum::<f64>() / f64::from(count);
        // Four standard errors.
        assert!((mean - 0.25).abs() < 4.0 * 0.2205 / 128.0, "{mean}");
    }

    /// The last bits are random: what a table of 2²⁴ entries leaves of a number is as even as the
    /// number: all 29 bits behind the 24th are set as often as not.
    #[test]
    fn the_last_bits_are_random() {
        let count = 1 << 16;
        let keys: Vec<SobolKey> =
            (0..count).map(|i| SobolKey { index: i % 256, seed: hash(i / 256) }).collect();
        let mut out = vec![[0.0; 2]; keys.len()];
        points(&keys, 2, &mut out);
        for bit in 25..=53 {
            let set = |x: &f64| (x * f64::from(bit).exp2()).rem_euclid(2.0) >= 1.0;
            for k in 0..2 {
                let share =
                    out.iter().filter(|pair| set(&pair[k])).count() as f64 / out.len() as f64;
                // Four and a half standard errors: one in 10⁵ of 58.
                assert!((share - 0.5).abs() < 4.5 * 0.5 / 256.0, "bit {bit}: {share}");
            }
        }
    }
}
